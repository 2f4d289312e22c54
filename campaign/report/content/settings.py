"""Settings of benches, options, tasks and motions, in display units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pydantic import BaseModel

from campaign.api.quantity_words import field_quantity
from campaign.axis_kind import current_sides, each_in_axis_terms, in_axis_terms
from campaign.channels import COMMAND, UNITS, AxisKind, info
from campaign.channels import Quantity as PhysicalQuantity
from campaign.recording import ChannelInfo
from campaign.signals import MultiSine, Polyline, Signal, Sine, Zero
from campaign.text import number, pretty_unit
from campaign.trial import Task, Tree
from campaign.units import Quantity, convert

LISTED = 12
"""Maximum number of shown values of a list."""

Pairs = Iterator[tuple[str, str]]


def settings_of(options: BaseModel, without: Sequence[str] = ()) -> Pairs:
    """Label and text of every non-empty option, nested tables included: `motor: resistance`.

    `without`: names of fields to omit.
    """
    for name, field in type(options).model_fields.items():
        if name not in without:
            quantity = field_quantity(field)
            pairs = _told(_words(name), getattr(options, name), quantity and quantity.here)
            yield from pairs


def tree_settings(tree: Tree) -> Pairs:
    """Label and text of the entries of a table without a class; numbers are marked as SI."""
    for name, value in tree.items():
        for label, text in _told(_words(name), value, None):
            yield label, f"{text} (SI)" if text[:1].isdigit() or text[:1] == "−" else text


def task_settings(task: Task, command: ChannelInfo | None) -> Pairs:
    """Label and text of a task; the unit of the channel `command` determines the kind of axis."""
    command = command or info(COMMAND, task.mode)
    axis = AxisKind.LINEAR if command.unit in ("m", "m/s", "N") else AxisKind.ROTARY
    rate = UNITS[axis][PhysicalQuantity.RATE]
    angle, torque = UNITS[axis][PhysicalQuantity.ANGLE], UNITS[axis][PhysicalQuantity.TORQUE]
    yield "mode", task.mode
    yield from _motion("command", task.command, (command.unit, command.display_unit))
    yield from _motion("acceleration of the base", task.base_acceleration, _per_second(rate))
    yield from _motion("disturbance", task.disturbance, torque)
    yield "compensation", task.compensation
    yield "duration", _amount(task.duration, ("s", "s"))
    start, stop = (number(time, 6) for time in task.window)
    yield "window", f"{start} to {stop} s"
    yield "sample rate", _amount(task.sample_rate, ("Hz", "Hz"))
    if task.start_angle:
        yield _words("start angle"), _amount(task.start_angle, angle)
    if task.stop_rate is not None:
        yield "stops at a rate of", _amount(task.stop_rate, rate)
    if task.spring_stiffness:
        per = f"{torque[0]}/{angle[0]}"
        yield "stiffness of the spring", _amount(task.spring_stiffness, (per, per))


def point_settings(point: Mapping[str, Any], options: BaseModel | None, bench: Any) -> Pairs:
    """Label and text of a trial's sweep point; a number of unknown unit is marked as SI.

    A swept `speed` has the unit of the option `speeds`.
    """
    for path, value in point.items():
        inside, _, rest = path.partition(".")
        lists = (path, f"{path}s", f"{path.removesuffix('y')}ies")
        quantities = (_quantity_at(options, name) for name in lists)
        quantity = (
            _quantity_at(bench, rest) if inside == "bench" else next(filter(None, quantities), None)
        )
        pairs = _told(_words(path.replace(".", ": ")), value, quantity)
        for label, text in pairs:
            bare = quantity is None and isinstance(value, float)
            yield label, f"{text} (SI)" if bare else text


def _motion(name: str, signal: Signal, unit: tuple[str, str]) -> Pairs:
    if not isinstance(signal, Zero):
        yield name, _signal(signal, unit)


def _signal(signal: Signal, unit: tuple[str, str]) -> str:
    match signal:
        case Sine():
            phase = f", phase {_amount(signal.phase, ('rad', 'deg'))}" if signal.phase else ""
            return (
                f"sine of {_amount(signal.amplitude, unit)}, {number(signal.frequency)} Hz{phase}"
            )
        case Polyline():
            low, high = (_amount(end, unit) for end in (min(signal.values), max(signal.values)))
            span = f"{number(signal.times[0], 6)} to {number(signal.times[-1], 6)} s"
            return f"polyline of {len(signal.times)} points over {span}, between {low} and {high}"
        case MultiSine():
            ends = (number(end) for end in (min(signal.frequencies), max(signal.frequencies)))
            largest = _amount(max(map(abs, signal.amplitudes)), unit)
            count = len(signal.amplitudes)
            return f"{count} sines of {' to '.join(ends)} Hz, the largest of {largest}"
    return "nothing"


def _told(label: str, value: Any, quantity: Quantity | None) -> Pairs:
    if isinstance(value, BaseModel):
        sides = (
            current_sides().at_motor if getattr(value, "side", "") == "motor" else current_sides()
        )
        for name, text in each_in_axis_terms(sides, settings_of(value)):
            yield f"{label}: {name}", text
    elif isinstance(value, Mapping):
        for name, item in value.items():
            yield from _told(f"{label}: {_words(str(name))}", item, quantity)
    elif isinstance(value, list | tuple) and any(isinstance(v, BaseModel | Mapping) for v in value):
        for place, item in enumerate(value, start=1):
            yield from _told(f"{label} {place}", item, quantity)
    elif isinstance(value, list | tuple):
        if value:
            yield label, _listed(value, quantity)
    elif value is not None and value != "":
        yield label, _with_unit(_plain(value, quantity), quantity)


def _listed(values: Sequence[Any], quantity: Quantity | None) -> str:
    shown = [_plain(value, quantity) for value in values[:LISTED]]
    more = [f"… ({len(values)})"] if len(values) > LISTED else []
    return _with_unit(", ".join([*shown, *more]), quantity)


def _plain(value: Any, quantity: Quantity | None) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int | float):
        return number(convert(value, quantity.si, quantity.display) if quantity else value, 6)
    return str(value)


def _with_unit(text: str, quantity: Quantity | None) -> str:
    return f"{text} {pretty_unit(quantity.display)}" if quantity else text


def _amount(value: float, unit: tuple[str, str]) -> str:
    """A number as text with its unit; `unit`: SI and display unit."""
    return f"{number(convert(value, *unit), 6)} {pretty_unit(unit[1])}"


def _per_second(rate: tuple[str, str]) -> tuple[str, str]:
    """Units of an acceleration from those of its rate: deg/s² for deg/s."""
    return f"{rate[0]}^2", f"{rate[1]}^2"


def _words(name: str) -> str:
    return in_axis_terms(name.replace("_", " "))


def _quantity_at(options: Any, path: str) -> Quantity | None:
    """Quantity of the field at a dotted path; None without one."""
    name, _, rest = path.partition(".")
    if isinstance(options, Mapping):
        return _quantity_at(options.get(name), rest) if rest else None
    sides = current_sides().at_motor if getattr(options, "side", "") == "motor" else current_sides()
    field = type(options).model_fields.get(name) if isinstance(options, BaseModel) else None
    if field is None:
        return None
    if rest:
        return _quantity_at(getattr(options, name), rest)
    quantity = field_quantity(field)
    return quantity and quantity.of(sides)
