"""Motions that tell nothing: what is refused of them, and what goes to no bench."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from campaign.channels import DRIVE_TORQUE, RELATIVE_ANGLE, RELATIVE_RATE, TEMPERATURE
from campaign.estimate import Origin
from campaign.estimation import gate
from campaign.estimation.intervals import with_error
from campaign.estimation.inverse.motion import FilterSettings
from campaign.estimation.inverse.presliding_share import HARDLY_SLIDES, Presliding
from campaign.experiments.any_motion import inverse_fit
from campaign.experiments.any_motion.inverse_fit import PRESLIDING, find, in_presliding
from campaign.experiments.any_motion.motions import moved, with_slowest
from campaign.experiments.friction_map import steady_recordings
from campaign.experiments.friction_map.stretches import points_of, slower
from campaign.parameter import IdentifiedRig
from campaign.protocol.bench_file import load_bench
from campaign.trial import Channel, Recording
from tests.estimation.coverage import holds
from tests.experiments.asked import asked
from tests.experiments.laboratory import execute, trials

RATE = 1000.0
TIME = np.arange(20_000) / RATE
NOISE = np.random.Generator(np.random.PCG64(5)).standard_normal((2, len(TIME)))
SWING = 0.3 * np.sin(2.0 * np.pi * TIME) + 0.2 * np.sin(2.0 * np.pi * 0.37 * TIME)

RIG = {"name": "rig", "axis": {"name": "tilt", "inertia": 1.0}}
"""kg m^2"""


def driven(angle: np.ndarray, torque: np.ndarray) -> Any:
    return recorded(
        Channel(RELATIVE_ANGLE, "rad", "angle", "deg", angle),
        Channel(DRIVE_TORQUE, "N m", "torque", "N m", torque),
    )


def recorded(*made: Channel) -> Any:
    """A trial that has nothing but these."""
    channels = {each.name: each for each in made}
    recording = Recording(TIME[: len(made[0].samples)], channels)
    task = SimpleNamespace(sample_rate=RATE, duration=len(TIME) / RATE, mode="recorded")
    trial = SimpleNamespace(
        number=1,
        kind="motion",
        point={},
        role="measurement",
        can_use=(),
        model_copy=lambda update: trial,
        task=task,
        bench=RIG,
        recording={"channels": []},
    )
    return SimpleNamespace(
        trial=trial,
        ending=SimpleNamespace(outcome="completed"),
        estimates=(),
        not_kept="",
        recording=lambda: recording,
        channel_names=lambda: frozenset(channels),
    )


def identified(angle: np.ndarray, torque: np.ndarray) -> IdentifiedRig:
    return asked("inverse_dynamics", [driven(angle, torque)]).identified


@pytest.mark.parametrize(
    ("angle", "torque", "message"),
    [
        (np.zeros_like(TIME), NOISE[0], "stands still"),
        (1e-5 * np.round(NOISE[1]), 1.0 + 0.02 * NOISE[0], "stands still"),
        (SWING, np.zeros_like(TIME), "zero throughout"),
    ],
)
def test_what_does_not_move_or_is_not_driven_is_refused(
    angle: np.ndarray, torque: np.ndarray, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        identified(angle, torque)


@pytest.mark.parametrize("rate", [0.0, 0.3])
def test_a_rate_that_does_not_change_tells_nothing(rate: float) -> None:
    """Its noise adds up to a motion that goes further and further, and is none."""
    measured = rate + 0.01 * NOISE[1]
    torque = Channel(DRIVE_TORQUE, "N m", "torque", "N m", 1.0 + 0.02 * NOISE[0])
    trial = recorded(Channel(RELATIVE_RATE, "rad/s", "rate", "deg/s", measured), torque)
    with pytest.raises(ValueError, match="constant but for its sensor's noise"):
        moved((trial,), FilterSettings.for_rate(RATE))
    swings = np.gradient(SWING, TIME) + measured
    trial = recorded(Channel(RELATIVE_RATE, "rad/s", "rate", "deg/s", swings), torque)
    assert moved((trial,), FilterSettings.for_rate(RATE))


def test_small_and_slow_motion_over_coarse_counts_is_none_of_these() -> None:
    counts = np.round(5.0 * np.sin(0.3 * TIME))
    assert moved((driven(counts, NOISE[0]),), FilterSettings.for_rate(RATE))


def test_a_constant_load_is_no_friction() -> None:
    found = identified(SWING, 2.0 + 0.02 * NOISE[0])
    assert [each.bench for each in found.parameters if each.bench] == []
    told = {each.estimate.name: each.estimate for each in found.parameters}
    for name in ("inertia", "coulomb_positive", "coulomb_negative"):
        assert told[name].kind == "at most" or told[name].origin is Origin.NOT_DETERMINED


def test_a_force_with_its_sign_swapped_is_told_and_goes_to_no_bench() -> None:
    rate = np.gradient(SWING, TIME)
    force = 2.0 * np.gradient(rate, TIME) + 3.0 * np.sign(rate) + 0.5 * rate + 0.02 * NOISE[0]
    places = [each.bench for each in identified(SWING, force).parameters]
    assert "axis.inertia" in places
    found = identified(SWING, -force)
    assert [each.bench for each in found.parameters if each.bench] == []
    told = {each.estimate.name: each.estimate for each in found.parameters}
    for name in ("inertia", "coulomb_positive", "coulomb_negative"):
        assert told[name].reason in gate.UNPHYSICAL
        assert dict(told[name].reason.values)["cause"] == gate.OPPOSITE_SIGNS.code


def strokes(speeds: tuple[float, ...]) -> Any:
    """A trial of strokes out and back, 2 s each, under 3 N m of dry friction."""
    rate = np.repeat([way * speed for speed in speeds for way in (1.0, -1.0)], 2000)
    torque = 3.0 * np.sign(rate) + 0.02 * NOISE[0][: len(rate)]
    trial = recorded(
        Channel(RELATIVE_RATE, "rad/s", "rate", "deg/s", rate + 1e-4 * NOISE[1][: len(rate)]),
        Channel(DRIVE_TORQUE, "N m", "torque", "N m", torque),
    )
    trial.trial.options, trial.trial.windows = {}, ()
    return trial


def test_slow_strokes_that_count_as_standstill_are_counted() -> None:
    """One recording of strokes at several speeds: the slowest are below 3 % of the fastest."""
    trial = strokes((1.0, 0.5, 0.02, 0.01))
    found, _ = points_of((trial,), 0.5)
    assert sorted(abs(point.speed) for point in found) == pytest.approx(
        [0.5, 0.5, 1.0, 1.0], rel=0.01
    )
    assert slower((trial,), 0.5, found) == 4


def test_friction_that_falls_exponentially_with_heat_is_held_by_a_line_over_it() -> None:
    """0.8 N m at 20 degC; what the line misses of its curve is a systematic part."""
    warm = 20.0 + 15.0 * (1.0 - np.exp(-TIME / 7.0))
    rate = np.gradient(SWING, TIME)
    dry = 0.8 * np.exp(-(warm - 20.0) / 30.0) * np.sign(rate)
    force = 0.1 * np.gradient(rate, TIME) + dry + 0.1 * rate + 0.01 * NOISE[0]
    trial = recorded(
        Channel(RELATIVE_ANGLE, "rad", "angle", "deg", SWING),
        Channel(DRIVE_TORQUE, "N m", "torque", "N m", force),
        Channel(TEMPERATURE, "degC", "temperature", "degC", warm),
    )
    found = asked("inverse_dynamics", [trial]).identified
    told = {each.estimate.name: each.estimate for each in found.parameters}
    assert "coulomb_over_temperature" in told
    for way in ("positive", "negative"):
        one = told[f"coulomb_{way}"]
        sources = {part.source: part.standard_uncertainty or 0.0 for part in one.systematic}
        assert sources["curve over temperature"] > 0.003
        low, high = one.combined
        assert low is not None
        assert high is not None
        assert low <= 0.8 <= high


def test_trials_and_slow_strokes_that_are_not_in_a_map_are_reasons() -> None:
    trials = (strokes((1.0, 0.5, 0.02, 0.01)), strokes((0.0,)))
    for number, trial in enumerate(trials, 1):
        trial.trial.number = number
    found = asked("friction_map", trials, shortest="0.5 s").identified
    without, slow = found.left_out
    assert without in steady_recordings.NO_STRETCH
    assert dict(without.values) == {"count": 1, "total": 2, "numbers": "2"}
    assert slow in steady_recordings.TOO_SLOW
    assert dict(slow.values) == {"count": 4}


def deflection(reach: float) -> np.ndarray:
    """Bristles that build up over a reach (rad), in Dahl's model, over their largest deflection."""
    state = np.zeros_like(TIME)
    for k, step in enumerate(np.diff(SWING)):
        state[k + 1] = np.sign(step) + (state[k] - np.sign(step)) * np.exp(-abs(step) / reach)
    return state


def on_bristles(reach: float) -> np.ndarray:
    """Torque of 2 kg m^2 on bristles of 30 N m, damped by 30 N m s/rad."""
    state = deflection(reach)
    inertia = 2.0 * np.gradient(np.gradient(SWING, TIME), TIME)
    force = inertia + 30.0 * state + 30.0 * reach * np.gradient(state, TIME)
    return np.asarray(force + 0.02 * NOISE[0])


@pytest.mark.parametrize(
    ("model", "reach"), [("inverse_dynamics", 0.5), ("inverse_dynamics", 2.0), ("whole_model", 0.5)]
)
def test_friction_of_an_axis_that_hardly_slides_is_not_determined(model: str, reach: float) -> None:
    """Damping of its bristles is no viscous friction of sliding, which it does not have."""
    options: dict[str, Any] = {"models": ("stribeck",), "starts": 1}
    trials = [driven(SWING[:8000], on_bristles(reach)[:8000])]
    found = asked(model, trials, **(options if model == "whole_model" else {})).identified
    told = {each.estimate.name: each.estimate for each in found.parameters}
    friction = [one for name, one in told.items() if name.startswith(("coulomb", "viscous"))]
    assert friction
    for one in friction:
        assert one.origin is Origin.NOT_DETERMINED
        assert one.reason in HARDLY_SLIDES
        assert dict(one.reason.values)["percent"] < 50.0
        assert dict(one.reason.values)["reach"] == pytest.approx(reach, rel=0.5)
    assert holds(told["inertia"], 2.0)
    assert not any(each.bench.startswith("friction") for each in found.parameters if each.bench)


def test_inertia_of_an_axis_that_never_slides_holds() -> None:
    """20 N m of the 38 N m at which `simulink` breaks away; least squares leave 26 of 35 kg m^2."""
    options = {"command": "torque", "torque": "20 N m", "lowest": "1 Hz", "highest": "20 Hz"}
    more = {"period": "2 s", "realisations": 2}
    played = execute(trials("excitation", load_bench("simulink"), {**options, **more}))
    found = asked("inverse_dynamics", played)
    inertia = {each.estimate.name: each.estimate for each in found.identified.parameters}["inertia"]
    assert inertia.origin is Origin.MEASURED
    assert holds(inertia, 35.0)
    assert any("with bristles in place of dry friction" in note for note in found.notes)


def test_an_inertia_beside_bristles_differs_by_its_own_systematic_part() -> None:
    found = Presliding(reach=0.1, share=0.0, values={"inertia": 3.5})
    one = with_error("inertia", 3.0, "kg m^2", 0.1, 20.0, "")
    plain, shifted = (in_presliding(one, found, corrected=own) for own in (False, True))
    assert (plain.value, plain.low, plain.high) == (one.value, one.low, one.high)
    assert (shifted.value, shifted.half_width) == pytest.approx((3.5, plain.half_width))
    assert shifted.low == pytest.approx(one.low + 0.5)
    for each in (plain, shifted):
        (part,) = each.systematic
        assert (part.source, part.standard_uncertainty) == (PRESLIDING, pytest.approx(0.5))


def test_instruments_are_not_corrected_by_a_noisy_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    def by_instruments(squares: Any, _: Any) -> Any:
        return squares, True

    trial = driven(SWING[:8000], on_bristles(0.5)[:8000])
    monkeypatch.setattr(inverse_fit, "held_against", by_instruments)
    filtering = FilterSettings.for_rate(RATE)
    pieces = moved((trial,), filtering)
    fit = find(pieces, (), with_slowest(filtering, pieces, None))
    assert fit.bristles is not None
    assert fit.estimates["inertia"].value == fit.squares["inertia"].value
    assert fit.estimates["inertia"].value != fit.bristles.values["inertia"]


def test_friction_of_an_axis_that_slides_is_determined() -> None:
    found = identified(SWING, on_bristles(1e-4))
    told = {each.estimate.name: each.estimate for each in found.parameters}
    assert holds(told["coulomb_positive"], 30.0)
    assert not any(one.reason in HARDLY_SLIDES for one in told.values())


@pytest.mark.parametrize(("bristles", "cable"), [(0.0, 0.0), (0.02, 0.0), (0.0, 3.0)])
def test_viscous_friction_is_no_presliding(bristles: float, cable: float) -> None:
    """Bristles may fit better than no dry friction: too small to matter, or in place of a cable.

    `bristles` in N m, `cable` in N m/rad.
    """
    rate = np.gradient(SWING, TIME)
    force = 0.2 * np.gradient(rate, TIME) + 5.0 * rate + cable * SWING
    force += bristles * deflection(0.5) + 0.02 * NOISE[0]
    told = {each.estimate.name: each.estimate for each in identified(SWING, force).parameters}
    viscous = [one for name, one in told.items() if name.startswith("viscous")]
    assert viscous
    for one in viscous:
        assert holds(one, 5.0)
