"""`campaign run --check-step`: the effect of half the step on each trial."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from campaign.archive.reading.open_run import open_run
from campaign.backends.step_check import CHANGE
from campaign.cli.output import print_note, print_warning
from campaign.options import Options
from campaign.recording import Outcome
from campaign.text import shortened

TOLERANCE = 1e-3
"""Largest change relative to a channel's RMS; the design value of the steps."""
SHOWN = 3
"""Most trials beyond the tolerance that the message names."""
SETTING = "backend.check_step=true"
"""Setting that the option `--check-step` stands for."""


class Change(NamedTuple):
    """The largest change of a trial's channels; `share` of the channel's RMS, inf if undefined."""

    share: float
    channel: str
    trial: str

    def __str__(self) -> str:
        share = f"{self.share:.2g} of its RMS" if self.share < math.inf else "no finite value"
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
    beyond = [each for each in changes if each.share > TOLERANCE]
    if not beyond:
        print_note(f"step check: half the step changes no channel by more than {changes[0]}")
        return
    named = "; ".join(shortened([str(each) for each in beyond], SHOWN))
    print_warning(
        f"step check: half the step changes {len(beyond)} of {len(changes)} trials by more than "
        f"{TOLERANCE:g} of a channel's RMS: {named}; steps: --set backend.longest_step=..."
    )


def _changes(archive: Path) -> Sequence[Change]:
    """Largest change of each completed trial, in descending order."""
    changes = []
    for trial in open_run(archive).trials:
        shares = trial.ending.telemetry.get(CHANGE)
        if trial.ending.outcome is Outcome.COMPLETED and isinstance(shares, dict) and shares:
            each = (
                Change(
                    share if isinstance(share, int | float) else math.inf, channel, trial.trial.name
                )
                for channel, share in shares.items()
            )
            changes.append(max(each, key=lambda change: change.share))
    return sorted(changes, key=lambda change: change.share, reverse=True)
