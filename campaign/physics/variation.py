"""What a bench's friction is today: the day's drift, the scatter of one trial, the preload.

A real axis is never quite the axis of yesterday. A bench says how much its friction parameters
scatter from day to day and from trial to trial; the draw depends on seeds and the day alone, so
the same trial always meets the same friction.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from campaign.physics.bench import Bench, VariationOptions
from campaign.physics.preload import PARAMETERS, changed, with_preload

SMALLEST_FACTOR = 0.05
"""However wide the scatter, some friction is left."""


def as_it_is(bench: Bench, seed: int) -> Bench:
    """`bench` with the friction of its day, its preload and the trial with this `seed`."""
    bench = of_its_day(bench)
    if bench.variation is None:
        return bench
    trial = np.random.Generator(np.random.PCG64([bench.variation.seed, seed, 1]))
    scatter = 1.0 + bench.variation.trial * float(trial.standard_normal())
    return _scaled(bench, dict.fromkeys(("coulomb_torque", "static_torque"), scatter))


def of_its_day(bench: Bench) -> Bench:
    """`bench` with the friction of its day and its preload: what its trials scatter around."""
    bench = preloaded(bench)
    return _scaled(bench, _day_factors(bench.variation)) if bench.variation else bench


def preloaded(bench: Bench) -> Bench:
    """`bench` with the friction that its preload makes of the nominal one."""
    friction = with_preload(bench.friction, bench.gear.ratio, bench.gear.preload)
    return bench.model_copy(update={"friction": friction})


def _day_factors(variation: VariationOptions) -> dict[str, float]:
    """Factor on each parameter, one draw each per day; on day 0 all are 1."""
    if variation.day == 0:
        return {}
    day = np.random.Generator(np.random.PCG64([variation.seed, variation.day]))
    draws = day.standard_normal(len(PARAMETERS))
    return {
        name: 1.0 + float(getattr(variation, name) * draw)
        for name, draw in zip(PARAMETERS, draws, strict=True)
    }


def _scaled(bench: Bench, factors: Mapping[str, float]) -> Bench:
    """`bench` with the parameters of all its friction times `factors`."""
    factors = {name: max(factor, SMALLEST_FACTOR) for name, factor in factors.items()}
    friction = {
        name: changed(options, lambda parameter, value: value * factors.get(parameter, 1.0))
        for name, options in bench.friction.items()
    }
    return bench.model_copy(update={"friction": friction})
