"""A draft mapping of undescribed files: their tables, and likely roles and units of columns."""

from campaign.importing.guess.column_guess import guess
from campaign.importing.guess.columns import Basis, ColumnGuess, TableGuess
from campaign.importing.guess.text import mapping_text

__all__ = ["Basis", "ColumnGuess", "TableGuess", "guess", "mapping_text"]
