"""A first mapping of files that nobody described: what is in them, and what columns may be."""

from campaign.importing.guess.column_guess import guess
from campaign.importing.guess.columns import Basis, ColumnGuess, TableGuess
from campaign.importing.guess.text import mapping_text

__all__ = ["Basis", "ColumnGuess", "TableGuess", "guess", "mapping_text"]
