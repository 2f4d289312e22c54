"""What a bench's friction is today: the day's drift, the scatter of one trial, the preload.

A real axis is never quite the axis of yesterday. A bench says how much its friction parameters
scatter from day to day and from trial to trial; the draw depends on seeds and the day alone, so
the same trial always meets the same friction.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from campaign.physics.bench import Bench, VariationOptions

PARAMETERS = (
    "coulomb_torque",
    "static_torque",
    "stribeck_velocity",
    "viscous_friction",
    "bristle_stiffness",
)


def as_it_is(bench: Bench, seed: int) -> Bench:
    """`bench` with the friction of its day and of the trial with this `seed`."""
    preload = bench.gear.preload
    factors = _factors(bench.variation, seed) if bench.variation else {}
    if not factors and preload is None:
        return bench
    friction = {}
    for name, options in bench.friction.items():
        changed = _scaled(options, factors)
        if preload is not None:
            changed = _preloaded(changed, preload)
        friction[name] = changed
    return bench.model_copy(update={"friction": friction})


def _factors(variation: VariationOptions, seed: int) -> dict[str, float]:
    """Factor on each parameter: one draw per day, times one per trial for all torques."""
    day = np.random.Generator(np.random.PCG64([variation.seed, variation.day]))
    draws = day.standard_normal(len(PARAMETERS))
    if variation.day == 0:
        draws[:] = 0.0
    factors = {
        name: 1.0 + float(getattr(variation, name) * draw)
        for name, draw in zip(PARAMETERS, draws, strict=True)
    }
    trial = np.random.Generator(np.random.PCG64([variation.seed, seed, 1]))
    scatter = 1.0 + variation.trial * float(trial.standard_normal())
    for name in ("coulomb_torque", "static_torque"):
        factors[name] *= scatter
    return {name: max(factor, 0.05) for name, factor in factors.items()}


def _scaled(options: Any, factors: dict[str, float]) -> Any:
    update = {
        name: getattr(options, name) * factor
        for name, factor in factors.items()
        if hasattr(options, name)
    }
    negative = getattr(options, "negative", None)
    if negative is not None:
        update["negative"] = negative.model_copy(
            update={
                name: getattr(negative, name) * factor
                for name, factor in factors.items()
                if getattr(negative, name, None) is not None
            }
        )
    return options.model_copy(update=update)


def _preloaded(options: Any, preload: Any) -> Any:
    """More static and Coulomb friction, in both directions, by the preload above its nominal."""
    extra = preload.torque - preload.nominal
    added = {
        "static_torque": preload.static_share * extra,
        "coulomb_torque": preload.coulomb_share * extra,
    }
    if options.preloaded is False:
        return options
    update = {name: getattr(options, name) + more for name, more in added.items()}
    negative = options.negative.model_copy(
        update={
            name: getattr(options.negative, name) + more
            for name, more in added.items()
            if getattr(options.negative, name) is not None
        }
    )
    return options.model_copy(update={**update, "negative": negative})
