"""Recordings that hold nothing: every kind copes with them, and says so.

A sensor that is not connected gives zeros, one that hangs a constant; a log may have gaps, be cut
off, or lack a channel. Each is done to every recording of a test.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

from campaign.estimate import Estimate
from campaign.experiments import experiments
from campaign.experiments.analysis import measured
from campaign.experiments.interface import Experiment
from campaign.recording import Recording
from campaign.result import Result
from tests.experiments.laboratory import Done, analyse
from tests.experiments.test_channels import CASES, Case, done

Spoil = Callable[[Recording, str], Recording]
"""Of a recording; the name is of the channel to spoil, where it is done to one."""


def _with(recording: Recording, change: Callable[[np.ndarray], np.ndarray]) -> Recording:
    channels = {n: replace(c, samples=change(c.samples)) for n, c in recording.channels.items()}
    return replace(recording, channels=channels)


def _constant(recording: Recording, name: str) -> Recording:
    return _with(recording, lambda samples: np.full_like(samples, samples[0]))


def _zero(recording: Recording, name: str) -> Recording:
    return _with(recording, np.zeros_like)


def _lost(recording: Recording, name: str) -> Recording:
    channel = recording.channels[name]
    nothing = replace(channel, samples=np.full_like(channel.samples, np.nan))
    return replace(recording, channels={**recording.channels, name: nothing})


def _zero_channel(recording: Recording, name: str) -> Recording:
    channel = recording.channels[name]
    nothing = replace(channel, samples=np.zeros_like(channel.samples))
    return replace(recording, channels={**recording.channels, name: nothing})


def _short(recording: Recording, name: str) -> Recording:
    cut = _with(recording, lambda samples: samples[:2])
    return replace(cut, time=recording.time[:2])


def _missing(recording: Recording, name: str) -> Recording:
    kept = {n: channel for n, channel in recording.channels.items() if n != name}
    return replace(recording, channels=kept)


WHOLE: dict[str, Spoil] = {"constant": _constant, "zero": _zero, "two samples": _short}
SINGLE: dict[str, Spoil] = {"zero channel": _zero_channel, "no numbers": _lost, "missing": _missing}


def spoilt(items: Iterable[Done], spoil: Spoil, name: str = "") -> list[Done]:
    return [replace(i, samples=spoil(i.samples, name), estimates=()) for i in items]


def required(items: Iterable[Done]) -> list[str]:
    """Channels that all of the trials require, and have."""
    items = list(items)
    shared = [set(item.trial.requires) & item.channel_names() for item in items]
    return sorted(set.intersection(*shared))


def measure_all(experiment: Experiment, items: Iterable[Done]) -> list[Done]:
    """As the runner does: a recording that holds nothing is told by a ValueError alone."""
    found = []
    for item in items:
        estimates: tuple[Estimate, ...] = ()
        with suppress(ValueError):
            estimates = tuple(e for e in measured(experiment, item) if np.isfinite(e.value))
        found.append(replace(item, estimates=estimates))
    return found


def says_what_is_wrong(result: Result) -> bool:
    """By a note, by what is not determined, or by finding nothing."""
    lost = [f for f in result.findings if not np.isfinite(f.value) and f.known.reason]
    return bool(result.notes) or bool(lost) or not result.findings


@pytest.mark.parametrize("how", [*WHOLE, *SINGLE])
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_recordings_that_hold_nothing_cost_numbers_and_not_the_analysis(
    case: Case, how: str
) -> None:
    items = done(case)
    experiment = experiments()[case.kind]
    for name in [""] if how in WHOLE else required(items):
        broken = spoilt(items, {**WHOLE, **SINGLE}[how], name)
        assert says_what_is_wrong(analyse(case.kind, broken)), name
        result = analyse(case.kind, measure_all(experiment, broken))
        # Of one dead sensor its metrics tell: zeros. Samples that were measured are not read again.
        assert says_what_is_wrong(result) or how == "zero channel", name
