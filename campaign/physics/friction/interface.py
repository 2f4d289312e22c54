"""The interface of a friction model, for benches and the engine."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self, get_args, get_origin

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ModelWrapValidatorHandler, model_validator
from pydantic.fields import FieldInfo

from campaign.axis_kind import axis_terms, current_sides
from campaign.options import Options
from campaign.physics.friction.unknowns import Sizes, Unknowns
from campaign.units import TORQUE, Phase, Quantity

Array = NDArray[np.float64]


class Ripple(Options):
    """Friction over position: every torque times 1 + amplitude sin(periods q + phase)."""

    amplitude: float = Field(default=0.0, ge=0, lt=1)
    """Share of the torque."""
    periods: float = Field(default=1.0, gt=0, le=10_000)
    """Periods of the load over 2 pi: a revolution of a rotary axis, 2 pi m of a linear one."""
    phase: Phase = 0.0
    """Phase at zero angle, of the load's angle times periods."""


class FrictionOptions(Options):
    """What every friction interface has, whatever its model."""

    side: Literal["load", "motor"] = "load"
    """Where it acts: a motor-side torque counts N times at the load."""
    velocity: Literal["load", "motor"] = "load"
    """Which relative rate drives it: the load's, or the motor's (N times the load's)."""
    preloaded: bool = True
    """Whether the preload of the anti-backlash gear acts on this interface."""
    ripple: Ripple = Ripple()
    """How the torque varies with the angle of the load."""

    @model_validator(mode="wrap")
    @classmethod
    def _of_its_side(cls, tree: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        """Between a rotary motor and a linear load, each side has units of its own."""
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
        """What one N m of it counts at the load behind a gear `ratio`, and its rate per load rate.

        The rates are relative to the hull.
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
    """How a friction model answers small motions: what the margins of a loop are computed from.

    The viscous part, `FrictionModel.viscous`, comes on top of everything here.

    Attributes:
        stuck: as the friction of a bench at rest; None: it holds the load rigidly.
        stuck_compensation: as a compensation at rest, where the rate does not answer within the
            step; None: its torque jumps with the sign of the rate, which is nothing linear.
        sliding_damping: slope of the torque over the rate far above the Stribeck velocity
            (N m s/rad at the interface).
    """

    stuck: Presliding | None
    stuck_compensation: Presliding | None
    sliding_damping: float = 0.0


def _always(options: Any) -> bool:
    return True


@dataclass(frozen=True)
class DryFriction:
    """Friction that is a set at rest: |T| <= `static_torque` when stuck, and `sliding` in motion.

    A step function can not say that: it is told the rate, and at rest the torque follows from all
    that acts. As a plant's friction such models are solved together, by the engine
    (`campaign.physics.dry_step`); their step function is for prescribed motion.

    Attributes:
        sliding: torque against the motion (N m, 0 or more, `FrictionModel.viscous` apart), compiled
            as a step function is: `sliding(parameters, direction, speed)`, direction 1.0 or -1.0,
            speed in that direction (rad/s of the interface, 0 or more); see
            `campaign.physics.sliding_torque`.
        static_torque: the most (N m) that it holds before it slides in a direction (1.0 or -1.0),
            from validated options; no less than `sliding` at speed 0.
        jumps: whether a compensation with these options has the sign of the rate, zero at rest; the
            engine then meets the jump inside its step. Else its step function says what it does, as
            it does for a sampled controller.
    """

    sliding: Callable[..., float]
    static_torque: Callable[[Any, float], float]
    jumps: Callable[[Any], bool] = _always


@dataclass(frozen=True)
class FrictionModel:
    """A friction model.

    Attributes:
        name: what a bench's `model` says.
        summary: one line for `campaign kinds`.
        options: its parameters; a subclass of FrictionOptions with `model: Literal[name]`.
        parameters: the flat parameters its step function reads, from validated options.
        state_size: how many numbers its step function keeps, from validated options and the step
            (s) that it is asked over: the engine's, or the sample of a sampled controller.
        step: its step function, plain Python that is compiled when a trial needs it; see
            `campaign.physics.step_function`.
        viscous: the part linear in velocity (N m s/rad), which the engine integrates exactly.
        steady_state: friction torque (N m) at constant velocity (rad/s), shape (n,), viscous
            part included.
        changeable: the options of its own that scatter and preload may change; None for every
            option of its own with a physical unit.
        stored_energy: what its state stores (J at the interface), from validated options and the
            state (s,) of its step function; NaN where that is not known for these options; None: no
            storage function of the model is known.
        step_for: a step function that does for these options and is faster than `step`, one of the
            module's own (each function is compiled for itself); None: there is none.
        small_signal: its answer to small motions, from validated options; None: not declared, and
            the loop of a bench with it is known only while it slides.
        dry: what it is at rest, of a model without a state; None: its step function says all.
        fastest: the shortest time (s) that a step must resolve for its torque, from validated
            options, besides what `small_signal` says; None: none.
        no_compensation: why it cannot compensate, for a reader; "" where it can.
        unknowns: the parameters that motions identify, from the friction's sizes, for each
            direction (True) or both alike. None: it is not identified.
        added: names of options that the equations of its source do not have.
        switches: how many functions of rate, state and torque change its equations where they pass
            zero, from validated options: the events of an integrator with a variable step. None: it
            is not stated.
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
        """Refuse a step function of the form that it had before lanes."""
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
        """`changeable`, or what stands for it."""
        if self.changeable is not None:
            return self.changeable
        return tuple(
            name
            for name, field in self.options.model_fields.items()
            if name not in FrictionOptions.model_fields and _quantity_of(field) is not None
        )

    def torques(self) -> tuple[str, ...]:
        """Those of `may_change` that are torques: what a preload can raise."""
        fields = self.options.model_fields
        return tuple(
            name
            for name in self.may_change()
            if name in fields and _quantity_of(fields[name]) == TORQUE
        )


def _quantity_of(field: FieldInfo) -> Quantity | None:
    """The quantity of a field that is one number, optional or not."""
    if isinstance(field.annotation, type) and issubclass(field.annotation, float):
        return next((m for m in field.metadata if isinstance(m, Quantity)), None)
    for member in get_args(field.annotation):  # `Torque | None`
        if get_origin(member) is Annotated and get_args(member)[0] is float:
            return next((m for m in get_args(member) if isinstance(m, Quantity)), None)
    return None
