"""A test's truth: read apart, checked, placed when it is wrong, and told only by its digest."""

from __future__ import annotations

import pytest

from campaign.errors import ProtocolError
from campaign.experiments import experiments
from campaign.physics.truth import digest
from campaign.protocol import load_protocol, make_plan
from campaign.trial import canonical_json
from tests.protocol.conftest import KINDS, SHIPPED

TEST = (
    '[[test]]\nname = "swing"\nkind = "swing"\nbench = "simulink"\ntruth = "truth.toml"\n'
    'frequency = "0.24 Hz"\n'
)
PLAIN = TEST.replace('truth = "truth.toml"\n', "")
ODD = 'static_torque = "31.4159265 N m"'


@pytest.fixture
def truth(desk, simulink: str) -> str:
    """The shipped bench with another static torque on its load, in a file; its text."""
    text = simulink.replace('static_torque = "32 N m"', ODD, 1)
    assert ODD in text
    desk.write("truth.toml", text)
    return text


def test_it_is_in_the_fingerprint_and_nothing_else_of_the_trial(desk, truth: str) -> None:
    plan = make_plan(desk.load(TEST), seed=0)
    plain = make_plan(desk.load(PLAIN), seed=0)
    (trial,), (alone,) = plan.trials, plain.trials
    assert trial.model_copy(update={"truth": ""}) == alone
    assert trial.fingerprint != alone.fingerprint
    assert plan.fingerprint != plain.fingerprint
    assert list(plan.truths) == [trial.truth]
    assert plan.truths[trial.truth]["friction"]["load"]["static_torque"] == 31.4159265
    assert digest(plan.truths[trial.truth]) == trial.truth


def test_another_truth_is_another_trial(desk, truth: str) -> None:
    (one,) = make_plan(desk.load(TEST), seed=0).trials
    desk.write("truth.toml", truth.replace("31.4159265", "31.4"))
    (other,) = make_plan(desk.load(TEST), seed=0).trials
    assert one.fingerprint != other.fingerprint


def test_what_is_not_simulated_is_no_part_of_it(desk, truth: str) -> None:
    (one,) = make_plan(desk.load(TEST), seed=0).trials
    limits = truth[: truth.index("[limits]")] + (
        '[limits]\nangle = "1 deg"\nrate = "1 deg/s"\nacceleration = "1 deg/s^2"\n'
        'torque = "1 N m"\ncurrent = "1 A"\nduration = "1 s"\n'
    )
    desk.write("truth.toml", limits)
    plan = make_plan(desk.load(TEST), seed=0)
    assert plan.trials[0].fingerprint == one.fingerprint
    assert not plan.breaches


def test_nothing_but_the_plan_has_it(desk, truth: str) -> None:
    """Neither sources, options, tests nor trials tell the number by which it differs."""
    protocol = desk.load(TEST)
    plan = make_plan(protocol, seed=0)
    assert "truth.toml" not in plan.protocol.sources
    assert plan.protocol.truth_sources == {"truth.toml": truth}
    said = [trial.model_dump_json() for trial in plan.trials]
    said += [canonical_json(plan.normalised), repr(plan.tests), repr(plan.protocol.sources)]
    assert not any("31.4159265" in text for text in said)
    assert "31.4159265" in repr(plan.truths)


def test_a_sweep_of_the_bench_turns_the_truth_too(desk, truth: str) -> None:
    text = TEST + '[test.matrix]\n"bench.axis.inertia" = ["40 kg m^2", "50 kg m^2"]\n'
    plan = make_plan(desk.load(text), seed=0)
    for trial, inertia in zip(plan.trials, (40.0, 50.0), strict=True):
        assert trial.bench["axis"]["inertia"] == inertia
        plant = plan.truths[trial.truth]
        assert plant["axis"]["inertia"] == inertia
        assert plant["friction"]["load"]["static_torque"] == 31.4159265


def test_what_is_set_is_stated_alone(desk, truth: str) -> None:
    plan = make_plan(desk.load(TEST, "swing.bench.axis.inertia=40 kg m^2"), seed=0)
    assert plan.trials[0].bench["axis"]["inertia"] == 40.0
    assert plan.truths[plan.trials[0].truth]["axis"]["inertia"] == 35.0


def test_a_sweep_of_software_leaves_the_truth_as_it_is(desk, truth: str) -> None:
    text = TEST + "[test.matrix]\n" + '"bench.compensation.lugre.gain" = [0.5, 1.0]\n'
    plan = make_plan(desk.load(text), seed=0)
    assert len({trial.fingerprint for trial in plan.trials}) == 2
    assert len({trial.truth for trial in plan.trials}) == 1


def test_what_an_experiment_changes_of_the_bench_is_changed_of_the_truth(desk, truth: str) -> None:
    """`model_output` varies the friction of its own benches; `sensitivity` only software."""
    desk.write(
        "protocol.toml",
        TEST.replace('kind = "swing"', 'kind = "model_output"').replace(
            'frequency = "0.24 Hz"\n', ""
        ),
    )
    protocol = load_protocol(desk.folder / "protocol.toml", experiments(), shipped=SHIPPED)
    plan = make_plan(protocol, seed=0)
    changed = {
        (trial.bench["friction"]["load"]["coulomb_torque"], trial.truth) for trial in plan.trials
    }
    assert len(changed) > 1
    for torque, name in changed:
        if torque != 26.0:
            assert plan.truths[name]["friction"]["load"]["coulomb_torque"] == torque


def test_it_is_named_on_the_command_line_for_every_test(desk, truth: str) -> None:
    path = desk.write("protocol.toml", PLAIN)
    file = str(desk.folder / "truth.toml")
    protocol = load_protocol(path, KINDS, shipped=SHIPPED, truth=file)
    (trial,) = make_plan(protocol, seed=0).trials
    assert trial.truth == make_plan(desk.load(TEST, name="named.toml"), seed=0).trials[0].truth
    with pytest.raises(ProtocolError, match=r"--truth none\.toml: 'none\.toml': no such file"):
        load_protocol(path, KINDS, shipped=SHIPPED, truth="none.toml")
    shipped = load_protocol(path, KINDS, shipped=SHIPPED, truth="simulink")
    assert make_plan(shipped, seed=0).trials[0].truth


WRONG = {
    "unknown key": ('inertia = "35 kg m^2"', 'inertia = "35 kg m^2"\n§mass = "3 kg"'),
    "wrong unit": ('inertia = "35 kg m^2"', 'inertia = §"35 kg"'),
    "not TOML": ("[axis]", "[axis§"),
    "other teeth": ("ratio = 141.176", "ratio = §100.0"),
    "newer": ("[axis]", "[axis]"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_mistake_in_it_is_placed_in_it(desk, simulink: str, name: str) -> None:
    was, now = WRONG[name]
    assert was in simulink
    text = simulink.replace(was, now, 1)
    desk.write("truth.toml", "schema = §99\n" + text if name == "newer" else text)
    desk.problems(TEST)


def test_a_truth_that_is_not_there_is_a_mistake_of_the_test(desk) -> None:
    (problem,) = desk.problems(TEST.replace('truth = "truth.toml"', 'truth = §"truth.toml"'))
    assert "no such file" in problem.message
    desk.marks.clear()
    (problem,) = desk.problems(TEST.replace('truth = "truth.toml"', 'truth = §"simulinc"'))
    assert "did you mean 'simulink'" in problem.message
    desk.marks.clear()
    desk.problems(TEST.replace('truth = "truth.toml"', "truth = §3"))


def test_sensors_that_the_stated_controller_cannot_have(desk, simulink: str) -> None:
    sampled = simulink.replace(
        "[controller.rate]", '[controller]\nsample_rate = "1 kHz"\n\n[controller.rate]', 1
    )
    desk.write("truth.toml", sampled + '\n[sensors]\ngyro = { noise = "0.1 deg/s" }\n')
    with pytest.raises(ProtocolError, match=r"under the stated controller: .gyro\.noise."):
        desk.load(TEST)


def test_a_sweep_over_what_the_truth_lacks(desk, simulink: str) -> None:
    """It would be believed, and not be."""
    a, b = simulink.index("[friction."), simulink.index("[controller")
    desk.write("truth.toml", "friction = {}\n" + simulink[:a] + simulink[b:])
    text = TEST + '[test.matrix]\n§"bench.friction.load.coulomb_torque" = ["20 N m", "22 N m"]\n'
    (problem,) = desk.problems(text)
    assert "has no 'friction.load.coulomb_torque'" in problem.message
