"""Swept values as text, with name and unit.

A path is an option of the test (`frequency`) or a value of its bench (`bench.gear.preload.torque`);
its quantity stands where it is declared.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from campaign.experiments import experiments
from campaign.experiments.interface import bench_of
from campaign.options import describe
from campaign.physics.bench_knowledge import number_at
from campaign.result import Axis, Value
from campaign.text import pretty_unit
from campaign.trial import Trial
from campaign.units import Quantity, convert

BENCH = "bench."


def quantity_of(path: str, trial: Trial) -> Quantity | None:
    """The quantity of a swept value; None for a number without unit and other values."""
    if path.startswith(BENCH):
        at = number_at(bench_of(trial), path.removeprefix(BENCH))
        return at[1] if at else None
    options = describe(experiments()[trial.kind].options)
    quantities = (info.quantity for info in options if info.name == path)
    quantity = next(quantities, None)
    return quantity and quantity.here


def name_of(path: str) -> str:
    """Name of a path: `preload torque` for `bench.gear.preload.torque`."""
    return " ".join(path.removeprefix(BENCH).split(".")[-2:]).replace("_", " ")


def shown_value(value: object, quantity: Quantity | None) -> str:
    """A swept value (SI) as text: `0.24 Hz`, `18 deg/s²`, `yes`."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not isinstance(value, int | float):
        return str(value)
    if quantity is None:
        return f"{value:.4g}"
    number = convert(float(value), quantity.si, quantity.display)
    return f"{number:.4g} {pretty_unit(quantity.display)}"


def words(
    point: Mapping[str, Value], trial: Trial, bare: frozenset[str] = frozenset()
) -> Iterator[str]:
    """Values of a point as text: `0.24 Hz` for paths in `bare`, else `preload torque 50 N·m`."""
    for path, value in point.items():
        text = shown_value(value, quantity_of(path, trial))
        yield text if path in bare else f"{name_of(path)} {text}"


def axis_of(path: str, trial: Trial) -> Axis:
    """The axis along a swept number."""
    quantity, name = quantity_of(path, trial), name_of(path)
    label = name[:1].upper() + name[1:]
    return Axis(label, quantity.si, quantity.display) if quantity else Axis(label)
