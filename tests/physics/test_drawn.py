"""Samples of what is archived must not change: the friction of a day and a trial, to the bit.

The numbers were computed by the program as it was before scatter and preload went by path.
"""

from __future__ import annotations

import copy
import hashlib
import json
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from campaign.physics.bench import Bench
from campaign.physics.variation import as_it_is
from tests.physics.test_friction_paths import LUGRE
from tests.physics.test_variation import SCATTER as WIDE

KEPT = Path(__file__).parent / "kept"  # benches as they were when the digests were taken
PLATFORM = "1e5b0a23510bbb530736c275e6bd566d37207d0912e6c3667f0e8038b464b549"
SIMULINK = "f77a99ae99f6e9af74d7e6df0791387053e401ca6dbfb174451a6e26ff21b3bd"
TRIAL_ONLY = "42ec1a623a1d1a0029e78a5ba2716da65ec903f249c7b20be4089adbb7373ad5"

PRELOADS = ("33 N m", "50 N m", "31.5 N m")
DAYS = range(6)
SEEDS = (0, 1, 44, 2**62 + 7)


def friction_numbers(bench: Bench) -> Iterator[tuple[str, float]]:
    """Every parameter of every interface and direction that is given, by dotted path."""
    for name, options in bench.friction.items():
        for prefix, table in ((name, options), (f"{name}.negative", options.negative)):
            for parameter in LUGRE:
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


TOGETHER = {"paths": ["coulomb_torque", "static_torque"], "relative": 0.1}
NOMINAL = {"torque": "33 N m", "nominal": "33 N m"}


def written(name: str) -> dict[str, Any]:
    return tomllib.loads((KEPT / f"{name}.toml").read_text(encoding="utf-8"))


def simulink(variation: dict[str, Any], preload: dict[str, Any]) -> dict[str, Any]:
    tree = written("simulink")
    tree["variation"] = {"seed": 5, **variation}
    tree["gear"]["preload"] = {**NOMINAL, **preload}
    return tree


def lopsided(variation: dict[str, Any], preload: dict[str, Any]) -> dict[str, Any]:
    tree = simulink(variation, preload)
    tree["friction"]["load"]["negative"] = {"static_torque": "35 N m"}
    return tree


def test_the_platform_has_the_friction_that_it_always_had() -> None:
    tree = written("platform")
    found = drawn(tree, "50 N m", 3, 44)
    assert found["load.coulomb_torque"] == 16.220326975242507
    assert found["mesh.negative.static_torque"] == 21.157594298115526
    assert found["load.negative.stribeck_velocity"] == 0.029107154176369842
    assert found["load.negative.viscous_friction"] == 4.280837474917904
    assert found["motor.bristle_stiffness"] == 998.9528515560273
    assert drawn(tree, "31.5 N m", 5, 1)["mesh.static_torque"] == 1.4827681844106704
    assert drawn(tree, "33 N m", 0, 44)["load.coulomb_torque"] == 16.082740102881093
    assert digest(tree) == PLATFORM


@pytest.mark.parametrize(
    ("variation", "preload"),
    [
        (
            {"day_to_day": WIDE, "trial_to_trial": {"torques": TOGETHER}},
            {"shares": {"static_torque": 0.7, "coulomb_torque": 0.4}},
        ),
        (
            {
                "day_to_day": {f"*.{name}": r for name, r in WIDE.items()},
                "trial_to_trial": {"torques": TOGETHER},
            },
            {"shares": {"*": {"static_torque": 0.7}, "coulomb_torque": 0.4}},
        ),
    ],
)
def test_every_spelling_has_the_same_draws(variation: Any, preload: Any) -> None:
    assert digest(lopsided(variation, preload)) == SIMULINK


def test_a_trial_scatters_as_it_did() -> None:
    tree = lopsided({"trial_to_trial": {"torques": {**TOGETHER, "relative": 0.25}}}, {})
    assert digest(tree) == TRIAL_ONLY


def test_a_normalised_bench_reads_back_as_it_is() -> None:
    tree = lopsided(
        {
            "day_to_day": {"coulomb_torque": 0.02, "load.bristle_damping": {"relative": 0.1}},
            "trial_to_trial": {"both": {"paths": ["*.static_torque", "motor.coulomb_torque"],
                                        "relative": 0.1}},
        },
        {"shares": {"load.static_torque": 0.5}},
    )  # fmt: skip
    bench = Bench.model_validate(tree)
    normalised = bench.model_dump(mode="json")
    assert normalised["variation"]["day_to_day"] == {
        "coulomb_torque": 0.02,
        "load": {"bristle_damping": 0.1},
    }
    assert normalised["variation"]["trial_to_trial"]["both"]["paths"][0] == "static_torque"
    assert normalised["gear"]["preload"]["shares"] == {"load": {"static_torque": 0.5}}
    again = Bench.model_validate(normalised, context={"si": True})
    assert again == bench
    assert again.model_dump(mode="json") == normalised
