"""What a bench's friction is today: the day's drift, the scatter of one trial, the preload.

A real axis is never quite the axis of yesterday. A bench says how much its friction parameters
scatter from day to day and from trial to trial; the draw depends on seeds and the day alone, so
the same trial always meets the same friction.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from campaign.physics.bench import Bench, PreloadOptions, VariationOptions

PARAMETERS = (
    "coulomb_torque",
    "static_torque",
    "stribeck_velocity",
    "viscous_friction",
    "bristle_stiffness",
)
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
    """`bench` with the friction that its preload adds to (or takes from) the nominal one.

    The axis gains what the preload says; interfaces share it as they share the static torque of
    the axis. Raises ValueError, with a message for the user, where no friction would be left.
    """
    preload = bench.gear.preload
    if preload is None or preload.torque == preload.nominal:
        return bench
    loaded = {name: f for name, f in bench.friction.items() if f.preloaded}
    ratios = {name: bench.gear.ratio if f.side == "motor" else 1.0 for name, f in loaded.items()}
    at_load = {name: getattr(f, "static_torque", 0.0) * ratios[name] for name, f in loaded.items()}
    whole = sum(at_load.values())
    friction = dict(bench.friction)
    for name, options in loaded.items():
        share = at_load[name] / whole if whole > 0 else 1.0 / len(loaded)
        friction[name] = _raised(name, options, preload, share / ratios[name])
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
        name: _changed(options, lambda parameter, value: value * factors.get(parameter, 1.0))
        for name, options in bench.friction.items()
    }
    return bench.model_copy(update={"friction": friction})


def _raised(name: str, options: Any, preload: PreloadOptions, share: float) -> Any:
    """One interface with its `share` of what the preload adds (N m at the interface)."""
    extra = share * (preload.torque - preload.nominal)
    added = {
        "static_torque": preload.static_share * extra,
        "coulomb_torque": preload.coulomb_share * extra,
    }

    def more(parameter: str, value: float) -> float:
        raised = value + added.get(parameter, 0.0)
        if raised <= 0 < value:
            raise ValueError(
                f"a preload of {preload.torque:g} N m leaves friction.{name} with a "
                f"{parameter} of {raised:.4g} N m; raise preload.torque or lower its share"
            )
        return raised

    return _changed(options, more)


def _changed(options: Any, change: Callable[[str, float], float]) -> Any:
    """Friction options with the parameters that scatter or grow changed, in both directions."""

    def own(of: Any) -> dict[str, float]:
        values = {name: getattr(of, name, None) for name in PARAMETERS}
        return {name: change(name, value) for name, value in values.items() if value is not None}

    update: dict[str, Any] = own(options)
    negative = getattr(options, "negative", None)
    if negative is not None:
        update["negative"] = negative.model_copy(update=own(negative))
    return options.model_copy(update=update)
