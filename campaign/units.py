"""Conversion of text quantities to SI, and back.

Inside the program every number is SI. Validation of a protocol or bench converts text such as
``"18 deg/s^2"`` to a float; the page converts it to text in the display unit. `unit_grammar`
defines the spelling and value of units. A quantity accepts every unit of its dimensions; angles,
cycles and energy have dimensions of their own.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Annotated, Any

from pydantic import GetCoreSchemaHandler, ValidationInfo
from pydantic_core import PydanticCustomError, core_schema

from campaign.axis_kind import AxisKind, Sides, axis_unit, current_sides
from campaign.text import pretty_unit
from campaign.unit_grammar import Unit, parse_unit, respelled


@dataclass(frozen=True)
class Quantity:
    """A physical quantity: its SI unit, display unit, and usual units.

    Used as pydantic metadata: ``inertia: Annotated[float, INERTIA]``. The field then takes text
    with a unit. A bare number is an error, except under the validation context
    ``{"si": True}`` with which normalised (already SI) trees are read back.

    Attributes:
        accepts: units in messages and in `campaign kinds units`; all units of the dimensions work.
        also: (unit, its meaning for this quantity): `1/min` is `rpm` for a speed.
        linear: its replacement if its side of the gear is linear; None: the same.
        of_motor: whether it belongs to the motor, which may be rotary with a linear axis.
        through_lead: its replacement between a rotary motor and a linear axis; None: `linear`.
    """

    name: str
    si: str
    display: str
    accepts: tuple[str, ...]
    also: tuple[tuple[str, str], ...] = ()
    linear: Quantity | None = field(default=None, repr=False)
    of_motor: bool = False
    through_lead: Quantity | None = field(default=None, repr=False)

    @property
    def here(self) -> Quantity:
        """The corresponding quantity of the current axis (`axis_kind.axis_terms`)."""
        return self.of(current_sides())

    def of(self, sides: Sides) -> Quantity:
        """The corresponding quantity of a bench with these sides."""
        kind = sides.motor if self.of_motor else sides.load
        if kind is AxisKind.ROTARY:
            return self
        if self.through_lead is not None and sides.motor is AxisKind.ROTARY:
            return self.through_lead
        return self.linear or self

    def parse(self, text: str) -> float:
        """SI value of `text` for the current axis. Raises ValueError with a message for users."""
        own = self.here
        try:
            return own.parse_own(text)
        except ValueError as error:
            raise ValueError(f"{error}{self._of_other_kind(text, own)}") from None

    def _of_other_kind(self, text: str, own: Quantity) -> str:
        """Hint for a unit that is valid only for another kind of axis; else empty."""
        for other in {self, self.linear, self.through_lead} - {own, None}:
            try:
                other.parse_own(text)  # type: ignore[union-attr]
            except ValueError:
                continue
            if self.of_motor:
                kind = "rotary" if own is self else "linear"
                return f"; the motor of this bench is {kind} (axis.kind, gear.lead)"
            return (
                f"; the axis of this bench is {'rotary' if own is self else 'linear'} (axis.kind)"
            )
        return ""

    def parse_own(self, text: str) -> float:
        """SI value of `text` for exactly this quantity, independent of the axis."""
        number, unit = split_quantity(text)
        if not unit:
            raise ValueError(f"{text!r} has no unit; expected a {self.name} such as {self.example}")
        try:
            value = number * self._factor(parse_unit(unit))
        except LookupError:
            raise ValueError(f"{unit!r} is not a unit of {self.name}; {self._allowed()}") from None
        except ValueError as error:
            why = self._meant(unit) or str(error)
            raise ValueError(f"{unit!r} is not a unit; {self._allowed()}; {why}") from None
        if not math.isfinite(value):
            raise ValueError(f"{text!r} is not a finite number")
        return value

    def _factor(self, unit: Unit) -> float:
        """Value of `unit` in SI units. Raises LookupError for other dimensions."""
        for spelled, meant in self.also:
            if unit == parse_unit(spelled):
                unit = parse_unit(meant)
        si = parse_unit(self.si)
        if unit.dimensions != si.dimensions:
            raise LookupError
        return float(unit.factor / si.factor)

    def _meant(self, unit: str) -> str:
        """Suggestion of a valid unit for the invalid `unit`, spelled as in `accepts`; or empty."""
        for near in respelled(unit):
            meant = parse_unit(near)
            try:
                self._factor(meant)
            except LookupError:
                continue
            listed = (each for each in self.accepts if parse_unit(each) == meant)
            return f"did you mean {next(listed, near)!r}?"
        return ""

    @property
    def example(self) -> str:
        """A valid value, quoted."""
        return f'"1 {self.display}"'

    def _allowed(self) -> str:
        return f"allowed are {', '.join(self.accepts)}"

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.with_info_before_validator_function(self._validate, handler(source))

    def _validate(self, value: Any, info: ValidationInfo) -> Any:
        context = info.context
        if type(value) is float and type(context) is dict and context.get("si"):
            return value  # most of an archive
        if isinstance(value, str):
            try:
                return self.parse(value)
            except ValueError as error:
                raise PydanticCustomError("quantity", "{why}", {"why": str(error)}) from None
        already_si = isinstance(context, Mapping) and context.get("si")
        if isinstance(value, int | float) and not isinstance(value, bool) and not already_si:
            raise PydanticCustomError(
                "quantity",
                "{value} has no unit; write it as text, such as {example}",
                {"value": value, "example": f'"{value:g} {self.here.display}"'},
            )
        return value


_NUMBER = re.compile(
    r"\s*([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?|[-+]?(?:nan|inf(?:inity)?)\b)"
    r"(?:/([1-9][0-9]*)(?![0-9.eE]))?\s*(.*?)\s*\Z",
    re.I | re.S,
)
LONGEST = 100
"""Maximum number of characters of a quantity."""


def split_quantity(text: str) -> tuple[float, str]:
    """Number and unit text of ``"0.05 deg/s"``. Raises ValueError without a number at the begin.

    The number may be a fraction: ``"1/65536 rev/count"``.
    """
    if len(text) > LONGEST:
        raise ValueError(
            f"a quantity is a number and a unit, not a text of over {LONGEST} characters"
        )
    match = _NUMBER.match(text)
    if match is None:
        raise ValueError(f"{text!r} does not begin with a number")
    number, of, unit = match.groups()
    if unit.startswith(","):
        raise ValueError(f"{text!r}: the decimal sign is a point, as in {text.replace(',', '.')!r}")
    if unit.startswith("_"):
        raise ValueError(f"{text!r}: digits are not grouped, as in {text.replace('_', '')!r}")
    return float(number) / float(of or 1), unit


def convert(value: Any, unit: str, to: str) -> Any:
    """Convert `value` (number or array) from `unit` to `to`; no operation for equal units."""
    if unit == to:
        return value
    return value * factor(unit, to)


def to_si(text: str) -> float:
    """SI value of `text` in any unit (`"18 deg/s^2"`), without a check of dimensions.

    Raises ValueError if it is not a number with a known unit.
    """
    number, unit = split_quantity(text)
    try:
        return number * float(parse_unit(unit).factor)
    except ValueError as error:
        near = list(respelled(unit))
        alike = len({parse_unit(each) for each in near}) == 1
        why = f"did you mean {near[0]!r}?" if alike else error
        raise ValueError(f"{unit!r} is not a unit: {why}") from None


@lru_cache(maxsize=1024)
def factor(unit: str, to: str) -> float:
    """Value of one `unit` in units of `to`. Raises ValueError for different dimensions."""
    one, other = parse_unit(unit), parse_unit(to)
    if one.dimensions != other.dimensions:
        raise ValueError(f"{unit!r} is no multiple of {to!r}")
    return float(one.factor / other.factor)


def same_dimension(one: str, other: str) -> bool:
    """Whether both units have the same dimension; unknown units only if their texts are equal."""
    try:
        return one == other or factor(one, other) > 0
    except ValueError:
        return False


DISPLAY = {
    "rad": "deg",
    "rad/s": "deg/s",
    "rad/s^2": "deg/s^2",
    "m": "mm",
    "m/s": "mm/s",
    "m/s^2": "mm/s^2",
}
"""Default display unit by SI unit."""


def in_words(value: float, unit: str, display: str = "", form: str = ".3g") -> str:
    """`5 mm/s`: a number (SI) in the display unit of the current axis.

    `unit` and `display` (absent: the same) are units of a rotary axis, such as rad/s and deg/s.
    """
    shown = axis_unit(display or unit)
    unit_text = "deg" if shown == "deg" else pretty_unit(shown)
    return f"{convert(value, axis_unit(unit), shown):{form}} {unit_text}"


def angle_text(value: float, form: str = ".3g") -> str:
    """`5 deg` or `5 mm` for an angle (rad) or a position (m)."""
    return in_words(value, "rad", "deg", form)


def rate_text(value: float, form: str = ".3g") -> str:
    """`5 deg/s` or `5 mm/s` for a rate (rad/s or m/s)."""
    return in_words(value, "rad/s", "deg/s", form)


def torque_text(value: float, form: str = ".3g") -> str:
    """`5 N·m` or `5 N` for a torque (N m) or a force (N)."""
    return in_words(value, "N m", form=form)


def _quantity(
    name: str,
    si: str,
    display: str,
    *others: str,
    also: tuple[tuple[str, str], ...] = (),
    linear: Quantity | None = None,
    of_motor: bool = False,
) -> Quantity:
    accepts = tuple(dict.fromkeys((display, si, *others)))
    return Quantity(name, si, display, accepts, also, linear, of_motor)


POSITION = _quantity("position", "m", "mm", "um", "cm", "in")
VELOCITY = _quantity("velocity", "m/s", "mm/s", "um/s", "mm/min", "m/min")
ACCELERATION = _quantity("acceleration", "m/s^2", "mm/s^2")
FORCE = _quantity("force", "N", "N", "mN", "kN", "lbf")
FORCE_RATE = _quantity("force rate", "N/s", "N/s", "mN/s")
MASS = _quantity("mass", "kg", "kg", "g", "lbm")
FORCE_CONSTANT = _quantity("force constant", "N/A", "N/A", "mN/A")
LINEAR_BACK_EMF_CONSTANT = _quantity("back-EMF constant", "V s/m", "V s/m", "mV s/mm")
STIFFNESS = _quantity("stiffness", "N/m", "N/m", "kN/m", "N/mm", "N/um")
DAMPING = _quantity("damping", "N s/m", "N s/m", "N s/mm")
VELOCITY_GAIN = _quantity("velocity-to-current gain", "A s/m", "A s/m", "A s/mm")
VELOCITY_INTEGRAL_GAIN = _quantity("integral velocity-to-current gain", "A/m", "A/m", "A/mm")

PHASE = _quantity("phase", "rad", "deg", "mrad", "urad", "arcmin", "arcsec")
ANGLE = _quantity("angle", "rad", "deg", "mrad", "urad", "arcmin", "arcsec", linear=POSITION)
MOTOR_ANGLE = replace(ANGLE, of_motor=True)
LEAD = _quantity("lead", "m/rev", "mm/rev", "m/rad", "in/rev")
ANGULAR_RATE = _quantity(
    "angular rate",
    "rad/s",
    "deg/s",
    "mrad/s",
    "deg/min",
    "deg/hour",
    "rpm",
    also=(("1/min", "rpm"),),  # as data sheets print a speed
    linear=VELOCITY,
)
ANGULAR_ACCELERATION = _quantity(
    "angular acceleration", "rad/s^2", "deg/s^2", "mrad/s^2", linear=ACCELERATION
)
TIME = _quantity("time", "s", "s", "ms", "us", "min", "hour", "h")
FREQUENCY = _quantity("frequency", "Hz", "Hz", "mHz", "kHz", "MHz")
TORQUE = _quantity("torque", "N m", "N m", "mN m", "kN m", "ozf in", "lbf in", linear=FORCE)
TORQUE_RATE = _quantity("torque rate", "N m/s", "N m/s", "mN m/s", linear=FORCE_RATE)
CURRENT = _quantity("current", "A", "A", "mA")
VOLTAGE = _quantity("voltage", "V", "V", "mV")
RESISTANCE = _quantity("resistance", "ohm", "ohm", "mohm")
INDUCTANCE = _quantity("inductance", "H", "mH", "uH")
INERTIA = _quantity(
    "moment of inertia", "kg m^2", "kg m^2", "kg cm^2", "g m^2", "g cm^2", linear=MASS
)
TORQUE_CONSTANT = _quantity(
    "torque constant", "N m/A", "N m/A", "mN m/A", linear=FORCE_CONSTANT, of_motor=True
)
BACK_EMF_CONSTANT = _quantity(
    "back-EMF constant",
    "V s/rad",
    "V s/rad",
    "mV s/rad",
    "V/rpm",
    "V/krpm",
    linear=LINEAR_BACK_EMF_CONSTANT,
    of_motor=True,
)
ROTATIONAL_STIFFNESS = _quantity(
    "rotational stiffness",
    "N m/rad",
    "N m/rad",
    "kN m/rad",
    "N m/mrad",
    "N m/deg",
    linear=STIFFNESS,
)
ROTATIONAL_DAMPING = _quantity(
    "rotational damping", "N m s/rad", "N m s/rad", "mN m s/rad", "N m s/deg", linear=DAMPING
)
OBSERVER_GAIN = replace(
    ROTATIONAL_DAMPING,
    through_lead=_quantity("motor torque per velocity", "N m s/m", "N m s/m", "mN m s/m", "N s"),
)
RATE_GAIN = _quantity("rate-to-current gain", "A s/rad", "A s/rad", "A s/deg", linear=VELOCITY_GAIN)
CURRENT_GAIN = _quantity("current-to-voltage gain", "V/A", "V/A", "mV/A")
CURRENT_INTEGRAL_GAIN = _quantity("integral current-to-voltage gain", "V/A/s", "V/A/s", "V/(A s)")
RATE_INTEGRAL_GAIN = _quantity(
    "integral rate-to-current gain", "A/rad", "A/rad", "A/deg", linear=VELOCITY_INTEGRAL_GAIN
)
INVERSE_TIME = _quantity("inverse time", "1/s", "1/s")
LENGTH = _quantity("length", "m", "m", "mm", "cm", "km", "ft")

Angle = Annotated[float, ANGLE]
MotorAngle = Annotated[float, MOTOR_ANGLE]
Phase = Annotated[float, PHASE]
Lead = Annotated[float, LEAD]
AngularRate = Annotated[float, ANGULAR_RATE]
AngularAcceleration = Annotated[float, ANGULAR_ACCELERATION]
Time = Annotated[float, TIME]
Frequency = Annotated[float, FREQUENCY]
Torque = Annotated[float, TORQUE]
TorqueRate = Annotated[float, TORQUE_RATE]
Current = Annotated[float, CURRENT]
Voltage = Annotated[float, VOLTAGE]
Resistance = Annotated[float, RESISTANCE]
Inductance = Annotated[float, INDUCTANCE]
Inertia = Annotated[float, INERTIA]
TorqueConstant = Annotated[float, TORQUE_CONSTANT]
BackEmfConstant = Annotated[float, BACK_EMF_CONSTANT]
RotationalStiffness = Annotated[float, ROTATIONAL_STIFFNESS]
RotationalDamping = Annotated[float, ROTATIONAL_DAMPING]
ObserverGain = Annotated[float, OBSERVER_GAIN]
RateGain = Annotated[float, RATE_GAIN]
CurrentGain = Annotated[float, CURRENT_GAIN]
CurrentIntegralGain = Annotated[float, CURRENT_INTEGRAL_GAIN]
RateIntegralGain = Annotated[float, RATE_INTEGRAL_GAIN]
InverseTime = Annotated[float, INVERSE_TIME]
Length = Annotated[float, LENGTH]
