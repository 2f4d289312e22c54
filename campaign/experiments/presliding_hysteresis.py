"""Presliding hysteresis: friction over small displacements, and lost energy.

Below breakaway friction depends on displacement rather than on rate: it follows the displacement
like a spring that yields, and returns on another branch. The area of the loop is the energy lost
in a cycle (Figure 2.11).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from pydantic import Field

from campaign.channels import FRICTION_TORQUE, RELATIVE_ANGLE
from campaign.estimate import Estimate, Window
from campaign.estimation.intervals import shifted_by
from campaign.experiments.interface import Experiment, TestData, TrialData, metrics, validated
from campaign.experiments.shared import default_options
from campaign.experiments.shared.captions import amount, listed, sentence, trials_of
from campaign.experiments.shared.common import closed, number_of
from campaign.experiments.shared.friction_models import ConditionGroup, in_models, places
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.reason import Cause
from campaign.result import Array, Axis, Column, Curve, Figure, Finding, Panel, Result, Table
from campaign.signals import Polyline
from campaign.trial import Task, TrialRequest
from campaign.units import Angle, Frequency, in_words

AMPLITUDE = "amplitude"
PER_CYCLE = 400
"""Linear segments of the prescribed rate in a cycle."""
SMALL = 1e-4
"""Largest displacement (rad) that is shown in microradians."""
READABLE = 0.3
"""Share of the largest amplitude up to which loops have a further panel."""


class PreslidingHysteresisOptions(Options):
    """Options of a presliding-hysteresis test."""

    amplitudes: tuple[Angle, ...] = Field(
        default=(0.25e-3, 0.5e-3, 1e-3, 2e-3, 4e-3), min_length=1, max_length=1000
    )
    """Amplitudes of the displacement."""
    frequency: Frequency = Field(default=0.1, gt=0)
    """Frequency of the displacement; slow, or bristle damping widens the loops."""
    cycles: int = Field(default=8, ge=2, le=1000)
    """Cycles of the displacement; the last one is measured. Small loops need several to close."""
    sample_rate: Frequency = Field(default=200.0, gt=0, le=100_000)
    """Rate of the recording; at least 100 samples per cycle."""
    models: tuple[str, ...] = ()
    """Friction models to describe the bench's friction, one by one; none: its own."""


def _trials(options: PreslidingHysteresisOptions, bench: Bench) -> Iterator[TrialRequest]:
    if options.sample_rate < 100 * options.frequency:
        raise ValueError("a loop needs at least 100 samples per cycle; raise sample_rate")
    windows = windows_of(options)
    last = windows[-1]
    for point, tree in in_models(bench, options.models):
        for amplitude in options.amplitudes:
            if amplitude <= 0:
                raise ValueError("amplitudes are positive")
            yield TrialRequest(
                Task(
                    mode="prescribed",
                    command=strokes(options, amplitude),
                    duration=last.stop,
                    window=(last.start, last.stop),
                    sample_rate=options.sample_rate,
                ),
                point={**point, AMPLITUDE: amplitude},
                bench=tree,
                windows=windows,
            )


def windows_of(options: PreslidingHysteresisOptions) -> tuple[Window, Window]:
    """The last two cycles, for the plan and for archived trials without windows."""
    period = 1.0 / options.frequency
    stop = (0.5 + options.cycles) / options.frequency
    return (
        Window("cycle before", stop - 2.0 * period, stop - period),
        Window("last cycle", stop - period, stop),
    )


def strokes(options: PreslidingHysteresisOptions, amplitude: float) -> Polyline:
    """Rate from the middle to one turning point in half a period, then the cycles from there.

    With a start in the middle, the first loop is nearly the steady one. With a start at a turning
    point and straight bristles, small loops need many cycles to become symmetric.
    """
    phase = np.arange((2 * options.cycles + 1) * PER_CYCLE // 2 + 1) / PER_CYCLE
    rate = 2.0 * np.pi * options.frequency * amplitude * np.sin(2.0 * np.pi * phase)
    rate[phase < 0.5] *= 0.5
    times = phase / options.frequency
    return Polyline(times=tuple(map(float, times)), values=tuple(map(float, rate)))


NOISELESS = Cause(
    "noiseless", "a computed loop has no noise; its systematic part is the gap at its end"
)
UNITS = {"peak": "N m", "hysteresis_energy": "J", "loss_factor": ""}


def loop_sizes(displacement: Array, friction: Array, amplitude: float) -> dict[str, float]:
    """Largest torque (N m), energy (J), and loss factor of a closed cycle.

    The loss factor is energy over pi times peak times amplitude (rad): 0 for a spring, 4/pi for dry
    sliding. displacement (rad), friction (N m): shape (n,).
    """
    peak = float(np.max(np.abs(friction)))
    energy = float(np.trapezoid(friction, displacement))
    loss = energy / (np.pi * peak * amplitude) if peak > 0 else 0.0
    return {"peak": peak, "hysteresis_energy": energy, "loss_factor": loss}


def _loop(data: TrialData, window: Window) -> tuple[Array, Array]:
    """Displacement (rad) and friction (N m) of a closed cycle, each (n,)."""
    cut = data.recording().window(window.start, window.stop)
    if not len(cut.time):
        raise ValueError("the recording ends before its last loop")
    return closed(cut[RELATIVE_ANGLE], cut[FRICTION_TORQUE])


def _windows(data: TrialData) -> tuple[Window, ...]:
    options = validated(PreslidingHysteresisOptions, data.trial.options)
    return data.trial.windows or windows_of(options)


def _measure(data: TrialData) -> Sequence[Estimate]:
    """Sizes of the last loop; their difference from the loop before is a systematic part."""
    before, last = (
        loop_sizes(*_loop(data, window), number_of(data.trial, AMPLITUDE))
        for window in _windows(data)
    )
    return [
        shifted_by(
            Estimate.without_interval(name, last[name], unit, NOISELESS()),
            "loop not closed",
            abs(last[name] - before[name]),
        )
        for name, unit in UNITS.items()
    ]


def _analyse(data: TestData) -> Result:
    groups = places(data.completed(), (AMPLITUDE,))
    if not groups:
        return Result()
    loops = [
        (place, [(item, metrics(item, _measure)) for item in place.trials]) for place in groups
    ]
    every = [
        ({**place.point, AMPLITUDE: number_of(item.trial, AMPLITUDE)}, own)
        for place, items in loops
        for item, own in items
    ]
    largest = max(number_of(item.trial, AMPLITUDE) for place in groups for item in place.trials)
    display, energy = ("urad", "uJ") if largest <= SMALL else ("mrad", "mJ")
    table = Table(
        key="presliding-hysteresis",
        title="Energy lost in a cycle by amplitude of the displacement",
        columns=(
            *groups[0].columns,
            Column("amplitude", "Amplitude", "rad", display, exact=True),
            Column("peak", "Largest friction torque", "N m", "N m"),
            Column("energy", "Energy per cycle", "J", energy),
            Column("loss_factor", "Loss factor"),
        ),
        rows=tuple({**at, **own, "energy": own["hysteresis_energy"]} for at, own in every),
        note="The energy is the area of the loop of friction torque over displacement. The loss "
        "factor is that energy over π times torque times amplitude: 0 for a spring, 4/π = 1.27 for "
        "dry sliding.",
    )
    findings = tuple(Finding.of(own["hysteresis_energy"], at) for at, own in every)
    small = [amplitude for place in groups for amplitude in _small(place)]
    again = f" Beside them those up to {_shown(max(small), display)} again." if small else ""
    figure = Figure(
        key="presliding-hysteresis",
        title="Friction over small displacements",
        caption=f"The last cycle of each amplitude, closed; arrows show which way it runs.{again} "
        + " ".join(_what_shows(place, items, display, energy) for place, items in loops),
        alt="Friction torque over displacement: one closed loop per amplitude.",
        panels=tuple(panel for place in groups for panel in _panels(place, display)),
        thesis=("2.11",),
        across=2,
        trials=trials_of(item for place in groups for item in place.trials),
    )
    return Result((table,), (figure,), findings)


def _what_shows(
    place: ConditionGroup,
    items: Sequence[tuple[TrialData, Mapping[str, Estimate]]],
    unit: str,
    energy: str,
) -> str:
    """Energy and loss factor of the smallest and the largest loop."""
    known = [each for each in items if math.isfinite(each[1]["hysteresis_energy"].value)]
    if not known:
        return ""
    ordered = sorted(known, key=lambda each: number_of(each[0].trial, AMPLITUDE))
    parts = [
        f"{amount(own['hysteresis_energy'].value, 'J', energy)} a cycle at "
        f"{_shown(number_of(item.trial, AMPLITUDE), unit)} "
        f"(loss factor {own['loss_factor'].value:.2g})"
        for item, own in (ordered[0], ordered[-1])
    ]
    start = f"{place.label} loses" if place.label else "Lost are"
    return sentence(f"{start} {listed(list(dict.fromkeys(parts)))}")


def _small(place: ConditionGroup) -> list[float]:
    """Amplitudes (rad) of the loops that are too small to read in a panel of all loops."""
    known = [number_of(item.trial, AMPLITUDE) for item in place.trials]
    return [each for each in known if each <= READABLE * max(known)]


def _panels(place: ConditionGroup, display: str) -> Iterator[Panel]:
    """Panel of all loops, and one of the small loops on axes of its own."""
    whole = _panel(place, display)
    yield whole
    small = _small(place)
    if small:
        near = [number_of(item.trial, AMPLITUDE) in small for item in place.trials]
        curves = [curve for curve, shown in zip(whole.curves, near, strict=True) if shown]
        title = f"{place.label}, small amplitudes" if place.label else "Small amplitudes"
        yield replace(whole, curves=curves, title=title)


def _panel(place: ConditionGroup, display: str) -> Panel:
    curves = [
        Curve(*_loop(item, _windows(item)[-1]), label, label, "loop")
        for item in place.trials
        for label in [_shown(number_of(item.trial, AMPLITUDE), display)]
    ]
    return Panel(
        Axis("Displacement", "rad", display),
        Axis("Friction torque", "N m", "N m"),
        curves,
        place.label,
    )


def _shown(amplitude: float, display: str) -> str:
    if display == "urad":
        return f"± {amplitude * 1e6:.3g} µrad"
    return f"± {in_words(amplitude, 'rad', 'mrad')}"


EXPERIMENT = Experiment(
    name="presliding_hysteresis",
    summary="friction over small displacements and the energy of the loops (Figure 2.11)",
    options=PreslidingHysteresisOptions,
    trials=_trials,
    analyse=_analyse,
    measure=_measure,
    fit=default_options.presliding,
    perturbs_bench=True,
    requires={FRICTION_TORQUE: "the loops", RELATIVE_ANGLE: "the displacement"},
)
