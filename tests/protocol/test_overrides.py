"""What `--set` changes, and what it says when it cannot."""

from __future__ import annotations

import pytest

from campaign.errors import ProtocolError
from campaign.protocol import make_plan

TEST = (
    '[[test]]\nname = "swing"\nkind = "swing"\nbench = "simulink"\nfrequency = "0.24 Hz"\n'
    "matrix = { cycles = [1, 2] }\n"
)


def plan(desk, *overrides: str):
    return make_plan(desk.load(TEST, *overrides), seed=0)


def test_option_as_bare_text_and_as_toml(desk) -> None:
    for text in ("swing.frequency=0.5 Hz", 'swing.frequency = "0.5 Hz"'):
        assert plan(desk, text).trials[0].options["frequency"] == 0.5


def test_field_of_the_bench(desk) -> None:
    trials = plan(desk, "swing.bench.axis.inertia=40 kg m^2").trials
    assert [trial.bench["axis"]["inertia"] for trial in trials] == [40.0, 40.0]
    assert plan(desk).trials[0].bench["axis"]["inertia"] == 35.0


def test_setting_a_swept_path_ends_its_sweep(desk) -> None:
    trials = plan(desk, "swing.cycles=5").trials
    assert [(trial.point, trial.options["cycles"]) for trial in trials] == [({}, 5)]


def test_a_sweep_can_be_set(desk) -> None:
    trials = plan(desk, "swing.matrix.cycles=[3, 4]", 'swing.matrix.style=["slow", "fast"]').trials
    assert [trial.point["cycles"] for trial in trials] == [3, 3, 4, 4]
    dotted = plan(desk, "swing.matrix.bench.gear.ratio=[100, 120]").trials
    assert [trial.point.get("bench.gear.ratio") for trial in dotted] == [100, 120, 100, 120]


def test_whole_matrix_and_common_keys(desk) -> None:
    changed = plan(desk, "swing.matrix={ gain = [1, 2, 3] }", "swing.repeat=2")
    assert len(changed.trials) == 6
    assert changed.protocol.overrides == ("swing.matrix={ gain = [1, 2, 3] }", "swing.repeat=2")


def test_top_level(desk) -> None:
    top = plan(desk, "title=A new day", "operator=me", 'tags=["a", "b"]').protocol
    assert (top.title, top.operator, top.tags) == ("A new day", "me", ("a", "b"))


def test_the_last_one_wins(desk) -> None:
    trials = plan(desk, "swing.cycles=5", "swing.cycles=6").trials
    assert [trial.options["cycles"] for trial in trials] == [6]


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("swing.frequency=0.5", r'0.5 has no unit; write it as text, such as "0.5 Hz"'),
        ("swing.frequency=0.5 rad/s", "'rad/s' is not a unit of frequency"),
        ("swing.frequenci=0.5 Hz", "did you mean 'frequency'?"),
        ("swing.cycles=0", "must be at least 1"),
        ("swing.matrix.cycles=[1, 0]", "must be at least 1"),
        ("swing.matrix.cicles=[1]", "did you mean 'cycles'?"),
        ("swing.matrix.cycles=7", "7 is no sweep"),
        ("swing.bench.axis.inertia=40", "40 has no unit"),
        ("swing.bench.axis.inertai=40 kg m^2", "did you mean 'inertia'?"),
        ("swing.bench=simulnk", "did you mean 'simulink'?"),
        ("swing.compensation=lugr", "did you mean 'lugre'?"),
        ("swing.kind=swin", "did you mean 'swing'?"),
        ("swimg.cycles=3", "did you mean 'swing'?"),
        ("swing=3", "'swing' is a whole test"),
        ("titel=x", "did you mean 'title'?"),
        ("tags=x", "'x' is not a list"),
        ("include=[]", "no test and no top-level key is called 'include'"),
        ("swing.cycles", "not a setting; write --set test.option=value"),
        ("=3", "not a setting"),
        ("a b=3", "not a setting"),
        ("a\nb.c=3", "not a setting"),
    ],
)
def test_a_setting_that_cannot_be(desk, override: str, message: str) -> None:
    with pytest.raises(ProtocolError) as caught:
        plan(desk, override)
    assert all(str(problem).startswith(f"--set {override}: ") for problem in caught.value.problems)
    assert message in str(caught.value)


def test_text_that_would_smuggle_in_more_toml_is_text(desk) -> None:
    assert plan(desk, 'title="a"\noperator="b"').protocol.title == '"a"\noperator="b"'


def test_scatter_by_path(desk) -> None:
    [trial, _] = plan(desk, "swing.bench.variation.day_to_day.coulomb_torque=0.1").trials
    assert trial.bench["variation"]["day_to_day"] == {"coulomb_torque": 0.1}
    [trial, _] = plan(desk, "swing.bench.variation.day_to_day.load.static_torque=0.1").trials
    assert trial.bench["variation"]["day_to_day"] == {"load": {"static_torque": 0.1}}
    text = "swing.bench.variation.day_to_day.load.static_torqe=0.1"
    with pytest.raises(
        ProtocolError, match=r"^--set .*no parameter 'static_torqe'.*'static_torque"
    ):
        plan(desk, text)
