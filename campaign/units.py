"""Text quantities to SI and back.

Inside the program every number is SI. Text such as ``"18 deg/s^2"`` becomes a float when a
protocol or a bench is validated, and becomes text in a reader's unit again on the page. Each
physical quantity names the units it accepts: pint alone would take ``1 Hz`` for ``1 rad/s`` and
``1 N m`` for ``1 J``, so a whitelist decides and pint only converts.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import GetCoreSchemaHandler, ValidationInfo
from pydantic_core import PydanticCustomError, core_schema

if TYPE_CHECKING:
    import pint


@dataclass(frozen=True)
class Quantity:
    """A physical quantity: its SI unit, the unit people read, and every unit it accepts.

    Used as pydantic metadata: ``inertia: Annotated[float, INERTIA]``. The field then takes text
    with a unit. A bare number is an error, except under the validation context
    ``{"si": True}`` with which normalised (already SI) trees are read back.
    """

    name: str
    si: str
    display: str
    accepts: tuple[str, ...]

    def parse(self, text: str) -> float:
        """SI value of `text`; ValueError with a message for the user when it has none."""
        number, unit = split_quantity(text)
        if not unit:
            raise ValueError(f"{text!r} has no unit; expected a {self.name} such as {self.example}")
        if not math.isfinite(number):
            raise ValueError(f"{text!r} is not a finite number")
        try:
            parsed = _unit(unit)
        except Exception:  # noqa: BLE001 - pint raises whatever its parser meets
            raise ValueError(f"{unit!r} is not a unit; {self._allowed()}") from None
        if parsed not in _accepted(self.accepts):
            raise ValueError(f"{unit!r} is not a unit of {self.name}; {self._allowed()}")
        return float(_registry().Quantity(number, parsed).to(self.si).magnitude)

    @property
    def example(self) -> str:
        """What a valid value looks like, quoted."""
        return f'"1 {self.display}"'

    def _allowed(self) -> str:
        return f"allowed are {', '.join(self.accepts)}"

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.with_info_before_validator_function(self._validate, handler(source))

    def _validate(self, value: Any, info: ValidationInfo) -> Any:
        if isinstance(value, str):
            try:
                return self.parse(value)
            except ValueError as error:
                raise PydanticCustomError("quantity", "{why}", {"why": str(error)}) from None
        already_si = isinstance(info.context, Mapping) and info.context.get("si")
        if isinstance(value, int | float) and not isinstance(value, bool) and not already_si:
            raise PydanticCustomError(
                "quantity",
                "{value} has no unit; write it as text, such as {example}",
                {"value": value, "example": f'"{value:g} {self.display}"'},
            )
        return value


_NUMBER = re.compile(
    r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf(?:inity)?))\s*(.*?)\s*\Z",
    re.I | re.S,
)


def split_quantity(text: str) -> tuple[float, str]:
    """Number and unit text of ``"0.05 deg/s"``; ValueError when it does not begin with a number."""
    if len(text) > 100:
        raise ValueError("a quantity is a number and a unit, not a text of over 100 characters")
    match = _NUMBER.match(text)
    if match is None:
        raise ValueError(f"{text!r} does not begin with a number")
    if match[2].startswith(","):
        raise ValueError(f"{text!r}: the decimal sign is a point, as in {text.replace(',', '.')!r}")
    return float(match[1]), match[2]


def convert(value: Any, unit: str, to: str) -> Any:
    """`value` (number or array) from `unit` to `to`; the same unit costs nothing."""
    if unit == to:
        return value
    return value * factor(unit, to)


def to_si(text: str) -> float:
    """SI value of `text` in any unit (`"18 deg/s^2"`), where no one field's whitelist applies.

    Raises ValueError when it is not a number with a known unit.
    """
    number, unit = split_quantity(text)
    registry = _registry()
    try:
        return float(registry.Quantity(number, _unit(unit)).to_base_units().magnitude)
    except Exception:  # noqa: BLE001 - pint raises whatever its parser meets
        raise ValueError(f"{unit!r} is not a unit") from None


@cache
def factor(unit: str, to: str) -> float:
    """How many `to` one `unit` is. Purely multiplicative units only."""
    return float(_registry().Quantity(1.0, _unit(unit)).to(_unit(to)).magnitude)


@cache
def _registry() -> pint.UnitRegistry[Any]:
    import pint

    return pint.UnitRegistry(cache_folder=None)


@cache
def _unit(text: str) -> Any:
    for symbol, spelled in (("°", "deg"), ("Ω", "ohm"), ("·", " "), ("²", "^2")):
        text = text.replace(symbol, spelled)
    return _registry().Unit(text)


@cache
def _accepted(units: tuple[str, ...]) -> frozenset[Any]:
    return frozenset(_unit(unit) for unit in units)


def _quantity(name: str, si: str, display: str, *others: str) -> Quantity:
    return Quantity(name, si, display, tuple(dict.fromkeys((display, si, *others))))


ANGLE = _quantity("angle", "rad", "deg", "mrad", "urad", "arcmin", "arcsec")
ANGULAR_RATE = _quantity("angular rate", "rad/s", "deg/s", "mrad/s", "deg/min", "deg/hour", "rpm")
ANGULAR_ACCELERATION = _quantity("angular acceleration", "rad/s^2", "deg/s^2", "mrad/s^2")
TIME = _quantity("time", "s", "s", "ms", "us", "min", "hour", "h")
FREQUENCY = _quantity("frequency", "Hz", "Hz", "mHz", "kHz", "MHz")
TORQUE = _quantity("torque", "N m", "N m", "mN m", "kN m")
TORQUE_RATE = _quantity("torque rate", "N m/s", "N m/s", "mN m/s")
CURRENT = _quantity("current", "A", "A", "mA")
VOLTAGE = _quantity("voltage", "V", "V", "mV")
RESISTANCE = _quantity("resistance", "ohm", "ohm", "mohm")
INDUCTANCE = _quantity("inductance", "H", "mH", "uH")
INERTIA = _quantity("moment of inertia", "kg m^2", "kg m^2", "g m^2", "g cm^2")
TORQUE_CONSTANT = _quantity("torque constant", "N m/A", "N m/A", "mN m/A")
BACK_EMF_CONSTANT = _quantity("back-EMF constant", "V s/rad", "V s/rad", "mV s/rad", "V/rpm")
ROTATIONAL_STIFFNESS = _quantity(
    "rotational stiffness", "N m/rad", "N m/rad", "kN m/rad", "N m/mrad", "N m/deg"
)
ROTATIONAL_DAMPING = _quantity(
    "rotational damping", "N m s/rad", "N m s/rad", "mN m s/rad", "N m s/deg"
)
RATE_GAIN = _quantity("rate-to-current gain", "A s/rad", "A s/rad", "A s/deg")
CURRENT_GAIN = _quantity("current-to-voltage gain", "V/A", "V/A", "mV/A")
CURRENT_INTEGRAL_GAIN = _quantity("integral current-to-voltage gain", "V/A/s", "V/A/s", "V/(A s)")
RATE_INTEGRAL_GAIN = _quantity("integral rate-to-current gain", "A/rad", "A/rad", "A/deg")
INVERSE_TIME = _quantity("inverse time", "1/s", "1/s")
LENGTH = _quantity("length", "m", "m", "mm", "cm", "km", "ft")

Angle = Annotated[float, ANGLE]
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
RateGain = Annotated[float, RATE_GAIN]
CurrentGain = Annotated[float, CURRENT_GAIN]
CurrentIntegralGain = Annotated[float, CURRENT_INTEGRAL_GAIN]
RateIntegralGain = Annotated[float, RATE_INTEGRAL_GAIN]
InverseTime = Annotated[float, INVERSE_TIME]
Length = Annotated[float, LENGTH]
