"""Friction models prepared for the engine, of one trial and of several."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from campaign.arrays import Array
from campaign.physics.blocks import Dry, Elements, by_lane, zeros
from campaign.physics.complete import CompleteBench
from campaign.physics.equal_interfaces import alike, side_by_side
from campaign.physics.friction import model_of
from campaign.physics.friction.interface import DryFriction, FrictionOptions
from campaign.physics.loop import viscous_at_load
from campaign.physics.rows import (
    ANSWERS,
    ASKED,
    DRY,
    DRY_DIRECTION,
    HAS,
    KEEPS,
    LIMITS,
    MEETS,
    MEETS_PER_STEP,
    MEETS_RIPPLE,
    MEETS_STEP,
)
from campaign.physics.sliding_torque import address_of_sliding, single_sliding
from campaign.physics.step_function import (
    AN_INSTANT,
    ROOM_TEMPERATURE,
    Motion,
    address_of,
    single_step,
)


@dataclass(frozen=True)
class DryInterface:
    """Additional data of an interface if the engine solves for its friction; see `DryFriction`.

    Attributes:
        options, parameters: of the model.
        torque: torque at the load per N m of the interface (N m).
    """

    dry: DryFriction
    options: Any
    parameters: Array
    torque: float

    @property
    def sliding(self) -> Callable[..., float]:
        return self.dry.sliding

    @cached_property
    def limits(self) -> tuple[float, float, float, float]:
        """Holding torques (N m at the load), forwards and backwards, and those of the slowest
        sliding; this loads the compiled sliding function.
        """
        signs = (1.0, -1.0)
        holds = [self.torque * self.dry.static_torque(self.options, sign) for sign in signs]
        starts = [
            self.torque * single_sliding(self.sliding, self.parameters, sign, 0.0) for sign in signs
        ]
        return holds[0], holds[1], starts[0], starts[1]


@dataclass(frozen=True)
class Interface:
    """One friction model of one trial, as plant or compensation."""

    step: Callable[..., Any]
    parameters: Array
    state_size: int
    torque: float
    rate: float
    viscous: float
    motor_side: bool
    ripple: tuple[float, float, float]
    dry: DryInterface | None

    @classmethod
    def of(
        cls, options: FrictionOptions, gain: float, bench: CompleteBench, solved: bool, step: float
    ) -> Interface:
        """Prepare a model. `solved`: the engine solves it if it is dry; else by its step function.

        step: s, of its step function.
        """
        model = model_of(options)
        torque, rate = bench.at_load(options)
        ripple = options.ripple
        parameters = np.asarray(model.parameters(options), dtype=float)
        dry = None
        if solved and model.dry is not None:
            dry = DryInterface(model.dry, options, parameters, torque * gain)
        return cls(
            step=model.step if model.step_for is None else model.step_for(options),
            parameters=parameters,
            state_size=model.state_size(options, step),
            torque=torque * gain,
            rate=rate,
            viscous=gain * viscous_at_load(options, bench),
            motor_side=options.side == "motor",
            ripple=(ripple.amplitude, ripple.periods, ripple.phase),
            dry=dry,
        )

    def address(self, lanes: int, members: int) -> int:
        """Address of its step function, compiled for `lanes` lanes of `members` such interfaces."""
        return address_of(self.step, lanes, members, len(self.parameters), self.state_size)

    @property
    def model(self) -> tuple[Hashable, ...]:
        """Key of its compiled functions."""
        dry = None if self.dry is None else self.dry.sliding
        return self.step, dry, len(self.parameters), self.state_size

    @property
    def structure(self) -> Hashable:
        return *self.model, self.motor_side, self.ripple[0] != 0.0


def torque_at(interface: Interface, rate: float, angle: float) -> float:
    """Torque at the load (N m) at the start of a trial, for relative rate (rad/s), angle (rad)."""
    amplitude, periods, phase = interface.ripple
    motion = Motion.at(rate * interface.rate, rate * interface.rate, AN_INSTANT, position=angle)
    state = np.zeros(interface.state_size)
    mean, _ = single_step(interface.step, interface.parameters, state, motion)
    return mean * interface.torque * (1.0 + amplitude * math.sin(periods * angle + phase))


def plant_elements(
    interfaces: Sequence[Sequence[Interface]], steps: Sequence[float], rates: Sequence[float]
) -> Elements:
    """Friction of the bench. `interfaces`: of each lane, in one order.

    steps: of each lane (s).   rates: relative rates at the start of the trials (rad/s).
    """
    return _elements(interfaces, steps, rates, in_plant=True, reads_sensors=False)


def compensation_elements(
    interfaces: Sequence[Sequence[Interface]], steps: Sequence[float], *, reads_sensors: bool
) -> Elements:
    """Friction models of compensation. A sampled controller sets the steps of its models."""
    rates = [0.0] * len(steps)
    return _elements(interfaces, steps, rates, in_plant=False, reads_sensors=reads_sensors)


def _elements(
    interfaces: Sequence[Sequence[Interface]],
    steps: Sequence[float],
    rates: Sequence[float],
    *,
    in_plant: bool,
    reads_sensors: bool,
) -> Elements:
    asked = [[each for each in own if each.dry is None] for own in interfaces]
    dry = [[each for each in own if each.dry is not None] for own in interfaces]
    both = [[*own, *more] for own, more in zip(asked, dry, strict=True)]
    first, width = asked[0], len(interfaces)
    states = max((each.state_size for each in first), default=0)
    met = zeros(2, MEETS, width)
    met[:, MEETS_STEP], met[:, MEETS_PER_STEP] = steps, 1.0 / np.asarray(steps)
    met[:, MEETS_RIPPLE] = 1.0
    # A model without a state gets the torque that previous ones leave: it needs a separate call.
    yields = [in_plant and each.state_size == 0 for each in first]
    sides = [each.motor_side and reads_sensors for each in both[0]]
    alone = [one or each.ripple[0] != 0.0 for one, each in zip(yields, first, strict=True)]
    kinds = [(*each.model, side) for each, side in zip(first, sides, strict=False)]
    groups = alike(kinds, alone)
    heads = [group.start for group in groups]
    fixed = side_by_side(_fixed(asked, in_plant=in_plant), groups)
    kept = side_by_side(zeros(len(first), KEEPS + states, width), groups)
    sizes = [group.stop - group.start for group in groups]
    addresses = [first[head].address(width, size) for head, size in zip(heads, sizes, strict=True)]
    answer = zeros(ANSWERS, width)
    return Elements(
        address=np.array(addresses, dtype=np.uintp),
        fixed=fixed,
        fixed_at=_addresses(fixed)[heads],
        kept=kept,
        kept_at=_addresses(kept)[heads],
        met=met,
        met_at=_addresses(met),
        answer=answer,
        answer_at=answer.ctypes.data,
        viscous=by_lane([[each.viscous for each in own] for own in both]),
        motor_side=np.array([sides[head] for head in heads], dtype=np.int64),
        side=np.array(sides, dtype=np.int64),
        rippled=_rippled([first[head] for head in heads]),
        ripple=_ripples([[own[head] for head in heads] for own in asked]),
        dry=_dry(dry, rates),
    )


def _dry(interfaces: Sequence[Sequence[Interface]], rates: Sequence[float]) -> Dry:
    first, width = interfaces[0], len(interfaces)
    fixed, wave = _fixed(interfaces, in_plant=True), zeros(len(first), 1, width)
    asked, answer, state = zeros(ASKED, width), zeros(1, width), zeros(DRY, width)
    wave[:] = 1.0
    state[DRY_DIRECTION] = np.sign(rates)
    limits = [[each.dry.limits for each in own if each.dry is not None] for own in interfaces]
    return Dry(
        address=np.array(
            [
                address_of_sliding(each.dry.sliding, width, len(each.parameters))
                for each in first
                if each.dry is not None
            ],
            dtype=np.uintp,
        ),
        fixed=fixed,
        fixed_at=_addresses(fixed),
        limits=by_lane([np.reshape(own, (len(first), LIMITS)) for own in limits]),
        rippled=_rippled(first),
        ripple=_ripples(interfaces),
        wave=wave,
        wave_at=_addresses(wave),
        asked=asked,
        asked_at=asked.ctypes.data,
        answer=answer,
        answer_at=answer.ctypes.data,
        state=state,
        numbers=state,
    )


def _fixed(interfaces: Sequence[Sequence[Interface]], *, in_plant: bool) -> Array:
    """Constants of each interface, shape (interfaces, HAS + parameters, lanes)."""
    first = interfaces[0]
    most = max((len(each.parameters) for each in first), default=0)
    fixed = zeros(len(first), HAS + most, len(interfaces))
    for k, own in enumerate(interfaces):
        for e, each in enumerate(own):
            fixed[e, :HAS, k] = (
                each.rate,
                each.torque,
                1.0 / each.torque if each.torque else 0.0,
                each.state_size > 0 or not in_plant,
                ROOM_TEMPERATURE,
                1.0,
            )
            fixed[e, HAS : HAS + len(each.parameters), k] = each.parameters
    return fixed


def _rippled(interfaces: Sequence[Interface]) -> NDArray[np.int64]:
    return np.array([each.ripple[0] != 0.0 for each in interfaces], dtype=np.int64)


def _ripples(interfaces: Sequence[Sequence[Interface]]) -> Array:
    return by_lane([np.reshape([each.ripple for each in own], (len(own), 3)) for own in interfaces])


def _addresses(rows: Array) -> NDArray[np.uintp]:
    """Memory address of the rows of each element, shape (elements,)."""
    return rows.ctypes.data + np.arange(len(rows), dtype=np.uintp) * np.uintp(rows.strides[0])
