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
"""How people write that a number has no unit."""
AT_REST = "the hull is taken to be at rest, so the load's rate in space is that to the hull"
GEARED = "divided by the ratio of the gear; without `[gear]` in the bench that is 1, a direct drive"


@dataclass(frozen=True)
class RigFacts:
    """What of a rig turns one channel into another; None where it is not known.

    Attributes:
        axis: how the axis moves; `motor` how its motor does.
        ratio: N, motor rate over load rate; 1 without a gear, where the motor drives directly.
        torque_per_current: drive torque at the load per ampere (N m/A).
    """

    axis: AxisKind = AxisKind.ROTARY
    motor: AxisKind = AxisKind.ROTARY
    ratio: float = 1.0
    torque_per_current: float | None = None

    @classmethod
    def of(cls, bench: Bench) -> RigFacts:
        """The facts of a bench, as far as it has them."""
        return cls(
            bench.sides.load, bench.sides.motor, bench.ratio or 1.0, bench.torque_per_current
        )


def made_of_column(
    name: str, entry: ChannelColumn, cells: Cells, stated: str, rig: RigFacts
) -> ChannelSource:
    """The channel that a column is.

    Args:
        stated: the unit that the file states; "" for none.

    Raises ValueError with a message for the user where units do not go together.
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
    """The channel that is derived from another, as the mapping says.

    Raises ValueError where nothing leads from one to the other.
    """
    what = _info(name, entry, rig, None)
    number, by = _times(entry)
    ways: tuple[tuple[Literal["copy", "derivative", "integral"], str], ...] = (
        ("copy", "1"),
        ("derivative", "1/s"),
        ("integral", "s"),
    )
    for how, per in ways:
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
    """How a channel follows from another one, where the rig is known well enough."""

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
"""What suffices for a channel that nobody recorded, the best first; what is made on the way to
another one comes before it."""


def _ways(have: Collection[str], rig: RigFacts) -> dict[str, _Way]:
    """How each channel that there is not follows from those that there are."""
    found: dict[str, _Way] = {}
    for way in _WAYS:
        known = {*have, *found}
        if way.name not in known and way.source in known and way.factor(rig):
            found[way.name] = way
    return found


def sufficient(have: Collection[str], rig: RigFacts) -> frozenset[str]:
    """The channels that there are, and those that follow from them."""
    return frozenset((*have, *_ways(have, rig)))


def following(
    wanted: Collection[str], have: Mapping[str, ChannelSource], rig: RigFacts
) -> Iterator[tuple[ChannelSource, str]]:
    """Channels that are wanted and not there, made of others, and what to remark; in their order.

    A channel on the way to a wanted one comes before it.
    """
    ways, known = _ways(have, rig), dict(have)
    for name in sorted(wanted):
        path: list[_Way] = []
        while name not in known and name in ways:
            path.append(ways[name])
            name = ways[name].source
        for way in reversed(path):
            made = known[way.name] = _made(
                way.name,
                info(way.name, axis=rig.axis),
                how=way.how,
                source=way.source,
                factor=way.factor(rig) or 1.0,
                relative_uncertainty=known[way.source].relative_uncertainty,
            )
            verb = "the derivative of" if way.how == "derivative" else "made of"
            yield made, f"{way.name} is {verb} {way.source}{way.remark}"


def _info(name: str, entry: ChannelColumn, rig: RigFacts, unit: Unit | None) -> ChannelInfo:
    """What a channel is; one of the laboratory's own has the unit it is written in."""
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
    """The uncertainty of `times`, or of the scale, as a share of it; None where none is stated."""
    if not entry.uncertainty:
        return None
    error, unit = split_quantity(entry.uncertainty)
    if error < 0:
        raise ValueError(f"the uncertainty {entry.uncertainty!r} is negative")
    if unit.strip() == "%":
        return error / 100.0  # of 'times', whatever it is in
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
