"""Stribeck curve: friction of steady sliding at many constant speeds.

The load is moved at each speed exactly as prescribed, without a drive, in both directions. Once the
bristles have settled, the friction torque lies on the model's curve of steady sliding (Figure 2.9,
Equation 4.6). The measurement shows that it reaches this curve.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from pydantic import Field

from campaign.channels import FRICTION_TORQUE, LOAD_RATE
from campaign.estimate import Estimate
from campaign.estimation.intervals import multiplied, of_series
from campaign.estimation.sampled_curve import drop_interval_if_deterministic, largest
from campaign.experiments.interface import Experiment, TestData, TrialData, bench_of
from campaign.experiments.shared.captions import amount, listed, sentence, surely_above, trials_of
from campaign.experiments.shared.friction_models import (
    OF_ONE,
    RESOLVED,
    ConditionGroup,
    combined,
    in_models,
    places,
    resolved,
    simulated,
)
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.physics.steady_friction import steady_friction
from campaign.reason import Cause
from campaign.result import (
    Array,
    Axis,
    Cell,
    Column,
    Curve,
    Figure,
    Finding,
    Mark,
    Panel,
    Result,
    Table,
)
from campaign.signals import Polyline
from campaign.text import number
from campaign.trial import Task, TrialRequest
from campaign.units import Angle, AngularRate, Frequency, Time

OF_THE_MODEL = Cause("from the model", "worked out from the model of the bench, and not measured")
OWN = ("speed",)
TORQUE = "friction_torque"
RAMP = 0.1
"""s, from rest to the speed."""
LEVEL = 1e-3
"""Smallest relative change of a torque that counts as a fall or a rise."""
SHOWN = 1.5
"""Factor by which curves extend beyond the slowest and the fastest speed."""


def default_speeds() -> tuple[float, ...]:
    """25 speeds at equal ratios from 0.001 to 1 rad/s."""
    return tuple(float(speed) for speed in np.geomspace(1e-3, 1.0, 25))


class StribeckCurveOptions(Options):
    """Options of a Stribeck-curve test."""

    speeds: tuple[AngularRate, ...] = Field(
        default_factory=default_speeds, min_length=1, max_length=10_000
    )
    """Constant speeds; each is run in both directions."""
    settle_angle: Angle = Field(default=0.02, ge=0)
    """Travel before a reading: many times the deflection of the bristles."""
    settle_time: Time = Field(default=0.2, ge=0)
    """Shortest time at constant speed before a reading."""
    window_time: Time = Field(default=0.1, gt=0)
    """Duration of the reading."""
    sample_rate: Frequency = Field(default=1000.0, gt=0, le=100_000)
    """Rate of the recording."""
    models: tuple[str, ...] = ()
    """Friction models to describe the bench's friction, one by one; none: its own."""


def _trials(options: StribeckCurveOptions, bench: Bench) -> Iterator[TrialRequest]:
    if options.window_time * options.sample_rate < 1:
        raise ValueError("the window holds no sample; raise window_time or sample_rate")
    for point, tree in in_models(bench, options.models):
        for speed in options.speeds:
            if speed <= 0:
                raise ValueError("speeds are positive; each is run in both directions")
            settled = RAMP + max(options.settle_time, options.settle_angle / speed)
            stop = settled + options.window_time
            for rate in (speed, -speed):
                yield TrialRequest(
                    Task(
                        mode="prescribed",
                        command=Polyline(times=(0.0, RAMP), values=(0.0, rate)),
                        duration=stop,
                        window=(settled, stop),
                        sample_rate=options.sample_rate,
                        start_angle=-0.5 * rate * (stop - 0.5 * RAMP),
                    ),
                    point={**point, "speed": rate},
                    bench=tree,
                )


def _measure(data: TrialData) -> tuple[Estimate, ...]:
    """Mean rate (rad/s) and mean friction torque (N m) of the reading, both signed."""
    cut = data.recording().window(*data.trial.task.window)
    found = (
        of_series("rate", cut[LOAD_RATE], "rad/s"),
        of_series(TORQUE, cut[FRICTION_TORQUE], "N m"),
    )
    return simulated(drop_interval_if_deterministic(each, abs(each.value)) for each in found)


@dataclass(frozen=True)
class _Points:
    """Readings by rate, both signed, repeats together.

    Attributes:
        promised: friction of steady sliding by the bench's own model (N m), shape (n,).
        deviations: relative deviation of each reading from it, as a magnitude.
    """

    rates: tuple[Estimate, ...]
    torques: tuple[Estimate, ...]
    promised: Array
    deviations: tuple[Estimate, ...]

    @property
    def rate(self) -> Array:
        """rad/s, shape (n,)."""
        return np.array([each.value for each in self.rates])


def _points(place: ConditionGroup) -> _Points:
    """Readings with a rate and a torque: without a rate the model states no friction."""
    read = (combined(trials, _measure) for trials in place.by("speed").values())
    moved = [each for each in read if each["rate"].value]
    found = [each for each in moved if math.isfinite(each["rate"].value + each[TORQUE].value)]
    rates = tuple(each["rate"] for each in found)
    torques = tuple(each[TORQUE] for each in found)
    rate = np.array([each.value for each in rates])
    promised = np.add(*steady_friction(bench_of(place.trials[0].trial), rate))
    return _Points(rates, torques, promised, tuple(map(_deviation, torques, promised)))


def _deviation(torque: Estimate, promised: float) -> Estimate:
    error = None if torque.standard_error is None else torque.standard_error / abs(float(promised))
    value = abs(torque.value / float(promised) - 1.0)
    return replace(torque, value=value, unit="", low=None, high=None, standard_error=error)


def _largest_deviation(points: _Points) -> Estimate:
    found = largest("stribeck_deviation", points.deviations, "")
    found = resolved(replace(found, systematic=points.deviations[0].systematic), 1.0)
    return replace(found, low=None if found.low is None else max(found.low, 0.0))


NOTHING_MOVED = "No reading has both a rate and a torque: friction in motion is not determined."


def _analyse(data: TestData) -> Result:
    told = [(place, _points(place)) for place in places(data.completed(), OWN)]
    found = [(place, points) for place, points in told if points.rates]
    if not found:
        return Result(notes=(NOTHING_MOVED,) if told else ())
    rows: list[dict[str, Cell]] = []
    findings: list[Finding] = []
    panels: list[Panel] = []
    for place, points in found:
        rows += [
            {**place.point, "rate": v, "torque": t, "curve": float(p)}
            for v, t, p in zip(points.rates, points.torques, points.promised, strict=True)
        ]
        findings.append(Finding.of(_largest_deviation(points), place.point))
        panels += _panels(place, points)
    worst = max(finding.value for finding in findings) or RESOLVED
    table = Table(
        key="stribeck-curve",
        title="Friction of steady sliding",
        columns=(
            *found[0][0].columns,
            Column("rate", "Rate", "rad/s", "deg/s"),
            Column("torque", "Friction torque", "N m", "N m"),
            Column("curve", "Stribeck curve", "N m", "N m", reason=OF_THE_MODEL()),
        ),
        rows=tuple(rows),
        note="Measured torque and curve agree within "
        f"{number(worst, 1)} of the torque. "
        "A reading is the friction over the travel of its window; a ripple over position that is "
        f"longer than that stays in it. {OF_ONE}",
    )
    drawn = any(torque.has_interval for _, points in found for torque in points.torques)
    bars = ", with their 95 % intervals" if drawn else ""
    figure = Figure(
        key="stribeck-curve",
        title="Stribeck curve",
        caption=f"{' '.join(_what_shows(place, points) for place, points in found)} The points are "
        f"measured in steady sliding{bars}, each direction in its own sign "
        "and panel; the lines are the model's own curve and its two parts.",
        alt="Friction torque over speed on a logarithmic axis, one panel per direction: measured "
        "points beside the curve of the model and its two parts.",
        panels=tuple(panels),
        thesis=("2.9",),
        across=min(2, len(panels)),
        one_scale=True,
        trials=trials_of(item for place, _ in found for item in place.trials),
    )
    return Result((table,), (figure,), tuple(findings))


def _what_shows(place: ConditionGroup, points: _Points) -> str:
    """Caption sentence: friction of the points from the slowest to the fastest speed."""
    speed = np.abs(points.rate)
    torques = [
        multiplied(torque, float(np.sign(rate)))
        for rate, torque in zip(points.rate, points.torques, strict=True)
    ]
    order = np.argsort(speed, kind="stable")
    least = min(order, key=lambda k: torques[k].value)
    first, last = order[0], order[-1]
    ends = [amount(torques[k].value, "N m") for k in (first, least, last)]
    speeds = [amount(float(speed[k]), "rad/s", "deg/s") for k in (first, least, last)]
    words = [f"friction is {ends[0]} at {speeds[0]}"]
    if _higher(torques[first], torques[least]):
        words.append(f"falls to {ends[1]} at {speeds[1]} (velocity weakening)")
    if _higher(torques[last], torques[least]):
        words.append(f"rises to {ends[2]} at {speeds[2]} (velocity strengthening)")
    if len(words) == 1:
        words.append(f"no other that the points show up to {speeds[2]}")
    return sentence(f"{f'{place.label}: ' if place.label else ''}{listed(words)}")


def _higher(one: Estimate, other: Estimate) -> bool:
    """Whether one torque exceeds another by more than their intervals."""
    high = other.combined[1] if other.has_interval else None
    return surely_above(one, other.value if high is None else high, LEVEL * abs(other.value))


def _panels(place: ConditionGroup, points: _Points) -> Iterator[Panel]:
    """A panel for each measured direction: in one panel they would overlap."""
    bench = bench_of(place.trials[0].trial)
    speed = np.abs(points.rate)
    fine = np.geomspace(speed.min() / SHOWN, speed.max() * SHOWN, 400)
    for name, sign in (("positive", 1.0), ("negative", -1.0)):
        if not np.any(points.rate * sign > 0):
            continue
        dry, viscous = (sign * part for part in steady_friction(bench, sign * fine))
        curves = [
            Curve(fine, dry + viscous, "s(v) + σ2 v", "fit"),
            Curve(fine, dry, "Stribeck part s(v)", "alternative", "thin"),
            Curve(fine, viscous, "viscous part σ2 v", "reference", "thin"),
            _direction(points, sign, name),
        ]
        title = f"{name.capitalize()} direction"
        yield Panel(
            Axis("Speed", "rad/s", "deg/s", scale="log"),
            Axis("Friction, in its direction", "N m", "N m"),
            curves,
            f"{place.label}, {name} direction" if place.label else title,
            list(_least_mark(fine, dry + viscous)),
        )


def _least_mark(fine: Array, torque: Array) -> Iterator[Mark]:
    """Mark of the least friction (N m) over speeds (rad/s), both (n,), if it rises to both ends."""
    least = int(np.argmin(torque))
    if min(torque[0], torque[-1]) > torque[least] * (1.0 + LEVEL):
        at, lowest = float(fine[least]), float(torque[least])
        label = f"least: {amount(lowest, 'N m')} at {amount(at, 'rad/s', 'deg/s', 2)}"
        yield Mark(label, x=at, y=lowest, point=True, series="fit")


def _direction(points: _Points, sign: float, name: str) -> Curve:
    """Readings of one direction over their speeds, with intervals."""
    chosen = [
        multiplied(torque, sign)
        for rate, torque in zip(points.rate, points.torques, strict=True)
        if rate * sign > 0
    ]
    speeds = np.abs(points.rate[points.rate * sign > 0])
    return Curve.of(speeds, chosen, f"{name} direction", name)


EXPERIMENT = Experiment(
    name="stribeck_curve",
    summary="friction of steady sliding at constant speeds, beside the model's curve (Figure 2.9)",
    options=StribeckCurveOptions,
    trials=_trials,
    analyse=_analyse,
    perturbs_bench=True,
    requires={FRICTION_TORQUE: "the friction of each point", LOAD_RATE: "the rate of each point"},
    measure=_measure,
)
