"""Options of small motions below breakaway, and selection of such trials."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydantic import Field

from campaign.arrays import Array
from campaign.channels import DRIVE_TORQUE, GYRO_RATE, RELATIVE_ANGLE, RELATIVE_RATE
from campaign.estimation.inverse.motion import whole_pieces
from campaign.estimation.presliding_dynamics.record import FEWEST, Assumptions, Record
from campaign.estimation.presliding_dynamics.start import first_plant
from campaign.experiments.interface import TrialData, validated
from campaign.experiments.presliding_multisine.dynamics import record_of, with_torques_known
from campaign.options import Options
from campaign.signals import Zero
from campaign.units import Frequency, RotationalDamping, Torque


class PreslidingMultisineOptions(Options):
    """Options of a presliding-multisine test."""

    amplitudes: tuple[Torque, ...] = Field(default=(0.5, 1.0, 2.0), min_length=1, max_length=100)
    """Largest torques of the multisine; all of them far below breakaway."""
    lowest: Frequency = Field(default=0.5, gt=0)
    """Lowest line; the others are its odd multiples, and its period is that of the torque."""
    highest: Frequency = Field(default=60.0, gt=0)
    """Highest line, well above the resonance of the load on its bristles."""
    periods: int = Field(default=10, ge=2, le=10_000)
    """Periods of the torque in a trial."""
    realisations: int = Field(default=1, ge=1, le=100)
    """Trials of each amplitude, each with its own phases."""
    seed: int = Field(default=1, ge=0, lt=2**63)
    """Seed of the phases; the same seed repeats them."""
    damping_ratio: float = Field(default=0.8, gt=0, le=2.0)
    """Assumed damping ratio, to compare with the measured damping (Eq. 4.12)."""
    sample_rate: Frequency = Field(default=1000.0, gt=0, le=100_000)
    """Rate of the recording; at least 8 times the highest line."""


class PreslidingOptions(Options):
    """Options of the model `presliding`."""

    viscous_friction: RotationalDamping | None = Field(default=None, ge=0)
    """sigma2 at the load, to subtract from the damping of small motions; absent: the bench's."""
    damping_ratio: float = Field(default=0.8, gt=0, le=2.0)
    """Assumed damping ratio, to compare with the measured damping (Eq. 4.12)."""


MOTION = (GYRO_RATE, RELATIVE_RATE, RELATIVE_ANGLE)
MOST_SAMPLES = 300_000
"""Most samples of all trials that are not planned small motions; the simulation follows each."""
BEYOND = 2.0
"""Corner of the low-pass over the highest frequency of the load's motion."""
ONLY_RAMPS = 0.1
"""Residual of a straight line over the torque (both rms) below which a torque has no reversal."""
EXPLAINED = 0.5
"""Least share of the torque's variance that inertia, damping, spring and friction explain."""
DIRECTION = 0.5
"""Largest ratio of friction by direction to friction by angle; with more, the load slides."""


def usable(trials: Sequence[TrialData]) -> tuple[Sequence[TrialData], str]:
    """Trials that stay below breakaway, or the reason for none.

    These are trials planned for it (`presliding_multisine`), if there are any; else open-loop
    trials and imported recordings that return to their initial position.
    """
    shown = [
        each
        for each in trials
        if DRIVE_TORQUE in each.channel_names() and each.channel_names() & set(MOTION)
    ]
    planned = [each for each in shown if is_planned(each)]
    if planned:
        return planned, ""
    suitable: list[TrialData] = []
    whys: list[str] = []
    samples = 0
    for each in shown:
        if why := _not_even(each):
            whys.append(why)
            continue
        samples += each.trial.task.samples
        if samples > MOST_SAMPLES:
            whys.append(f"{each.trial.label}: more than {MOST_SAMPLES} samples; take a part of it")
            break
        try:
            record = small_motion(each)
        except ValueError as error:
            whys.append(str(error))
            continue
        if why := slides(record):
            whys.append(f"{record.named}: {why}")
        else:
            suitable.append(each)
    if suitable:
        return suitable, ""
    names = f"{DRIVE_TORQUE} and {' or '.join(MOTION)}"
    return (), f"no trial is a small motion below breakaway ({_told(whys) or f'none has {names}'})"


def _told(whys: Sequence[str]) -> str:
    more = len(whys) - 1
    return whys[0] + (f"; and so on of {more} more" if more else "") if whys else ""


def is_planned(data: TrialData) -> bool:
    """Whether a trial is a small motion by its plan, so that its data need no check."""
    return data.trial.kind == "presliding_multisine"


def small_motion(data: TrialData) -> Record:
    """Record of a trial. Raises ValueError with the reason if it has too little data."""
    if is_planned(data):
        return record_of(data, 1.0 / options_of(data).lowest)
    if not data.trial.recording:
        return record_of(data)
    recording, label = data.recording(), data.trial.label
    torque = recording[DRIVE_TORQUE]
    pieces = whole_pieces(np.isfinite(torque), FEWEST)
    if not pieces:
        raise ValueError(f"{label}: its torque has no {FEWEST} samples without a lost one")
    piece = max(pieces, key=lambda each: len(torque[each]))
    name = _measured(data)
    values = recording[name][piece]
    return Record(
        1.0 / data.trial.task.sample_rate,
        torque[piece],
        rate=None if name == RELATIVE_ANGLE else values,
        angle=values if name == RELATIVE_ANGLE else None,
        at_rest=False,  # the initial state of an imported recording is unknown
        label=label,
    )


def records_of(trials: Sequence[TrialData], motions: Sequence[Array] = ()) -> list[Record]:
    """Records with torques of `with_torques_known`. motions: fitted motions of the load."""
    return with_torques_known(trials, [small_motion(each) for each in trials], motions)


def span_of(trials: Sequence[TrialData], records: Sequence[Record]) -> tuple[float, float]:
    """Lowest and highest frequency (Hz) of all trials."""
    spans = [_span(*each) for each in zip(trials, records, strict=True)]
    return min(low for low, _ in spans), max(high for _, high in spans)


def _span(data: TrialData, record: Record) -> tuple[float, float]:
    """Frequency range (Hz) that a trial shows."""
    if is_planned(data):
        options = options_of(data)
        return options.lowest, options.highest
    return 1.0 / float(record.time[-1]), record.highest_frequency()


def options_of(data: TrialData) -> PreslidingMultisineOptions:
    """Options of a planned trial."""
    return validated(PreslidingMultisineOptions, data.trial.options)


def slides(record: Record) -> str:
    """Why a record is no small motion below breakaway; empty if it is one.

    Regression of the low-passed torque on acceleration, rate, angle and direction: torque on
    bristles grows with the angle, and sliding friction jumps with the direction.
    """
    if _only_ramps(record.torque):
        return "its torque only rises or falls: without a reversal nothing shows that it returns"
    try:
        first_plant([record], Assumptions())
    except ValueError as error:
        return str(error)
    torque, angle, rate, acceleration = _smooth(record)
    x = np.linspace(-1.0, 1.0, len(torque))
    columns = np.column_stack([angle, np.sign(rate), rate, acceleration])
    # Offset and drift; the drift of an angle integrated from a rate is a parabola.
    trend = np.linalg.qr(np.vander(x, 3))[0]
    columns = columns - trend @ (trend.T @ columns)
    torque = torque - trend @ (trend.T @ torque)
    size = np.linalg.norm(columns, axis=0)
    if not np.all(size > 0) or not np.any(torque):
        return "its motion holds nothing"
    shares, *_ = np.linalg.lstsq(columns / size, torque, rcond=None)
    left = torque - columns / size @ shares
    spring, direction = shares[:2]
    if left @ left > (1.0 - EXPLAINED) * (torque @ torque):
        return "its torque and its motion do not belong together, or are hardly more than noise"
    if spring <= 0 or direction > DIRECTION * spring:
        return "it slides: its torque goes with the direction, not with the angle"
    return ""


def _only_ramps(torque: Array) -> bool:
    """Whether a torque is nearly a straight line."""
    x = np.linspace(-1.0, 1.0, len(torque))
    left = torque - np.polyval(np.polyfit(x, torque, 1), x)
    return bool(np.std(left) < ONLY_RAMPS * np.std(torque))


def _smooth(record: Record) -> tuple[Array, Array, Array, Array]:
    """Torque, angle, rate and acceleration after the same zero-phase low-pass."""
    from scipy.signal import butter, sosfiltfilt

    values = record.rate if record.rate is not None else np.asarray(record.angle)
    valid = np.isfinite(values)
    values = np.interp(record.time, record.time[valid], values[valid])
    corner = min(BEYOND * record.highest_frequency() * record.step, 0.2)
    sos = butter(2, 2.0 * corner, output="sos")
    torque, values = sosfiltfilt(sos, record.torque), sosfiltfilt(sos, values)
    rate = values if record.rate is not None else np.gradient(values, record.step)
    angle = values if record.rate is None else np.cumsum(values - np.mean(values)) * record.step
    return torque, angle, rate, np.gradient(rate, record.step)


def _not_even(data: TrialData) -> str:
    """Why a trial is not examined; empty if it is."""
    task, label = data.trial.task, data.trial.label
    if data.trial.recording:
        return ""
    if task.mode != "torque":
        return f"{label}: its loop moved it on purpose, beyond breakaway"
    return "" if isinstance(task.base_acceleration, Zero) else f"{label}: the hull moves"


def _measured(data: TrialData) -> str:
    """Channel of the motion: a recorded channel, before one that was computed."""
    channels = data.trial.recording.get("channels")
    computed = {
        str(each.get("name"))
        for each in (channels if isinstance(channels, list) else [])
        if isinstance(each, dict) and each.get("how", "column") != "column"
    }
    names = data.channel_names()
    order = [each for each in (GYRO_RATE, RELATIVE_ANGLE, RELATIVE_RATE) if each in names]
    return next((each for each in order if each not in computed), order[-1])
