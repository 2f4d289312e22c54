"""Breakaway: a slow torque ramp from rest, with its presliding curve (section 4.3.3).

The loop is open; the drive torque rises until the load slides. The torque at that moment is the
breakaway torque. The start of the friction-position curve gives the bristle stiffness sigma0. An
*assumed* damping ratio gives sigma1, which the ramp does not show.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from pydantic import Field, JsonValue

from campaign.channels import DRIVE_TORQUE, GYRO_RATE, RELATIVE_ANGLE
from campaign.estimate import Estimate, Origin, Window
from campaign.estimation.breakaway_torque import breakaway_torque
from campaign.estimation.excitation_detection import found_ramp
from campaign.estimation.presliding import Presliding, damping_by_ratio, fit_presliding
from campaign.estimation.relative_rate import (
    LONGEST,
    RelativeRate,
    made_of_counts,
    resolved_rate,
    slides_from,
    stop_rate,
)
from campaign.experiments.breakaway.figures import position_figure, ramp_figure
from campaign.experiments.breakaway.means import OF_A_RAMP, Ramps, compared, means_of, parameters_of
from campaign.experiments.breakaway.remarks import remarks
from campaign.experiments.breakaway.tables import chord_of, findings_of, table_of, window_table
from campaign.experiments.interface import (
    Experiment,
    Model,
    TestData,
    TrialData,
    bench_of,
    key,
    metrics,
    validated,
)
from campaign.experiments.shared import default_options
from campaign.experiments.shared.captions import trials_of
from campaign.experiments.shared.common import conditions, grouped, numbered
from campaign.experiments.shared.detected_trials import named_or_found
from campaign.experiments.shared.rig import Rig
from campaign.experiments.shared.systematic import INERTIA, TORQUE_CONSTANT, with_systematic
from campaign.options import Options
from campaign.parameter import IdentifiedRig
from campaign.physics.bench import Bench
from campaign.physics.complete import inertia_of
from campaign.physics.friction import friction_models
from campaign.reason import Cause
from campaign.recording import Array, Recording
from campaign.result import Figure, Result
from campaign.signals import Polyline
from campaign.trial import OfferedRecording, Task, Trial, TrialRequest
from campaign.units import (
    Angle,
    AngularRate,
    Frequency,
    Inertia,
    RotationalDamping,
    Time,
    Torque,
    TorqueRate,
    in_words,
    rate_text,
)

WAYS = {"positive": 1.0, "negative": -1.0}
OF_INERTIA = Cause("part of the inertia", "it serves the inertia's part alone")
ASSUMED_RATIO = Cause(
    "assumed damping ratio",
    "it follows from an assumed damping ratio, on which a ramp carries no information; an interval "
    "is that of the stiffness alone",
)
FOR_ORIENTATION = Cause(
    "for orientation", "torque over stiffness of the strongest interface, for orientation"
)
BY_CRITERION = Cause("chosen by a criterion", "chosen by the Bayesian information criterion")


def default_positions() -> tuple[float, ...]:
    """Ten angles from -45 to 45 deg (rad)."""
    return tuple(float(angle) for angle in np.deg2rad(np.linspace(-45.0, 45.0, 10)))


class BreakawayOptions(Options):
    """Options of a breakaway test."""

    positions: tuple[Angle, ...] = Field(default_factory=default_positions, min_length=1)
    """Angles of the load relative to the hull for the ramps."""
    directions: tuple[Literal["positive", "negative"], ...] = Field(
        default=("positive", "negative"), min_length=1, max_length=2
    )
    """Directions of the ramps, one after the other; friction may differ by direction."""
    torque_rate: TorqueRate = Field(default=1.0, gt=0)
    """Slope of the ramp, at the load. Sweep it to see its effect on the results."""
    peak_torque: Torque = Field(default=60.0, gt=0)
    """End of the ramp if the load does not move; above the expected breakaway torque."""
    rest: Time = Field(default=0.5, ge=0)
    """Standstill before the ramp, to estimate the gyro's bias."""
    sliding_rate: AngularRate = Field(default=0.005, gt=0)
    """Rate at which the load counts as sliding. The trial ends at four times this rate, at least
    two counts of the gyro."""
    fit_share: float = Field(default=0.8, gt=0.1, lt=1.0)
    """The presliding curve is fitted up to this share of the breakaway torque."""
    damping_ratio: float = Field(default=0.8, gt=0, le=2.0)
    """Assumed damping ratio of presliding, from which sigma1 follows (Eq. 4.12)."""
    inertia: Inertia | None = Field(default=None, gt=0)
    """J in Eq. 4.12; absent: that of the bench."""
    viscous_friction: RotationalDamping | None = Field(default=None, ge=0)
    """sigma2 to subtract in Eq. 4.12; absent: that of the bench's load side."""
    sample_rate: Frequency = Field(default=1000.0, gt=0, le=100_000)
    """Rate of the recording."""


def _trials(options: BreakawayOptions, bench: Bench) -> Iterator[TrialRequest]:
    windows = windows_of(options)
    _, ramp = windows
    ends = stop_rate(options.sliding_rate, Rig(bench).rate_step)
    places = [(side, position) for side in options.directions for position in options.positions]
    for number, (direction, position) in enumerate(places, start=1):
        peak = WAYS[direction] * options.peak_torque
        yield TrialRequest(
            Task(
                mode="torque",
                command=Polyline(times=(0.0, ramp.start, ramp.stop), values=(0.0, 0.0, peak)),
                duration=ramp.stop,
                window=(ramp.start, ramp.stop),
                sample_rate=options.sample_rate,
                start_angle=position,
                stop_rate=ends,
            ),
            point={"measurement": number, "position": position, "direction": direction},
            note=f"ends early, once the load slides at {rate_text(ends)}",
            windows=windows,
        )


def _warnings(options: BreakawayOptions, bench: Bench) -> Iterator[str]:
    if bench.axis.inertia is None:
        yield (
            "its ramps give no breakaway torque: the bench does not say axis.inertia "
            "(what the torque accelerates): add it before they are executed"
        )


def _found(
    options: BreakawayOptions, bench: Bench, offered: OfferedRecording
) -> Iterator[TrialRequest]:
    """The ramp in an unplanned recording, until the load first slides."""
    known = {RELATIVE_ANGLE} & offered.channels
    recording = offered.read([GYRO_RATE, DRIVE_TORQUE, *known])
    resolved = _resolved(recording, options.sliding_rate, own_sensor=False)
    threshold = max(options.sliding_rate, resolved.finest)
    slides = slides_from(resolved.values, threshold)
    if slides is None:
        raise ValueError(f"the load never slides at {rate_text(threshold)} (sliding_rate)")
    ramp = found_ramp(recording.time, recording[DRIVE_TORQUE], float(recording.time[slides[0]]))
    # The smoothing needs half of its window after that.
    stop = min(offered.duration, float(recording.time[slides[1] - 1]) + 0.5 * resolved.window)
    coarse = ""
    if threshold > options.sliding_rate:
        coarse = f"; sliding is {rate_text(threshold)}, the least that its sensor resolves"
    place: dict[str, JsonValue] = {}
    if known and "position" not in offered.conditions:
        place["position"] = round(float(recording[RELATIVE_ANGLE][0]), 4)
    looked_for = Window("rest", 0.0, ramp.start), Window("ramp", ramp.start, stop)
    windows = named_or_found(offered, looked_for)
    yield TrialRequest(
        Task(mode="recorded", duration=stop, window=(ramp.start, stop), sample_rate=1.0),
        point=place | {"direction": "positive" if ramp.slope > 0 else "negative"},
        note=f"a ramp of {in_words(ramp.slope, 'N m/s')} from {ramp.start:.3g} s was found{coarse}",
        windows=windows,
        part=(0.0, stop),
        options={
            "torque_rate": float(f"{abs(ramp.slope):.3g}"),
            "rest": ramp.start,
            "sliding_rate": threshold,
        },
    )


def _resolved(recording: Recording, finest: float, *, own_sensor: bool) -> RelativeRate:
    """The rate of a recording, smoothed until its sensor resolves `finest` (rad/s).

    A rate made of encoder counts is replaced by the slope of the angle: one count is many times as
    fast. `own_sensor`: whether the rate is known to have its own sensor; imported rates are not.
    """
    angle = recording[RELATIVE_ANGLE] if RELATIVE_ANGLE in recording.channels else None
    rate, step = recording[GYRO_RATE], _step(recording)
    if angle is not None and own_sensor:
        own_sensor = not made_of_counts(rate, angle, step)
    return resolved_rate(rate, angle, step, finest, LONGEST, own_sensor=own_sensor)


def _step(recording: Recording) -> float:
    return float(np.ptp(recording.time)) / max(len(recording.time) - 1, 1)


def windows_of(options: BreakawayOptions) -> tuple[Window, Window]:
    """Windows of standstill and ramp, for the plan and for archived plans without windows."""
    stop = options.rest + options.peak_torque / options.torque_rate
    return Window("rest", 0.0, options.rest), Window("ramp", options.rest, stop)


def _windows(trial: Trial) -> dict[str, Window]:
    planned = windows_of(validated(BreakawayOptions, trial.options))
    return {window.name: window for window in trial.windows or planned}


def direction_of(trial: Trial) -> str:
    """Direction of a ramp; positive for archived trials that do not state it."""
    return str(trial.point.get("direction", "positive"))


def _samples(data: TrialData) -> tuple[Array, Array, Array]:
    """Time (s), rate (rad/s) and drive torque (N m), with signs of a rising ramp; each (n,).

    For an executed ramp, a rate made of counts is differentiated again from the angle, so that it
    resolves less than one count. The torque is relative to its mean at rest.
    """
    recording, sign = data.recording(), WAYS[direction_of(data.trial)]
    time, rate, torque = recording.time, recording[GYRO_RATE], recording[DRIVE_TORQUE]
    if data.trial.recording:
        return time, sign * rate, sign * torque
    if RELATIVE_ANGLE in recording.channels:
        angle, step = recording[RELATIVE_ANGLE], _step(recording)
        if bench_of(data.trial).rate_is_of_encoder or made_of_counts(rate, angle, step):
            rate = np.gradient(angle, step)
    # At rest no torque is commanded: the mean is the zero of the sensor.
    rest = _windows(data.trial)["rest"]
    zero = torque[(time >= rest.start) & (time < rest.stop)]
    zero = zero[np.isfinite(zero)]
    return time, sign * rate, sign * (torque - (np.mean(zero) if len(zero) else 0.0))


def _seen(data: TrialData, finest: float) -> Array:
    """The smoothed rate (rad/s) that detects sliding, with the sign of a rising ramp; (n,)."""
    own_sensor = not (data.trial.recording or bench_of(data.trial).rate_is_of_encoder)
    seen = _resolved(data.recording(), finest, own_sensor=own_sensor)
    return WAYS[direction_of(data.trial)] * seen.values


def curve_of(data: TrialData, breakaway: float) -> Presliding:
    """The presliding curve of a ramp whose load slides at `breakaway` (N m).

    Raises ValueError if the ramp does not show enough of it.
    """
    options = validated(BreakawayOptions, data.trial.options)
    start = _windows(data.trial)["ramp"].start
    return fit_presliding(*_samples(data), start, breakaway, options.fit_share)


def _measure(data: TrialData) -> Sequence[Estimate]:
    """Breakaway torque and, if the curve can be fitted, stiffness with quantities from it."""
    options, bench = validated(BreakawayOptions, data.trial.options), bench_of(data.trial)
    inertia = inertia_of(bench, "friction of a load that gathers speed")
    seen = _seen(data, options.sliding_rate)
    try:
        breakaway = breakaway_torque(*_samples(data), inertia, options.sliding_rate, seen)
    except ValueError as error:
        if slides_from(seen, options.sliding_rate) is None:
            raise
        raise ValueError(f"{error}; a higher sample_rate holds more of it") from error
    torque = with_systematic(breakaway.torque, bench, INERTIA, inertia * breakaway.acceleration)
    torque = _by_torque_constant(torque, bench)
    acceleration = Estimate.without_interval(
        "peak_acceleration", breakaway.acceleration, "rad/s^2", OF_INERTIA()
    )
    try:
        curve = curve_of(data, breakaway.torque.value)
    except ValueError:
        return torque, acceleration
    if _is_of_any_size(curve.stiffness):
        return torque, acceleration
    return torque, acceleration, *_of_curve(curve, options, bench)


def _is_of_any_size(one: Estimate) -> bool:
    """Whether a number is open over decades: it would dominate the mean of all ramps."""
    return one.origin is Origin.NOT_DETERMINED and not one.has_interval


def _of_curve(curve: Presliding, options: BreakawayOptions, bench: Bench) -> Iterator[Estimate]:
    viscous = options.viscous_friction
    if viscous is None:
        models = friction_models()
        load = (each for each in bench.friction.values() if each.side == "load")
        viscous = sum(models[each.model].viscous(each) for each in load)
    inertia = options.inertia or inertia_of(bench, "a damping ratio")
    stiffness = curve.interfaces[0].stiffness  # not the end of a bound
    damping = damping_by_ratio(stiffness, inertia, viscous, options.damping_ratio)
    curve = curve.with_damping(damping)
    measured = _by_torque_constant(curve.stiffness, bench)
    yield measured
    if not _is_of_any_size(curve.stiffness_at_rest):
        yield _by_torque_constant(curve.stiffness_at_rest, bench)
    yield _damping(measured, damping, 0.5 * (damping + viscous) / stiffness)
    yield chord_of(curve.chord)
    span = curve.interfaces[0].torque / curve.interfaces[0].stiffness
    yield Estimate.without_interval("presliding_span", span, "rad", FOR_ORIENTATION())
    count = float(len(curve.interfaces))
    yield Estimate.without_interval("interfaces", count, "", BY_CRITERION(), kind="count")
    for share, own in curve.by_window.items():
        yield replace(own, name=f"bristle_stiffness_to_{share:g}")


def _damping(stiffness: Estimate, value: float, slope: float) -> Estimate:
    """sigma1 (N m s/rad) by an assumed damping ratio, with the interval due to the stiffness.

    slope: d sigma1 / d sigma0 (s) of Equation 4.12, with ratio, inertia and viscous friction exact.
    """
    damping = Estimate.without_interval(
        "bristle_damping",
        value,
        "N m s/rad",
        ASSUMED_RATIO(),
        origin=Origin.ASSUMED,
        method="Equation 4.12",
    )
    low, high, error = stiffness.low, stiffness.high, stiffness.standard_error
    if stiffness.kind != "number" or low is None or high is None or error is None:
        return damping
    parts = (
        replace(part, standard_uncertainty=slope * (part.standard_uncertainty or 0.0))
        for part in stiffness.systematic
        if part.standard_uncertainty is not None
    )
    return replace(
        damping,
        low=value + slope * (low - stiffness.value),
        high=value + slope * (high - stiffness.value),
        level=stiffness.level,
        standard_error=slope * error,
        freedom=stiffness.freedom,
        systematic=tuple(parts),
    )


def _by_torque_constant(estimate: Estimate, bench: Bench) -> Estimate:
    """A torque or stiffness with the systematic part of the torque constant, proportional to it."""
    return with_systematic(estimate, bench, TORQUE_CONSTANT, estimate.value)


def _analyse(data: TestData) -> Result:
    places = [_ramps(group) for group in grouped(data.completed(), own=OF_A_RAMP).values()]
    groups = [compared(ramps, places) for ramps in places]
    whole = numbered(map(_of_ramps, groups))
    if data.model is None:
        return whole
    notes = list(whole.notes)
    parameters = tuple(parameters_of(groups, curve_of, notes))
    return replace(whole, notes=tuple(notes), identified=IdentifiedRig(parameters))


def _ramps(group: tuple[TrialData, ...]) -> Ramps:
    return Ramps(
        group,
        tuple({**conditions(item), "direction": direction_of(item.trial)} for item in group),
        tuple(metrics(item, _measure) for item in group),
    )


def _of_ramps(ramps: Ramps) -> Result:
    """Result of the ramps of one sweep point."""
    means = means_of(ramps)
    return Result(
        (table_of(ramps, means), *window_table(ramps)),
        tuple(_figures(ramps, means)),
        tuple(findings_of(ramps, means)),
        tuple(remarks(ramps)),
    )


def _figures(ramps: Ramps, means: Mapping[str, Mapping[str, Estimate]]) -> Iterator[Figure]:
    drawn = (k for k, data in enumerate(ramps.trials) if not data.not_kept)
    shown = next((k for k in drawn if "bristle_stiffness" in ramps.found[k]), None)
    if shown is not None:
        data, torque = ramps.trials[shown], ramps.found[shown]["breakaway_torque"].value
        curve, place = curve_of(data, torque), ramps.places[shown]
        yield ramp_figure(_samples(data), curve, torque, place, trials_of([data]))
    if len(ramps.found) > 2 and all("position" in place for place in ramps.places):
        yield position_figure(ramps, means)


EXPERIMENT = Experiment(
    name="breakaway",
    summary="breakaway torque and presliding stiffness from a slow torque ramp (Table 4.5)",
    options=BreakawayOptions,
    trials=_trials,
    analyse=_analyse,
    fit=default_options.breakaway,
    warnings=_warnings,
    measure=_measure,
    needs_samples=False,
    recorded=_found,
    windows=("rest", "ramp"),
    requires={
        DRIVE_TORQUE: "the torque at which the load slides",
        GYRO_RATE: "the presliding curve, and the moment at which the load slides",
    },
    model=Model(
        name="ramps",
        summary="from ramps: breakaway torque, stiffness of the last interface to slip, "
        "torque of the others",
    ),
    key_numbers=(
        key("breakaway_torque", statistic="mean"),
        key("bristle_stiffness", statistic="mean"),
        key("stiffness_at_rest", statistic="mean"),
    ),
)
