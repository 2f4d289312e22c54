"""Completeness of a bench for simulation, and its missing values.

A bench states facts: for an analysis of recordings, the known values are enough. The equations of
motion need more values; this module lists them and their purposes.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, TypeVar, cast

from pydantic import Field

from campaign.options import Options
from campaign.physics.bench import (
    AxisOptions,
    Bench,
    ControllerOptions,
    CurrentController,
    LimitsOptions,
    MotorOptions,
    RateController,
)
from campaign.physics.gear import GearOptions
from campaign.units import BackEmfConstant, Inductance, Inertia, Resistance

_Narrow = TypeVar("_Narrow", bound=Options)

PURPOSES = {
    "axis.inertia": "what the torque accelerates",
    "motor.torque_constant": "the torque per ampere",
    "motor.back_emf_constant": "the voltage that motion takes from the current loop",
    "motor.resistance": "the current that a voltage drives",
    "motor.inductance": "how fast the current follows",
    "controller.rate": "the rate loop",
    "controller.current": "the current loop",
    "limits": "what must never be exceeded while it moves",
}
"""Purpose of each value that a simulation needs, by its dotted path in the bench."""


class CompleteAxis(AxisOptions):
    """An axis whose inertia is known."""

    inertia: Inertia = Field(gt=0)


class CompleteMotor(MotorOptions):
    """A motor whose winding is known."""

    back_emf_constant: BackEmfConstant = Field(ge=0)
    resistance: Resistance = Field(gt=0)
    inductance: Inductance = Field(gt=0)


class CompleteController(ControllerOptions):
    """Loops whose gains are known."""

    rate: RateController
    current: CurrentController


class CompleteBench(Bench):
    """A bench that can be simulated; `complete` makes it from a bench with all values."""

    axis: CompleteAxis
    motor: CompleteMotor
    gear: GearOptions
    controller: CompleteController
    limits: LimitsOptions

    @property
    def torque_per_current(self) -> float:
        """N Kt: torque at the load per ampere (N m/A)."""
        return self.gear.ratio * self.motor.torque_constant


class IncompleteBenchError(ValueError):
    """A bench lacks a necessary value; the message is for the user.

    Attributes:
        paths: dotted paths of the missing fields.
    """

    def __init__(self, message: str, paths: Iterable[str] = ()) -> None:
        super().__init__(message)  # message only: another process has to unpickle it
        self.paths = tuple(paths)

    @classmethod
    def of(cls, bench: Bench, paths: Sequence[str], who: str) -> IncompleteBenchError:
        """Error for `who`, which needs the values missing at `paths`; with their purposes."""
        what = "; ".join(
            f"{path} ({PURPOSES[path]})" if path in PURPOSES else path for path in paths
        )
        return cls(f"{who} needs what the bench {bench.name!r} does not say: {what}", paths)


def lacking(bench: Bench, paths: Sequence[str] = tuple(PURPOSES)) -> tuple[str, ...]:
    """Those of `paths` that the bench lacks; by default of all that a simulation needs."""
    return tuple(path for path in paths if _at(bench, path) is None)


def require(bench: Bench, paths: Sequence[str], who: str) -> None:
    """Raise IncompleteBenchError if the bench lacks any of `paths`; it names all of them.

    who: what needs the values, e.g. "a rate command's plan".
    """
    if paths := lacking(bench, paths):
        raise IncompleteBenchError.of(bench, paths, who)


def inertia_of(bench: Bench, who: str) -> float:
    """Inertia J (kg m^2). Raises IncompleteBenchError if the bench lacks it."""
    if bench.axis.inertia is None:
        raise IncompleteBenchError.of(bench, ("axis.inertia",), who)
    return bench.axis.inertia


def control_rate(bench: Bench) -> float | None:
    """Sample rate of the controller (Hz); None if it is continuous or unknown."""
    return None if bench.controller is None else bench.controller.sample_rate


def pointing_high_pass(bench: Bench) -> float:
    """Corner frequency (Hz) of the high-pass of the pointing error; 0 without one."""
    return 0.0 if bench.controller is None else bench.controller.pointing_high_pass


def limits_of(bench: Bench, who: str = "whatever moves") -> LimitsOptions:
    """Limits of the bench. Raises IncompleteBenchError if it has none."""
    if bench.limits is None:
        raise IncompleteBenchError.of(bench, ("limits",), who)
    return bench.limits


def complete(bench: Bench, who: str = "a simulation") -> CompleteBench:
    """The bench as a CompleteBench, for simulation.

    Raises IncompleteBenchError, which names every missing field.
    """
    if isinstance(bench, CompleteBench):
        return bench
    require(bench, tuple(PURPOSES), who)
    # The parts are already validated; only their types become narrower.
    return CompleteBench.model_construct(
        bench.model_fields_set,
        **{
            **dict(bench),
            "axis": _narrowed(CompleteAxis, bench.axis),
            "motor": _narrowed(CompleteMotor, bench.motor),
            "gear": bench.gear or GearOptions(ratio=1.0),
            "controller": _narrowed(CompleteController, bench.controller),
        },
    )


def _narrowed(kind: type[_Narrow], options: Options | None) -> _Narrow:
    """A table as its narrower type; the caller ensures that no value is missing."""
    given: dict[str, Any] = {} if options is None else dict(options)
    narrowed = kind.model_construct(options.model_fields_set if options else None, **given)
    return cast("_Narrow", narrowed)


def _at(bench: Bench, path: str) -> Any:
    """Value at a dotted path; None without one."""
    value: Any = bench
    for name in path.split("."):
        value = getattr(value, name, None)
    return value
