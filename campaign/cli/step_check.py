"""`campaign run --check-step`: the effect of half the step on each trial."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from pydantic import JsonValue

from campaign.archive.reading.open_run import open_run
from campaign.backends.step_check import CHANGE
from campaign.cli.output import print_note, print_warning
from campaign.options import Options
from campaign.recording import Outcome

TOLERANCE = 1e-3
"""Largest change relative to a channel's RMS; the design value of the steps."""
SHOWN = 3
"""Most trials beyond the tolerance that the message names."""
SETTING = "backend.check_step=true"
"""Setting that the option `--check-step` stands for."""


class Change(NamedTuple):
    """The largest change of a trial's channels; `share` of the channel's RMS, None if undefined."""

    share: float | None
    channel: str
    trial: str

    def __str__(self) -> str:
        share = "no finite value" if self.share is None else f"{self.share:.2g} of its RMS"
        return f"{self.channel} in {self.trial} ({share})"


def is_checked(options: Options) -> bool:
    """Whether a backend with these options checks its steps."""
    return bool(getattr(options, "check_step", False))


def say_step_check(archive: Path) -> None:
    """Print the largest change, or a warning on the trials beyond the tolerance."""
    changes = _changes(archive)
    if not changes:
        print_note("step check: no trial completed")
        return
    beyond = [each for each in changes if each.share is None or each.share > TOLERANCE]
    if not beyond:
        print_note(f"step check: half the step changes no channel by more than {changes[0]}")
        return
    named = "; ".join(str(each) for each in beyond[:SHOWN])
    more = f"; and {len(beyond) - SHOWN} more" if len(beyond) > SHOWN else ""
    print_warning(
        f"step check: half the step changes {len(beyond)} of {len(changes)} trials by more than "
        f"{TOLERANCE:g} of a channel's RMS: {named}{more}; steps: --set backend.longest_step=..."
    )


def _changes(archive: Path) -> Sequence[Change]:
    """Largest change of each completed trial, in descending order."""
    changes = []
    for trial in open_run(archive).trials:
        by_channel = trial.ending.telemetry.get(CHANGE)
        if (
            trial.ending.outcome is Outcome.COMPLETED
            and isinstance(by_channel, dict)
            and by_channel
        ):
            changes.append(_largest(by_channel, trial.trial.name))
    return sorted(changes, key=_size, reverse=True)


def _largest(told: Mapping[str, JsonValue], trial: str) -> Change:
    changes = (
        Change(share if isinstance(share, int | float) else None, channel, trial)
        for channel, share in told.items()
    )
    return max(changes, key=_size)


def _size(change: Change) -> float:
    return float("inf") if change.share is None else change.share
