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
from campaign.experiments.shared.recorded_motion import validation_of
from campaign.experiments.shared.systematic import TORQUE_CONSTANT, with_scale, with_systematic
from campaign.signals import MultiSine
from campaign.trial import Recording

ROWS, FEWEST_ROWS = 20.0, 25.0
"""of a commanded sum of sines: per period of its highest frequency, and per second at least."""
SLOWEST = 0.02
"""of the fastest rate: default of the rate below which the axis is at standstill."""
MOST_SAMPLES = 5_000_000
"""Largest number of samples of all trials together; further trials are left out."""
SHORTEST_PIECE = 1.0
"""s; shortest usable motion without a lost sample, or `MOST` of its trial if that is shorter."""
MOST = 0.9
"""of a trial."""
FORCES = (DRIVE_TORQUE, JOINT_TORQUE)
"""Force channels, the better first: a sensor at the load does not measure motor and gear."""
FEWEST_SAMPLES = 100
"""of a piece without a lost sample."""
FORCE = "force"
RATES_ALIKE = 1.01
"""Largest ratio of sample rates that count as equal: times of files are rounded, and a resampled
trial has its own mean step."""
ONE_WAY = 0.02
"""Largest share of the moving samples in a direction that counts as one without motion."""


@dataclass(frozen=True)
class MotionPiece:
    """A piece of a trial: measured and commanded motion; None if no command was recorded.

    of_rate: whether the rate was measured and the position is its integral.
    """

    trial: int
    motion: Motion
    wanted: Motion | None
    of_rate: bool = False

    def part(self, which: slice) -> MotionPiece:
        """A slice of its samples."""
        wanted = None if self.wanted is None else self.wanted.part(which)
        return replace(self, motion=self.motion.part(which), wanted=wanted)


def usable(trials: Sequence[TrialData]) -> tuple[Sequence[TrialData], str]:
    """Trials with a force and a motion, up to `MOST_SAMPLES`, or why there are none."""
    usable_trials: list[TrialData] = []
    samples = 0
    for each in trials:
        names = each.channel_names()
        if not names & {*FORCES} or not names & {RELATIVE_ANGLE, RELATIVE_RATE}:
            continue
        samples += each.trial.task.samples
        if usable_trials and samples > MOST_SAMPLES:
            break
        usable_trials.append(each)
    if not usable_trials:
        force = f"{DRIVE_TORQUE} or {JOINT_TORQUE}"
        return (), f"no trial has {force}, and {RELATIVE_ANGLE} or {RELATIVE_RATE}"
    return usable_trials, ""


def read(
    data: TestData, low_pass: float | None, decimation: int | None, skip: float
) -> tuple[FilterSettings, tuple[MotionPiece, ...], tuple[MotionPiece, ...]]:
    """Filter settings, with defaults for the sample rate; pieces of the trials and the validation.

    Raises ValueError if either has no usable piece.
    """
    rate = data.trials[0].trial.task.sample_rate
    plain = FilterSettings.for_rate(rate)
    decimation = decimation or max(plain.decimation, round(rate / rows_of(data.trials)))
    filtering = FilterSettings(low_pass or plain.low_pass, decimation, round(skip * rate))
    pieces = moved(data.trials, filtering)
    unseen = validation_of(data, usable)
    return filtering, pieces, moved(unseen, filtering) if unseen else ()


def rows_of(trials: Sequence[TrialData]) -> float:
    """Rows per second: fewer for slow sums of sines, else enough for friction in reversals."""
    highest = 0.0
    for task in (each.trial.task for each in trials):
        if task.mode != "rate" or not isinstance(task.command, MultiSine):
            return REGRESSION_RATE
        highest = max(highest, *task.command.frequencies)
    return max(FEWEST_ROWS, ROWS * highest)


def moved(trials: Sequence[TrialData], filtering: FilterSettings) -> tuple[MotionPiece, ...]:
    """Pieces without a lost sample of all trials. Raises ValueError if they do not suit a fit."""
    pieces = tuple(piece for each in trials for piece in _pieces(each, filtering))
    if not pieces:
        raise ValueError(
            f"nothing is recorded for {SHORTEST_PIECE:g} s without a lost sample, and no whole "
            f"trial with {FEWEST_SAMPLES} samples"
        )
    if not any(np.any(each.motion.force) for each in pieces):
        raise ValueError(f"{force_of(trials[0])} is zero throughout")
    if not any(_moves(each, filtering.low_pass) for each in pieces):
        if all(each.of_rate for each in pieces):
            raise ValueError("the rate is constant but for its sensor's noise")
        raise ValueError("the axis stands still: what it moves is no more than its sensor's noise")
    rates = [each.motion.sample_rate for each in pieces]
    if max(rates) > RATES_ALIKE * min(rates):
        shown = ", ".join(dict.fromkeys(f"{rate:.4g} Hz" for rate in sorted(rates)))
        raise ValueError(
            f"the trials have several sample rates ({shown}), and one fit takes one: name a test "
            "whose trials share it, as in `campaign identify RUN:TEST`"
        )
    return pieces


PLACE_AND_RATE = (
    Term("q", "", "", "", lambda motion: motion.position),
    Term("v", "", "", "", lambda motion: motion.rate),
)
"""Columns of rows: angle and rate."""


def place_and_rate(pieces: Sequence[MotionPiece], filtering: FilterSettings) -> Array:
    """Angle and rate of each row, shape (n, 2)."""
    rows = [all_rows(each.motion, PLACE_AND_RATE, filtering).columns for each in pieces]
    return np.concatenate(rows)


def force_of(trial: TrialData) -> str:
    """The channel used as the force: the first of `FORCES` that the trial has."""
    names = trial.channel_names()
    return next((name for name in FORCES if name in names), DRIVE_TORQUE)


def with_constants(one: Estimate, data: TestData) -> Estimate:
    """An estimate with the systematic parts of the force's constants; a time has none."""
    if not one.unit.startswith(("N", "kg")) or one.origin is Origin.NOT_DETERMINED:
        return one
    first = data.trials[0]
    if data.bench.motor is not None and not first.trial.recording:
        one = with_systematic(one, data.bench, TORQUE_CONSTANT, one.value)
    return with_scale(one, first, force_of(first))


def _moves(piece: MotionPiece, low_pass: float) -> bool:
    """Whether the measured signal varies more than from one independent sample to the next.

    Low-passed white noise does not: its samples half a period of the corner apart differ by 1.4
    times their deviation. A position integrated from a noisy rate would; so the rate is used there.
    """
    motion = piece.motion
    measured = motion.rate if piece.of_rate else motion.position
    apart = max(1, round(0.5 * motion.sample_rate / low_pass))
    return bool(np.std(measured) > np.std(measured[apart:] - measured[:-apart]))


def never_moved(motions: Sequence[Motion], slowest: float) -> tuple[str, ...]:
    """Directions without motion faster than `slowest` (SI), except for a few noisy samples.

    Raises ValueError if neither direction has any.
    """
    rate = np.concatenate([motion.rate for motion in motions])
    count = {"positive": np.sum(rate > slowest), "negative": np.sum(rate < -slowest)}
    total = sum(count.values())
    if total == 0:
        raise ValueError("the axis never moves faster than what counts as standing still")
    return tuple(direction for direction, samples in count.items() if samples <= ONE_WAY * total)


def with_slowest(
    filtering: FilterSettings, pieces: Sequence[MotionPiece], slowest: float | None
) -> FilterSettings:
    """Settings with the rate (SI) below which the axis is at standstill; None: a default share."""
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
    """Channels to read: the angle if recorded, else the rate; the gyro for the acceleration."""
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
    # Inertia acts on the load's motion in space, friction on its rate relative to the hull.
    inertial = zero_phase(parts[GYRO_RATE], filtering.low_pass, motion.sample_rate)
    return replace(motion, acceleration=np.gradient(inertial, 1.0 / motion.sample_rate))


def _wanted(time: Array, parts: dict[str, Array], filtering: FilterSettings) -> Motion | None:
    force, warm = parts[FORCE], parts.get(TEMPERATURE)
    if REFERENCE in parts:
        motion = motion_of_position(time, parts[REFERENCE], force, filtering.low_pass, warm)
    elif COMMAND in parts:
        motion = motion_of_rate(time, parts[COMMAND], force, filtering.low_pass, warm)
    else:
        return None
    return motion if np.ptp(motion.rate) > 0 else None
