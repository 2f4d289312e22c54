"""Observer gain: benefit and cost of a higher gain (5.3.2 to 5.3.4).

Three quantities are measured at every gain and compared with linear theory for the same bench: the
stabilization error under base motion, the rate per disturbance torque (Equation 5.4), and the rate
from the gyro's noise (Equation 5.5). A trial that reaches a limit or diverges is a result too: the
loop is unstable at that gain.

The corner frequency N K0 / (2 pi J') of the observer states the gain, comparable between benches.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from pydantic import Field, JsonValue

from campaign.channels import FRICTION_TORQUE, GYRO_RATE, LOAD_RATE, POINTING_ERROR
from campaign.estimate import Estimate
from campaign.estimation.intervals import LEVEL, multiplied, shifted_by
from campaign.experiments.interface import (
    ChosenValue,
    Experiment,
    TestData,
    bench_of,
    key,
    validated,
)
from campaign.experiments.observer_gain.figures import error_figure, noise_figure, rejection_figure
from campaign.experiments.observer_gain.metrics import (
    BY_THEORY,
    Gain,
    gain_of,
    is_noisy,
    measure,
    measured_corner,
    own_observer,
    worst_ratio,
)
from campaign.experiments.shared import default_options
from campaign.experiments.shared.common import by_value, with_changes
from campaign.experiments.shared.pointing_error import (
    SineMotionOptions,
    rest_task,
    seen_through,
    windows_of,
)
from campaign.experiments.shared.rig import MOST
from campaign.experiments.shared.rounded_choices import Choices, nice, share
from campaign.physics import observer_loop as theory
from campaign.physics.bench import Bench
from campaign.physics.complete import CompleteBench, complete, limits_of
from campaign.physics.stability import growth_rate
from campaign.reason import Cause
from campaign.recording import Outcome
from campaign.result import Cell, Column, Figure, Finding, Result, Table, Value
from campaign.signals import Sine
from campaign.trial import Task, Tree, TrialRequest
from campaign.units import Frequency, Time, Torque, in_words

ALL_STABLE = Cause("stable at every gain", "stable at every gain that was tried")
CORNERS = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0)
SETTLE = 2.0
"""Shortest time (s) before a measurement of a disturbance or noise."""


class ObserverGainOptions(SineMotionOptions):
    """Options of a study of the observer's gain."""

    observer: str = "observer"
    """Name of the disturbance observer on the bench."""
    corners: tuple[Frequency, ...] = Field(default=CORNERS, min_length=1, max_length=1000)
    """Corner frequencies N K0 / (2 pi J') to try; the bench's own is always among them."""
    noise_time: Time = Field(default=20.0, ge=0)
    """Time to measure the noise; 0: noise is not measured."""
    disturbance: Torque = Field(default=5.0, gt=0)
    """Amplitude of the disturbance torque on the load."""
    disturbance_frequencies: tuple[Frequency, ...] = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
    """Frequencies of the disturbance; none: rejection is not measured."""
    disturbance_cycles: int = Field(default=8, ge=1, le=10_000)
    """Whole cycles of it to measure."""
    without_friction: bool = True
    """Measure noise and rejection on the bench without its friction, as the equations assume: in
    simulation only. With friction, a stuck load does not obey the equations."""

    def without_effect(self) -> frozenset[str]:
        rejection = {"disturbance", "disturbance_cycles"}
        return frozenset(() if self.disturbance_frequencies else rejection)


def _tuned(bench: Bench, name: str, corner: float) -> CompleteBench:
    """The bench with its observer at this corner frequency (Hz)."""
    known = complete(bench, "the theory of an observer")
    gain = theory.gain_for(known, corner, own_observer(bench, name)[1])
    tree = with_changes(bench, {f"compensation.{name}.gain": gain})
    return complete(Bench.model_validate(tree, context={"si": True}))


def _benches(options: ObserverGainOptions, bench: Bench) -> Iterator[tuple[float, CompleteBench]]:
    """Each corner frequency (Hz; 0 is without observer) with the bench tuned to it."""
    own, _ = own_observer(bench, options.observer)
    yield 0.0, complete(bench)
    for corner in sorted({*options.corners, own}):
        if corner <= 0:
            raise ValueError("corner frequencies are positive; 0 is always measured, too")
        yield corner, _tuned(bench, options.observer, corner)


def predicted_limit(bench: Bench, name: str, highest: float) -> float | None:
    """Corner frequency (Hz) from which the linear loop is unstable; None if stable at `highest`."""

    def is_stable(corner: float) -> bool:
        return growth_rate(_tuned(bench, name, corner), name) < 0

    if is_stable(highest):
        return None
    low, high = 1e-3 * highest, highest
    while high > 1.005 * low:
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if is_stable(middle) else (low, middle)
    return high


def _fit(options: ObserverGainOptions, bench: Bench) -> Mapping[str, ChosenValue]:
    """Default base motion; times of noise and disturbance within the limit of duration."""
    choices, longest = Choices(options), MOST * limits_of(bench).duration
    why = share("duration", MOST)
    if longest < SETTLE + options.noise_time:
        choices.take("noise_time", max(0.0, nice(longest - SETTLE, "s")), f"within {why}")
    kept = tuple(
        f
        for f in options.disturbance_frequencies
        if max(SETTLE, 2.0 / f) + options.disturbance_cycles / f <= longest
    )
    if kept != options.disturbance_frequencies:
        choices.take("disturbance_frequencies", kept, f"whose cycles are within {why}")
    return {**default_options.base_motion(options, bench), **choices.told}


def _trials(options: ObserverGainOptions, bench: Bench) -> Iterator[TrialRequest]:
    for corner, tuned in _benches(options, bench):
        name = options.observer if corner else "none"
        plain = tuned.model_dump(mode="json")
        linear = with_changes(tuned, {"friction": {}}) if options.without_friction else plain
        yield _request(options.task(name), plain, corner, "error")
        if corner and growth_rate(tuned, name) >= 0:
            continue  # unstable: the first trial shows it
        if options.noise_time and is_noisy(bench):
            task = rest_task(name, SETTLE, SETTLE + options.noise_time, options.sample_rate)
            yield _request(task, linear, corner, "noise")
        for frequency in options.disturbance_frequencies:
            task = _rejection_task(options, name, frequency)
            yield _request(task, linear, corner, "rejection", disturbance_frequency=frequency)


REQUIRED = {"error": POINTING_ERROR, "noise": LOAD_RATE, "rejection": GYRO_RATE}
"""Required channel of a trial, by its measured quantity."""


def _request(task: Task, bench: Tree, corner: float, measured: str, **more: float) -> TrialRequest:
    point: dict[str, JsonValue] = {"measured": measured, "corner": corner, **more}
    can_use = (FRICTION_TORQUE,) if measured == "error" else ()
    requires = (REQUIRED[measured],)
    return TrialRequest(
        task,
        point=point,
        bench=bench,
        requires=requires,
        can_use=can_use,
        windows=windows_of(task)[:1],
    )


def _rejection_task(options: ObserverGainOptions, name: str, frequency: float) -> Task:
    start = max(SETTLE, 2.0 / frequency)
    stop = start + options.disturbance_cycles / frequency
    disturbance = Sine(amplitude=options.disturbance, frequency=frequency)
    return rest_task(name, start, stop, options.sample_rate, disturbance=disturbance)


def _analyse(data: TestData) -> Result:
    if not data.trials:
        return Result()
    options = validated(ObserverGainOptions, data.trials[0].trial.options)
    bench = complete(bench_of(data.trials[0].trial), "the theory of an observer")
    own, inertia = own_observer(bench, options.observer)
    groups = by_value(data.trials, "corner")
    gains = [gain_of(*each, groups.get(0.0, ())) for each in groups.items()]
    limit = predicted_limit(bench, options.observer, max(gain.corner for gain in gains) or own)
    figures: list[Figure] = [
        *error_figure(gains, own, limit),
        *rejection_figure(gains, own),
        *noise_figure(gains, own, limit),
    ]
    findings = tuple(_findings(gains, own, inertia or bench.axis.inertia, options))
    notes = tuple(_notes(gains, data, limit, options))
    table = _table(gains, seen_through(data.trials[0].trial))
    return Result((table,), tuple(figures), findings, notes)


def _findings(
    gains: list[Gain], own: float, inertia: float, options: ObserverGainOptions
) -> Iterator[Finding]:
    motion: dict[str, Value] = {
        "frequency": options.frequency,
        "acceleration": options.acceleration,
    }
    for gain in gains:
        where: dict[str, Value] = {"corner": gain.corner, "observer": options.observer}
        if gain.error is not None:
            error = replace(gain.error, name="stabilization_error_at_gain")
            yield Finding.of(error, {**motion, **where})
        if gain.noise is not None:
            yield Finding.of(gain.noise, where)
        for point in gain.rejection:
            point_where = {**where, "disturbance_frequency": point.frequency}
            yield Finding.of(point.measured, point_where)
    yield from _limit_found(gains)
    chosen = [g for g in gains if np.isclose(g.corner, own)]
    if chosen and chosen[0].error is not None:
        yield Finding.of(chosen[0].error, {**motion, "compensation": options.observer})
    corner = measured_corner(chosen[0], gains[0]) if chosen and gains[0].corner == 0 else None
    if corner is not None:
        conditions: dict[str, Value] = {"compensation": options.observer}
        yield Finding.of(corner, conditions)
        load_gain = shifted_by(multiplied(corner, 2 * np.pi * inertia), "inertia", None)
        yield Finding.of(replace(load_gain, name="observer_gain", unit="N m s/rad"), conditions)


def _limit_found(gains: list[Gain]) -> Iterator[Finding]:
    """Corner frequency of instability: between two measured gains, or above all of them."""
    name = "unstable_corner_frequency"
    stable = [gain.corner for gain in gains if gain.corner and gain.stable]
    first = _first_unstable(gains)
    if first is not None:
        below = max((corner for corner in stable if corner < first.corner), default=0.0)
        method = "the lowest gain tried that was unstable, and the highest below it that was stable"
        limit = Estimate(name, first.corner, "Hz", below, first.corner, LEVEL, method)
        yield Finding.of(limit, {})
    elif stable:
        limit = Estimate(name, max(stable), "Hz", kind="at least", reason=ALL_STABLE())
        yield Finding.of(limit, {})


def _first_unstable(gains: list[Gain]) -> Gain | None:
    return next((gain for gain in gains if gain.unstable and gain.corner > 0), None)


def _notes(
    gains: list[Gain], data: TestData, limit: float | None, options: ObserverGainOptions
) -> Iterator[str]:
    first = _first_unstable(gains)
    expected = (
        f"by the eigenvalues of the loop without dry friction, from {limit:.3g} Hz"
        if limit is not None
        else "by the eigenvalues of the loop"
    )
    if first is not None:
        yield (
            f"Unstable from K0 = {in_words(first.gain, 'N m s/rad', form='.4g')} at the "
            f"load (corner {first.corner:.4g} Hz): {first.unstable}. A result, not a failure; "
            f"{expected}."
        )
    elif all(gain.stable for gain in gains if gain.corner):
        yield f"Stable at every gain that was tried: {expected}."
    others = [d for d in data.trials if d.ending.outcome in (Outcome.FAULT, Outcome.INTERRUPTED)]
    if others:
        yield f"{len(others)} of {len(data.trials)} trials were not executed and are not analysed."
    if not any(d.trial.point["measured"] == "noise" for d in data.trials):
        yield "No noise was measured: the bench is not sampled, or its gyro has none."
    if options.without_friction:
        yield (
            "Noise and rejection are measured on the bench without its friction, as Equations 5.4 "
            "and 5.5 are derived."
        )


def _row(gain: Gain) -> dict[str, Cell]:
    state = "stable" if gain.stable else "unstable" if gain.unstable else "not known"
    measured = ("corner", "gain", "error", "error_theory", "noise", "noise_theory")
    return {
        **{name: getattr(gain, name) for name in measured},
        "worst": worst_ratio(gain),
        "state": state if gain.corner else "no observer",
    }


def _table(gains: list[Gain], remark: str) -> Table:
    return Table(
        key="observer-gain",
        title="Benefits and costs of the observer gain",
        columns=(
            Column("corner", "Corner frequency", "Hz", "Hz", exact=True),
            Column("gain", "K0 at the load", "N m s/rad", "N m s/rad", exact=True),
            Column("error", "Error (1σ)", "rad", "mrad"),
            Column("error_theory", "by Eq. 5.4", "rad", "mrad"),
            Column("noise", "Rate from noise (1σ)", "rad/s", "deg/s"),
            Column("noise_theory", "by Eq. 5.5", "rad/s", "deg/s", reason=BY_THEORY()),
            Column("worst", "|ω/T| over Eq. 5.4, worst"),
            Column("state", "Loop"),
        ),
        rows=tuple(_row(gain) for gain in gains),
        note="The error by Eq. 5.4 is calculated from the friction in the same trial. "
        "Equations 5.4 and 5.5 are taken with the bench's PI controller in place of a constant. "
        f"The error is that of the position, 1σ.{remark}",
    )


EXPERIMENT = Experiment(
    name="observer_gain",
    summary="error, disturbance rejection and noise over the observer's gain (Eq. 5.4 and 5.5)",
    options=ObserverGainOptions,
    trials=_trials,
    analyse=_analyse,
    fit=_fit,
    perturbs_bench=True,
    measure=measure,
    needs_samples=False,
    requires={
        POINTING_ERROR: "the stabilization error",
        GYRO_RATE: "the rejection of disturbances; disturbance_frequencies = [] does without",
        LOAD_RATE: 'what the noise of the gyro does to the load; noise_time = "0 s" does without',
    },
    can_use={FRICTION_TORQUE: "error by Eq. 5.4 beside the measured one"},
    # The gain at which the loop becomes unstable is one of the results.
    seeks_instability=True,
    uses_failed=True,
    key_numbers=(
        key("stabilization_error"),
        key("observer_corner_frequency"),
        key("observer_gain"),
        key("unstable_corner_frequency"),
    ),
)
