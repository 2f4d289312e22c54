"""What the plan of a velocity map warns of: numbers from the appendix' bench, in closed form."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from campaign.experiments import experiments
from campaign.experiments.friction_map.pilot import PilotedMapOptions
from campaign.experiments.friction_map.runs import VelocityMapOptions
from campaign.experiments.friction_map.warnings import map_warnings
from campaign.physics.bench import Bench
from campaign.protocol import load_protocol, make_plan
from tests.physics.benches import Tree, bench

PROTOCOLS = Path(__file__).parents[2] / "protocols"
EIGHT = [f"{speed} deg/s" for speed in (0.1, 0.5, 1, 2, 4, 8, 16, 32)]


def warned(rig: Bench, **written: object) -> list[str]:
    options = VelocityMapOptions.model_validate({"speeds": EIGHT, "max_time": "60 s", **written})
    return list(map_warnings(options, rig))


def without_friction(tree: Tree) -> None:
    tree["friction"] = {}


def rippled(periods: float) -> Callable[[Tree], None]:
    def edit(tree: Tree) -> None:
        tree["friction"]["load"]["ripple"] = {"amplitude": 0.01, "periods": periods}

    return edit


def test_a_sound_map_has_none() -> None:
    assert warned(bench()) == []


def test_no_more_speeds_than_parameters() -> None:
    for rig in (bench(), bench(without_friction)):
        (told,) = warned(rig, speeds=[*EIGHT[:4], EIGHT[5]])
        assert told.startswith("5 speeds cannot determine the 5 parameters of the Stribeck curve")
        assert "6 are the fewest" in told
    assert warned(bench(), speeds=EIGHT[:6]) == []
    assert len(warned(bench(), speeds=[*EIGHT[:4], EIGHT[5], EIGHT[0]])) == 1, (
        "a repeat is no speed"
    )


def test_too_few_speeds_below_the_stribeck_velocity() -> None:
    """vs is 0.03 rad/s, 1.72 deg/s: two of these are below it."""
    few = ["0.5 deg/s", "1 deg/s", *EIGHT[3:], "40 deg/s"]
    (told,) = warned(bench(), speeds=few)
    assert told.startswith("2 of 8 speeds are below the Stribeck velocity of 1.72 deg/s")
    assert "run 3 or more below it, from 0.172 deg/s on" in told
    assert warned(bench(), speeds=["1.7 deg/s", *few]) == []
    assert warned(bench(without_friction), speeds=few) == []


def test_no_speed_far_above_the_stribeck_velocity() -> None:
    """vs is 1.72 deg/s, and three times that 5.16 deg/s."""
    slow = [*EIGHT[:5], "5 deg/s"]
    (told,) = warned(bench(), speeds=slow)
    assert told.startswith("no speed is above 3 times the Stribeck velocity, 5.16 deg/s")
    assert "coulomb_torque is extrapolated" in told
    assert warned(bench(), speeds=[*slow, "5.2 deg/s"]) == []
    assert warned(bench(without_friction), speeds=slow) == []


def test_without_a_stribeck_effect_nothing_is_below_it() -> None:
    def flat(tree: Tree) -> None:
        for interface in tree["friction"].values():
            interface["static_torque"] = interface["coulomb_torque"]

    assert warned(bench(flat), speeds=[*EIGHT[3:], "40 deg/s", "50 deg/s"]) == []


def test_settling_for_too_short_an_angle() -> None:
    """32 N m / 18 000 N m/rad is 0.102 deg, and 7 of them 0.713 deg: 0.3 s at 2.38 deg/s."""
    speeds = ["0.5 deg/s", "1 deg/s", "1.5 deg/s", "2.3 deg/s", "2.4 deg/s", *EIGHT[4:]]
    (told,) = warned(bench(), speeds=speeds, settle_angle="0.3 deg", settle_time="0.3 s")
    assert told.startswith("at 0.5 to 2.3 deg/s runs settle for too short an angle")
    assert "settle for 0.71 deg or more: Ts/sigma0 is 0.102 deg" in told
    assert warned(bench(), speeds=speeds, settle_angle="0.72 deg") == []


# 20 periods per revolution are 18 deg, and 0.8 of that 14.4 deg. The loop follows 1.5 Hz of it, up
# to 27 deg/s.
SLOW = ["0.05 deg/s", "0.06 deg/s", "0.07 deg/s", "0.08 deg/s", "0.09 deg/s", "40 deg/s"]


def test_a_ripple_that_no_run_shows() -> None:
    """60 s at 0.09 deg/s are 5 deg; 40 deg/s is too fast, though its window is 48 deg long."""
    (told,) = warned(bench(rippled(20)), speeds=SLOW)
    assert told.startswith("at 0.05 to 0.09 deg/s windows are shorter than a period of friction's")
    assert "ripple, 18 deg" in told
    assert "of the runs below 27 deg/s 0 span one, and 2 have to" in told
    assert warned(bench(rippled(20)), speeds=[*SLOW, "5 deg/s", "6 deg/s"]) == []
    assert "1 span one" in warned(bench(rippled(20)), speeds=[*SLOW, "5 deg/s"])[0]


def test_a_ripple_that_runs_show_is_taken_out() -> None:
    """90 periods are 4 deg: 60 s at 0.07, 0.08 and 0.09 deg/s, less 0.75 deg, span 0.8 of that."""
    assert warned(bench(rippled(90)), speeds=SLOW) == []


def test_two_starts_average_a_ripple() -> None:
    told = warned(bench(rippled(20)), speeds=SLOW, start_angles=["-30 deg", "-21 deg"])
    assert told == []
    assert warned(bench(rippled(20)), speeds=SLOW, start_angles=["-30 deg"])


def test_a_travel_shorter_than_the_ripple() -> None:
    (told,) = warned(bench(rippled(20)), speeds=EIGHT[:6], max_travel="10 deg")
    assert told.startswith("max_travel of 10 deg is shorter than a period of friction's ripple, 18")
    assert warned(bench(rippled(60)), speeds=EIGHT[:6], max_travel="10 deg") == []
    spread = warned(bench(rippled(20)), speeds=EIGHT[:6], max_travel="10 deg", spread_starts=True)
    assert not any("at one place" in told for told in spread)


@pytest.mark.parametrize("name", ["velocity_map", "repeatability", "quickstart"])
def test_the_shipped_maps_have_none(name: str) -> None:
    protocol = load_protocol(PROTOCOLS / f"{name}.toml", experiments(), shipped=PROTOCOLS)
    tests = make_plan(protocol, seed=0).tests
    assert [test.warnings for test in tests] == [()] * len(tests)


def test_a_pilot_decides_the_rest() -> None:
    """Of a map that it will not run as it is written the plan does not warn."""
    tree = {"slowest": "0.5 deg/s", "fastest": "40 deg/s", "settle_angle": "0.3 deg"}
    plain, piloted = (
        PilotedMapOptions.model_validate({**tree, "max_time": "60 s", "pilot": pilot})
        for pilot in (False, True)
    )
    assert "settle for" in " ".join(map_warnings(plain, bench()))
    assert list(map_warnings(piloted, bench())) == []
