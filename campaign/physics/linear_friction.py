"""Friction linearized at rest or in sliding.

Stuck: every interface is in presliding, a spring and a damper. Sliding: every interface is far
above its Stribeck velocity, where only the part that grows with the rate remains. Between the two,
friction *falls* with the rate; this causes stick-slip, and no linear loop represents it.

Ripple over position counts at its mean of zero; parameters by direction count at their mean.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from campaign.physics.compensation.interface import Compensator
from campaign.physics.complete import CompleteBench
from campaign.physics.friction import model_of, small_signal_of
from campaign.physics.friction.interface import FrictionOptions, Presliding, SmallSignal
from campaign.physics.loop import viscous_at_load

Regime = Literal["stuck", "sliding"]
REGIMES: tuple[Regime, ...] = ("stuck", "sliding")


class NoLoopError(ValueError):
    """There is no linear loop in this regime; the message states the reason for the user."""


@dataclass(frozen=True)
class FrictionPath:
    """Torque at the load over the load's relative motion: stiffness q + (damping + viscous) v.

    Attributes:
        stiffness: N m/rad.
        damping, viscous: N m s/rad; separate, because a loop's matrices contain the viscous part.
        motor_side: whether a sampled compensation reads it from the resolver.
    """

    stiffness: float
    damping: float
    viscous: float
    motor_side: bool = False


def bench_friction(bench: CompleteBench, regime: Regime) -> FrictionPath:
    """Sum of all friction of the bench. Raises NoLoopError."""
    if regime == "stuck" and not bench.friction:
        raise NoLoopError("the bench has no friction to be stuck in")
    paths = [
        _path(options, bench, _in_plant(name, options, regime), 1.0)
        for name, options in bench.friction.items()
    ]
    return FrictionPath(
        stiffness=sum(path.stiffness for path in paths),
        damping=sum(path.damping for path in paths),
        viscous=sum(path.viscous for path in paths),
    )


def compensation_friction(
    bench: CompleteBench, compensator: Compensator, regime: Regime
) -> tuple[FrictionPath, ...]:
    """Friction models of the compensation, with its gains. Raises NoLoopError."""
    return tuple(
        _path(options, bench, _as_compensation(options, regime), gain)
        for options, gain in compensator.friction
        if gain != 0.0
    )


def _path(
    options: FrictionOptions, bench: CompleteBench, own: Presliding, gain: float
) -> FrictionPath:
    torque, rate = bench.at_load(options)
    scale = gain * torque * rate
    return FrictionPath(
        stiffness=scale * own.stiffness,
        damping=scale * own.damping,
        viscous=gain * viscous_at_load(options, bench),
        motor_side=options.side == "motor",
    )


def _in_plant(name: str, options: FrictionOptions, regime: Regime) -> Presliding:
    stuck = _own(options, regime).stuck
    if stuck is None:
        raise NoLoopError(f"friction.{name} is dry: stuck, it holds the load rigidly")
    return stuck


def _as_compensation(options: FrictionOptions, regime: Regime) -> Presliding:
    stuck = _own(options, regime).stuck_compensation
    if stuck is None:
        raise NoLoopError("the compensation's torque jumps with the sign of the rate")
    return stuck


def _own(options: FrictionOptions, regime: Regime) -> SmallSignal:
    """Response of an interface; in sliding it has the damping of sliding, and no spring."""
    if regime == "sliding":
        return SmallSignal.of_bristles(0.0, small_signal_of(options).sliding_damping)
    model = model_of(options)
    if model.small_signal is None:
        raise NoLoopError(f"the friction model '{model.name}' does not declare its presliding")
    return model.small_signal(options)
