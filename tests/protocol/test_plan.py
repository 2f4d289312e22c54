"""What is in a plan, and what its seeds and fingerprints depend on."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from campaign.errors import ExitCode, LimitError, ProtocolError, UsageError
from campaign.experiments import experiments
from campaign.experiments.shared.common import with_changes
from campaign.protocol import (
    as_tree,
    check_limits,
    check_loops,
    load_protocol,
    low_margins,
    make_plan,
)
from campaign.trial import Role, Trial

from .conftest import KINDS, SHIPPED

SWING = '[[test]]\nname = "swing"\nkind = "swing"\nbench = "simulink"\nfrequency = "0.5 Hz"\n'
SPEEDS = (
    '[[test]]\nname = "speeds"\nkind = "speeds"\nbench = "simulink"\n'
    'speeds = ["1 deg/s", "2 deg/s", "3 deg/s", "4 deg/s", "5 deg/s", "6 deg/s"]\n'
)
MATRIX = "matrix = { cycles = [1, 2, 3] }\n"


def seeds(plan) -> dict[tuple[object, ...], int]:
    return {(t.test, t.role, str(t.point), t.repeat): t.seed for t in plan.trials}


def test_seeds_depend_on_the_place_alone(desk) -> None:
    text = SWING + "repeat = 3\n" + MATRIX + SPEEDS + "repeat = 2\n"
    plan = make_plan(desk.load(text), seed=5)
    alone = make_plan(desk.load(text), seed=5, only=["speeds"])
    shuffled = make_plan(desk.load(text + 'order = "shuffled"\n'), seed=5)
    more = make_plan(desk.load(text.replace("[1, 2, 3]", "[7, 3, 1, 2]")), seed=5)
    assert len(set(seeds(plan).values())) == len(plan.trials) == 9 + 14
    assert seeds(alone).items() <= seeds(plan).items()
    assert seeds(shuffled) == seeds(plan)
    assert seeds(plan).items() <= seeds(more).items()
    assert [t.number for t in alone.trials] == list(range(1, 15))


def test_a_seed_is_drawn_and_recorded_when_none_is_given(desk) -> None:
    protocol = desk.load(SWING)
    first, second = make_plan(protocol), make_plan(protocol)
    assert first.seed != second.seed
    again = make_plan(protocol, seed=first.seed)
    assert again.trials == first.trials
    assert again.fingerprint == first.fingerprint


def test_a_test_with_its_own_seed_ignores_the_plan_s(desk) -> None:
    protocol = desk.load(SWING + "seed = 42\n")
    first, second = make_plan(protocol, seed=1), make_plan(protocol, seed=2)
    assert first.tests[0].seed == 42
    assert first.trials == second.trials


def test_shuffled_order(desk) -> None:
    plan = make_plan(desk.load(SPEEDS + 'order = "shuffled"\nrepeat = 2\nseed = 3\n'))
    blocks = [plan.trials[:7], plan.trials[7:]]
    orders = []
    for number, block in enumerate(blocks, start=1):
        assert {trial.repeat for trial in block} == {number}
        assert [t.role is Role.WARM_UP for t in block] == [True] + 6 * [False]
        orders.append([trial.point["speed"] for trial in block[1:]])
    written = [trial.point["speed"] for trial in make_plan(desk.load(SPEEDS)).trials[1:]]
    assert sorted(orders[0]) == sorted(orders[1]) == written
    # 6! orders: three of them being equal by chance has a probability of 2e-6, for one seed.
    assert written != orders[0] != orders[1] != written


def test_trials_are_what_validation_would_make_of_them(desk) -> None:
    plan = make_plan(desk.load(SWING + MATRIX))
    for trial in plan.trials:
        again = Trial.model_validate_json(trial.model_dump_json())
        assert again == trial
        assert again.fingerprint == trial.fingerprint


def test_prose_does_not_change_the_fingerprint_and_physics_does(desk) -> None:
    def fingerprint(text: str, *overrides: str) -> str:
        return make_plan(desk.load(text, *overrides), seed=1).fingerprint

    plain = fingerprint(SWING + MATRIX)
    assert fingerprint('title = "x"\nnotes = "y"\n' + SWING + "# a comment\n" + MATRIX) == plain
    same = SWING.replace('"0.5 Hz"', '"500 mHz"')
    assert fingerprint(same + MATRIX) == plain
    changed = [
        (SWING + MATRIX.replace("3", "4"),),
        (SWING.replace("0.5", "0.6") + MATRIX,),
        (SWING + "repeat = 2\n" + MATRIX,),
        (SWING + MATRIX, "swing.bench.axis.inertia=36 kg m^2"),
    ]
    assert len({plain, *(fingerprint(*change) for change in changed)}) == 5


def test_sources_are_verbatim_and_named_as_written(desk, simulink: str) -> None:
    desk.write("more/own bench.toml", simulink)
    included = SPEEDS.replace('"simulink"', '"../more/own bench.toml"')
    desk.write("sub/other.toml", included)
    desk.write("values.toml", "x = 1\n")
    main = 'include = ["sub/other.toml"]\npublished = "values.toml"\n' + SWING + "# end"
    plan = make_plan(desk.load(main))
    assert plan.protocol.sources == {
        "protocol.toml": main,
        "sub/other.toml": included,
        "more/own bench.toml": simulink,
        "values.toml": "x = 1\n",
        "simulink": simulink,
    }
    assert [test.name for test in plan.tests] == ["speeds", "swing"]
    assert plan.protocol.published == "values.toml"


def test_a_plan_is_json(desk) -> None:
    plan = make_plan(desk.load(SWING + MATRIX + SPEEDS))
    tree = json.loads(json.dumps(as_tree(plan), allow_nan=False))
    assert tree["duration_s"] == 2.0 + 4.0 + 6.0 + 7 * 2.0
    assert tree["samples"] == 200 + 400 + 600 + 7 * 20
    assert [trial["number"] for trial in tree["trials"]] == list(range(1, 11))
    assert {use["limit"] for use in tree["tests"][0]["limits"]} == {
        "angle",
        "rate",
        "acceleration",
        "torque",
        "current",
        "duration",
    }


def test_unknown_only(desk) -> None:
    with pytest.raises(UsageError, match=r"'swign'; allowed are swing; did you mean 'swing'\?"):
        make_plan(desk.load(SWING), only=["swign"])


def test_an_experiment_that_refuses_names_the_point(desk) -> None:
    protocol = desk.load("\n" + SWING + "matrix = { gain = [1, 101, 102] }\n")
    with pytest.raises(ProtocolError) as caught:
        make_plan(protocol)
    assert str(caught.value).endswith(
        "protocol.toml:2:1: test 'swing' at gain = 101.0: the gain is too high for this bench"
    )


def test_a_recording_nobody_can_store_is_refused(desk) -> None:
    with pytest.raises(ProtocolError, match=r"a trial of .* samples"):
        make_plan(desk.load(SWING.replace('"0.5 Hz"', '"1e-9 Hz"')))


# Limits.


def test_a_plan_within_its_limits_passes(desk) -> None:
    check_limits(make_plan(desk.load(SWING + SPEEDS)))


def test_every_broken_limit_is_named_with_value_and_bound(desk) -> None:
    text = SWING.replace('"0.5 Hz"', '"0.1 Hz"') + (
        '[test.matrix]\nacceleration = ["1 deg/s^2", "36 deg/s^2", "37 deg/s^2", "38 deg/s^2",'
        ' "39 deg/s^2"]\n' + SPEEDS.replace('"6 deg/s"', '"95 deg/s"')
    )
    with pytest.raises(LimitError) as caught:
        check_limits(make_plan(desk.load(text)))
    message = str(caught.value)
    assert caught.value.exit_code is ExitCode.LIMIT_OR_FAULT
    assert "5 of 12 trials" in message
    # 39 deg/s^2 / (0.2 pi / s)^2 = 98.79 deg; 36: 91.19 deg, as the thesis' own 0.1 Hz row.
    assert "swing: angle up to 98.79 deg, limit 90 deg: trial-00005" in message
    assert "[acceleration=36 deg/s^2] 91.19 deg" in message
    assert "and 1 more" in message
    assert "speeds: rate up to 95 deg/s, limit 90 deg/s: trial-00012" in message


def test_each_repeat_that_breaks_a_limit_is_named(desk) -> None:
    """Of trials with one bench and task the plan keeps margins once, but every broken limit.

    Each repeat has a warm-up and six speeds.
    """
    fast = SPEEDS.replace('"6 deg/s"', '"95 deg/s"')
    plan = make_plan(desk.load(fast + "repeat = 3\n"))
    assert [use.trial for use in plan.breaches if use.margin.limit == "rate"] == [7, 14, 21]
    (test,) = plan.tests
    assert [use.trial for use in test.closest if use.margin.limit == "rate"] == [7]


# The shipped protocols.


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted(SHIPPED.glob("*.toml")), ids=lambda path: path.stem)
def test_shipped_protocols_can_be_executed_within_the_limits(path) -> None:
    plan = make_plan(load_protocol(path, experiments(), shipped=SHIPPED))
    check_limits(plan)
    check_loops(plan)
    assert not list(low_margins(plan))
    nothing_published = {
        "quickstart",
        "ship_motion",
        "stick_slip_map",
        "linear",
        "presliding_multisine",
        "compensator_data",
        "excitation",
    }
    assert path.stem in nothing_published or any(test.reproduces for test in plan.tests)


def test_the_full_map_has_80_speeds_in_both_directions() -> None:
    path = SHIPPED / "velocity_map.toml"
    plan = make_plan(load_protocol(path, experiments(), shipped=SHIPPED))
    speeds = [t.point["speed"] for t in plan.trials if t.role is Role.MEASUREMENT]
    assert len(set(speeds)) == 80
    assert min(speeds) == pytest.approx(0.05 * 3.141592653589793 / 180)
    assert max(speeds) == pytest.approx(65 * 3.141592653589793 / 180)


def test_a_request_may_bring_its_own_bench(desk) -> None:
    """The trial gets it, whole, and is held against its limits, not the test's."""
    swing = KINDS["swing"]

    def two(options, bench):
        other = with_changes(bench, {"axis.inertia": 70.0, "limits.acceleration": 0.05})
        (request,) = swing.trials(options, bench)
        yield request
        yield replace(request, bench=other)

    path = desk.write("two.toml", SWING)
    kinds = {"swing": replace(swing, trials=two)}
    plan = make_plan(load_protocol(path, kinds, shipped=SHIPPED), seed=1)
    plain, varied = plan.trials
    assert (plain.bench["axis"]["inertia"], varied.bench["axis"]["inertia"]) == (35.0, 70.0)
    assert plain.bench["friction"] == varied.bench["friction"]
    assert plain.fingerprint != varied.fingerprint
    assert [(use.trial, use.margin.limit) for use in plan.breaches] == [(2, "acceleration")]


def test_a_request_s_own_bench_is_validated(desk) -> None:
    swing = KINDS["swing"]

    def bad(options, bench):
        (request,) = swing.trials(options, bench)
        tree = bench.model_dump(mode="json")
        yield replace(request, bench={**tree, "axis": {**tree["axis"], "inertia": -1.0}})

    path = desk.write("bad.toml", SWING)
    with pytest.raises(ProtocolError, match=r"swing.*axis.inertia"):
        make_plan(load_protocol(path, {"swing": replace(swing, trials=bad)}, shipped=SHIPPED))


def test_no_archive_is_larger_than_the_plan_says(desk, tmp_path) -> None:
    """Noise cannot be compressed: the largest archive that the trials can have."""
    import numpy as np

    from campaign.archive.layout.header import RunHeader
    from campaign.archive.layout.run_status import RunStatus
    from campaign.archive.writing.writer import RunWriter
    from campaign.backends.sim import CHANNELS
    from campaign.recording import Ending, Outcome

    now = "2026-11-21T09:36:58Z"
    plan = make_plan(desk.load(SWING + MATRIX), seed=1)
    header = RunHeader(name="noise", created=now, sources=dict(plan.protocol.sources))
    writer = RunWriter.create(tmp_path / "results", header, plan.trials)
    random = np.random.default_rng(1)
    for trial in plan.trials:
        count = int(trial.task.duration * trial.task.sample_rate)
        recorder = writer.begin(trial)
        recorder.start(CHANNELS)
        noise = random.integers(0, 2**62, size=(len(CHANNELS) + 1, count)).view(float)
        recorder.append(noise[0], noise[1:])
        recorder.finish(Ending(Outcome.COMPLETED), now, now)
    written = writer.seal(RunStatus.COMPLETE, ended=now).stat().st_size
    assert 0.8 * plan.size < written <= plan.size


# The loops.

WRONG = 'stab.bench.controller.rate.proportional="11441.5 A s/rad"'
STABILIZATION = (
    '[[test]]\nname = "stab"\nkind = "stabilization"\nbench = "platform.toml"\n'
    'compensation = "lugre"\n'
)


def shipped_plan(desk, text: str, *overrides: str):
    desk.write("platform.toml", (SHIPPED / "benches" / "platform.toml").read_text())
    path = desk.write("own.toml", text)
    return make_plan(load_protocol(path, experiments(), overrides=overrides, shipped=SHIPPED))


def test_a_plan_knows_the_loop_of_every_compensation_and_regime(desk) -> None:
    (test,) = shipped_plan(desk, STABILIZATION).tests
    assert {(use.compensation, use.mode, use.regime) for use in test.loops} == {
        ("lugre", "rate", "stuck"),
        ("lugre", "rate", "sliding"),
    }
    assert all(use.margins.stable and not use.margins.low for use in test.loops)
    tightness = [use.margins.tightness for use in test.loops]
    assert tightness == sorted(tightness)


def test_a_gain_in_amperes_per_degree_taken_for_radians_is_refused(desk) -> None:
    """199.692 A s/rad, typed as if it were A s/deg: 57.3 times too much."""
    plan = shipped_plan(desk, STABILIZATION, WRONG)
    check_limits(plan)  # no motion that is commanded tells
    with pytest.raises(LimitError) as caught:
        check_loops(plan)
    message = str(caught.value)
    assert caught.value.exit_code is ExitCode.LIMIT_OR_FAULT
    assert "stab: UNSTABLE" in message
    assert "(lugre, " in message
    assert "in trial-00001" in message
    assert "platform.toml" in message
    assert "A s/deg given as A s/rad?" in message
    assert "campaign check" in message


@pytest.mark.slow
def test_an_experiment_that_seeks_instability_may_have_it(desk) -> None:
    text = STABILIZATION.replace('kind = "stabilization"', 'kind = "sensitivity"')
    plan = shipped_plan(desk, text, WRONG)
    assert not plan.tests[0].loops[0].margins.stable
    check_loops(plan)
    tree = as_tree(plan)["tests"][0]
    assert tree["seeks_instability"] is True
    assert tree["loops"][0]["stable"] is False
    assert tree["loops"][0]["phase_margin_rad"] is None


def test_a_low_margin_is_told_and_not_refused(desk) -> None:
    low = 'stab.bench.controller.rate.proportional="5300 A s/rad"'  # 2.5 dB below the limit
    plan = shipped_plan(desk, STABILIZATION, low)
    check_loops(plan)
    (line,) = low_margins(plan)
    assert "stab" in line
    assert "20 deg or 3 dB" in line
    assert not list(low_margins(shipped_plan(desk, STABILIZATION)))


def test_what_has_no_motor_has_no_loop(desk) -> None:
    path = SHIPPED / "friction_behaviour.toml"
    plan = make_plan(load_protocol(path, experiments(), shipped=SHIPPED))
    assert all(not test.loops for test in plan.tests)


def test_a_swept_gain_is_found_at_the_trial_that_has_it(desk) -> None:
    text = STABILIZATION + (
        '[test.matrix]\n"bench.controller.rate.proportional" = ["100 A s/rad", "9000 A s/rad"]\n'
    )
    (test,) = shipped_plan(desk, text).tests
    assert test.loops[0].trial == 2
    assert not test.loops[0].margins.stable


def test_values_that_are_not_written_follow_from_the_bench(desk) -> None:
    """In options, trials and JSON, with the reason; at each point of the matrix for its bench."""
    text = """
        [[test]]
        name = "ramp"
        kind = "breakaway"
        bench = "platform.toml"
        positions = ["0 deg"]
        directions = ["positive"]
        torque_rate = "2 N m/s"
        seed = 1
        [test.matrix]
        "bench.limits.torque" = ["1000 N m", "50 N m"]
    """
    plan = shipped_plan(desk, text)
    (test,) = plan.tests
    assert test.chosen["peak_torque"] == "1.8 times the static torque"
    assert "torque_rate" not in test.chosen
    assert as_tree(plan)["tests"][0]["chosen"] == dict(test.chosen)
    peaks = [trial.options["peak_torque"] for trial in plan.trials]
    assert peaks == [test.options["peak_torque"], pytest.approx(0.9 * 50.0)]
    ends = [trial.task.command.values[-1] for trial in plan.trials]
    assert ends == peaks
