"""Presliding hysteresis: friction over small sinusoidal displacements, and the energy it takes.

Below breakaway friction depends on displacement rather than on rate: it follows the displacement
like a spring that yields, and comes back on another branch. The area of the loop is the energy lost
in a cycle (Figure 2.11).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from campaign.channels import FRICTION_TORQUE, RELATIVE_ANGLE
from campaign.experiments.common import failures_note
from campaign.experiments.friction_models import Place, in_models, places
from campaign.experiments.interface import Experiment, TestData, TrialData
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.result import (
    Array,
    Axis,
    Column,
    Curve,
    Figure,
    Finding,
    Panel,
    Result,
    Table,
    Value,
)
from campaign.signals import Polyline
from campaign.trial import Task, TrialRequest
from campaign.units import Angle, Frequency

OWN = ("amplitude",)
PER_CYCLE = 400
"""Straight pieces of the prescribed rate in a cycle."""
SMALL = 1e-4
"""rad; displacements up to here are shown in microradian."""


class PreslidingHysteresisOptions(Options):
    """Options of a presliding-hysteresis test."""

    amplitudes: tuple[Angle, ...] = Field(
        default=(0.25e-3, 0.5e-3, 1e-3, 2e-3, 4e-3), min_length=1, max_length=1000
    )
    """Amplitudes of the displacement."""
    frequency: Frequency = Field(default=0.1, gt=0)
    """Frequency of the displacement; slow, or bristle damping widens the loops."""
    cycles: int = Field(default=8, ge=2, le=1000)
    """Cycles of the displacement; the last one is measured. Small loops need some to close."""
    sample_rate: Frequency = Field(default=200.0, gt=0, le=100_000)
    """Rate of the recording; at least 100 samples per cycle."""
    models: tuple[str, ...] = ()
    """Friction models to describe the bench's friction by, one after the other; none: its own."""


def _trials(options: PreslidingHysteresisOptions, bench: Bench) -> Iterator[TrialRequest]:
    if options.sample_rate < 100 * options.frequency:
        raise ValueError("a loop needs at least 100 samples per cycle; raise sample_rate")
    stop = (0.5 + options.cycles) / options.frequency
    for point, tree in in_models(bench, options.models):
        for amplitude in options.amplitudes:
            if amplitude <= 0:
                raise ValueError("amplitudes are positive")
            yield TrialRequest(
                Task(
                    mode="prescribed",
                    command=strokes(options, amplitude),
                    duration=stop,
                    window=(stop - 1.0 / options.frequency, stop),
                    sample_rate=options.sample_rate,
                ),
                point={**point, "amplitude": amplitude},
                bench=tree,
            )


def strokes(options: PreslidingHysteresisOptions, amplitude: float) -> Polyline:
    """Rate from the middle to one turning point in half a period, then the cycles from there.

    Begun in the middle, the loop is nearly the steady one from its first cycle; begun at a turning
    point with straight bristles, small loops take many cycles to become symmetric.
    """
    phase = np.arange((2 * options.cycles + 1) * PER_CYCLE // 2 + 1) / PER_CYCLE
    rate = 2.0 * np.pi * options.frequency * amplitude * np.sin(2.0 * np.pi * phase)
    rate[phase < 0.5] *= 0.5
    times = phase / options.frequency
    return Polyline(times=tuple(map(float, times)), values=tuple(map(float, rate)))


@dataclass(frozen=True)
class Loop:
    """One closed cycle: displacement (rad) and friction (N m), shape (n,); the energy it takes (J).

    Attributes:
        peak: largest friction torque (N m).
    """

    amplitude: float
    displacement: Array
    friction: Array
    energy: float
    peak: float

    @property
    def loss_factor(self) -> float:
        """Energy over pi times peak and amplitude: 0 for a spring, 4/pi for dry sliding."""
        return self.energy / (np.pi * self.peak * self.amplitude)


def _loop(data: TrialData) -> Loop:
    cut = data.recording().window(*data.trial.task.window)
    displacement = np.append(cut[RELATIVE_ANGLE], cut[RELATIVE_ANGLE][0])
    friction = np.append(cut[FRICTION_TORQUE], cut[FRICTION_TORQUE][0])
    return Loop(
        amplitude=float(str(data.trial.point["amplitude"])),
        displacement=displacement,
        friction=friction,
        energy=float(np.trapezoid(friction, displacement)),
        peak=float(np.max(np.abs(friction))),
    )


def _analyse(data: TestData) -> Result:
    found = places(data.completed(), OWN)
    if not found:
        return Result(notes=failures_note(data))
    loops = [(place, [_loop(item) for item in place.trials]) for place in found]
    rows: list[dict[str, Value]] = [
        {
            **place.point,
            "amplitude": loop.amplitude,
            "peak": loop.peak,
            "energy": loop.energy,
            "loss_factor": loop.loss_factor,
        }
        for place, own in loops
        for loop in own
    ]
    largest = max(loop.amplitude for _, own in loops for loop in own)
    display, energy = ("urad", "uJ") if largest <= SMALL else ("mrad", "mJ")
    table = Table(
        key="presliding-hysteresis",
        title="Energy lost in a cycle by amplitude of the displacement",
        columns=(
            *found[0].columns,
            Column("amplitude", "Amplitude", "rad", display),
            Column("peak", "Largest friction torque", "N m", "N m"),
            Column("energy", "Energy per cycle", "J", energy),
            Column("loss_factor", "Loss factor"),
        ),
        rows=tuple(rows),
        note="The energy is the area of the loop of friction torque over displacement. The loss "
        "factor is that energy over π times torque times amplitude: 0 for a spring, 4/π = 1.27 for "
        "dry sliding.",
    )
    findings = tuple(
        Finding("hysteresis_energy", loop.energy, "J", {**place.point, "amplitude": loop.amplitude})
        for place, own in loops
        for loop in own
    )
    figure = Figure(
        key="presliding-hysteresis",
        title="Friction over small displacements",
        caption="Small displacements are almost elastic; larger ones leave the spring line, reach "
        "sliding, and enclose more energy. A static model has no presliding: its loop is a box of "
        "any size.",
        alt="Friction torque over displacement: one closed loop per amplitude, narrow for small "
        "amplitudes and nearly rectangular for large ones.",
        panels=tuple(_panel(place, own, display) for place, own in loops),
        thesis=("2.11",),
        across=min(2, len(loops)),
    )
    return Result((table,), (figure,), findings, failures_note(data))


def _panel(place: Place, loops: list[Loop], display: str) -> Panel:
    curves = [
        Curve(
            loop.displacement,
            loop.friction,
            _amplitude(loop.amplitude, display),
            f"loop-{number}",
        )
        for number, loop in enumerate(loops)
    ]
    return Panel(
        Axis("Displacement", "rad", display),
        Axis("Friction torque", "N m", "N m"),
        curves,
        place.label,
    )


def _amplitude(amplitude: float, display: str) -> str:
    if display == "urad":
        return f"± {amplitude * 1e6:.3g} µrad"
    return f"± {amplitude * 1e3:.3g} mrad"


EXPERIMENT = Experiment(
    name="presliding_hysteresis",
    summary="friction over small displacements and the energy of the loops (Figure 2.11)",
    options=PreslidingHysteresisOptions,
    trials=_trials,
    analyse=_analyse,
    requires={FRICTION_TORQUE: "the loops", RELATIVE_ANGLE: "the displacement"},
)
