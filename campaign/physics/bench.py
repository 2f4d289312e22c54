"""The bench: the platform under test, validated from `benches/*.toml`.

Symbols are those of the thesis (Figure 5.3, Table 5.1, appendix); all numbers are SI after
validation.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import (
    Field,
    ModelWrapValidatorHandler,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    field_serializer,
    field_validator,
    model_validator,
)

from campaign.axis_kind import AxisKind, Sides, axis_terms, sides_in
from campaign.options import LaterOptions, Options, is_archived
from campaign.physics.bench_knowledge import KnownOptions, known_in_si
from campaign.physics.bench_paths import wrong_paths
from campaign.physics.compensation import CompensationField
from campaign.physics.friction import FrictionField
from campaign.physics.friction.interface import FrictionOptions
from campaign.physics.friction_paths import invalid
from campaign.physics.gear import GearOptions
from campaign.physics.preload import loading, with_preload
from campaign.physics.scatter import VariationOptions, acting
from campaign.physics.sensors import SensorsOptions
from campaign.units import (
    Angle,
    AngularAcceleration,
    AngularRate,
    BackEmfConstant,
    Current,
    CurrentGain,
    CurrentIntegralGain,
    Frequency,
    Inductance,
    Inertia,
    InverseTime,
    RateGain,
    RateIntegralGain,
    Resistance,
    Time,
    Torque,
    TorqueConstant,
)


class AxisOptions(LaterOptions):
    """The stabilized axis."""

    later = frozenset({"kind"})

    name: str
    """Axis of the platform, e.g. azimuth."""
    kind: Literal["rotary", "linear"] = "rotary"
    """Type of motion. On a linear axis every angle is a position, every torque a force."""
    inertia: Inertia | None = Field(default=None, gt=0)
    """J: inertia of motor, transmission and load, seen at the load."""


class MotorOptions(Options):
    """The servo motor."""

    torque_constant: TorqueConstant = Field(gt=0)
    """Kt: motor torque per ampere."""
    back_emf_constant: BackEmfConstant | None = Field(default=None, ge=0)
    """Ke: voltage per rate of the motor shaft relative to the hull."""
    resistance: Resistance | None = Field(default=None, gt=0)
    """R: armature resistance."""
    inductance: Inductance | None = Field(default=None, gt=0)
    """L: armature inductance."""


class IdealRateController(Options):
    """PI of the rate loop in ideal form: i = Kp (e + Ki * integral of e)."""

    form: Literal["ideal"]
    """ideal: the proportional gain multiplies the integral gain."""
    proportional: RateGain = Field(gt=0)
    """Kpv: current per rate error."""
    integral: InverseTime = Field(ge=0)
    """Kiv: reciprocal of the integral time."""

    @property
    def integral_gain(self) -> float:
        """Current per integrated rate error (A/rad)."""
        return self.proportional * self.integral


class ParallelRateController(Options):
    """PI of the rate loop in parallel form: i = Kp e + Ki * integral of e."""

    form: Literal["parallel"]
    """parallel: both gains are independent."""
    proportional: RateGain = Field(gt=0)
    """Kpv: current per rate error."""
    integral: RateIntegralGain = Field(ge=0)
    """Kiv: current per integrated rate error."""

    @property
    def integral_gain(self) -> float:
        """Current per integrated rate error (A/rad)."""
        return self.integral


class IdealCurrentController(Options):
    """PI of the current loop in ideal form: V = Kp (e + Ki * integral of e)."""

    form: Literal["ideal"]
    """ideal: the proportional gain multiplies the integral gain."""
    proportional: CurrentGain = Field(gt=0)
    """Kpc: voltage per current error."""
    integral: InverseTime = Field(ge=0)
    """Kic: reciprocal of the integral time."""

    @property
    def integral_gain(self) -> float:
        """Voltage per integrated current error (V/(A s))."""
        return self.proportional * self.integral


class ParallelCurrentController(Options):
    """PI of the current loop in parallel form: V = Kp e + Ki * integral of e."""

    form: Literal["parallel"]
    """parallel: both gains are independent."""
    proportional: CurrentGain = Field(gt=0)
    """Kpc: voltage per current error."""
    integral: CurrentIntegralGain = Field(ge=0)
    """Kic: voltage per integrated current error."""

    @property
    def integral_gain(self) -> float:
        """Voltage per integrated current error (V/(A s))."""
        return self.integral


RateController = Annotated[
    IdealRateController | ParallelRateController, Field(discriminator="form")
]
CurrentController = Annotated[
    IdealCurrentController | ParallelCurrentController, Field(discriminator="form")
]


class ControllerOptions(LaterOptions):
    """The nested loops: rate outside, current inside (Figure 5.3)."""

    later = frozenset({"rate_feedback"})

    rate: RateController | None = None
    """The rate (velocity) PI, fed by the gyro."""
    current: CurrentController | None = None
    """The current PI. It stays continuous when the rate loop is sampled."""
    sample_rate: Frequency | None = Field(default=None, gt=0, le=1e5)
    """Sample rate of the rate loop and the compensation; absent: they are continuous."""
    delay: Time = Field(default=0.0, ge=0, le=1.0)
    """Delay from a sample to its current command."""
    relative_rate_filter: Time = Field(default=0.0, ge=0)
    """Time constant of the first-order low-pass of the relative rate for compensation."""
    rate_feedback: Literal["gyro", "encoder"] = "gyro"
    """Feedback of the rate loop: the gyro, or the relative rate from the encoder."""
    pointing_high_pass: Frequency = Field(default=0.0, ge=0)
    """Corner of the first-order high-pass of the pointing error; 0 for none."""

    @field_validator("rate_feedback")
    @classmethod
    def _of_samples(cls, feedback: str, info: ValidationInfo) -> str:
        if feedback == "encoder" and info.data.get("sample_rate", 0.0) is None:
            raise ValueError("'encoder' needs controller.sample_rate: its angle is differenced")
        return feedback

    @field_validator("delay")
    @classmethod
    def _delay_of_samples(cls, delay: float, info: ValidationInfo) -> float:
        """A continuous loop has no samples; it would silently ignore a delay."""
        if delay > 0 and info.data.get("sample_rate", delay) is None:
            raise ValueError("'delay' needs controller.sample_rate: a continuous loop has none")
        return delay


class AppendageOptions(Options):
    """An elastic part of the load: an inertia on a spring, seen by the gyro only through the load.

    It puts an antiresonance at its own frequency and a resonance just above into the open loop.
    """

    inertia: Inertia = Field(gt=0)
    """Its inertia, a part of the axis' inertia."""
    frequency: Frequency = Field(gt=0)
    """Its natural frequency with the load at rest."""
    damping_ratio: float = Field(ge=0, le=2)
    """Its damping ratio with the load at rest."""


UNLIMITED = "unlimited"
"""Angle limit of an endless axis."""


class LimitsOptions(Options):
    """Limits of the axis, checked before any motion.

    All but acceleration and duration are also monitored during a trial.
    """

    angle: Angle = Field(gt=0)
    """Largest angle of the load relative to the hull, in both directions from zero; "unlimited" for
    an endless axis."""
    rate: AngularRate = Field(gt=0)
    """Largest rate of the load relative to the hull."""
    rate_time: Time = Field(default=0.01, gt=0, le=1.0)
    """Averaging time of the measured rate for its limit. It is shorter if the axis could travel
    further than 2 % of the angle limit."""
    acceleration: AngularAcceleration = Field(gt=0)
    """Largest commanded acceleration, of the load or of the hull."""
    torque: Torque = Field(gt=0)
    """Largest drive torque at the load."""
    current: Current = Field(gt=0)
    """Largest motor current."""
    duration: Time = Field(gt=0)
    """Longest single trial."""

    @field_validator("angle", mode="wrap")
    @classmethod
    def _endless(cls, value: Any, parse: ValidatorFunctionWrapHandler) -> float:
        return math.inf if value == UNLIMITED else float(parse(value))

    @field_serializer("angle", when_used="json")
    def _in_words(self, angle: float) -> float | str:
        """Infinity as text, because JSON has none."""
        return UNLIMITED if math.isinf(angle) else angle


class Bench(Options):
    """A platform under test; values may be unknown. `complete` names what a simulation needs."""

    name: str
    """Its name, in the archive and the report."""
    description: str = ""
    """Description, and source of its numbers."""
    known: KnownOptions = KnownOptions()
    """Uncertainties of its values, and the published cells that it is based on."""
    axis: AxisOptions
    """The stabilized axis."""
    appendage: AppendageOptions | None = None
    """An elastic part of the load; absent: it is rigid."""
    motor: MotorOptions | None = None
    """The servo motor."""
    gear: GearOptions | None = None
    """The gear; absent: the motor drives the load directly."""
    friction: dict[str, FrictionField] = Field(default={}, max_length=8)
    """The true friction, by interface (`load`, `motor` ...); `friction = {}` where unknown."""
    variation: VariationOptions | None = None
    """Scatter of the friction of a simulated bench; absent: none."""
    controller: ControllerOptions | None = None
    """The loops."""
    sensors: SensorsOptions = SensorsOptions()
    """The sensors."""
    compensation: dict[str, CompensationField] = {}
    """Compensation methods tuned for this bench, by the name that a test uses."""
    limits: LimitsOptions | None = None
    """The limits; without them no motion is allowed."""

    @model_validator(mode="before")
    @classmethod
    def _name_methods(cls, tree: Any) -> Any:
        """Default method: `[compensation.observer]` needs no `method = "observer"`."""
        if not isinstance(tree, dict) or not isinstance(tree.get("compensation"), dict):
            return tree
        named = {
            name: {"method": name, **entry} if isinstance(entry, dict) else entry
            for name, entry in tree["compensation"].items()
        }
        return {**tree, "compensation": named}

    @model_validator(mode="before")
    @classmethod
    def _known_in_one_place(cls, tree: Any, info: ValidationInfo) -> Any:
        """The first archives of format 3 have `given` and `fitted` beside `known`."""
        if not is_archived(info) or not isinstance(tree, Mapping):
            return tree
        beside = {name: tree[name] for name in ("given", "fitted") if name in tree}
        rest = {name: value for name, value in tree.items() if name not in beside}
        return {"known": beside, **rest} if beside else tree

    @field_validator("sensors")
    @classmethod
    def _sensors_are_sampled(cls, sensors: SensorsOptions, info: ValidationInfo) -> SensorsOptions:
        """A continuous controller has ideal sensors; it must not silently ignore a flaw."""
        controller = info.data.get("controller")
        if controller is None or controller.sample_rate is not None:
            return sensors
        if controller.rate is None or controller.current is None:
            return sensors  # the controller is incomplete, and not stated to be continuous
        flaws = [
            f"{sensor}.{name}"
            for sensor in SensorsOptions.model_fields
            for name, value in getattr(sensors, sensor)
            if value > 0
        ]
        if flaws:
            raise ValueError(
                f"{', '.join(map(repr, flaws))} needs controller.sample_rate: a continuous "
                "controller sees everything exactly"
            )
        return sensors

    @model_validator(mode="after")
    def _leave_friction(self) -> Bench:
        """A preload below nominal must not remove more friction than the total."""
        if self.gear is not None:
            with_preload(self.friction, self.gear.ratio, self.gear.preload)
            return self
        for name, each in self.friction.items():
            if "motor" in (each.side, each.velocity):
                raise ValueError(f"'friction.{name}' is of the motor's side: add gear.ratio")
        return self

    @model_validator(mode="wrap")
    @classmethod
    def _paths_lead_somewhere(
        cls, tree: Any, handler: ModelWrapValidatorHandler[Self], info: ValidationInfo
    ) -> Self:
        """Paths of scatter, preload and `known` must exist; others would have no effect."""
        with axis_terms(sides_in(tree)):
            bench = handler(tree)
        preload = None if bench.gear is None else bench.gear.preload
        wrong = list(wrong_paths(tree, bench.friction, bench.variation, preload))
        if bench.gear is not None and bench.gear.lead is not None and not bench.is_linear:
            message = "a lead needs a linear axis, and the axis is rotary (axis.kind)"
            wrong.append((("gear", "lead"), message))
        if bench.is_linear and bench.limits and math.isinf(bench.limits.angle):
            wrong.append((("limits", "angle"), "a linear axis has ends: write how far it may go"))
        if wrong:
            raise invalid(wrong)
        # Archived values are SI, and an experiment's own bench may lack paths of `known`.
        if is_archived(info):
            return bench
        return bench.model_copy(update={"known": known_in_si(bench)})

    @property
    def is_linear(self) -> bool:
        """Whether the axis is linear."""
        return self.axis.kind == AxisKind.LINEAR.value

    @property
    def sides(self) -> Sides:
        """Kinds of motion of axis and motor."""
        load = AxisKind(self.axis.kind)
        driven = self.gear is not None and self.gear.lead is not None
        return Sides(load, AxisKind.ROTARY if driven else load)

    def with_friction(self, friction: Mapping[str, Any]) -> Self:
        """This bench with other friction, and the parts of scatter and preload that apply to it."""
        update: dict[str, Any] = {"friction": dict(friction)}
        if self.variation is not None:
            update["variation"] = acting(self.variation, friction)
        if self.gear is not None and self.gear.preload is not None:
            preload = loading(self.gear.preload, friction)
            update["gear"] = self.gear.model_copy(update={"preload": preload})
        return self.model_copy(update=update)

    def known_uncertainty(self, path: str) -> float | None:
        """Standard uncertainty (1 sigma, SI) of the value at a dotted path, e.g. `axis.inertia`.

        None if it is not stated.
        """
        known = self.known.values.get(path)
        return None if known is None else known.standard_deviation

    def at_load(self, friction: FrictionOptions) -> tuple[float, float]:
        """Torque at the load per N m of an interface, and its rate per load relative rate."""
        return friction.at_load(self.gear.ratio if self.gear else 1.0)

    @property
    def rate_is_of_encoder(self) -> bool:
        """Whether the rate of the loop and of the recording is derived from the encoder."""
        return self.controller is not None and self.controller.rate_feedback == "encoder"

    @property
    def ratio(self) -> float | None:
        """N: motor rate over load rate; 1 without a gear, None without gear and motor."""
        if self.gear is not None:
            return self.gear.ratio
        return None if self.motor is None else 1.0

    @property
    def torque_per_current(self) -> float | None:
        """N Kt: torque at the load per ampere (N m/A); None without a motor."""
        if self.motor is None:
            return None
        return (self.ratio or 1.0) * self.motor.torque_constant
