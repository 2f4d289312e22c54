"""Actual friction of a bench: drift of the day, scatter of a trial, preload.

Friction of a real axis varies. A bench states the scatter of its friction parameters from day to
day and from trial to trial. The draws depend only on seeds and the day, so the same trial always
has the same friction.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from functools import reduce
from operator import mul
from typing import TypeVar

import numpy as np

from campaign.physics.bench import Bench
from campaign.physics.friction_paths import changeable, matched
from campaign.physics.preload import changed, with_preload
from campaign.physics.scatter import TORQUES, Line

_Bench = TypeVar("_Bench", bound=Bench)
SMALLEST_FACTOR = 0.05
"""Lower bound of a factor, so that friction stays positive."""
_MOST_BENCHES = 64
_OF_ITS_DAY: dict[int, tuple[Bench, Bench]] = {}
"""Benches, and the same benches on their day, by the id of the bench."""
_DAY, _TRIAL = 2, 3
"""Stream numbers: they separate the named draws of day and trial from each other and older ones."""


def as_it_is(bench: _Bench, seed: int) -> _Bench:
    """`bench` with the friction of its day, its preload and the trial with this `seed`."""
    bench = of_its_day(bench)
    variation = bench.variation
    if variation is None:
        return bench
    draws = ((line, _draw_of_trial(variation.seed, seed, line.name)) for line in variation.trials)
    return _scaled(bench, draws)


def is_drawn(bench: Bench) -> bool:
    """Whether the friction of `bench` depends on the seed of a trial."""
    return bench.variation is not None and len(bench.variation.trials) > 0


def of_its_day(bench: _Bench) -> _Bench:
    """`bench` with the friction of its day and its preload, the center of its trials' scatter."""
    kept = _OF_ITS_DAY.get(id(bench))  # the cache keeps the bench, so its id stays unique
    if kept is None:
        if len(_OF_ITS_DAY) >= _MOST_BENCHES:
            _OF_ITS_DAY.clear()
        kept = _OF_ITS_DAY[id(bench)] = bench, _of_its_day(bench)
    return kept[1]  # type: ignore[return-value]


def _of_its_day(bench: _Bench) -> _Bench:
    bench = preloaded(bench)
    variation = bench.variation
    if variation is None or variation.day == 0:
        return bench
    draws = ((line, _draw_of_day(variation.seed, variation.day, line.name))
             for line in variation.days)  # fmt: skip
    return _scaled(bench, draws)


def preloaded(bench: _Bench) -> _Bench:
    """`bench` with the friction that results from its preload."""
    if bench.gear is None:
        return bench
    friction = with_preload(bench.friction, bench.gear.ratio, bench.gear.preload)
    return bench.model_copy(update={"friction": friction})


# Five parameters have a common stream, in this order, and the common draw `torques` is the first
# number of a trial's stream: simulations of old archives must be bit-identical. Every other path
# has its own stream, seeded by its name. So neither an additional or removed line nor the order of
# lines changes another draw.
_TOGETHER = (
    "coulomb_torque",
    "static_torque",
    "stribeck_velocity",
    "viscous_friction",
    "bristle_stiffness",
)


def _draw_of_day(seed: int, day: int, name: str) -> float:
    """Standard normal number of a day for the line `name`."""
    if name in _TOGETHER:
        draws = np.random.Generator(np.random.PCG64([seed, day])).standard_normal(len(_TOGETHER))
        return float(draws[_TOGETHER.index(name)])
    return _draw([seed, day, _DAY, _number(name)])


def _draw_of_trial(seed: int, trial: int, name: str) -> float:
    """Standard normal number of the trial with the seed `trial` for the line `name`."""
    if name == TORQUES:
        return _draw([seed, trial, 1])
    return _draw([seed, trial, _TRIAL, _number(name)])


def _draw(entropy: list[int]) -> float:
    return float(np.random.Generator(np.random.PCG64(entropy)).standard_normal())


def _number(name: str) -> int:
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:16], "big")


def _scaled(bench: _Bench, draws: Iterable[tuple[Line, float]]) -> _Bench:
    """`bench` with the parameters of each line times (1 + relative * draw), line by line."""
    declared = {name: changeable(options) for name, options in bench.friction.items()}
    factors: dict[str, dict[str, list[float]]] = {}
    for line, draw in draws:
        factor = max(1.0 + line.relative * draw, SMALLEST_FACTOR)
        places = {place for path in line.paths for place in matched(path, declared)}
        for interface, parameter in places:
            factors.setdefault(interface, {}).setdefault(parameter, []).append(factor)
    scaled = {name: _times(bench.friction[name], each) for name, each in factors.items()}
    return bench.model_copy(update={"friction": {**bench.friction, **scaled}})


def _times(options: object, factors: Mapping[str, Sequence[float]]) -> object:
    return changed(options, lambda name, value: reduce(mul, factors.get(name, ()), value))
