"""Messages and exit code for damage of an archive."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from campaign.archive import RunWriter
from campaign.archive.reading.damage import Damage
from campaign.archive.reading.damage_words import heading, in_words, listed
from campaign.archive.reading.run_reader import RunReader
from campaign.backends.interface import Backend, ServesArchive
from campaign.cli.output import print_note
from campaign.errors import ExitCode

SHOWN = 20
"""Most damage that is told line by line; `campaign verify` tells of all."""


def say_damaged(path: Path, damaged: Sequence[Damage]) -> ExitCode:
    """Tell on standard error what is damaged of the run at `path`; ARCHIVE when anything is."""
    if not damaged:
        return ExitCode.DONE
    print_note(f"{heading(path, damaged)}:", style="yellow")
    for line in listed(damaged, SHOWN):
        print_note(f"  {line}", style="yellow")
    return ExitCode.ARCHIVE


def archive_of(backend: Backend) -> RunReader | None:
    """The run that a backend serves, where it serves one."""
    return backend.archive if isinstance(backend, ServesArchive) else None


def note_damaged(writer: RunWriter, source: RunReader) -> None:
    """Write into a new run's journal what is damaged of the one that it comes from."""
    for damage in source.damaged[:SHOWN]:
        writer.decision("source damaged", f"{source.name}: {in_words(damage)}")
    if len(source.damaged) > SHOWN:
        more = len(source.damaged) - SHOWN
        writer.decision("source damaged", f"{source.name}: and {more} more")
