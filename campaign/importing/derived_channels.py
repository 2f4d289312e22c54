"""From columns to channels: units, signs, constants, derived channels."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from campaign.channels import (
    COMMAND,
    DRIVE_TORQUE,
    GYRO_RATE,
    MOTOR_ANGLE,
    MOTOR_CURRENT,
    MOTOR_RATE,
    RELATIVE_ANGLE,
    RELATIVE_RATE,
    VOCABULARY,
    AxisKind,
    Quantity,
    info,
)
from campaign.importing.description import Cells, ChannelSource
from campaign.importing.mapping import ChannelColumn
from campaign.recording import ChannelInfo
from campaign.unit_grammar import ONE, Unit, parse_unit
from campaign.units import split_quantity

if TYPE_CHECKING:
    from campaign.physics.bench import Bench

PLAIN = ("", "1", "-")
"""Spellings of a unit for numbers without one."""
AT_REST = "the hull is taken to be at rest, so the load's rate in space is that to the hull"
GEARED = "divided by the ratio of the gear; without `[gear]` in the bench that is 1, a direct drive"


@dataclass(frozen=True)
class RigFacts:
    """Parameters of a rig that derive one channel from another; None if unknown.

    Attributes:
        axis, motor: kind of motion of the axis and of its motor.
        ratio: N, motor rate over load rate; 1 without a gear (direct drive).
        torque_per_current: drive torque at the load per ampere (N m/A).
    """

    axis: AxisKind = AxisKind.ROTARY
    motor: AxisKind = AxisKind.ROTARY
    ratio: float = 1.0
    torque_per_current: float | None = None

    @classmethod
    def of(cls, bench: Bench) -> RigFacts:
        """The known parameters of a bench."""
        return cls(
            bench.sides.load, bench.sides.motor, bench.ratio or 1.0, bench.torque_per_current
        )


def made_of_column(
    name: str, entry: ChannelColumn, cells: Cells, stated: str, rig: RigFacts
) -> ChannelSource:
    """The channel of a column.

    Args:
        stated: the unit that the file states; "" for none.

    Raises ValueError with a message for the user if units do not match.
    """
    written = entry.unit or stated
    if not written and _info(name, entry, rig, None).unit:
        raise ValueError(
            f"the file states no unit of column {cells.name!r}; write unit = ..., or "
            'unit = "1" for a number without one'
        )
    number, by = _times(entry)
    unit = _unit(written) * by
    what = _info(name, entry, rig, unit)
    si = _unit(what.unit)
    if unit.dimensions != si.dimensions:
        raise ValueError(_mismatch(name, entry, written, what))
    return _made(
        name,
        what,
        cells=cells,
        factor=entry.sign * number * float(unit.factor / si.factor),
        offset=entry.offset,
        relative_uncertainty=_relative(entry, number),
        filter=entry.filter,
    )


def made_of_channel(
    name: str, entry: ChannelColumn, source: ChannelSource, rig: RigFacts
) -> ChannelSource:
    """The channel that the mapping derives from another.

    Raises ValueError if it is no multiple, derivative or integral of the other.
    """
    what = _info(name, entry, rig, None)
    number, by = _times(entry)
    candidates: tuple[tuple[Literal["copy", "derivative", "integral"], str], ...] = (
        ("copy", "1"),
        ("derivative", "1/s"),
        ("integral", "s"),
    )
    for how, per in candidates:
        unit = _unit(source.unit) * by * _unit(per)
        if unit.dimensions == _unit(what.unit).dimensions:
            shares = _relative(entry, number), source.relative_uncertainty
            known = [share for share in shares if share is not None]
            return _made(
                name,
                what,
                how=how,
                source=source.name,
                factor=entry.sign * number * float(unit.factor / _unit(what.unit).factor),
                # Factors are independent of each other.
                relative_uncertainty=math.hypot(*known) if known else None,
                filter=entry.filter,
            )
    raise ValueError(
        f"{name} is in {what.unit} and {source.name} in {source.unit}; neither that times a "
        "constant nor its derivative or integral is the other"
    )


def _made(name: str, what: ChannelInfo, **of: Any) -> ChannelSource:
    return ChannelSource(
        name=name, unit=what.unit, label=what.label, display_unit=what.display_unit, **of
    )  # fmt: skip


class _Way(NamedTuple):
    """Derivation of a channel from another one; its factor is None if the rig is unknown."""

    name: str
    source: str
    how: Literal["copy", "derivative"]
    factor: Callable[[RigFacts], float | None]
    remark: str = ""


_WAYS = (
    _Way(RELATIVE_ANGLE, MOTOR_ANGLE, "copy", lambda rig: 1.0 / rig.ratio, f"; {GEARED}"),
    _Way(RELATIVE_RATE, RELATIVE_ANGLE, "derivative", lambda rig: 1.0),
    _Way(RELATIVE_RATE, MOTOR_RATE, "copy", lambda rig: 1.0 / rig.ratio, f"; {GEARED}"),
    _Way(RELATIVE_RATE, GYRO_RATE, "copy", lambda rig: 1.0, f"; {AT_REST}"),
    _Way(GYRO_RATE, RELATIVE_RATE, "copy", lambda rig: 1.0, f"; {AT_REST}"),
    _Way(DRIVE_TORQUE, MOTOR_CURRENT, "copy", lambda rig: rig.torque_per_current),
)
"""Derivations of channels that were not recorded, the best first; intermediate channels come
before those that depend on them."""


def _ways(have: Collection[str], rig: RigFacts) -> dict[str, _Way]:
    """Derivations of the missing channels from the available ones, by name."""
    result: dict[str, _Way] = {}
    for step in _WAYS:
        known = {*have, *result}
        if step.name not in known and step.source in known and step.factor(rig):
            result[step.name] = step
    return result


def sufficient(have: Collection[str], rig: RigFacts) -> frozenset[str]:
    """The available channels and those derived from them."""
    return frozenset((*have, *_ways(have, rig)))


def following(
    wanted: Collection[str], have: Mapping[str, ChannelSource], rig: RigFacts
) -> Iterator[tuple[ChannelSource, str]]:
    """The wanted channels that are missing, derived from others, each with a remark.

    An intermediate channel comes before the channel that depends on it.
    """
    derivations, known = _ways(have, rig), dict(have)
    for name in sorted(wanted):
        path: list[_Way] = []
        while name not in known and name in derivations:
            path.append(derivations[name])
            name = derivations[name].source
        for step in reversed(path):
            made = known[step.name] = _made(
                step.name,
                info(step.name, axis=rig.axis),
                how=step.how,
                source=step.source,
                factor=step.factor(rig) or 1.0,
                relative_uncertainty=known[step.source].relative_uncertainty,
            )
            verb = "the derivative of" if step.how == "derivative" else "made of"
            yield made, f"{step.name} is {verb} {step.source}{step.remark}"


def _info(name: str, entry: ChannelColumn, rig: RigFacts, unit: Unit | None) -> ChannelInfo:
    """Name, unit and label of a channel; a laboratory's own channel keeps the mapping's unit."""
    if name == COMMAND and unit is not None:
        for mode in ("rate", "torque"):
            what = info(COMMAND, mode, axis=rig.axis)
            if _unit(what.unit).dimensions == unit.dimensions:
                return what
    if name in VOCABULARY:
        axis = rig.motor if name in (MOTOR_ANGLE, MOTOR_RATE) else rig.axis
        depends = VOCABULARY[name].quantity is Quantity.DEPENDS and unit is None
        return info(name, "rate", axis=axis) if depends else info(name, axis=axis)
    if not entry.label:
        raise ValueError(
            f"{name!r} is none of the channels that analyses know (`campaign kinds channels`); "
            "give a channel of your own a 'label'"
        )
    written = entry.unit if entry.unit not in PLAIN else ""
    if entry.times:
        written = split_quantity(entry.times)[1]
    return ChannelInfo(name, written, entry.label, written)


def _unit(text: str) -> Unit:
    return ONE if text.strip() in PLAIN else parse_unit(text)


def _times(entry: ChannelColumn) -> tuple[float, Unit]:
    if not entry.times:
        return 1.0, ONE
    number, unit = split_quantity(entry.times)
    if number == 0:
        raise ValueError("'times' is zero; nothing would be left of the column")
    return number, _unit(unit)


def _relative(entry: ChannelColumn, number: float) -> float | None:
    """Relative uncertainty of `times`, or of the scale; None if not stated."""
    if not entry.uncertainty:
        return None
    error, unit = split_quantity(entry.uncertainty)
    if error < 0:
        raise ValueError(f"the uncertainty {entry.uncertainty!r} is negative")
    if unit.strip() == "%":
        return error / 100.0  # of 'times', in any unit
    if not entry.times:
        raise ValueError(
            f"the uncertainty {entry.uncertainty!r} needs a 'times' that it is of; without one "
            "write a share, as in '5 %'"
        )
    _, by = _times(entry)
    of = _unit(unit)
    if of.dimensions != by.dimensions:
        raise ValueError(f"the uncertainty {entry.uncertainty!r} has another unit than 'times'")
    return abs(error * float(of.factor / by.factor) / number)


def _mismatch(name: str, entry: ChannelColumn, written: str, what: ChannelInfo) -> str:
    given = f"{written!r} times {entry.times!r}" if entry.times else repr(written)
    constant = "" if entry.times else "; 'times' is for a constant that leads there"
    other = {"rad": "m", "m": "rad"}
    turned = {base for base, _ in _unit(written).dimensions} & set(other)
    wanted = {base for base, _ in _unit(what.unit).dimensions} & set(other)
    if turned and wanted and turned != wanted and not entry.times:
        now, then = ("linear", "rotary") if wanted == {"m"} else ("rotary", "linear")
        constant = f"; the bench's axis is {now}: is it {then} (axis.kind)?"
    return f"{name} is in {what.unit or 'no unit'}, and {given} is no multiple of that{constant}"
