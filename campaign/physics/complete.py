"""Completeness of a bench for simulation, and its missing values.

A bench is facts: whoever analyses recordings writes what is known. The equations of motion need
more, and here is the one place that says what, and what each is for.
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
"""What a simulation needs of a bench, by dotted path, and what for."""


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
    """A bench that can be simulated; `complete` makes it of one that has all of that."""

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
    """A bench lacks what something needs; the message is for the user.

    Attributes:
        paths: of the fields, dotted.
    """

    def __init__(self, message: str, paths: Iterable[str] = ()) -> None:
        super().__init__(message)  # alone, so that it can be handed on to another process
        self.paths = tuple(paths)

    @classmethod
    def of(cls, bench: Bench, paths: Sequence[str], who: str) -> IncompleteBenchError:
        """What `who` needs and the bench does not say at `paths`, with what each is for."""
        what = "; ".join(
            f"{path} ({PURPOSES[path]})" if path in PURPOSES else path for path in paths
        )
        return cls(f"{who} needs what the bench {bench.name!r} does not say: {what}", paths)


def lacking(bench: Bench, paths: Sequence[str] = tuple(PURPOSES)) -> tuple[str, ...]:
    """Those of `paths` at which the bench says nothing; of all that a simulation needs."""
    return tuple(path for path in paths if _at(bench, path) is None)


def require(bench: Bench, paths: Sequence[str], who: str) -> None:
    """Raise IncompleteBenchError, which names every one of `paths` that the bench lacks.

    who: what needs it, e.g. "a rate command's plan".
    """
    if paths := lacking(bench, paths):
        raise IncompleteBenchError.of(bench, paths, who)


def inertia_of(bench: Bench, who: str) -> float:
    """J (kg m^2). Raises IncompleteBenchError where nobody says it."""
    if bench.axis.inertia is None:
        raise IncompleteBenchError.of(bench, ("axis.inertia",), who)
    return bench.axis.inertia


def control_rate(bench: Bench) -> float | None:
    """Of its sampled controller (Hz); None where it is continuous, or nobody says."""
    return None if bench.controller is None else bench.controller.sample_rate


def pointing_high_pass(bench: Bench) -> float:
    """Corner (Hz) of the high-pass that its pointing error is seen through; 0 without one."""
    return 0.0 if bench.controller is None else bench.controller.pointing_high_pass


def limits_of(bench: Bench, who: str = "whatever moves") -> LimitsOptions:
    """Its limits. Raises IncompleteBenchError where it has none."""
    if bench.limits is None:
        raise IncompleteBenchError.of(bench, ("limits",), who)
    return bench.limits


def complete(bench: Bench, who: str = "a simulation") -> CompleteBench:
    """The same bench as one that can be simulated.

    Raises IncompleteBenchError naming every field that it lacks.
    """
    if isinstance(bench, CompleteBench):
        return bench
    require(bench, tuple(PURPOSES), who)
    # Its parts are validated; only their types become narrower.
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
    """A table as its narrower type; the caller knows that it has all of it."""
    given: dict[str, Any] = {} if options is None else dict(options)
    narrowed = kind.model_construct(options.model_fields_set if options else None, **given)
    return cast("_Narrow", narrowed)


def _at(bench: Bench, path: str) -> Any:
    """What stands at a dotted path; None where nothing does."""
    found: Any = bench
    for name in path.split("."):
        found = getattr(found, name, None)
    return found
