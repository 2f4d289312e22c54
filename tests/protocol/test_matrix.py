"""What a matrix expands to."""

from __future__ import annotations

import math

import pytest

from campaign.errors import ProtocolError
from campaign.protocol import make_plan

TEST = '[[test]]\nname = "t"\nkind = "swing"\nbench = "simulink"\n'
GOOD = TEST + 'frequency = "0.5 Hz"\n'


def swept(desk, matrix: str, path: str, test: str = GOOD) -> list[object]:
    plan = make_plan(desk.load(test + matrix))
    return [trial.point[path] for trial in plan.trials]


@pytest.mark.parametrize(
    ("written", "values"),
    [
        ("[3, 1, 2]", [3, 1, 2]),
        ("{ start = 0, stop = 1, num = 5 }", [0, 0.25, 0.5, 0.75, 1]),
        ("{ start = 1, stop = 0, num = 3 }", [1, 0.5, 0]),
        ("{ start = 2, stop = 9, num = 1 }", [2]),
        ("{ start = 1, stop = 100, num = 3, spacing = 'log' }", [1, 10, 100]),
        ("{ start = 0.1, stop = 0.5, step = 0.1 }", [0.1, 0.2, 0.3, 0.4, 0.5]),
        ("{ start = 0, stop = 1, step = 0.3 }", [0, 0.3, 0.6, 0.9]),
        ("{ start = 3, stop = 1, step = -1 }", [3, 2, 1]),
        ("{ start = 2, stop = 2, step = 1 }", [2]),
    ],
)
def test_bare_values(desk, written: str, values: list[float]) -> None:
    assert swept(desk, f"matrix = {{ gain = {written} }}\n", "gain") == values


def test_integers_of_a_range_stay_integers(desk) -> None:
    values = swept(desk, "matrix = { cycles = { start = 1, stop = 4, step = 1 } }\n", "cycles")
    assert values == [1, 2, 3, 4]
    assert all(type(value) is int for value in values)


def test_a_range_with_a_unit_is_converted(desk) -> None:
    matrix = 'matrix = { acceleration = { start = "0 deg/s^2", stop = "90 deg/s^2", num = 4 } }\n'
    with pytest.raises(ProtocolError, match="greater than 0"):
        desk.load(GOOD + matrix)
    values = swept(desk, matrix.replace('"0 deg', '"60 deg'), "acceleration")
    assert values == pytest.approx([math.radians(x) for x in (60, 70, 80, 90)], rel=1e-11)


def test_a_required_option_may_come_from_the_matrix_alone(desk) -> None:
    values = swept(desk, 'matrix = { frequency = ["1 Hz", "200 mHz"] }\n', "frequency", TEST)
    assert values == pytest.approx([1.0, 0.2])


def test_first_key_is_slowest(desk) -> None:
    plan = make_plan(desk.load(GOOD + 'matrix = { cycles = [1, 2], style = ["slow", "fast"] }\n'))
    points = [(trial.point["cycles"], trial.point["style"]) for trial in plan.trials]
    assert points == [(1, "slow"), (1, "fast"), (2, "slow"), (2, "fast")]
    assert [trial.number for trial in plan.trials] == [1, 2, 3, 4]
    assert [trial.options["style"] for trial in plan.trials] == ["slow", "fast", "slow", "fast"]
    assert [trial.task.duration for trial in plan.trials] == [2.0, 2.0, 4.0, 4.0]


def test_a_repetition_is_the_whole_matrix_once_more(desk) -> None:
    plan = make_plan(desk.load(GOOD + "repeat = 2\nmatrix = { cycles = [1, 2] }\n"))
    found = [(trial.repeat, trial.point["cycles"]) for trial in plan.trials]
    assert found == [(1, 1), (1, 2), (2, 1), (2, 2)]


@pytest.mark.parametrize(
    ("path", "written", "value"),
    [
        ("bench.axis.inertia", '"40 kg m^2"', 40.0),
        ("bench.gear.ratio", "100", 100.0),
        ("bench.friction.load.coulomb_torque", '"30 N m"', 30.0),
        # Fields that the bench file leaves to their defaults.
        ("bench.controller.relative_rate_filter", '"2 ms"', 0.002),
        ("bench.controller.sample_rate", '"2 kHz"', 2000.0),
        # Through two unions and two tables of free names.
        ("bench.compensation.lugre.friction.load.static_torque", '"33 N m"', 33.0),
    ],
)
@pytest.mark.parametrize("quote", ['"', ""])
def test_a_bench_can_be_swept(desk, path: str, written: str, value: float, quote: str) -> None:
    text = f"{GOOD}[test.matrix]\n{quote}{path}{quote} = [{written}]\n"
    trial = make_plan(desk.load(text)).trials[0]
    found = {"bench": trial.bench}
    for key in path.split("."):
        found = found[key]
    assert found == value
    assert trial.point == {path: value}


def test_a_table_that_the_bench_file_leaves_out_can_be_swept(desk) -> None:
    sampled = '"bench.controller.sample_rate" = ["1 kHz"]\n'
    noise = '"bench.sensors.gyro.noise" = ["1 mrad/s", "2 mrad/s"]\n'
    plan = make_plan(desk.load(GOOD + f"[test.matrix]\n{sampled}{noise}"))
    found = [trial.bench["sensors"]["gyro"]["noise"] for trial in plan.trials]
    assert sorted(set(found)) == [0.001, 0.002]


def test_a_whole_friction_can_be_swept(desk) -> None:
    stribeck = (
        '{ model = "stribeck", static_torque = "32 N m", coulomb_torque = "26 N m", '
        'stribeck_velocity = "0.03 rad/s" }'
    )
    plan = make_plan(desk.load(GOOD + f'[test.matrix]\n"bench.friction.load" = [{stribeck}]\n'))
    friction = plan.trials[0].bench["friction"]
    assert friction["load"]["model"] == "stribeck"
    assert friction["motor"]["model"] == "lugre"


def test_sweeping_one_field_leaves_the_rest_of_the_bench(desk) -> None:
    plain = make_plan(desk.load(GOOD)).trials[0].bench
    matrix = '[test.matrix]\n"bench.axis.inertia" = ["35 kg m^2", "36 kg m^2"]\n'
    first, second = (trial.bench for trial in make_plan(desk.load(GOOD + matrix)).trials)
    assert first == plain
    assert second == {**plain, "axis": {**plain["axis"], "inertia": 36.0}}


def test_too_large_is_refused_before_anything_is_expanded(desk) -> None:
    ranges = ", ".join(
        f"{name} = {{ start = 1, stop = 2, num = 9999999 }}" for name in ("gain", "cycles")
    )
    protocol = desk.load(GOOD + f"matrix = {{ {ranges} }}\n")
    with pytest.raises(ProtocolError, match=r":6:1: test 't' alone has 99999980000001, the plan"):
        make_plan(protocol)


def test_exactly_the_largest_plan_is_allowed_and_one_more_is_not(desk, monkeypatch) -> None:
    for module in ("axes", "expand"):
        monkeypatch.setattr(f"campaign.protocol.{module}.LARGEST_PLAN", 6)
    two = GOOD.replace('"t"', '"u"') + "repeat = 3\n"
    small = GOOD + "matrix = { cycles = [1, 2, 3] }\n" + two
    assert len(make_plan(desk.load(small)).trials) == 6
    large = desk.load(small + GOOD.replace('"t"', '"v"'))
    with pytest.raises(ProtocolError, match="the plan has over 6 trials"):
        make_plan(large)
    assert len(make_plan(large, allow_large=True).trials) == 7


def test_values_of_a_large_matrix_are_checked_too(desk, monkeypatch) -> None:
    monkeypatch.setattr("campaign.protocol.axes.LARGEST_PLAN", 2)
    protocol = desk.load(GOOD + "matrix = { cycles = [1, 2, 0] }\n")
    with pytest.raises(ProtocolError, match="must be at least 1"):
        make_plan(protocol, allow_large=True)


def test_scatter_and_shares_are_swept_by_their_path(desk, simulink: str) -> None:
    desk.write(
        "own.toml",
        simulink.replace("[limits]\n", "[variation.day_to_day]\nload.coulomb_torque = 0.1\n"
        "static_torque = { relative = 0.1 }\n[variation.trial_to_trial]\n"
        "both = { paths = ['static_torque', 'coulomb_torque'], relative = 0.1 }\n"
        "[gear.preload]\ntorque = '2 N m'\nnominal = '1 N m'\n[limits]\n"),
    )  # fmt: skip
    test = GOOD.replace('"simulink"', '"own.toml"')
    for path in (
        "variation.day_to_day.load.coulomb_torque",
        "variation.day_to_day.static_torque",
        "variation.trial_to_trial.both.relative",
        "gear.preload.shares.static_torque",
    ):
        path = f"bench.{path}"
        assert swept(desk, f"matrix = {{ '{path}' = [0, 0.2] }}\n", path, test) == [0, 0.2]


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("variation.static_torque", "allowed are .*bench.variation.day_to_day, bench.variation.tr"),
        ("gear.preload.static_share", "allowed are .*bench.gear.preload.shares"),
        ("variation.day_to_day.static_torque.relative", "static_torque' has no parts"),
        ("variation.day_to_day.static_torqe", "did you mean 'bench.variation.day_to_day.static_to"),
    ],
)
def test_what_is_not_there_cannot_be_swept(desk, path: str, message: str) -> None:
    platform = GOOD.replace('"simulink"', '"platform"')
    with pytest.raises(ProtocolError, match=f"nothing to sweep at 'bench.{path}'.*{message}"):
        desk.load(platform + f"matrix = {{ 'bench.{path}' = [0, 0.2] }}\n")
