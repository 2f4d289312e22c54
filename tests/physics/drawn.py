"""What became of a bench's friction on some days and in some trials, in a form to compare exactly.

The numbers in `test_drawn.py` were computed by the program as it was before scatter and preload
went by path.
"""

from __future__ import annotations

import copy
import hashlib
import json
from collections.abc import Iterator
from typing import Any

from campaign.physics.bench import Bench
from campaign.physics.variation import as_it_is

PARAMETERS = (
    "coulomb_torque",
    "static_torque",
    "stribeck_velocity",
    "stribeck_exponent",
    "viscous_friction",
    "bristle_stiffness",
    "bristle_damping",
)
PRELOADS = ("33 N m", "50 N m", "31.5 N m")
DAYS = range(6)
SEEDS = (0, 1, 44, 2**62 + 7)


def friction_numbers(bench: Bench) -> Iterator[tuple[str, float]]:
    """Every parameter of every interface and direction that is given, by dotted path."""
    for name, options in bench.friction.items():
        for prefix, table in ((name, options), (f"{name}.negative", options.negative)):
            for parameter in PARAMETERS:
                value = getattr(table, parameter, None)
                if value is not None:
                    yield f"{prefix}.{parameter}", value


def drawn(tree: dict[str, Any], preload: str, day: int, seed: int) -> dict[str, float]:
    """The friction of one trial, of a bench as written."""
    tree = copy.deepcopy(tree)
    tree["variation"]["day"] = day
    tree["gear"]["preload"]["torque"] = preload
    return dict(friction_numbers(as_it_is(Bench.model_validate(tree), seed)))


def digest(tree: dict[str, Any]) -> str:
    """SHA-256 of the friction of all preloads, days and seeds, to the bit."""
    found = {
        f"{preload}, day {day}, seed {seed}": {
            path: value.hex() for path, value in drawn(tree, preload, day, seed).items()
        }
        for preload in PRELOADS
        for day in DAYS
        for seed in SEEDS
    }
    return hashlib.sha256(json.dumps(found, sort_keys=True).encode()).hexdigest()
