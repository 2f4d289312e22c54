"""Friction models in use: as compensation, in `campaign kinds`, in the choice of a step."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from campaign.cli.kinds import show_kind
from campaign.physics.bench import Bench
from campaign.physics.complete import complete
from campaign.physics.loop_margins import LoopMargins
from campaign.physics.plan_loops import loops_of
from campaign.physics.variation import as_it_is
from campaign.signals import Sine
from tests.physics.benches import Tree, bench, run, task
from tests.physics.friction.cases import MODELS, on, options

SHAKES = Sine(amplitude=0.6, frequency=0.5)


def compensated(name: str, sampled: bool) -> Bench:
    """The thesis' bench, with this model as compensation of the same friction."""

    def edit(tree: Tree) -> None:
        tree["friction"] = {}
        tree["compensation"] = {}
        if sampled:
            tree["controller"]["sample_rate"] = "1 kHz"

    plain = bench(edit).with_friction({"load": options(name)}).model_dump(mode="json")
    own = plain["friction"]["load"]
    plain["compensation"] = {"own": {"method": "friction-model", "friction": {"load": own}}}
    return Bench.model_validate(plain, context={"si": True})


@pytest.mark.slow
@pytest.mark.parametrize("sampled", [False, True])
@pytest.mark.parametrize("name", [name for name in MODELS if name != "karnopp"])
def test_a_model_compensates_its_own_friction(name: str, sampled: bool) -> None:
    """At the step that the trial chooses: the error of the angle falls to less than a third."""
    rig = compensated(name, sampled)
    spread = {}
    for compensation in ("none", "own"):
        what = task(base_acceleration=SHAKES, compensation=compensation, duration=6.0)
        _, found = run(rig, what, None)
        spread[compensation] = np.std(found["pointing_angle"][2000:])
    assert spread["own"] < spread["none"] / 3.0


def test_karnopp_cannot_compensate_and_says_why(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ValidationError, match="'karnopp' cannot compensate: within its band"):
        compensated("karnopp", sampled=False)
    show_kind("karnopp")
    assert "It cannot compensate: within its band" in " ".join(capsys.readouterr().out.split())
    show_kind("gms")
    assert "cannot compensate" not in capsys.readouterr().out


@pytest.mark.parametrize("name", MODELS)
def test_scatter_and_preload_reach_every_model(name: str) -> None:
    tree = on(name).model_dump(mode="json")
    tree["variation"] = {"trial_to_trial": {"coulomb_torque": {"relative": 0.1}}, "seed": 3}
    varied = as_it_is(Bench.model_validate(tree, context={"si": True}), 5).friction["load"]
    assert varied.coulomb_torque != 26.0


@pytest.mark.parametrize("name", MODELS)
def test_margins_know_every_model(name: str) -> None:
    """Sliding in every model; stuck, where it is no set at rest."""
    loops = dict(loops_of(complete(on(name)), "none", "rate"))
    assert isinstance(loops["sliding"], LoopMargins)
    assert isinstance(loops["stuck"], LoopMargins) == (name != "karnopp")


@pytest.mark.parametrize(
    ("name", "changes", "message"),
    [
        ("leuven", {"hysteresis_reserve": 0.9}, "greater than or equal to 1"),
        ("gms", {"torque_shares": (0.5, 0.4), "stiffness_shares": (0.5, 0.5)}, "sum up to 0.9"),
        ("gms", {"torque_shares": (0.5, 0.5)}, "equally many"),
        ("bliman-sorine", {"slow_stiffness": None}, "needs static_torque and slow_stiffness"),
        ("bliman-sorine", {"static_torque": 25.0}, "must be more than coulomb_torque"),
        ("bliman-sorine", {"slow_stiffness": 9000.0}, "no peak"),
        ("armstrong", {"memory_lag": 0.2}, "less than or equal to 0.05"),
    ],
)
def test_what_no_model_can_be_is_refused(name: str, changes: Any, message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        options(name, **changes)


def test_listed_shares_are_the_elements() -> None:
    same = options("gms", torque_shares=(0.25,) * 4, stiffness_shares=(0.48, 0.24, 0.16, 0.12))
    four = options("gms", elements=4)
    from campaign.physics.friction.elements import shares_of, virgin_torque

    for listed, follows in zip(shares_of(same), shares_of(four), strict=True):
        np.testing.assert_allclose(listed, follows, rtol=1e-12)
    way = np.array([1e-3])
    assert virgin_torque(four, 26.0, 18000.0, way)[0] > 0.0
    assert same.without_effect() == {"elements", "element_shape"}
