"""Breakaway force against the rate of the applied force.

An external torque ramp acts on the free load as an ideal force, without a drive. The breakaway
torque is the largest friction before the load slides. Static models do not depend on the rate; in
the LuGre model the bristles have less time to reach their static deflection. Figure 2.8, after
Johannes et al., from Canudas de Wit et al. (1995).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from campaign.channels import FRICTION_TORQUE, LOAD_RATE
from campaign.estimate import Estimate
from campaign.estimation.relative_rate import STOP_FACTOR
from campaign.estimation.sampled_curve import at_sample, bracketed, peak
from campaign.experiments.interface import Experiment, TestData, TrialData, validated
from campaign.experiments.shared.captions import amount, sentence, setting, trials_of
from campaign.experiments.shared.friction_models import (
    OF_ONE,
    ConditionGroup,
    combined,
    in_models,
    model_series,
    places,
    simulated,
)
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.result import Array, Axis, Column, Curve, Figure, Finding, Panel, Result, Table
from campaign.signals import Polyline
from campaign.trial import Task, TrialRequest
from campaign.units import AngularRate, Torque, TorqueRate

OWN = ("torque_rate",)
SAMPLES = 4000
"""Fewest samples of a ramp, which resolve its peak to a part in thousands."""
SLOWEST_RECORDING = 1000.0
"""Lowest sample rate (Hz): breakaway is equally fast on slow ramps."""
STEP = 2e-3
"""Relative change of a torque that the time step of a simulation may cause."""


class ForceRateOptions(Options):
    """Options of a force-rate test."""

    torque_rates: tuple[TorqueRate, ...] = Field(
        default=(3.0, 10.0, 30.0, 100.0, 300.0, 1000.0), min_length=1, max_length=1000
    )
    """Slopes of the ramps."""
    peak_torque: Torque = Field(default=60.0, gt=0)
    """End of a ramp if the load does not move; above the expected breakaway torque."""
    sliding_rate: AngularRate = Field(default=0.01, gt=0)
    """Rate at which the load counts as sliding; the peak is before that."""
    models: tuple[str, ...] = ()
    """Friction models to describe the bench's friction, one by one; none: its own."""


def _trials(options: ForceRateOptions, bench: Bench) -> Iterator[TrialRequest]:
    for point, tree in in_models(bench, options.models):
        for rate in options.torque_rates:
            if rate <= 0:
                raise ValueError("torque rates are positive")
            duration = options.peak_torque / rate
            yield TrialRequest(
                Task(
                    mode="spring",  # of no stiffness: only the ramp moves the load
                    disturbance=Polyline(times=(0.0, duration), values=(0.0, options.peak_torque)),
                    duration=duration,
                    window=(0.0, duration),
                    sample_rate=max(SAMPLES / duration, SLOWEST_RECORDING),
                    stop_rate=STOP_FACTOR * options.sliding_rate,
                ),
                point={**point, "torque_rate": rate},
                note="ends early, once the load slides",
                bench=tree,
            )


def _measure(data: TrialData) -> tuple[Estimate, ...]:
    """Largest friction before sliding (N m), and the torque applied at that moment (N m)."""
    options = validated(ForceRateOptions, data.trial.options)
    recording = data.recording()
    sliding = np.abs(recording[LOAD_RATE]) > options.sliding_rate
    if not sliding.any():
        raise ValueError("the load did not slide; raise peak_torque or lower sliding_rate")
    slides = max(int(np.argmax(sliding)), 1)
    friction = recording[FRICTION_TORQUE]
    applied = data.trial.task.disturbance.sample(recording.time)
    at = int(np.argmax(friction[:slides]))
    return simulated(
        (_breakaway(friction, slides, at), at_sample("applied_torque", applied, at, "N m"))
    )


def _breakaway(friction: Array, slides: int, at: int) -> Estimate:
    """Largest friction (N m) before sample `slides`, that of sample `at`.

    On a fast ramp the load reaches the sliding rate while friction still rises: the peak is then
    between the last sample before and the first one after.
    """
    if at == slides - 1 and friction[slides] > friction[at]:
        ends = float(friction[at]), float(friction[slides])
        method = "friction as sliding begins, between two samples"
        return bracketed("breakaway_torque", ends[0], "N m", ends, method)
    return peak("breakaway_torque", friction[:slides], "N m")


@dataclass(frozen=True)
class _Breakaway:
    """Breakaway at one rate of the applied torque (N m/s), repeats combined."""

    torque_rate: float
    breakaway: Estimate
    applied: Estimate


def _breakaways(place: ConditionGroup) -> Iterator[_Breakaway]:
    for rate, trials in place.by("torque_rate").items():
        estimates = combined(trials, _measure)
        yield _Breakaway(rate, estimates["breakaway_torque"], estimates["applied_torque"])


def _analyse(data: TestData) -> Result:
    groups = places(data.completed(), OWN)
    if not groups:
        return Result()
    rows = {place.label: (place, list(_breakaways(place))) for place in groups}
    every = [(place, row) for place, own in rows.values() for row in own]
    table = Table(
        key="force-rate",
        title="Breakaway torque by rate of the applied torque",
        columns=(
            *groups[0].columns,
            Column("torque_rate", "Rate of the applied torque", "N m/s", "N m/s", exact=True),
            Column("breakaway", "Breakaway torque", "N m", "N m"),
            Column("applied", "Applied torque at that moment", "N m", "N m"),
        ),
        rows=tuple({**place.point, **vars(row)} for place, row in every),
        note="The breakaway torque is the largest friction torque before the load slides. "
        + OF_ONE,
    )
    findings = tuple(
        Finding.of(row.breakaway, {**place.point, "torque_rate": row.torque_rate})
        for place, row in every
    )
    return Result((table,), (_figure(rows),), findings)


def _figure(rows: dict[str, tuple[ConditionGroup, list[_Breakaway]]]) -> Figure:
    peaks: list[Curve] = []
    histories: dict[str, list[Curve]] = {}
    sentences: list[str] = []
    items: list[TrialData] = []
    for label, (place, own) in rows.items():
        series = model_series(str(place.point.get("model", label or "measured")))
        rates = np.array([row.torque_rate for row in own])
        torques = [row.breakaway for row in own]
        peaks.append(Curve.of(rates, torques, label, series, "line+points"))
        for title, curve in _histories(place, own, label, series):
            histories.setdefault(title, []).append(curve)
        sentences.append(_what_shows(own, label))
        items += place.trials
    top = max(float(curve.y.max()) for curve in peaks)
    applied = Axis("Applied torque", "N m", "N m", limits=(0.0, 1.6 * top))
    friction = Axis("Friction torque", "N m", "N m", limits=(0.0, 1.15 * top))
    line = np.array([0.0, 1.6 * top])
    several = len(histories) > 1
    ramps = "the slowest and during the fastest ramp" if several else "the only ramp"
    held = Curve(line, line, "friction holds the load", "reference", "thin")
    return Figure(
        key="force-rate",
        title="Breakaway torque over the rate of the applied torque",
        caption=f"{' '.join(sentences)} Behind: friction during {ramps}. On the dotted line "
        "friction holds the load; below it the load gains speed.",
        alt="Breakaway torque over torque rate on a logarithmic axis, and friction torque over "
        "applied torque for the slowest and the fastest ramp.",
        panels=(
            Panel(
                Axis("Rate of the applied torque", "N m/s", "N m/s", scale="log"),
                Axis("Breakaway torque", "N m", "N m", limits=(0.0, 1.15 * top)),
                peaks,
                "Breakaway",
            ),
            *(
                Panel(applied, friction, [*curves, held], title)
                for title, curves in histories.items()
            ),
        ),
        thesis=("2.8",),
        across=3,
        trials=trials_of(items),
    )


def _what_shows(rows: list[_Breakaway], label: str) -> str:
    """Caption sentence: breakaway torque of the slowest and of the fastest ramp."""
    first, last = rows[0], rows[-1]
    who = f"{label}: breakaway" if label else "breakaway"
    torques = [amount(row.breakaway.value, "N m") for row in (first, last)]
    rates = [setting(row.torque_rate, "N m/s") for row in (first, last)]
    if len(rows) == 1:
        return sentence(f"{who} at {torques[0]} where the torque rises by {rates[0]}")
    if not _apart(first.breakaway, last.breakaway):
        return sentence(f"{who} at {torques[0]}, at {rates[0]} as at {rates[1]}")
    change = "falls" if last.breakaway.value < first.breakaway.value else "rises"
    return sentence(f"{who} {change} from {torques[0]} at {rates[0]} to {torques[1]} at {rates[1]}")


def _apart(one: Estimate, other: Estimate) -> bool:
    """Whether two breakaway torques differ by more than their intervals and the share `STEP`.

    A simulation's time step may change them by that share, which no interval includes.
    """
    halves = [each.half_width for each in (one, other) if each.has_interval]
    scatter = math.hypot(*(half for half in halves if math.isfinite(half)))
    return abs(one.value - other.value) > max(scatter, STEP * abs(one.value))


def _histories(
    place: ConditionGroup, rows: list[_Breakaway], label: str, series: str
) -> Iterator[tuple[str, Curve]]:
    """Friction over applied torque of the slowest and the fastest ramp, each with a panel title.

    A common panel would show two equal-looking curves for each model.
    """
    rates = list(dict.fromkeys((rows[0].torque_rate, rows[-1].torque_rate)))
    titles = ("Slowest ramp", "Fastest ramp") if len(rates) == 2 else ("Ramp",)
    shown = {
        rate: f"{title}: {setting(rate, 'N m/s')}"
        for rate, title in zip(rates, titles, strict=True)
    }
    for rate, title in shown.items():
        for item in place.trials:
            if item.trial.point["torque_rate"] == rate:
                recording = item.recording()
                applied = item.trial.task.disturbance.sample(recording.time)
                yield title, Curve(applied, recording[FRICTION_TORQUE], label, series)


EXPERIMENT = Experiment(
    name="force_rate",
    summary="breakaway torque against the rate of an applied torque (Figure 2.8)",
    options=ForceRateOptions,
    trials=_trials,
    analyse=_analyse,
    perturbs_bench=True,
    requires={
        FRICTION_TORQUE: "its peak, which is the breakaway torque",
        LOAD_RATE: "the moment at which the load slides",
    },
    measure=_measure,
)
