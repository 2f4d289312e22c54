"""Every mistake is reported at its own line and column (marked § in the text), with a way out."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from campaign.errors import ProtocolError
from campaign.protocol import load_protocol

HEAD = '[[test]]\nname = "t"\nkind = "swing"\nbench = "simulink"\n'
GOOD = HEAD + 'frequency = "0.24 Hz"\n'
SWEPT = GOOD + "[test.matrix]\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        # Not TOML.
        ("title = §\n", r"not valid TOML: invalid value"),
        ('title = "a"\n[[test§]\n', r"not valid TOML: expected ']]'"),
        ('title = "never closed§', r"not valid TOML"),
        ('title = "a"\ntitle = "b"§\n', r"not valid TOML: cannot overwrite a value"),
        # The top level.
        (GOOD.replace("[[test]]", '§titel = "x"\n[[test]]'), r"unknown key 'titel'.*'title'\?"),
        ("title = §3\n" + GOOD, r"3 is not text in quotes"),
        ('tags = §"a"\n' + GOOD, r"'a' is not a list"),
        ('tags = ["a", §1]\n' + GOOD, r"1 is not text in quotes"),
        ("§title = 'no tests'\n", r"no tests; add a \[\[test\]\]"),
        ("§", r"no tests"),
        ("§[test]\nname = 't'\n", r"a table is not a list; write \[\[test\]\]"),
        # What every test has.
        (GOOD.replace('"swing"', '§"swign"'), r"unknown kind 'swign'.*speeds.*'swing'\?"),
        (GOOD.replace('"swing"', "§7"), r"7 is not text"),
        (GOOD.replace('[[test]]\nname = "t"', "§[[test]]"), r"'name' is missing: Name of the test"),
        (GOOD.replace('"t"', "§[]"), r"a list is not text in quotes"),
        (GOOD.replace('"t"', '§"Tea Time"'), r"'Tea Time': must be lower-case letters and digits"),
        (GOOD.replace('"simulink"', '§"simulik"'), r"no shipped bench.*or the path.*'simulink'\?"),
        (GOOD.replace('"simulink"', '§"nope.toml"'), r"'nope.toml': no such file \(looked for"),
        (GOOD.replace('"simulink"', '§"../.."'), r"a folder, not a TOML file"),
        (GOOD.replace('"simulink"', r'§"a\u0000b.toml"'), r"cannot be read|no such file"),
        (GOOD + "repeat = §0\n", r"0 is out of range; it must be at least 1"),
        (GOOD + 'repeat = §"2"\n', r"'2' is not a whole number"),
        (GOOD + "repeat = §true\n", r"true is not a whole number"),
        (GOOD + 'order = §"shufled"\n', r"allowed are as written, shuffled; did you mean 'shuf"),
        (GOOD + "seed = §-1\n", r"-1 is out of range"),
        (GOOD + "seed = §99999999999999999999\n", r"more than 64 bits"),
        (GOOD + "matrix = §3\n", r"3 is not a table"),
        # The options of its kind.
        (HEAD.replace("[[", "§[["), r"'frequency' is missing: a frequency such as \"1 Hz\"; Of"),
        (GOOD + '§frequenzy = "1 Hz"\n', r"unknown key 'frequenzy'; .*did you mean 'frequency'\?"),
        (GOOD + "§repaet = 3\n", r"did you mean 'repeat'\?"),
        (HEAD + 'frequency = §"0,24 Hz"\n', r"decimal sign is a point"),
        (HEAD + "frequency = §0.24\n", r"0.24 has no unit; .*\"0.24 Hz\""),
        (HEAD + 'frequency = §"0.24"\n', r"has no unit"),
        (HEAD + 'frequency = §"1 rad/s"\n', r"'rad/s' is not a unit of frequency; allowed are Hz"),
        (HEAD + 'frequency = §"0.24 Hurtz"\n', r"'Hurtz' is not a unit; allowed are Hz"),
        (HEAD + 'frequency = §"fast"\n', r"does not begin with a number"),
        (HEAD + 'frequency = §"-1 Hz"\n', r"'-1 Hz' is out of range; it must be greater than 0 Hz"),
        (
            GOOD + 'acceleration = §"-18 deg/s^2"\n',
            r"'-18 deg/s\^2' is out of range; it must be greater than 0 rad/s\^2",
        ),
        (HEAD + 'frequency = §"nan Hz"\n', r"not a finite number"),
        (HEAD + "frequency = §nan\n", r"nan is not a finite number"),
        (HEAD + "frequency = §true\n", r"true is not a frequency as text"),
        (HEAD + 'frequency = §["1 Hz"]\n', r"a list is not a frequency as text, such as \"1 Hz\""),
        (HEAD + "frequency = §2020-01-01\n", r"2020-01-01 is not a frequency as text"),
        (GOOD + "gain = §inf\n", r"inf is not a finite number"),
        (GOOD + 'gain = §"3"\n', r"'3' is not a number"),
        (GOOD + "gain = §true\n", r"true is not a number"),
        (GOOD + 'flag = §"yes"\n', r"'yes' is not true or false"),
        (GOOD + "flag = §1\n", r"1 is not true or false"),
        (GOOD + "cycles = §2.5\n", r"2.5 is not a whole number"),
        (GOOD + 'style = §"fsat"\n', r"'fsat' is not allowed here; .*did you mean 'fast'\?"),
        (GOOD + 'compensation = §"lugree"\n', r"no compensation of the bench 'simuli.*'lugre'\?"),
        # The matrix: paths.
        (GOOD + 'matrix = { §acceleratio = ["1 deg/s^2"] }\n', r"did you mean 'acceleration'\?"),
        (SWEPT + '§"bench.axis.inertai" = ["3 kg m^2"]\n', r"mean 'bench.axis.inertia'\?"),
        (
            SWEPT + "bench.friction.laod.§coulomb_torque = ['3 N m']\n",
            r"nothing to sweep at 'bench.friction.laod'; .*did you mean 'bench.friction.load'\?",
        ),
        (SWEPT + '§"bench.compensation.observer.gian" = ["3 N m s/rad"]\n', r"observer.gain'\?"),
        (GOOD + 'matrix = { §bench = ["simulink"] }\n', r"one \[\[test\]\] for each bench"),
        (GOOD + "matrix = { §repeat = [1, 2] }\n", r"'repeat' belongs to the whole test"),
        (GOOD + "matrix = { frequency.§x = [1] }\n", r"'frequency.x': 'frequency' has no parts"),
        # The matrix: values.
        (GOOD + "matrix = { cycles = §3 }\n", r"3 is no sweep; write a list"),
        (GOOD + "matrix = { cycles = §[] }\n", r"an empty list"),
        (GOOD + "matrix = { cycles = [1, §0] }\n", r"0 is out of range"),
        (GOOD + "matrix = { cycles = [§'x', 1] }\n", r"'x' is not a whole number"),
        (GOOD + "matrix = { gain = [1, 2, §nan] }\n", r"nan is not a finite number"),
        (GOOD + "matrix = { cycles = [1, 2, §1] }\n", r"1 stands there twice; .*repeat"),
        (SWEPT + 'acceleration = ["1 deg/s^2", §18]\n', r"18 has no unit; .*\"18 deg/s\^2\""),
        (
            SWEPT + '"bench.axis.inertia" = ["35 kg m^2", §"0 kg m^2", §"3 kg"]\n',
            r"greater than 0 kg m\^2[\s\S]*'kg' is not a unit of moment of inertia",
        ),
        (SWEPT + 'compensation = ["none", §"sttic", "lugre"]\n', r"did you mean 'static'\?"),
        (SWEPT + '"bench.friction.load.model" = ["lugre", §"lugri"]\n', r"unknown model 'lugri'"),
        (GOOD + "§gain = 1\nmatrix = { gain = [2] }\n", r"'gain' is swept by the matrix and given"),
        # The matrix: ranges.
        (GOOD + "matrix = { gain = { start = 1, stop = 2, §nun = 3 } }\n", r"did you mean 'num'\?"),
        (GOOD + "matrix = { gain = §{ start = 1, stop = 2 } }\n", r"either 'num' or 'step'"),
        (GOOD + "matrix = { gain = §{ start = 1, num = 2 } }\n", r"'stop' is missing"),
        (GOOD + "matrix = { gain = §{ start = 1, stop = 2, num = 2, step = 1 } }\n", r"either"),
        (GOOD + "matrix = { gain = { start = 1, stop = 2, num = §0 } }\n", r"at least 1"),
        (GOOD + "matrix = { gain = §{ start = 1, stop = 2, step = -1 } }\n", r"never reaches"),
        (GOOD + "matrix = { gain = §{ start = 1, stop = 2, step = 0 } }\n", r"never reaches"),
        (GOOD + "matrix = { gain = §{ start = 0, stop = 1, step = 1e-300 } }\n", r"over 10000000"),
        (GOOD + "matrix = { gain = { start = 0, stop = 1, num = §999999999999 } }\n", r"at most"),
        (SWEPT + "gain = §{ start = 0, stop = 1, num = 3, spacing = 'log' }\n", r"one sign, nei"),
        (SWEPT + "gain = { start = 1, stop = 2, num = 3, spacing = §'lin' }\n", r"mean 'linear'\?"),
        (SWEPT + 'acceleration = §{ start = "1 deg/s^2", stop = 2, num = 3 }\n', r"different unit"),
        (
            SWEPT
            + "acceleration = §{ start = '1 rad/s^2', stop = '2 rad/s^2', step = '9 deg/s^2' }\n",
            r"different un",
        ),
        (GOOD + "matrix = { acceleration = §{ start = 1, stop = 2, num = 3 } }\n", r"has no unit"),
        (GOOD + "matrix = { gain = §{ start = -1, stop = 2, num = 3 } }\n", r"at least 0"),
    ],
)
def test_mistake_in_a_protocol(desk, text: str, message: str) -> None:
    problems = desk.problems(text)
    assert re.search(message, str(ProtocolError(problems))), str(ProtocolError(problems))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('inertia = "35 kg m^2"', "inertia = §35", r"35 has no unit; .*\"35 kg m\^2\""),
        ('inertia = "35', '§inertai = "35', r"unknown key 'inertai'.*did you mean 'inertia'\?"),
        ('[axis]\nname = "azimuth"', "§[axis]", r"'name' is missing"),
        ('inertia = "35 kg m^2"', 'inertia = §"-35 kg m^2"', r"must be greater than 0 kg m\^2"),
        ("ratio = 141.176", "ratio = §'many'", r"'many' is not a number"),
        ("[gear]\nratio = 141.176", "§[gear]", r"'ratio' is missing: N: motor rate over load"),
        ('form = "ideal"', 'form = §"ideel"', r"unknown form 'ideel'; .*ideal, parallel"),
        ('[controller.rate]\nform = "ideal"', "§[controller.rate]", r"'form' is missing; allowed"),
        (
            'model = "lugre"',
            'model = §"LuGree"',
            r"'LuGree'; allowed are armstrong.*; did you mean",
        ),
        ("compensation.obs", "compensation.§obz", r"'obzerver'; .*'observer'\?, or say which with"),
        ('[limits]\nangle = "90 deg"', "§[limits]", r"'angle' is missing: an angle"),
        ('[limits]\nangle = "90 deg"', '[limits]\nangle = §"90 deg/s"', r"not a unit of angle"),
        ("[motor]\n", "[motor]\nbad = §\n", r"not valid TOML"),
    ],
)
def test_mistake_in_a_bench(desk, simulink: str, old: str, new: str, message: str) -> None:
    assert simulink.count(old) >= 1
    desk.write("benches/own.toml", simulink.replace(old, new, 1))
    problems = desk.problems(GOOD.replace('"simulink"', '"benches/own.toml"'))
    assert re.search(message, str(ProtocolError(problems))), str(ProtocolError(problems))


DAYS, TRIALS = "[variation.day_to_day]\n", "[variation.trial_to_trial]\n"
PRELOAD = "[gear.preload]\ntorque = '2 N m'\nnominal = '1 N m'\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (DAYS + "§coulomb_torqe = 0.1\n", "did you mean 'coulomb_torque'"),
        (TRIALS + "load.§gain = 0.1\n", "friction.load has no parameter 'gain'"),
        (TRIALS + "§'laod.static_torque' = 0.1\n", "no friction interface 'laod'; allowed are lo"),
        (
            TRIALS + "a = { relative = 0.1, paths = [§'x'] }\n",
            "no friction interface has a par.*'x'",
        ),
        (DAYS + "'*' = { §sign_smoothing = 0.1 }\n", "has a parameter 'sign_smoothing' that can"),
        (DAYS + "static_torque = { §relatve = 0.1 }\n", "unknown key 'relatve'; allowed are paths"),
        (DAYS + "static_torque = §0.4\n", "0.4 is out of range; it must be at most 0.3"),
        (DAYS + "load.coulomb_torque = §'3 %'\n", "'3 %': not a relative standard dev"),
        (DAYS + "viscous_friction = 0.1\n§'*.viscous_friction' = 0.1\n", "stands there twice"),
        ("[variation]\n§static_torque = 0.1\n", "allowed are seed, day, day_to_day, trial_to_tri"),
        (PRELOAD + "§static_share = 1.0\n", "allowed are torque, nominal, shares"),
        (PRELOAD + "shares = { §stribeck_velocity = 1.0 }\n", "is a torque; allowed are coulomb_t"),
        (PRELOAD + "shares = { load = { static_torque = §3 } }\n", "3 is out of range"),
    ],
)
def test_mistake_in_the_path_of_a_friction_parameter(
    desk, simulink: str, text: str, message: str
) -> None:
    desk.write("own.toml", simulink.replace("[limits]\n", f"{text}[limits]\n"))
    problems = desk.problems(GOOD.replace('"simulink"', '"own.toml"'))
    assert re.search(message, str(ProtocolError(problems)))


def test_everything_wrong_is_said_at_once(desk, simulink: str) -> None:
    desk.write(
        "own.toml", simulink.replace('"35 kg m^2"', "§35").replace("[gear]", "[gear]\n§a = 1")
    )
    desk.write("more.toml", HEAD.replace('"t"', '"u"') + "frequency = §1\n")
    problems = desk.problems(
        'include = ["more.toml"]\n§oparator = "me"\n'
        + HEAD.replace('"simulink"', '"own.toml"')
        + "frequency = §2\ncycles = §0\n"
    )
    assert len(problems) == 6


def test_a_bench_of_two_tests_complains_once(desk, simulink: str) -> None:
    desk.write("own.toml", simulink.replace('"35 kg m^2"', "§35"))
    test = GOOD.replace('"simulink"', '"own.toml"')
    assert len(desk.problems(test + test.replace('"t"', '"u"'))) == 1


def test_column_counts_characters_not_bytes(desk) -> None:
    desk.problems(GOOD + 'matrix = { style = ["slow", §"größe", §"x"] }\n')


def test_windows_line_ends_and_byte_order_mark(desk) -> None:
    with pytest.raises(ProtocolError) as caught:
        desk.load("\ufeff" + (HEAD + "frequency = 1\n").replace("\n", "\r\n"))
    assert [(p.line, p.column) for p in caught.value.problems] == [(5, 13)]


# Files that cannot be used.


BACK = 'include = [§"protocol.toml"]\n'


@pytest.mark.parametrize(
    ("files", "text", "message"),
    [
        (
            {"a.toml": 'include = ["b.toml"]\n' + GOOD, "b.toml": BACK},
            'include = ["a.toml"]\n',
            "includes itself: protocol.toml → a.toml → b.toml → protocol.toml",
        ),
        (
            {"sub/a.toml": 'include = [§"../sub/../protocol.toml"]\n'},
            'include = ["sub/a.toml"]\n',
            "protocol.toml → sub/a.toml → protocol.toml",
        ),
        (
            {"a.toml": 'include = ["c.toml"]\n', "c.toml": GOOD},
            'include = ["a.toml", §"c.toml"]\n',
            "included twice, the first time: protocol.toml → a.toml → c.toml",
        ),
        ({}, 'include = [§"other.toml"]\n' + GOOD, "'other.toml': no such file (looked for"),
        ({}, 'published = §"own.toml"\n' + GOOD, "no such file"),
        (
            {"benches/platform.toml": ""},
            GOOD.replace('"simulink"', '§"benches/platfrom.toml"'),
            "did you mean 'platform.toml'?",
        ),
        (
            {"more.toml": GOOD},
            'include = ["more.toml"]\n' + GOOD.replace('"t"', '§"t"'),
            "more.toml:2:8",  # the first of that name
        ),
    ],
)
def test_files_that_name_others(desk, files: dict[str, str], text: str, message: str) -> None:
    for name, content in files.items():
        desk.write(name, content)
    problems = desk.problems(text)
    assert message in problems[0].message


def test_deep_chain_of_includes(desk) -> None:
    for number in range(1, 40):
        mark = "§" if number == 15 else ""
        desk.write(f"{number}.toml", f'include = [{mark}"{number + 1}.toml"]\n')
    problems = desk.problems('include = ["1.toml"]\n')
    assert "more than 16 files" in problems[0].message


def test_a_missing_bench_is_not_taken_for_the_protocol_that_names_it(desk, simulink: str) -> None:
    problems = desk.problems(GOOD.replace('"simulink"', '§"protocols.toml"'))
    assert "did you mean" not in problems[0].message
    desk.write("Rig.toml", simulink)
    problems = desk.problems(GOOD.replace('"simulink"', '§"rig"'))
    assert "did you mean 'Rig.toml'?" in problems[0].message


def test_a_bench_that_is_included_is_told_to_be_one(desk, simulink: str) -> None:
    desk.write("rig.toml", "schema = 3\n" + simulink)
    problems = desk.problems('include = ["rig.toml"]\n' + GOOD)
    assert [str(each.file.name) for each in problems] == ["rig.toml"]
    assert "this is a bench, and a protocol is asked for" in problems[0].message


def _only_problem(path: Path) -> str:
    with pytest.raises(ProtocolError) as caught:
        load_protocol(path, {}, shipped=path)
    assert len(caught.value.problems) == 1
    return str(caught.value)


def test_files_that_are_no_text(tmp_path: Path) -> None:
    latin = tmp_path / "latin.toml"
    latin.write_bytes('title = "a"\nnotes = "größe"\n'.encode("latin-1"))
    assert "latin.toml: not UTF-8 text (byte 24, line 2)" in _only_problem(latin)
    assert "no such file" in _only_problem(tmp_path / "none.toml")
    assert "a folder" in _only_problem(tmp_path)
    large = tmp_path / "large.toml"
    large.write_bytes(b"#" * (4 * 1024 * 1024 + 1))
    assert "larger than 4 MiB" in _only_problem(large)
    pipe = tmp_path / "pipe.toml"
    os.mkfifo(pipe)
    assert "not a regular file" in _only_problem(pipe)  # and does not wait for a writer


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may read everything")
def test_file_without_permission(tmp_path: Path) -> None:
    path = tmp_path / "secret.toml"
    path.write_text("")
    path.chmod(0)
    assert "cannot be read: Permission denied" in _only_problem(path)


@pytest.mark.parametrize(
    "text",
    [
        "a = " + "[" * 5000,
        "a = " + "[" * 100 + "]" * 100,
        "a" + ".a" * 5000 + " = 1",
        "a = " + "9" * 9999,
    ],
    ids=["unclosed", "nested", "dotted", "digits"],
)
def test_absurd_text(desk, text: str) -> None:
    with pytest.raises(ProtocolError):
        desk.load(text)
