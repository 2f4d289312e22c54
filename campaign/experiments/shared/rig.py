"""What a bench tells before anything moves that the size of an experiment depends on.

Where friction is not described its sizes are None, and whoever asks takes what the limits allow.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

from campaign.physics.bench import Bench
from campaign.physics.friction import friction_models
from campaign.physics.limits import worst_friction
from campaign.physics.loop import at_load
from campaign.physics.loop_margins import LoopMargins
from campaign.physics.loops_used import loops_of

SLOW = 1e-9
"""rad/s; friction at this rate is that of the onset of sliding."""
MOST = 0.9
"""of a limit that an experiment may use up by its own choice."""


@dataclass(frozen=True)
class Rig:
    """A bench as the sizes of an experiment follow from it; SI, at the load."""

    bench: Bench

    @cached_property
    def static_torque(self) -> float | None:
        """Largest torque at the onset of sliding (N m)."""
        return worst_friction(self.bench, SLOW) or None

    @cached_property
    def presliding(self) -> float | None:
        """Largest Ts / sigma0 of its interfaces (rad): friction's memory is some of these."""
        spans = []
        for options in self.bench.friction.values():
            declared = friction_models()[options.model].small_signal
            stuck = None if declared is None else declared(options).stuck
            static = getattr(options, "static_torque", None)
            if stuck is not None and stuck.stiffness > 0 and static:
                spans.append(static / stuck.stiffness / at_load(options, self.bench)[1])
        return max(spans, default=None)

    @cached_property
    def stribeck_velocity(self) -> float | None:
        """Lowest Stribeck velocity of its interfaces, as the load's rate (rad/s)."""
        speeds = [
            speed / at_load(options, self.bench)[1]
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

    @property
    def unwinding(self) -> float:
        """Angle (rad) that a stuck load lags at a reversal until the loop's integral has turned."""
        return self.unwinding_from(self.static_torque or 0.0)

    def unwinding_from(self, static_torque: float) -> float:
        """The same for a static torque (N m) that was found.

        From -Ts to Ts: 2 Ts / (N Kt Ki); 0 without an integral, which then never breaks it away.
        """
        gain = self.bench.torque_per_current * self.bench.controller.rate.integral_gain
        return 2.0 * static_torque / gain if gain > 0 else 0.0

    @property
    def torque(self) -> float:
        """What the limits of torque and current leave the drive (N m)."""
        limits = self.bench.limits
        return min(limits.torque, limits.current * self.bench.torque_per_current)

    def acceleration(self, rate: float) -> float:
        """Largest (rad/s^2) that limits and friction leave up to `rate` (rad/s), with a margin."""
        left = MOST * self.torque - worst_friction(self.bench, rate)
        limits = self.bench.limits
        return max(0.0, MOST * min(limits.acceleration, left / self.bench.axis.inertia))

    @property
    def rate_noise(self) -> float:
        """Standard deviation of a gyro sample with its quantisation (rad/s); 0 for an ideal one."""
        gyro = self.bench.sensors.gyro
        return math.hypot(gyro.noise, gyro.resolution / math.sqrt(12.0))

    @property
    def sample_rate(self) -> float:
        """Of a recording (Hz): 1 kHz, or the controller's where that is lower."""
        return min(1000.0, self.bench.controller.sample_rate or 1000.0)

    @cached_property
    def loop_time(self) -> float:
        """How long (s) the rate loop takes to forget: ten of its slower time constants."""
        gains = self.bench.controller.rate
        integral = gains.integral_gain
        slow = gains.proportional / integral if integral > 0 else 0.0
        loop = dict(loops_of(self.bench, "none", "rate")).get("sliding")
        crossovers = loop.crossovers if isinstance(loop, LoopMargins) else ()
        fast = 1.0 / min(crossovers) if crossovers else 0.0
        return 10.0 * max(fast, min(slow, 1.0))
