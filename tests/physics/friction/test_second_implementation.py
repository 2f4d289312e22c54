"""Karnopp, Armstrong, Leuven and GMS against their event-switched second implementation."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from campaign.physics.friction import friction_models
from campaign.signals import Polyline, Signal, Sine
from tests.physics.benches import run, task
from tests.physics.dry_cases import function
from tests.physics.friction.cases import on, options
from tests.physics.friction.switched import (
    Armstrong,
    ArmstrongMode,
    Gms,
    Karnopp,
    Leuven,
    PrintedKarnopp,
    switched,
)

STIFFNESS, DURATION = 900.0, 3.0
PULL = Sine(amplitude=0.12, frequency=0.5)
PUSH = Sine(amplitude=9.0, frequency=2.3, phase=1.0)
TWO = {"torque_shares": (0.5, 0.5), "stiffness_shares": (2.0 / 3.0, 1.0 / 3.0)}
CASES: dict[str, tuple[Any, dict[str, Any], dict[str, Any]]] = {
    "karnopp": (Karnopp, {}, {}),
    "karnopp, wide band": (Karnopp, {"band": 0.02}, {"zero_band": 0.02}),
    "armstrong": (Armstrong, {}, {}),
    "armstrong, long lag": (Armstrong, {"lag": 0.03}, {"memory_lag": 0.03}),
    "gms": (Gms, {}, TWO),
    "gms, fast": (Gms, {"attraction": 1e5}, {**TWO, "attraction": 1e5}),
    "leuven": (Leuven, {}, TWO),
    "leuven, d = 2": (
        Leuven,
        {"exponent": 2.0, "levels": (20.8, 20.8)},
        {**TWO, "transition_exponent": 2.0, "hysteresis_reserve": 1.3},
    ),
}


def test_switch_functions_are_the_events_of_the_second_implementation() -> None:
    """Stuck, and in both directions, a function has an event at either sign."""
    karnopp, armstrong = Karnopp(), Armstrong()
    none = (False, False)
    events = {
        "karnopp": len(karnopp.events((1, False))) + len(karnopp.events((0, True))) // 2,
        "armstrong": len(armstrong.events(ArmstrongMode(1, 0.0, 0.0)))
        + len(armstrong.events(ArmstrongMode(0, 0.0, 0.0))) // 2,
        "gms": len(Gms().events((1, none))),
        "leuven": len(Leuven().events((1, 1, none))),
    }
    made = {name: options(name, **CASES[name][2]) for name in events}
    stated = {name: friction_models()[name].switches for name in events}
    assert {name: state and state(made[name]) for name, state in stated.items()} == events


def engine(case: str, step: float, **fields: Any) -> dict[str, np.ndarray]:
    """Outputs each millisecond of a load on a spring."""
    pulled: dict[str, Any] = {"command": PULL, "spring_stiffness": STIFFNESS, **fields}
    what = task(mode="spring", duration=DURATION, **pulled)
    return run(on(case.split(",")[0], **CASES[case][2]), what, step)[1]


def error(found: dict[str, np.ndarray], true: dict[str, np.ndarray], name: str) -> float:
    """RMS over RMS."""
    off = found[name][: len(true[name])] - true[name]
    return float(np.sqrt(np.mean(off**2) / np.mean(true[name] ** 2)))


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_a_load_pulled_to_and_fro_is_that_of_the_second_implementation(case: str) -> None:
    kind, more, _ = CASES[case]
    load = kind(spring=STIFFNESS, pull=function(PULL), push=function(PUSH), **more)
    true, events = switched(load, np.arange(round(DURATION * 1000)) * 1e-3)
    assert len(events) >= 5
    coarse, fine = (engine(case, step, disturbance=PUSH) for step in (1e-3, 0.125e-3))
    for name in ("load_rate", "relative_angle"):
        assert error(coarse, true, name) < 2e-4
        assert error(fine, true, name) < (1e-5 if case == "karnopp, wide band" else 3e-6)
        # 64 for second order; what a jump of the curve inside a step leaves is of first order: 8.
        assert error(coarse, true, name) > (4.0 if case == "karnopp, wide band" else 24.0) * error(
            fine, true, name
        )
    typical = np.median(
        np.abs(fine["friction_torque"][: len(true["load_rate"])] - true["friction_torque"])
    )
    assert typical < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("case", [case for case in CASES if case.startswith("karnopp")])
def test_karnopp_as_it_is_printed_differs_by_its_band(case: str) -> None:
    """It keeps a momentum of up to J DV in the band, and no more: angles differ in proportion."""
    band = 1e-3 if case == "karnopp" else 0.02
    load = PrintedKarnopp(spring=STIFFNESS, pull=function(PULL), band=band)
    true, _ = switched(load, np.arange(round(DURATION * 1000)) * 1e-3)
    found = engine(case, 0.25e-3)
    off = np.max(np.abs(found["relative_angle"][: len(true["load_rate"])] - true["relative_angle"]))
    assert off < 2.0 * band
    assert off > 0.01 * band


@pytest.mark.slow
@pytest.mark.parametrize("case", ["karnopp", "armstrong", "gms", "leuven"])
def test_sticking_under_a_varying_load(case: str) -> None:
    """Held at 15 N m and shaken by 9 N m: below Tc in all, so that it goes on sticking."""
    push: Signal = Sine(amplitude=9.0, frequency=2.3)
    pull = Polyline(times=(0.0, 0.5, DURATION), values=(0.0, 15.0 / STIFFNESS, 15.0 / STIFFNESS))
    kind, more, _ = CASES[case]
    load = kind(
        spring=STIFFNESS,
        pull=lambda t: float(np.interp(t, pull.times, pull.values)),
        push=lambda t: 9.0 * math.sin(2 * math.pi * 2.3 * t),
        **more,
    )
    true, _ = switched(load, np.arange(round(DURATION * 1000)) * 1e-3)
    found = engine(case, 0.25e-3, command=pull, disturbance=push)
    count = len(true["load_rate"])
    np.testing.assert_allclose(found["relative_angle"][:count], true["relative_angle"], atol=2e-6)
    if case == "karnopp":
        assert np.max(np.abs(found["relative_angle"])) < 1e-15


def turns(rate: np.ndarray) -> int:
    """How often sliding forwards, sliding back and rest follow on each other."""
    return int(np.count_nonzero(np.diff(np.sign(np.where(np.abs(rate) < 1e-9, 0.0, rate)))))


def test_karnopp_stops_inside_its_band_and_does_not_chatter() -> None:
    true, _ = switched(Karnopp(spring=STIFFNESS, pull=function(PULL)), np.arange(3000) * 1e-3)
    assert turns(engine("karnopp", 1e-3)["load_rate"]) == turns(true["load_rate"]) > 3
