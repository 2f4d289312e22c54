"""`campaign import`: recordings of other programs as a run."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path

from campaign.cli.output import print_text
from campaign.cli.prepare import IMPORT, Request
from campaign.cli.run import run_protocol
from campaign.cli.run_options import DEFAULTS, RunOptions
from campaign.errors import ExitCode, UsageError


def import_recordings(
    files: Sequence[str],
    results: Path,
    given: RunOptions = DEFAULTS,
    *,
    only: tuple[str, ...] = (),
    changes: tuple[str, ...] = (),
) -> ExitCode:
    """Archive the recordings of a mapping. Raises UsageError, and the errors of a run."""
    if len(files) != 1:
        raise UsageError(
            f"one mapping at a time, not {len(files)} files; `campaign import --guess FILE...` "
            "prints a first mapping of recordings"
        )
    if Path(files[0]).is_file() and Path(files[0]).suffix.lower() != ".toml":
        raise UsageError(
            f"{files[0]} is not a mapping (a .toml file); `campaign import --guess "
            f"{shlex.quote(files[0])} > mapping.toml` writes a first one"
        )
    request = Request(files[0], only, changes, IMPORT)
    return run_protocol(request, results, given)


def guess_mapping(files: Sequence[Path]) -> ExitCode:
    """Print a first mapping of files, with marked doubtful entries."""
    from campaign.importing.guess import guess, mapping_text

    print_text(mapping_text(guess(files)))
    return ExitCode.DONE
