"""Extra files of an existing report, to be made again.

Who asked once for a PDF or for a trial's page keeps it: a report that is written again without the
option makes those files from the same analysis as its page, so that none is of an older one. A file
that was removed by hand is not made again.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from campaign.archive import RunReader
from campaign.errors import UsageError
from campaign.report.content.trial_choice import executed_trials
from campaign.report.formats import chosen_formats
from campaign.report.formats.interface import Format
from campaign.report.page.names import trial_file

MADE = ".campaign-made.json"
"""Of the report's folder: of which run it is, the files of each format, the trials with a page."""


@dataclass(frozen=True)
class MadeBefore:
    """What an earlier report of the same run has made besides, as far as it is still there.

    Attributes:
        formats: names, as `--format` takes them.
        trials: numbers of those with a page of their own.
    """

    formats: tuple[str, ...] = ()
    trials: tuple[int, ...] = ()


@dataclass
class Formats:
    """The formats of a report, those that were asked for and those that it had before.

    Attributes:
        asked: one of these that cannot be made costs the whole report.
        again: one of these costs itself.
        left_out: why one of `again` is not made, a line each.
    """

    asked: tuple[Format, ...]
    again: list[Format] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)

    @property
    def all(self) -> tuple[Format, ...]:
        return (*self.asked, *self.again)

    def leave_out(self, name: str, error: UsageError) -> None:
        """The earlier report's files of a format stay out of the new one: they would be stale."""
        self.left_out.append(f"{name}, which the earlier report had, is left out: {error}")


def made_before(output: Path, run: RunReader) -> MadeBefore:
    """What the report of `run` in the folder `output` has; nothing of another run, or of none."""
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
    """Those that were asked for, and those of the earlier report that this machine can make."""
    found = Formats(tuple(asked))
    names = {each.name for each in asked}
    for name in before.formats:
        if name not in names:
            try:
                found.again += chosen_formats([name])
            except UsageError as error:
                found.leave_out(name, error)
    return found


def remember(
    folder: Path, run: RunReader, formats: Mapping[str, Collection[str]], trials: Collection[int]
) -> None:
    """Write down what a new report has besides its page; nothing where there is nothing.

    formats: by name, the files that each has added.
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
    """Whether a format's own files are all there; figures that it added are no document."""
    names = [each for each in files if isinstance(each, str)] if isinstance(files, list) else []
    own = [name for name in names if "/" not in name] or names
    try:
        return bool(own) and all((output / name).is_file() for name in own)
    except (OSError, ValueError):  # no name that a file could have
        return False
