"""Extra files of an existing report, to be made again.

A report that is written again keeps its PDF and its pages of trials without the options for them.
These files are made from the same analysis as the page, so that none is outdated. Files that the
user removed are not made again.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from campaign.archive.reading.run_reader import RunReader
from campaign.errors import UsageError
from campaign.report.content.trial_choice import executed_trials
from campaign.report.formats import chosen_formats
from campaign.report.formats.interface import Format
from campaign.report.page.names import trial_file

MADE = ".campaign-made.json"
"""File in the report's folder with the run, the files of each format, the trials with a page."""


@dataclass(frozen=True)
class MadeBefore:
    """Existing extra files of an earlier report of the same run.

    Attributes:
        formats: names, as for `--format`.
        trials: numbers of the trials with a page.
    """

    formats: tuple[str, ...] = ()
    trials: tuple[int, ...] = ()


@dataclass
class Formats:
    """Formats of a report: requested ones, and those of the earlier report.

    Attributes:
        asked: requested formats; if one fails, the whole report fails.
        again: earlier formats; if one fails, only this one is omitted.
        left_out: reasons why formats of `again` are omitted, a line each.
    """

    asked: tuple[Format, ...]
    again: list[Format] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)

    @property
    def all(self) -> tuple[Format, ...]:
        return (*self.asked, *self.again)

    def leave_out(self, name: str, error: UsageError) -> None:
        """Record an omitted format; the earlier report's files of it would be outdated."""
        self.left_out.append(f"{name}, which the earlier report had, is left out: {error}")


def made_before(output: Path, run: RunReader) -> MadeBefore:
    """Extra files of the report in `output`; empty if it is of another run, or no report."""
    try:
        tree = json.loads((output / MADE).read_bytes())
    except (OSError, ValueError, RecursionError):
        return MadeBefore()
    if not isinstance(tree, dict) or tree.get("run") != run.header.name:
        return MadeBefore()
    formats, trials = tree.get("formats"), tree.get("trials")
    files = formats.items() if isinstance(formats, dict) else ()
    executed = executed_trials(run)
    numbers = trials if isinstance(trials, list) else ()
    return MadeBefore(
        tuple(name for name, own in files if _is_there(output, own)),
        tuple(n for n in executed if n in numbers and (output / trial_file(n)).is_file()),
    )


def all_formats(asked: Sequence[Format], before: MadeBefore) -> Formats:
    """Requested formats, and those of the earlier report that this machine can make."""
    all_ = Formats(tuple(asked))
    names = {each.name for each in asked}
    for name in before.formats:
        if name not in names:
            try:
                all_.again += chosen_formats([name])
            except UsageError as error:
                all_.leave_out(name, error)
    return all_


def remember(
    folder: Path, run: RunReader, formats: Mapping[str, Collection[str]], trials: Collection[int]
) -> None:
    """Record the extra files of a new report, if any.

    formats: added files by name of the format.
    """
    if formats or trials:
        tree: dict[str, Any] = {
            "run": run.header.name,
            "formats": {name: sorted(files) for name, files in formats.items()},
            "trials": sorted(trials),
        }
        text = json.dumps(tree, indent=1)
        (folder / MADE).write_text(f"{text}\n", encoding="utf-8", newline="\n")


def _is_there(output: Path, files: object) -> bool:
    """Whether all of a format's files exist; files in subfolders (figures) count only if alone."""
    names = [each for each in files if isinstance(each, str)] if isinstance(files, list) else []
    own = [name for name in names if "/" not in name] or names
    try:
        return bool(own) and all((output / name).is_file() for name in own)
    except (OSError, ValueError):  # no valid file name
        return False
