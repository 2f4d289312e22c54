"""What friction has to do with the numbers of a response: on `platform`, whose truth is known."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any, cast

import numpy as np
import pytest

from campaign.estimate import Estimate, Origin
from campaign.estimation.frequency.drive import TwoMass, not_determined
from campaign.estimation.frequency_response import HELD, NO_LOAD
from campaign.experiments.frequency_response.model.analysis import _parameters
from campaign.experiments.frequency_response.model.axis_numbers import (
    BENT,
    FRICTION,
    UNKNOWN,
    Weaker,
    by_rule,
    of_axis,
)
from campaign.experiments.frequency_response.model.frequency_fit import Masses
from campaign.parameter import Parameter
from campaign.physics.bench import Bench
from campaign.protocol.bench_file import load_bench
from campaign.reason import Reason
from campaign.result import Result
from tests.estimation.coverage import holds
from tests.estimation.excited_rigs import excited_rig
from tests.experiments.asked import asked
from tests.experiments.laboratory import Done, analyse, execute, trials

AMPLITUDES = ("4.5 deg/s", "9 deg/s")


@cache
def platform() -> Bench:
    return cast("Bench", load_bench("platform"))


@cache
def shaken(amplitude: str) -> tuple[Done, ...]:
    """Seven realisations; their numbers and seeds are no other amplitude's."""
    first = 100 * AMPLITUDES.index(amplitude)
    made = trials("excitation", platform(), {"signal": "multisine", "amplitude": amplitude})
    return execute(
        each.model_copy(update={"number": first + k, "seed": 1000 + first + k})
        for k, each in enumerate(made, start=1)
    )


@cache
def identified(*amplitudes: str) -> Result:
    done = [each for amplitude in amplitudes for each in shaken(amplitude)]
    return asked("frequency_response", done)


def truths() -> Mapping[str, float]:
    on = platform()
    whole, hung = on.axis.inertia, on.appendage
    assert whole is not None
    assert hung is not None
    return {
        "total_inertia": whole,
        "motor_inertia": whole - hung.inertia,
        "load_inertia": hung.inertia,
        "antiresonance": hung.frequency,
        "resonance": hung.frequency * math.sqrt(whole / (whole - hung.inertia)),
    }


def told(found: Result) -> Mapping[str, Parameter]:
    return {each.estimate.name: each for each in found.identified.parameters}


def rows(found: Result) -> Mapping[str, Mapping[str, Any]]:
    """Of the table of the two masses, by whose numbers they are."""
    (table,) = [each for each in found.tables if each.key == "two-masses"]
    return {str(row["of"]): row for row in table.rows}


@pytest.mark.slow
def test_one_amplitude_tells_the_response_and_not_the_axis() -> None:
    found = identified(AMPLITUDES[0])
    for name, parameter in told(found).items():
        assert parameter.estimate.origin is Origin.NOT_DETERMINED, name
        assert not parameter.estimate.has_interval, name
        assert parameter.estimate.reason in UNKNOWN
        assert parameter.bench == ""
        assert "second amplitude" in parameter.advice
    whose = rows(found)
    assert list(whose) == ["the response", "the axis"]
    # Its own inertia and antiresonance are known well, and are not those of the axis.
    for name in ("total_inertia", "antiresonance"):
        assert whose["the response"][name].has_interval
        assert not holds(whose["the response"][name], truths()[name])
        assert not whose["the axis"][name].has_interval
    assert any("Repeat it at half or twice the amplitude" in note for note in found.notes)


@pytest.mark.slow
def test_two_amplitudes_tell_the_axis() -> None:
    found = identified(*AMPLITUDES)
    parameters, whose = told(found), rows(found)
    for name, truth in truths().items():
        estimate = parameters[name].estimate
        assert estimate.systematic[0].source == FRICTION
        assert holds(estimate, truth), (name, estimate.value, estimate.combined, truth)
        assert estimate.half_width < 0.5 * truth
        # What friction has in it is apart from the scatter, which the response keeps.
        assert whose["the response"][name].systematic_uncertainty == 0.0
        assert whose["the axis"][name] == estimate
    assert parameters["total_inertia"].bench == "axis.inertia"
    assert parameters["antiresonance"].bench == "appendage.frequency"
    # Friction damps the mode more than anything else does: nothing of that goes to the bench.
    assert parameters["antiresonance_damping"].bench == ""


# The rule, by numbers alone


def number(name: str, value: float, error: float = 0.001) -> Estimate:
    half = 1.96 * error * value
    return Estimate(
        name, value, "", value - half, value + half, 0.95, standard_error=error * value
    )  # fmt: skip


def drive(**values: float) -> TwoMass:
    """One with these numbers; the others are not determined."""
    nothing = not_determined(Reason("test", "not looked at"))
    return TwoMass(
        nothing | {name: number(name, value) for name, value in values.items()},
        misfit="",
        excess=1.0,
        criterion=0.0,
        sides=("motor",),
        point=np.zeros(8),
        grounded=False,
    )


def parts(found: TwoMass, name: str) -> Sequence[float | None]:
    return [each.standard_uncertainty for each in found.estimates[name].systematic]


def test_without_distortion_the_response_is_the_axis() -> None:
    one = drive(total_inertia=2.0)
    assert of_axis(one, 0.0, ()) is one


def test_little_distortion_widens_and_much_withholds() -> None:
    one = drive(total_inertia=2.0, resonance=12.0, damping=3.0)
    little = of_axis(one, 0.01, ())
    assert parts(little, "total_inertia") == [pytest.approx(0.02)]
    assert parts(little, "resonance") == [pytest.approx(0.006)]
    # What friction adds to a damping no level of distortion bounds.
    assert little.estimates["damping"].reason in UNKNOWN
    much = of_axis(one, 1.01 * BENT, ())
    assert much.estimates["total_inertia"].reason == much.estimates["resonance"].reason == UNKNOWN()
    assert math.isnan(much.estimates["total_inertia"].value)
    assert by_rule(number("antiresonance", 11.0), 0.0).systematic == ()


def test_a_share_that_falls_slowly_is_still_held() -> None:
    """Of a bias that falls with the root of the rms, as bristles' does where they begin to slip."""
    for bias, fall in ((0.05, 0.5), (0.05, 1.0), (0.01, 0.5)):
        strong = drive(total_inertia=2.0 * (1.0 - bias))
        weak = drive(total_inertia=2.0 * (1.0 - bias * 2.0**fall))
        found = of_axis(strong, 0.1, [Weaker(weak, 2.0)])
        assert holds(found.estimates["total_inertia"], 2.0)
        assert found.estimates["total_inertia"].origin is Origin.MEASURED


def test_the_weaker_that_says_most_counts_and_agreement_is_no_proof() -> None:
    strong = drive(total_inertia=2.0)
    far, near = Weaker(drive(total_inertia=1.8), 2.0), Weaker(drive(total_inertia=2.0), 2.0)
    both = of_axis(strong, 0.1, [near, far])
    assert parts(both, "total_inertia") == parts(of_axis(strong, 0.1, [far]), "total_inertia")
    # Two amplitudes at which friction does alike agree, too.
    assert parts(of_axis(strong, 0.1, [near]), "total_inertia") == [pytest.approx(0.015)]


def test_a_weaker_that_fits_nothing_tells_nothing() -> None:
    misfit = replace(drive(), misfit="it leaves more than scatter")
    found = of_axis(drive(total_inertia=2.0), 0.1, [Weaker(misfit, 2.0)])
    assert found.estimates["total_inertia"].reason in UNKNOWN


@pytest.mark.parametrize("told_too", [{}, {"resonance": 12.0}])
def test_a_damping_is_told_with_its_resonance(told_too: Mapping[str, float]) -> None:
    one = drive(total_inertia=2.0, resonance_damping=0.3, **told_too)
    made = _parameters(Masses(one, None, axis=one), cast("Any", None))
    (damping,) = [each.estimate for each in made if each.estimate.name == "resonance_damping"]
    assert damping.is_determined is bool(told_too)
    assert damping.reason.code == ("" if told_too else "test")


@cache
def small(hung: bool, kind: str) -> tuple[Done, ...]:
    """Of `simulink` far below breakaway: its inertia resonates on its bristles at 10.7 Hz."""
    tree = load_bench("simulink").model_dump(mode="json")
    if hung:
        tree["appendage"] = {"inertia": 3.5, "frequency": 11.0, "damping_ratio": 0.02}
    lines = {"signal": "multisine", "lowest": "1 Hz", "highest": "60 Hz", "period": "2 s"}
    options = {
        "rate": {**lines, "amplitude": "0.02 deg/s"},
        "few": {**lines, "amplitude": "0.02 deg/s", "realisations": 2},
        "sines": {"loop": "open", "torque": "4 N m", "lowest": "2 Hz", "highest": "40 Hz"},
    }[kind]
    own = "frequency_response" if kind == "sines" else "excitation"
    return execute(trials(own, Bench.model_validate(tree, context={"si": True}), options))


@pytest.mark.parametrize("kind", ["rate", "few", "sines"])
@pytest.mark.parametrize("hung", [False, True])
def test_no_number_of_the_axis_is_told_of_what_its_bristles_hold(hung: bool, kind: str) -> None:
    found = asked("frequency_response", small(hung, kind))
    assert not [
        each for each in found.identified.parameters if each.estimate.origin is Origin.MEASURED
    ]
    modes = [row for table in found.tables if table.key == "modes" for row in table.rows]
    assert not [row for row in modes if cast("Estimate", row["frequency"]).is_determined]
    if kind == "sines":
        for each in analyse("frequency_response", small(hung, kind)).findings:
            assert each.known.origin is not Origin.MEASURED
    elif kind == "rate":
        assert {each.estimate.reason.code for each in found.identified.parameters} == {HELD.code}


def turntable(hung: bool) -> Bench:
    return excited_rig(4, linear=False, alike=False, appendage=hung)


@cache
def shaken_rig(hung: bool, kind: str, times: float) -> Result:
    """A small turntable, under torques of so many times its static friction."""
    on = turntable(hung)
    assert on.friction["load"].static_torque is not None
    torque = f"{times * on.friction['load'].static_torque!r} N m"
    lines = {"command": "torque", "torque": torque, "lowest": "1 Hz", "highest": "60 Hz"}
    own, options = {
        "sines": ("frequency_response", {"loop": "open", "torque": torque, "frequencies": SWEPT}),
        "multisine": ("excitation", {**lines, "period": "2 s"}),
        "noise": ("excitation", {**lines, "signal": "noise", "duration": "20 s"}),
    }[kind]
    return asked("frequency_response", execute(trials(own, on, options)))


SWEPT = [f"{each:.3f} Hz" for each in np.geomspace(1.0, 60.0, 60)]
OF_TWO = {"motor_inertia", "load_inertia", "stiffness", "resonance", "antiresonance"}
SMALL = [("sines", 1.0), ("multisine", 0.5), ("noise", 4.0)]


def measured(found: Result) -> dict[str, Estimate]:
    both = {name: each.estimate for name, each in told(found).items()}
    return {name: each for name, each in both.items() if each.origin is Origin.MEASURED}


@pytest.mark.parametrize(("kind", "times"), SMALL)
def test_a_rigid_axis_that_hardly_slides_has_no_second_inertia(kind: str, times: float) -> None:
    found = shaken_rig(False, kind, times)
    assert not OF_TWO & measured(found).keys()
    assert {each.estimate.reason.code for each in told(found).values()} == {NO_LOAD.code}
    modes = [row for table in found.tables if table.key == "modes" for row in table.rows]
    assert not [row for row in modes if cast("Estimate", row["frequency"]).is_determined]


@pytest.mark.parametrize(("kind", "times"), SMALL)
def test_what_hangs_on_that_axis_is_still_told(kind: str, times: float) -> None:
    on, found = turntable(True), measured(shaken_rig(True, kind, times))
    assert on.axis.inertia is not None
    assert on.appendage is not None
    whole, part = on.axis.inertia, on.appendage
    assert "antiresonance" in found
    assert holds(found["resonance"], part.frequency * math.sqrt(whole / (whole - part.inertia)))
