"""Trials as motions: channels, gaps, commanded motion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from campaign.arrays import Array
from campaign.channels import (
    COMMAND,
    DRIVE_TORQUE,
    GYRO_RATE,
    JOINT_TORQUE,
    REFERENCE,
    RELATIVE_ANGLE,
    RELATIVE_RATE,
    TEMPERATURE,
)
from campaign.estimate import Estimate, Origin
from campaign.estimation.inverse.motion import (
    REGRESSION_RATE,
    FilterSettings,
    Motion,
    motion_of_position,
    motion_of_rate,
    whole_pieces,
    zero_phase,
)
from campaign.estimation.inverse.rows import all_rows
from campaign.estimation.inverse.terms import Term
from campaign.experiments.interface import TestData, TrialData
from campaign.experiments.shared.systematic import TORQUE_CONSTANT, with_scale, with_systematic
from campaign.signals import MultiSine
from campaign.trial import Recording

ROWS, FEWEST_ROWS = 20.0, 25.0
"""of a commanded sum of sines: per period of its highest frequency, and per second at least."""
SLOWEST = 0.02
"""of the fastest rate: what is slower counts as standing still, where nobody says otherwise."""
MOST_SAMPLES = 5_000_000
"""of all trials together that are read; further trials are left out, and it is told."""
SHORTEST_PIECE = 1.0
"""s of a motion without a lost sample, to be used; or most of its trial."""
MOST = 0.9
"""of a trial."""
FORCES = (DRIVE_TORQUE, JOINT_TORQUE)
"""What moves the axis, the better first: a sensor at the load knows nothing of motor and gear."""
FEWEST_SAMPLES = 100
"""of a piece without a lost sample."""
FORCE = "force"
RATES_ALIKE = 1.01
"""Largest over smallest sample rate up to which trials have one: times of files are rounded, and
what was resampled has the mean step of its own trial."""
ONE_WAY = 0.02
"""Share of the moving samples up to which a direction counts as one that nothing moves in."""


@dataclass(frozen=True)
class MotionPiece:
    """A piece of a trial as it moved, and as it was meant to; None where nobody recorded that.

    of_rate: whether a rate was measured, and its position is no more than what that adds up to.
    """

    trial: int
    motion: Motion
    wanted: Motion | None
    of_rate: bool = False

    def part(self, which: slice) -> MotionPiece:
        """Samples of it that follow each other."""
        wanted = None if self.wanted is None else self.wanted.part(which)
        return replace(self, motion=self.motion.part(which), wanted=wanted)


def usable(trials: Sequence[TrialData]) -> tuple[Sequence[TrialData], str]:
    """Trials with a force and a motion, or why there are none; too many are cut."""
    found: list[TrialData] = []
    samples = 0
    for each in trials:
        names = each.channel_names()
        if not names & {*FORCES} or not names & {RELATIVE_ANGLE, RELATIVE_RATE}:
            continue
        samples += round(each.trial.task.duration * each.trial.task.sample_rate)
        if found and samples > MOST_SAMPLES:
            break
        found.append(each)
    if not found:
        force = f"{DRIVE_TORQUE} or {JOINT_TORQUE}"
        return (), f"no trial has {force}, and {RELATIVE_ANGLE} or {RELATIVE_RATE}"
    return found, ""


def read(
    data: TestData, low_pass: float | None, decimation: int | None, skip: float
) -> tuple[FilterSettings, tuple[MotionPiece, ...], tuple[MotionPiece, ...]]:
    """How motions are filtered, with defaults for the sample rate; all pieces of the trials, and
    those of the validation. Raises ValueError where either have none.
    """
    rate = data.trials[0].trial.task.sample_rate
    plain = FilterSettings.for_rate(rate)
    decimation = decimation or max(plain.decimation, round(rate / rows_of(data.trials)))
    filtering = FilterSettings(low_pass or plain.low_pass, decimation, round(skip * rate))
    pieces = moved(data.trials, filtering)
    if not data.validation:
        return filtering, pieces, ()
    unseen, why = usable(data.validation)
    if why:
        raise ValueError(f"of the validation {why}")
    return filtering, pieces, moved(unseen, filtering)


def rows_of(trials: Sequence[TrialData]) -> float:
    """Rows per second that slow sums of sines need: those of friction in reversals are more."""
    highest = 0.0
    for task in (each.trial.task for each in trials):
        if task.mode != "rate" or not isinstance(task.command, MultiSine):
            return REGRESSION_RATE
        highest = max(highest, *task.command.frequencies)
    return max(FEWEST_ROWS, ROWS * highest)


def moved(trials: Sequence[TrialData], filtering: FilterSettings) -> tuple[MotionPiece, ...]:
    """All pieces of all trials without a lost sample. Raises ValueError without any."""
    found = tuple(piece for each in trials for piece in _pieces(each, filtering))
    if not found:
        raise ValueError(
            f"nothing is recorded for {SHORTEST_PIECE:g} s without a lost sample, and no whole "
            f"trial with {FEWEST_SAMPLES} samples"
        )
    if not any(np.any(each.motion.force) for each in found):
        raise ValueError(f"{force_of(trials[0])} is zero throughout")
    if not any(_moves(each, filtering.low_pass) for each in found):
        if all(each.of_rate for each in found):
            raise ValueError("the rate is constant but for its sensor's noise")
        raise ValueError("the axis stands still: what it moves is no more than its sensor's noise")
    rates = [each.motion.sample_rate for each in found]
    if max(rates) > RATES_ALIKE * min(rates):
        told = ", ".join(dict.fromkeys(f"{rate:.4g} Hz" for rate in sorted(rates)))
        raise ValueError(
            f"the trials have several sample rates ({told}), and one fit takes one: name a test "
            "whose trials share it, as in `campaign identify RUN:TEST`"
        )
    return found


def place_and_rate(pieces: Sequence[MotionPiece], filtering: FilterSettings) -> Array:
    """Angle and rate of each row, shape (n, 2)."""
    own = (Term("q", "", "", "", lambda m: m.position), Term("v", "", "", "", lambda m: m.rate))
    return np.concatenate([all_rows(each.motion, own, filtering).columns for each in pieces])


def force_of(trial: TrialData) -> str:
    """The channel that is taken for what moves the axis."""
    names = trial.channel_names()
    return next((name for name in FORCES if name in names), DRIVE_TORQUE)


def with_constants(one: Estimate, data: TestData) -> Estimate:
    """With what a wrong constant of the force would do to it; of a time that is nothing."""
    if not one.unit.startswith(("N", "kg")) or one.origin is Origin.NOT_DETERMINED:
        return one
    first = data.trials[0]
    if data.bench.motor is not None and not first.trial.recording:
        one = with_systematic(one, data.bench, TORQUE_CONSTANT, one.value)
    return with_scale(one, first, force_of(first))


def _moves(piece: MotionPiece, low_pass: float) -> bool:
    """Whether what was measured goes further than from one independent sample to the next.

    What is left of white noise behind its low-pass does not: its samples twice a period of the
    corner apart differ by 1.4 times of how far they scatter. The sum of a rate's noise does, and
    tells nothing.
    """
    motion = piece.motion
    measured = motion.rate if piece.of_rate else motion.position
    apart = max(1, round(0.5 * motion.sample_rate / low_pass))
    return bool(np.std(measured) > np.std(measured[apart:] - measured[:-apart]))


def never_moved(motions: Sequence[Motion], slowest: float) -> tuple[str, ...]:
    """Directions in which nothing moves faster than `slowest` (SI), but for a few samples' noise.

    Raises ValueError where that are both.
    """
    rate = np.concatenate([motion.rate for motion in motions])
    count = {"positive": np.sum(rate > slowest), "negative": np.sum(rate < -slowest)}
    total = sum(count.values())
    if total == 0:
        raise ValueError("the axis never moves faster than what counts as standing still")
    return tuple(way for way, samples in count.items() if samples <= ONE_WAY * total)


def with_slowest(
    filtering: FilterSettings, pieces: Sequence[MotionPiece], slowest: float | None
) -> FilterSettings:
    """With the rate (SI) below which the axis stands still; None: a share of its fastest."""
    if slowest is None:
        slowest = SLOWEST * max(float(np.abs(each.motion.rate).max()) for each in pieces)
    return replace(filtering, slowest=slowest)


def _pieces(archived: TrialData, filtering: FilterSettings) -> Iterator[MotionPiece]:
    recording, task = archived.recording(), archived.trial.task
    force = force_of(archived)
    sources = _sources(recording, force)
    good = np.all([np.isfinite(recording[name]) for name in sources], axis=0)
    rate = task.sample_rate
    enough = min(round(SHORTEST_PIECE * rate), round(MOST * len(good)))
    fewest = max(FEWEST_SAMPLES, enough + filtering.skip)
    for piece in whole_pieces(good, fewest):
        parts = {name: np.asarray(recording[name][piece], dtype=float) for name in sources}
        parts[FORCE] = parts.pop(force)
        if task.mode == "rate" and not parts.keys() & {REFERENCE, COMMAND}:
            parts[COMMAND] = task.command.sample(recording.time[piece])
        yield MotionPiece(
            archived.trial.number,
            _motion(recording.time[piece], parts, filtering),
            _wanted(recording.time[piece], parts, filtering),
            RELATIVE_ANGLE not in parts,
        )


def _sources(recording: Recording, force: str) -> list[str]:
    """Channels that are read: an angle rather than a rate, a gyro for what is accelerated."""
    names = [force]
    names.append(RELATIVE_ANGLE if RELATIVE_ANGLE in recording.channels else RELATIVE_RATE)
    names += [name for name in (TEMPERATURE, REFERENCE) if name in recording.channels]
    if GYRO_RATE in recording.channels:
        names.append(GYRO_RATE)
    command = recording.channels.get(COMMAND)
    if REFERENCE not in names and command is not None and command.unit in ("rad/s", "m/s"):
        names.append(COMMAND)
    return names


def _motion(time: Array, parts: dict[str, Array], filtering: FilterSettings) -> Motion:
    force, warm = parts[FORCE], parts.get(TEMPERATURE)
    if RELATIVE_ANGLE in parts:
        motion = motion_of_position(time, parts[RELATIVE_ANGLE], force, filtering.low_pass, warm)
    else:
        motion = motion_of_rate(time, parts[RELATIVE_RATE], force, filtering.low_pass, warm)
    if GYRO_RATE not in parts:
        return motion
    # What is accelerated is the load in space; friction goes by its rate against the hull.
    inertial = zero_phase(parts[GYRO_RATE], filtering.low_pass, motion.sample_rate)
    return replace(motion, acceleration=np.gradient(inertial, 1.0 / motion.sample_rate))


def _wanted(time: Array, parts: dict[str, Array], filtering: FilterSettings) -> Motion | None:
    force, warm = parts[FORCE], parts.get(TEMPERATURE)
    if REFERENCE in parts:
        found = motion_of_position(time, parts[REFERENCE], force, filtering.low_pass, warm)
    elif COMMAND in parts:
        found = motion_of_rate(time, parts[COMMAND], force, filtering.low_pass, warm)
    else:
        return None
    return found if np.ptp(found.rate) > 0 else None
