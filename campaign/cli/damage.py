"""Messages and exit code for damage of an archive."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from campaign.archive.reading.damage import Damage
from campaign.archive.reading.damage_words import heading, listed
from campaign.archive.reading.run_reader import RunReader
from campaign.archive.writing.writer import RunWriter
from campaign.backends.interface import Backend, ServesArchive
from campaign.cli.output import print_warning
from campaign.errors import ExitCode

SHOWN = 20
"""Most damage that is listed; `campaign verify` lists all."""


def say_damaged(path: Path, damaged: Sequence[Damage]) -> ExitCode:
    """Print damage of the run at `path` on standard error; return ARCHIVE for any damage."""
    if not damaged:
        return ExitCode.DONE
    print_warning(f"{heading(path, damaged)}:")
    for line in listed(damaged, SHOWN):
        print_warning(f"  {line}")
    return ExitCode.ARCHIVE


def archive_of(backend: Backend) -> RunReader | None:
    """Archived run that a backend replays, if any."""
    return backend.archive if isinstance(backend, ServesArchive) else None


def note_damaged(writer: RunWriter, source: RunReader) -> None:
    """Write the damage of a source run into the journal of a new run."""
    for line in listed(source.damaged, SHOWN):
        writer.decision("source damaged", f"{source.name}: {line}")
