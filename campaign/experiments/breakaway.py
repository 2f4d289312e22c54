"""Breakaway: a slow torque ramp from rest, and what the presliding curve says (section 4.3.3).

The loop is open; the drive torque rises until the load slides. The torque at that moment is the
breakaway torque, the start of the friction-position curve gives the bristle stiffness sigma0, and
an *assumed* damping ratio gives sigma1, which the ramp itself does not show.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from campaign.channels import DRIVE_TORQUE, GYRO_RATE, RELATIVE_ANGLE
from campaign.experiments.common import conditions, failures_note, grouped
from campaign.experiments.interface import Experiment, TestData, TrialData, bench_of
from campaign.identification.presliding import (
    Presliding,
    breakaway_torque,
    damping_by_ratio,
    fine_angle,
    fit_presliding,
    presliding_curve,
)
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.physics.friction import friction_models
from campaign.result import (
    Array,
    Axis,
    Column,
    Curve,
    Figure,
    Finding,
    Mark,
    Panel,
    Result,
    Table,
    Value,
)
from campaign.signals import Polyline
from campaign.trial import Task, TrialRequest
from campaign.units import (
    Angle,
    AngularRate,
    Frequency,
    Inertia,
    RotationalDamping,
    Time,
    Torque,
    TorqueRate,
)

STOP_FACTOR = 4.0
"""Rate that ends the trial, over the rate that counts as sliding: enough to see it slide."""


def default_positions() -> tuple[float, ...]:
    """Ten angles from -45 to 45 deg (rad)."""
    return tuple(float(angle) for angle in np.deg2rad(np.linspace(-45.0, 45.0, 10)))


class BreakawayOptions(Options):
    """Options of a breakaway test."""

    positions: tuple[Angle, ...] = Field(default_factory=default_positions, min_length=1)
    """Angles of the load relative to the hull at which the ramp is run."""
    torque_rate: TorqueRate = Field(default=1.0, gt=0)
    """Slope of the ramp, at the load."""
    peak_torque: Torque = Field(default=60.0, gt=0)
    """Where the ramp ends if the load has not moved; above the breakaway torque expected."""
    rest: Time = Field(default=0.5, ge=0)
    """Standstill before the ramp."""
    sliding_rate: AngularRate = Field(default=0.005, gt=0)
    """Rate at which the load counts as sliding; the trial ends when it is four times this fast."""
    fit_share: float = Field(default=0.8, gt=0.1, lt=1.0)
    """The presliding curve is fitted up to this share of the breakaway torque."""
    damping_ratio: float = Field(default=0.8, gt=0, le=2.0)
    """Assumed damping ratio of presliding, from which sigma1 follows (Eq. 4.12)."""
    inertia: Inertia | None = Field(default=None, gt=0)
    """J that Eq. 4.12 takes; absent: that of the bench."""
    viscous_friction: RotationalDamping | None = Field(default=None, ge=0)
    """sigma2 that Eq. 4.12 takes off; absent: that of the bench's load side."""
    sample_rate: Frequency = Field(default=1000.0, gt=0, le=100_000)
    """Rate of the recording."""


def _trials(options: BreakawayOptions, bench: Bench) -> Iterator[TrialRequest]:
    ramp = options.peak_torque / options.torque_rate
    stop_rate = STOP_FACTOR * options.sliding_rate
    for number, position in enumerate(options.positions, start=1):
        yield TrialRequest(
            Task(
                mode="torque",
                command=Polyline(
                    times=(0.0, options.rest, options.rest + ramp),
                    values=(0.0, 0.0, options.peak_torque),
                ),
                duration=options.rest + ramp,
                window=(options.rest, options.rest + ramp),
                sample_rate=options.sample_rate,
                start_angle=position,
                stop_rate=stop_rate,
            ),
            point={"measurement": number, "position": position},
            note=f"ends early, once the load slides at {np.rad2deg(stop_rate):.3g} deg/s",
        )


@dataclass(frozen=True)
class Ramp:
    """One ramp and what it says: time, angle from its start, and torque, shape (n,), SI."""

    place: dict[str, Value]
    time: Array
    angle: Array
    torque: Array
    rate: Array
    found: Presliding
    damping: float


def _evaluate(data: TrialData) -> Ramp:
    options = BreakawayOptions.model_validate(data.trial.options, context={"si": True})
    bench = bench_of(data.trial)
    recording = data.recording()
    torque, rate = recording[DRIVE_TORQUE], recording[GYRO_RATE]
    before = recording.time <= options.rest
    angle = fine_angle(recording.time, rate, recording[RELATIVE_ANGLE])
    angle = angle - float(np.mean(angle[before]))
    sign = 1.0 if options.peak_torque > 0 else -1.0
    breakaway, at = breakaway_torque(
        recording.time, rate, torque, bench.axis.inertia, options.sliding_rate
    )
    ramp = (recording.time >= options.rest) & (np.arange(len(angle)) <= at)
    found = fit_presliding(sign * angle[ramp], sign * torque[ramp], breakaway, options.fit_share)
    viscous = options.viscous_friction
    if viscous is None:
        models = friction_models()
        viscous = sum(
            models[f.model].viscous(f) for f in bench.friction.values() if f.side == "load"
        )
    inertia = options.inertia or bench.axis.inertia
    damping = damping_by_ratio(found.stiffness, inertia, viscous, options.damping_ratio)
    return Ramp(conditions(data), recording.time, angle, torque, rate, found, damping)


def _analyse(data: TestData) -> Result:
    tables: list[Table] = []
    figures: list[Figure] = []
    findings: list[Finding] = []
    notes: list[str] = list(failures_note(data))
    groups = grouped(data.completed(), own=("measurement", "position"))
    for number, group in enumerate(groups.values(), start=1):
        ramps = []
        for item in group:
            try:
                ramps.append(_evaluate(item))
            except ValueError as error:
                notes.append(f"{item.trial.label}: {error}.")
        if not ramps:
            continue
        suffix = f"-{number}" if len(groups) > 1 else ""
        tables += [_table(ramps, suffix), _window_table(ramps, suffix)]
        figures.append(_figure(ramps[0], suffix))
        if len(ramps) > 2:
            figures.append(_position_figure(ramps, suffix))
        findings += _findings(ramps)
        notes += _remarks(ramps)
    return Result(tuple(tables), tuple(figures), tuple(findings), tuple(dict.fromkeys(notes)))


def _means(ramps: list[Ramp]) -> dict[str, float]:
    return {
        "breakaway_torque": float(np.mean([r.found.breakaway for r in ramps])),
        "bristle_stiffness": float(np.mean([r.found.stiffness for r in ramps])),
        "stiffness_at_rest": float(np.mean([r.found.stiffness_at_rest for r in ramps])),
        "bristle_damping": float(np.mean([r.damping for r in ramps])),
    }


UNITS = {
    "breakaway_torque": "N m",
    "bristle_stiffness": "N m/rad",
    "stiffness_at_rest": "N m/rad",
    "bristle_damping": "N m s/rad",
}


def _findings(ramps: list[Ramp]) -> Iterator[Finding]:
    for ramp in ramps:
        yield from _of_means([ramp], ramp.place)
    shared = {k: v for k, v in ramps[0].place.items() if k not in ("measurement", "position")}
    yield from _of_means(ramps, {**shared, "statistic": "mean"})


def _of_means(ramps: list[Ramp], place: dict[str, Value]) -> Iterator[Finding]:
    for quantity, value in _means(ramps).items():
        # sigma1 is a formula of sigma0 and of assumed numbers: no ramp measures it.
        computed = quantity == "bristle_damping"
        yield Finding(quantity, value, UNITS[quantity], place, recomputed=computed)


def _table(ramps: list[Ramp], suffix: str) -> Table:
    rows: list[dict[str, Value]] = [
        {
            "measurement": ramp.place.get("measurement"),
            "position": ramp.place.get("position"),
            **_means([ramp]),
            "chord": ramp.found.chord,
            "interfaces": len(ramp.found.interfaces),
        }
        for ramp in ramps
    ]
    mean: dict[str, Value] = {"measurement": "mean", "position": None, **_means(ramps)}
    mean |= {"chord": float(np.mean([r.found.chord for r in ramps])), "interfaces": None}
    return Table(
        key=f"presliding{suffix}",
        title="Breakaway torque and presliding parameters by position",
        columns=(
            Column("measurement", "Measurement"),
            Column("position", "Position", "rad", "deg"),
            Column("breakaway_torque", "Breakaway torque", "N m", "N m"),
            Column("bristle_stiffness", "σ0 (after the first slip)", "N m/rad", "N m/rad"),
            Column("stiffness_at_rest", "Stiffness at rest", "N m/rad", "N m/rad"),
            Column("chord", "Straight chord", "N m/rad", "N m/rad"),
            Column("bristle_damping", "σ1 (assumed)", "N m s/rad", "N m s/rad"),
            Column("interfaces", "Interfaces seen"),
        ),
        rows=(*rows, mean),
        thesis=("4.5",),
        note="σ0 is the stiffness of the interface that carries the largest torque; stiffness at "
        "rest is the slope before anything slips, the sum over all interfaces. σ1 is not "
        "measured: it follows from an assumed damping ratio (Equation 4.12).",
    )


def _window_table(ramps: list[Ramp], suffix: str) -> Table:
    shares = sorted({share for ramp in ramps for share in ramp.found.by_window})
    rows: list[dict[str, Value]] = []
    for share in shares:
        values = [r.found.by_window[share] for r in ramps if share in r.found.by_window]
        rows.append(
            {
                "share": share,
                "mean": float(np.mean(values)),
                "lowest": min(values),
                "highest": max(values),
            }
        )
    return Table(
        key=f"window{suffix}",
        title="How much the fitted window matters to σ0",
        columns=(
            Column("share", "Fitted up to (share of breakaway)"),
            Column("mean", "σ0, mean", "N m/rad", "N m/rad"),
            Column("lowest", "Lowest", "N m/rad", "N m/rad"),
            Column("highest", "Highest", "N m/rad", "N m/rad"),
        ),
        rows=tuple(rows),
    )


def _remarks(ramps: list[Ramp]) -> Iterator[str]:
    yield "σ1 is assumed from a damping ratio; a torque ramp carries no information on it."
    if any(len(ramp.found.interfaces) > 1 for ramp in ramps):
        yield (
            "The presliding curve has two slopes: all interfaces stick at first, then the weaker "
            "one slips and only the stronger goes on deflecting."
        )
    for ramp in ramps:
        for doubt in ramp.found.doubts:
            yield f"Measurement {ramp.place.get('measurement')}: {doubt}."


def _figure(ramp: Ramp, suffix: str) -> Figure:
    found = ramp.found
    time, torque_axis = Axis("Time", "s", "s"), Axis("Drive torque", "N m", "N m")
    angle_axis = Axis("Angle from the start", "rad", "mrad")
    shown = np.abs(ramp.torque) <= 1.02 * found.breakaway
    top = float(np.max(ramp.angle[shown])) if shown.any() else float(ramp.angle.max())
    first = found.interfaces[0]
    tail = sum(torque for _, _, torque in found.interfaces[1:])
    fine = np.linspace(0.0, top, 400)
    values = {
        name: value
        for k, (stiffness, _, torque) in enumerate(found.interfaces, start=1)
        for name, value in ((f"stiffness_{k}", stiffness), (f"torque_{k}", torque))
    }
    reach = fine[fine <= found.breakaway / first[0]]
    curves = [
        Curve(ramp.angle[shown], ramp.torque[shown], "measured", "measured"),
        Curve(fine, presliding_curve(fine, values), "fitted curve", "fit"),
        Curve(reach, tail + first[0] * reach, f"σ0 = {first[0]:,.0f} N m/rad", "reference", "thin"),
    ]
    if len(found.interfaces) > 1:
        steep = fine[fine <= 1.3 * (tail + first[0] * top * 0.02) / found.stiffness_at_rest]
        curves.append(
            Curve(
                steep,
                found.stiffness_at_rest * steep,
                f"at rest: {found.stiffness_at_rest:,.0f} N m/rad",
                "alternative",
            )
        )
    return Figure(
        key=f"ramp{suffix}",
        title="Breakaway: torque ramp, motion, and the presliding curve",
        caption="The torque rises until the load slides. Before that it already gives, "
        "elastically: the lower curve begins with the stiffness of all interfaces together and "
        "goes on, once the weaker ones slip, with that of the strongest.",
        alt="Drive torque and rate over time, and drive torque over angle with the fitted "
        "presliding curve and its initial slopes.",
        panels=(
            Panel(
                time,
                torque_axis,
                [Curve(ramp.time, ramp.torque, "measured", "measured")],
                marks=(Mark("breakaway", y=found.breakaway),),
            ),
            Panel(
                time,
                Axis("Rate", "rad/s", "deg/s"),
                [Curve(ramp.time, ramp.rate, "measured", "measured")],
            ),
            Panel(
                angle_axis,
                torque_axis,
                curves,
                marks=(Mark("end of the fit", y=found.window[1]),),
            ),
        ),
        thesis=("4.13",),
    )


def _position_figure(ramps: list[Ramp], suffix: str) -> Figure:
    position = np.array([float(str(r.place["position"])) for r in ramps])
    axis = Axis("Position", "rad", "deg")
    stiffness = np.array([r.found.stiffness for r in ramps])
    breakaway = np.array([r.found.breakaway for r in ramps])
    return Figure(
        key=f"positions{suffix}",
        title="Breakaway torque and bristle stiffness over position",
        caption="A real axis differs from place to place; a simulated one only as far as its bench "
        "says so.",
        alt="Breakaway torque and bristle stiffness, one dot per position.",
        panels=(
            Panel(
                axis,
                Axis("Breakaway torque", "N m", "N m"),
                [Curve(position, breakaway, "measured", "measured", "points")],
            ),
            Panel(
                axis,
                Axis("σ0", "N m/rad", "N m/mrad"),
                [Curve(position, stiffness, "measured", "measured", "points")],
            ),
        ),
        across=2,
    )


EXPERIMENT = Experiment(
    name="breakaway",
    summary="breakaway torque and presliding stiffness from a slow torque ramp (Table 4.5)",
    options=BreakawayOptions,
    trials=_trials,
    analyse=_analyse,
    requires={
        DRIVE_TORQUE: "the torque at which the load slides",
        GYRO_RATE: "the moment at which it slides",
        RELATIVE_ANGLE: "the presliding curve",
    },
)
