"""Figure of a component friction test: one ramp of each component, and all readings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from campaign.channels import DRIVE_TORQUE, GYRO_RATE
from campaign.estimate import Estimate
from campaign.experiments.interface import TrialData
from campaign.experiments.shared.captions import amount, listed, sentence
from campaign.result import Axis, Curve, Figure, Mark, Panel, Value

NUMBERS = 10
"""Most numbers of measurements at the axis."""
BEHIND = 1.5
"""Distance of the mean from the last measurement on the axis."""
TORQUE = "breakaway_torque"


@dataclass(frozen=True)
class ComponentCurves:
    """Curves of one component.

    Attributes:
        numbers: of the measurements.
        torques: their readings (N m), as many.
        mean: of the readings.
        ramp: the first measurement.
        count: one count of a sensor behind the gear (N m); 0 where it is at the load or perfect.
    """

    name: str
    numbers: tuple[int, ...]
    torques: tuple[Estimate, ...]
    mean: Estimate
    ramp: TrialData
    count: float


def component_figure(
    shown: Sequence[ComponentCurves],
    place: Mapping[str, Value],
    sliding_rate: float,
    trials: tuple[int, ...],
) -> Figure:
    """The figure of one place of the sweep; sliding_rate (rad/s) counts as sliding."""
    last = max(number for each in shown for number in each.numbers)
    ramps = [_ramp(each) for each in shown if not each.ramp.not_kept]
    return Figure(
        key="component-friction",
        title="Breakaway torque of the components",
        caption=f"{'One ramp of each component until it slides, then the' if ramps else 'The'} "
        "repeated readings of each component, with their 95 % intervals, and their mean, each "
        "component on its own scale. "
        f"{_what_shows(shown)}",
        alt="Rate over torque of one ramp for each component, and breakaway torque of each "
        "component over the number of the measurement.",
        panels=(
            *(
                [
                    Panel(
                        Axis("Torque at the load", "N m", "N m"),
                        Axis("Rate", "rad/s", "deg/s"),
                        ramps,
                        "One ramp of each",
                        [Mark("counts as sliding", y=sliding_rate)],
                    )
                ]
                if ramps
                else ()
            ),
            *(
                Panel(
                    _numbered(last),
                    Axis("Breakaway torque", "N m", "N m"),
                    _dots(each, place, last + BEHIND),
                    each.name.capitalize(),
                )
                for each in shown
            ),
        ),
        across=2,
        trials=trials,
    )


def _ramp(each: ComponentCurves) -> Curve:
    """Absolute rate over absolute torque of the first measurement."""
    recording = each.ramp.recording()
    torque, rate = np.abs(recording[DRIVE_TORQUE]), np.abs(recording[GYRO_RATE])
    return Curve(torque, rate, each.name, each.name, "thin")


def _dots(each: ComponentCurves, place: Mapping[str, Value], behind: float) -> tuple[Curve, Curve]:
    """Curves of the readings by their numbers, and of their mean after them."""
    own = {**place, "component": each.name}
    curve = partial(Curve.of, label=each.name, series=each.name, quantity=TORQUE)
    return (
        curve(each.numbers, each.torques, along="measurement", conditions=own),
        curve([behind], [each.mean], conditions={**own, "statistic": "mean"}),
    )


def _numbered(count: int) -> Axis:
    """Axis of the measurements with at most `NUMBERS` numbers, and their mean after them."""
    step = -(-count // NUMBERS)
    names = ((float(number), str(number)) for number in range(1, count + 1, step))
    return Axis("Measurement", places=(*names, (count + BEHIND, "mean")))


def _what_shows(shown: Sequence[ComponentCurves]) -> str:
    """Caption text: means of the components, the largest first, and steps of the readings."""
    order = sorted(shown, key=lambda each: -each.mean.value)
    words = [f"{each.name} {amount(each.mean.value, 'N m')}" for each in order]
    means = sentence(f"on average {listed(words)}")
    behind = [each for each in shown if each.count > 0]
    if not behind:
        return means
    step, names = amount(behind[0].count, "N m"), listed([each.name for each in behind])
    steps = f"One count of the sensor is {step} behind the gear"
    return f"{means} {steps}: readings of {names} are multiples of it."
