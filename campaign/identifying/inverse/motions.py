"""Trials as motions: which channels are taken, what is lost, and which motion was wanted."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from campaign.archive import ArchivedTrial
from campaign.channels import (
    COMMAND,
    DRIVE_TORQUE,
    GYRO_RATE,
    REFERENCE,
    RELATIVE_ANGLE,
    RELATIVE_RATE,
    TEMPERATURE,
)
from campaign.identification.inverse.motion import (
    Array,
    Filtering,
    Motion,
    motion_of_position,
    motion_of_rate,
    whole_pieces,
    zero_phase,
)
from campaign.trial import Recording

SLOWEST = 0.02
"""of the fastest rate: what is slower counts as standing still, where nobody says otherwise."""
MOST_SAMPLES = 5_000_000
"""of all trials together that are read; further trials are left out, and it is told."""
SHORTEST_PIECE = 1.0
"""s of a motion without a lost sample, to be used."""
FEWEST_SAMPLES = 100


@dataclass(frozen=True)
class Moved:
    """A piece of a trial as it moved, and as it was meant to; None where nobody recorded that."""

    trial: int
    motion: Motion
    wanted: Motion | None


def usable(trials: Sequence[ArchivedTrial]) -> tuple[Sequence[ArchivedTrial], str]:
    """Trials with a force and a motion, or why there are none; too many are cut."""
    found: list[ArchivedTrial] = []
    samples = 0
    for each in trials:
        names = each.channel_names()
        if DRIVE_TORQUE not in names or not names & {RELATIVE_ANGLE, RELATIVE_RATE}:
            continue
        samples += round(each.trial.task.duration * each.trial.task.sample_rate)
        if found and samples > MOST_SAMPLES:
            break
        found.append(each)
    if not found:
        return (), f"no trial has {DRIVE_TORQUE} and {RELATIVE_ANGLE} or {RELATIVE_RATE}"
    return found, ""


def moved(trials: Sequence[ArchivedTrial], filtering: Filtering) -> tuple[Moved, ...]:
    """All pieces of all trials without a lost sample. Raises ValueError without any."""
    found = tuple(piece for each in trials for piece in _pieces(each, filtering))
    if not found:
        raise ValueError(f"nothing is recorded for {SHORTEST_PIECE:g} s without a lost sample")
    if not any(np.any(each.motion.force) for each in found):
        raise ValueError(f"{DRIVE_TORQUE} is zero throughout")
    if not any(_moves(each.motion, filtering.low_pass) for each in found):
        raise ValueError("the axis stands still: what it moves is no more than its sensor's noise")
    rates = {round(each.motion.sample_rate, 6) for each in found}
    if len(rates) > 1:
        told = ", ".join(f"{rate:g} Hz" for rate in sorted(rates))
        raise ValueError(f"the trials have several sample rates ({told}): name one test")
    return found


def _moves(motion: Motion, low_pass: float) -> bool:
    """Whether the position goes further than from one independent sample to the next.

    What is left of white noise behind its low-pass does not: its samples twice a period of the
    corner apart differ by 1.4 times of how far they scatter.
    """
    apart = max(1, round(0.5 * motion.sample_rate / low_pass))
    steps = motion.position[apart:] - motion.position[:-apart]
    return bool(np.std(motion.position) > np.std(steps))


def with_slowest(filtering: Filtering, pieces: Sequence[Moved], slowest: float | None) -> Filtering:
    """With the rate (SI) below which the axis stands still; None: a share of its fastest."""
    if slowest is None:
        slowest = SLOWEST * max(float(np.abs(each.motion.rate).max()) for each in pieces)
    return replace(filtering, slowest=slowest)


def _pieces(archived: ArchivedTrial, filtering: Filtering) -> Iterator[Moved]:
    recording = archived.recording()
    sources = _sources(recording)
    good = np.all([np.isfinite(recording[name]) for name in sources], axis=0)
    rate = archived.trial.task.sample_rate
    fewest = max(FEWEST_SAMPLES, round(SHORTEST_PIECE * rate) + filtering.skip)
    for piece in whole_pieces(good, fewest):
        parts = {name: np.asarray(recording[name][piece], dtype=float) for name in sources}
        yield Moved(
            archived.trial.number,
            _motion(recording.time[piece], parts, filtering),
            _wanted(recording.time[piece], parts, filtering),
        )


def _sources(recording: Recording) -> list[str]:
    """Channels that are read: an angle rather than a rate, a gyro for what is accelerated."""
    names = [DRIVE_TORQUE]
    names.append(RELATIVE_ANGLE if RELATIVE_ANGLE in recording.channels else RELATIVE_RATE)
    names += [name for name in (TEMPERATURE, REFERENCE) if name in recording.channels]
    if GYRO_RATE in recording.channels:
        names.append(GYRO_RATE)
    command = recording.channels.get(COMMAND)
    if REFERENCE not in names and command is not None and command.unit in ("rad/s", "m/s"):
        names.append(COMMAND)
    return names


def _motion(time: Array, parts: dict[str, Array], filtering: Filtering) -> Motion:
    force, warm = parts[DRIVE_TORQUE], parts.get(TEMPERATURE)
    if RELATIVE_ANGLE in parts:
        motion = motion_of_position(time, parts[RELATIVE_ANGLE], force, filtering.low_pass, warm)
    else:
        motion = motion_of_rate(time, parts[RELATIVE_RATE], force, filtering.low_pass, warm)
    if GYRO_RATE not in parts:
        return motion
    # What is accelerated is the load in space; friction goes by its rate against the hull.
    inertial = zero_phase(parts[GYRO_RATE], filtering.low_pass, motion.sample_rate)
    return replace(motion, acceleration=np.gradient(inertial, 1.0 / motion.sample_rate))


def _wanted(time: Array, parts: dict[str, Array], filtering: Filtering) -> Motion | None:
    force, warm = parts[DRIVE_TORQUE], parts.get(TEMPERATURE)
    if REFERENCE in parts:
        found = motion_of_position(time, parts[REFERENCE], force, filtering.low_pass, warm)
    elif COMMAND in parts:
        found = motion_of_rate(time, parts[COMMAND], force, filtering.low_pass, warm)
    else:
        return None
    return found if np.ptp(found.rate) > 0 else None
