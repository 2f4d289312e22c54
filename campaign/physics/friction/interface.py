"""The interface of a friction model, for benches and the engine."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self, get_args, get_origin

from pydantic import Field, ModelWrapValidatorHandler, model_validator
from pydantic.fields import FieldInfo

from campaign.arrays import Array as Array
from campaign.axis_kind import axis_terms, current_sides
from campaign.options import Options
from campaign.physics.friction.unknowns import Sizes, Unknowns
from campaign.units import TORQUE, Phase, Quantity


class Ripple(Options):
    """Friction over position: every torque times 1 + amplitude sin(periods q + phase)."""

    amplitude: float = Field(default=0.0, ge=0, lt=1)
    """Share of the torque."""
    periods: float = Field(default=1.0, gt=0, le=10_000)
    """Periods of the load over 2 pi: a revolution of a rotary axis, 2 pi m of a linear one."""
    phase: Phase = 0.0
    """Phase at zero angle, of the load's angle times periods."""


class FrictionOptions(Options):
    """Options of every friction interface, for any model."""

    side: Literal["load", "motor"] = "load"
    """Side on which it acts: a motor-side torque counts N times at the load."""
    velocity: Literal["load", "motor"] = "load"
    """Relative rate that drives it: the load's, or the motor's (N times the load's)."""
    preloaded: bool = True
    """Whether the preload of the anti-backlash gear acts on this interface."""
    ripple: Ripple = Ripple()
    """Variation of the torque with the angle of the load."""

    @model_validator(mode="wrap")
    @classmethod
    def _of_its_side(cls, tree: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        """Units by side: a rotary motor with a linear load has different units."""
        sides = current_sides()
        if sides.load is sides.motor or not isinstance(tree, Mapping):
            return handler(tree)
        own, rate = (tree.get(name, "load") for name in ("side", "velocity"))
        with axis_terms(sides.at_motor if own == "motor" else sides):
            options = handler(tree)
        if own != rate:
            raise ValueError(
                f"side is '{own}' and velocity '{rate}': with gear.lead the two have different "
                "units, N m and m/s; write the same for both"
            )
        return options

    def at_load(self, ratio: float) -> tuple[float, float]:
        """Torque at the load per N m, for a gear `ratio`, and its rate per load rate.

        Rates are relative to the hull.
        """
        return (
            ratio if self.side == "motor" else 1.0,
            ratio if self.velocity == "motor" else 1.0,
        )


@dataclass(frozen=True)
class Presliding:
    """Friction of a stuck interface, linear in small motions: T = stiffness q + damping dq/dt.

    Attributes:
        stiffness: N m/rad at the interface.
        damping: N m s/rad at the interface, besides the viscous part.
    """

    stiffness: float
    damping: float


@dataclass(frozen=True)
class SmallSignal:
    """Response of a friction model to small motions, for the margins of a loop.

    It excludes the viscous part, `FrictionModel.viscous`.

    Attributes:
        stuck: as the friction of a bench at rest; None: it holds the load rigidly.
        stuck_compensation: as a compensation at rest, if the rate does not respond within the step;
            None: its torque jumps with the sign of the rate, which is not linear.
        sliding_damping: slope of the torque over the rate far above the Stribeck velocity
            (N m s/rad at the interface).
    """

    stuck: Presliding | None
    stuck_compensation: Presliding | None
    sliding_damping: float = 0.0

    @classmethod
    def of_bristles(cls, stiffness: float, damping: float = 0.0) -> SmallSignal:
        """Response of bristles, which is the same as friction and as a compensation."""
        bristles = Presliding(stiffness, damping)
        return cls(stuck=bristles, stuck_compensation=bristles)


def _always(options: Any) -> bool:
    return True


@dataclass(frozen=True)
class DryFriction:
    """Set-valued friction at rest: |T| <= `static_torque` if stuck, and `sliding` in motion.

    A step function cannot represent this: its input is the rate, and at rest the torque depends on
    the applied torques. In the plant, the engine solves all such models together
    (`campaign.physics.dry_step`); their step function is for prescribed motion.

    Attributes:
        sliding: torque against the motion (N m, 0 or more, without `FrictionModel.viscous`),
            compiled like a step function: `sliding(parameters, direction, speed)`, direction 1.0 or
            -1.0, speed in that direction (rad/s of the interface, 0 or more); see
            `campaign.physics.sliding_torque`.
        static_torque: largest torque (N m) before it slides in a direction (1.0 or -1.0), from
            validated options; no less than `sliding` at speed 0.
        jumps: whether a compensation with these options has the sign of the rate, zero at rest; the
            engine then solves the jump within its step. Else it uses the step function, as a
            sampled controller always does.
    """

    sliding: Callable[..., float]
    static_torque: Callable[[Any, float], float]
    jumps: Callable[[Any], bool] = _always


@dataclass(frozen=True)
class FrictionModel:
    """A friction model.

    Attributes:
        name: value of a bench's `model`.
        summary: one line for `campaign kinds`.
        options: its parameters; a subclass of FrictionOptions with `model: Literal[name]`.
        parameters: the flat parameters of its step function, from validated options.
        state_size: number of states of its step function, from validated options and the step (s)
            of its calls: the engine's, or the sample of a sampled controller.
        step: its step function, plain Python that is compiled when a trial needs it; see
            `campaign.physics.step_function`.
        viscous: the part linear in velocity (N m s/rad), which the engine integrates exactly.
        steady_state: friction torque (N m) at constant velocity (rad/s), shape (n,), viscous
            part included.
        changeable: its own options that scatter and preload can change; None for all its own
            options with a physical unit.
        stored_energy: energy of its state (J at the interface), from validated options and the
            state (s,) of its step function; NaN if it is unknown for these options; None: the model
            has no known storage function.
        step_for: a step function for these options that is faster than `step`; a different function
            of the module, because each is compiled separately. None: there is none.
        small_signal: its response to small motions, from validated options; None: not declared, and
            the loop of a bench with it is known only in sliding.
        dry: its behavior at rest, for a model without a state; None: the step function is complete.
        fastest: shortest time (s) that a step must resolve for its torque, from validated options,
            besides those of `small_signal`; None: none.
        no_compensation: why it cannot compensate, for the user; "" if it can.
        unknowns: parameters that motions identify, from the friction's sizes, by direction (True)
            or common to both. None: it is not identified.
        added: names of options that the equations of its source lack.
        switches: number of functions of rate, state and torque whose zero crossings change its
            equations, from validated options: the events of an integrator with a variable step.
            None: not stated.
    """

    name: str
    summary: str
    options: type[FrictionOptions]
    parameters: Callable[[Any], Array]
    state_size: Callable[[Any, float], int]
    step: Any
    viscous: Callable[[Any], float]
    steady_state: Callable[[Any, Array], Array]
    changeable: tuple[str, ...] | None = None
    small_signal: Callable[[Any], SmallSignal] | None = None
    stored_energy: Callable[[Any, Array], float] | None = None
    step_for: Callable[[Any], Callable[..., Any]] | None = None
    dry: DryFriction | None = None
    fastest: Callable[[Any], float] | None = None
    no_compensation: str = ""
    unknowns: Callable[[Sizes, bool], Unknowns] | None = None
    added: tuple[str, ...] = ()
    switches: Callable[[Any], int] | None = None

    def __post_init__(self) -> None:
        """Refuse a step function of the form before lanes."""
        form = list(inspect.signature(self.step).parameters)
        if len(form) != 3 or not callable(self.state_size):
            raise TypeError(
                f"the friction model {self.name!r} has a step function of ({', '.join(form)}) or a "
                "fixed state size, as before engine 2; see 'A friction model of before engine 2' "
                "in docs/developers/plug-ins.md"
            )
        if len(inspect.signature(self.state_size).parameters) != 2:
            raise TypeError(
                f"the state size of the friction model {self.name!r} must take options and step: "
                "write `state_size=lambda options, step: ...`"
            )

    def may_change(self) -> tuple[str, ...]:
        """Names of `changeable`, or its default."""
        if self.changeable is not None:
            return self.changeable
        return tuple(
            name
            for name, field in self.options.model_fields.items()
            if name not in FrictionOptions.model_fields and _quantity_of(field) is not None
        )

    def torques(self) -> tuple[str, ...]:
        """Those of `may_change` that are torques, which a preload can change."""
        fields = self.options.model_fields
        return tuple(
            name
            for name in self.may_change()
            if name in fields and _quantity_of(fields[name]) == TORQUE
        )


def _quantity_of(field: FieldInfo) -> Quantity | None:
    """Quantity of a field with one number, optional or not."""
    if isinstance(field.annotation, type) and issubclass(field.annotation, float):
        return next((m for m in field.metadata if isinstance(m, Quantity)), None)
    for member in get_args(field.annotation):  # `Torque | None`
        if get_origin(member) is Annotated and get_args(member)[0] is float:
            return next((m for m in get_args(member) if isinstance(m, Quantity)), None)
    return None
