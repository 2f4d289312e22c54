"""Quantities of a bench that size an experiment.

Without a description of friction its sizes are None; the caller uses what the limits allow.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

from campaign.physics.bench import Bench, LimitsOptions
from campaign.physics.bench_facts import rate_steps
from campaign.physics.complete import control_rate, lacking, limits_of
from campaign.physics.friction import small_signal_of
from campaign.physics.limit_watch import judged_samples
from campaign.physics.limits import worst_friction
from campaign.physics.loop_margins import LoopMargins
from campaign.physics.plan_loops import loops_of
from campaign.units import rate_text

SLOW = 1e-9
"""rad/s; friction at this rate is that of the onset of sliding."""
UNKNOWN_OVERSHOOT = 1.5
"""of a loop with unknown margins: a phase margin of 39 deg."""
MOST = 0.9
"""Share of a limit that the default options of an experiment may use."""


def bristles(bench: Bench) -> Iterator[tuple[float, float] | None]:
    """Ts / sigma0 (rad) and sigma0 (N m/rad) of each interface, at the load; None if unknown."""
    for options in bench.friction.values():
        stuck = small_signal_of(options).stuck
        static = getattr(options, "static_torque", None)
        if stuck is None or not stuck.stiffness > 0 or not static:
            yield None
            continue
        torque, rate = bench.at_load(options)
        yield static / stuck.stiffness / rate, torque * rate * stuck.stiffness


@dataclass(frozen=True)
class Rig:
    """Sizes of an experiment that follow from a bench; SI, at the load."""

    bench: Bench

    @cached_property
    def static_torque(self) -> float | None:
        """Largest torque at the onset of sliding (N m)."""
        return worst_friction(self.bench, SLOW) or None

    @cached_property
    def presliding(self) -> float | None:
        """Largest Ts / sigma0 of its interfaces (rad); the memory of friction is a few of these."""
        known = (each for each in bristles(self.bench) if each is not None)
        return max((span for span, _ in known), default=None)

    @cached_property
    def stribeck_velocity(self) -> float | None:
        """Lowest Stribeck velocity of its interfaces, as the load's rate (rad/s)."""
        speeds = [
            speed / self.bench.at_load(options)[1]
            for options in self.bench.friction.values()
            if (speed := getattr(options, "stribeck_velocity", None))
        ]
        return min(speeds, default=None)

    @cached_property
    def ripple_period(self) -> float | None:
        """Longest period of the friction's ripple over position (rad)."""
        periods = [
            2.0 * math.pi / ripple.periods
            for options in self.bench.friction.values()
            if (ripple := getattr(options, "ripple", None)) and ripple.amplitude > 0
        ]
        return max(periods, default=None)

    def unwinding(self, speed: float, static_torque: float | None = None) -> float:
        """Angle (rad) that a stuck load lags at a reversal until the loop has reversed its torque.

        The torque goes from -Ts to Ts; the proportional gain gives Kp v at once, the integral needs
        (2 Ts / (N Kt) - Kp v) / Ki. 0 without an integral, which then never breaks the load away,
        and without a stated controller or torque per current.

        Args:
            speed: of the run (rad/s).
            static_torque: an estimate (N m), in place of the bench's.
        """
        controller, per_ampere = self.bench.controller, self.bench.torque_per_current
        if controller is None or controller.rate is None or per_ampere is None:
            return 0.0
        gains = controller.rate
        torque = (self.static_torque or 0.0) if static_torque is None else static_torque
        left = max(2.0 * torque / per_ampere - gains.proportional * speed, 0.0)
        return left / gains.integral_gain if gains.integral_gain > 0 else 0.0

    def turned_within(self, angle: float) -> float:
        """Lowest speed (rad/s) at which `unwinding` does not exceed an angle (rad)."""
        controller = self.bench.controller
        whole = self.unwinding(0.0)
        if controller is None or controller.rate is None or whole <= angle:
            return 0.0
        return (whole - angle) * controller.rate.integral_gain / controller.rate.proportional

    @property
    def limits(self) -> LimitsOptions:
        """Limits of the bench. Raises IncompleteBenchError if it has none."""
        return limits_of(self.bench)

    @property
    def torque(self) -> float:
        """Torque that the limits of torque and current allow the drive (N m).

        The limit of current counts only if the bench states the torque per current.
        """
        limits, per_ampere = self.limits, self.bench.torque_per_current
        return min(limits.torque, math.inf if per_ampere is None else limits.current * per_ampere)

    def accelerated_by(self, torque: float) -> float:
        """Acceleration of a free load by a torque (N m), in rad/s^2.

        Infinite if the bench states no inertia: then the limit of acceleration alone counts.
        """
        return math.inf if self.bench.axis.inertia is None else torque / self.bench.axis.inertia

    def acceleration(self, rate: float) -> float:
        """Largest acceleration (rad/s^2) within limits and friction up to `rate`, with a margin."""
        left = MOST * self.torque - worst_friction(self.bench, rate)
        if left <= 0.0:
            return 0.0
        return MOST * min(self.limits.acceleration, self.accelerated_by(left))

    @property
    def rate_noise(self) -> float:
        """Standard deviation of a rate sample (rad/s), with quantization; 0 for an ideal sensor.

        For a rate of the encoder: that of the filtered difference of two angles.
        """
        bench, controller = self.bench, self.bench.controller
        gyro, encoder = (
            math.hypot(sensor.noise, sensor.resolution / math.sqrt(12.0))
            for sensor in (bench.sensors.gyro, bench.sensors.encoder)
        )
        if controller is None or not bench.rate_is_of_encoder:
            return gyro
        rate = controller.sample_rate or 1.0
        low_pass = controller.relative_rate_filter
        pole = math.exp(-1.0 / (rate * low_pass)) if low_pass > 0.0 else 0.0
        return encoder * rate * (1.0 - pole) * math.sqrt(2.0 / (1.0 + pole))

    @property
    def rate_left(self) -> float:
        """The rate limit (rad/s), less the sensor noise of the watched rate.

        The noise is six deviations of the encoder and one count, over the time of the limit watch,
        which takes the difference of two angles. Raises ValueError if nothing remains.
        """
        limits, encoder = self.limits, self.bench.sensors.encoder
        shown = 6.0 * math.sqrt(2.0) * encoder.noise + encoder.resolution
        watched = judged_samples(limits, self.sample_rate) / self.sample_rate
        left = limits.rate - shown / watched
        if left <= 0.0:
            raise ValueError(
                f"the encoder's noise alone reaches the rate limit of {rate_text(limits.rate)}; "
                "raise limits.rate or limits.rate_time"
            )
        return left

    @cached_property
    def overshoot(self) -> float:
        """Largest amplitude of the rate over that of its command, from the loop's phase margin.

        |L / (1 + L)| at the crossover is 1 / (2 sin(margin / 2)).
        """
        loop = dict(loops_of(self.bench, "none", "rate")).get("sliding")
        margin = loop.phase_margin if isinstance(loop, LoopMargins) else None
        return UNKNOWN_OVERSHOOT if margin is None else max(1.0, 0.5 / math.sin(0.5 * margin))

    @property
    def rate_step(self) -> float:
        """One count of a rate sample (rad/s); for a rate of the encoder after its filter."""
        if self.bench.rate_is_of_encoder:
            return rate_steps(self.bench).get("encoder", 0.0)
        return self.bench.sensors.gyro.resolution

    def rate_count(self, omega: float) -> float:
        """One count (rad/s) of a rate that swings with `omega` (rad/s); 0 if noise smooths it.

        An encoder counts the angle, whose amplitude is that of the rate over omega.
        """
        encoder, gyro = self.bench.sensors.encoder, self.bench.sensors.gyro
        sensor = encoder if self.bench.rate_is_of_encoder else gyro
        count = sensor.resolution if sensor.noise < 0.5 * sensor.resolution else 0.0
        return count * omega if self.bench.rate_is_of_encoder else count

    def slowest_seen(self, longest: float) -> float:
        """Lowest rate (rad/s) that its sensor resolves in half of a run of `longest` (s)."""
        sensors = self.bench.sensors
        if self.bench.rate_is_of_encoder:
            return 30.0 * sensors.encoder.resolution / (0.5 * longest)
        return 3.0 * sensors.gyro.resolution

    @property
    def sample_rate(self) -> float:
        """Sample rate of a recording (Hz): 1 kHz, or the controller's if that is lower."""
        return min(1000.0, control_rate(self.bench) or 1000.0)

    @cached_property
    def loop_time(self) -> float | None:
        """Settling time (s) of the rate loop: ten of its slower time constants.

        The fast one follows from the crossover, or from inertia, torque constant, ratio and gain if
        the bench is incomplete; None if it does not state those.
        """
        controller = self.bench.controller
        if controller is None or controller.rate is None:
            return None
        gains = controller.rate
        integral = gains.integral_gain
        slow = gains.proportional / integral if integral > 0 else 0.0
        loop = dict(loops_of(self.bench, "none", "rate")).get("sliding")
        crossovers = loop.crossovers if isinstance(loop, LoopMargins) else ()
        fast = 1.0 / min(crossovers) if crossovers else self._response_time(gains.proportional)
        return None if fast is None else 10.0 * max(fast, min(slow, 1.0))

    def _response_time(self, proportional: float) -> float | None:
        """J / (N Kt Kpv) (s) of a loop with an incomplete bench; 0 for a complete bench."""
        inertia, per_ampere = self.bench.axis.inertia, self.bench.torque_per_current
        if not lacking(self.bench):
            return 0.0  # a loop without a crossover
        if inertia is None or per_ampere is None:
            return None
        return inertia / (per_ampere * proportional)
