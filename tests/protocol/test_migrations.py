"""Files of an older schema: what they become, what they keep, and what is left to a person."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
import tomlkit

from campaign.cli.migrate import migrate_files, migrated
from campaign.errors import ExitCode, ProtocolError, UsageError
from campaign.experiments import experiments
from campaign.physics.bench import Bench
from campaign.protocol import load_protocol, make_plan
from campaign.protocol.bench_file import load_bench
from campaign.protocol.files import NEWEST
from campaign.protocol.migrations import MIGRATIONS, migrate
from campaign.resources import protocols_folder

from .conftest import SHIPPED

PRESENT = (SHIPPED / "benches" / "platform.toml").read_text(encoding="utf-8")
NOW = PRESENT[PRESENT.index("[variation]") : PRESENT.index("[controller]")]
BEFORE = """\
[variation]
seed = 44 # of all draws
day = 0
# What the days are worth.
coulomb_torque = 0.003 # Table 4.4
static_torque = 0.02
stribeck_velocity = 0.005
viscous_friction = 0.01
bristle_stiffness = 0.03
trial = 0.002

"""
SHARES = "shares = { static_torque = 1.0 }"
FORMER = PRESENT.replace(NOW, BEFORE).replace(SHARES, "static_share = 1.0\ncoulomb_share = 0.0")
PROTOCOL = """\
# A protocol of before.
title = "days" # ours

[[test]]
name = "days"
kind = "stabilization"
bench = "own.toml"

[test.matrix]
compensation = ["none", "lugre"] # both
# The scatter of the days.
"bench.variation.static_torque" = [0.01, 0.02] # to be swept
"bench.gear.preload.static_share" = [0.5, 1.0]
cycles = [3, 6]

[[test.operator]]
text = "Set {bench.gear.preload.static_share} and {{not this}}"
sets = ["bench.gear.preload.static_share"]
"""


def file(folder: Path, text: str, name: str = "own.toml") -> Path:
    path = folder / name
    path.write_bytes(text.encode())
    return path


def test_a_former_bench_becomes_the_same_bench_and_keeps_its_comments(tmp_path: Path):
    assert FORMER.count("static_share") == FORMER.count("[variation]") == 1
    path = file(tmp_path, FORMER)
    before = load_bench(str(path))
    assert migrate_files([path], None, check=False) is ExitCode.DONE
    text = path.read_text(encoding="utf-8")
    assert text.startswith("schema = 3\n")
    assert load_bench(str(path)) == before == load_bench("platform")
    kept = [line.strip() for line in FORMER.splitlines() if line.strip().startswith("#")]
    assert [line for line in kept if line not in text] == []
    assert "seed = 44 # of all draws" in text
    assert "coulomb_torque = 0.003 # Table 4.4" in text
    assert "\n[variation.day_to_day]" in text or "day_to_day = {" in text
    assert migrate_files([path], None, check=True) is ExitCode.DONE  # nothing is left


def test_what_a_bench_was_made_from_moves_under_known(tmp_path: Path):
    name = 'name = "platform"'
    moved = 'given = ["4.3"] # its friction\nfitted = ["5.3"]'
    text = PRESENT.replace(name, f"{name}\n{moved}")
    both = file(tmp_path, text)
    assert migrate_files([both], None, check=False) is ExitCode.TRIALS_FAILED  # by hand
    begin, axis = text.index("[known]"), text.index("[axis]")
    bench = file(tmp_path, text[:begin] + text[axis:], "former.toml")
    before = load_bench(str(bench))
    assert migrate_files([bench], None, check=False) is ExitCode.DONE
    after = bench.read_text(encoding="utf-8")
    assert tomllib.loads(after)["known"] == {"given": ["4.3"], "fitted": ["5.3"]}
    assert "# its friction" in after
    assert load_bench(str(bench)) == before
    assert migrate_files([bench], None, check=True) is ExitCode.DONE


def test_a_former_protocol_sweeps_the_same_again(tmp_path: Path):
    bench, path = file(tmp_path, FORMER), file(tmp_path, PROTOCOL, "days.toml")
    with pytest.raises(ProtocolError):
        load_protocol(path, experiments(), shipped=protocols_folder())
    assert migrate_files([bench, path], None, check=False) is ExitCode.DONE
    plan = make_plan(load_protocol(path, experiments(), shipped=protocols_folder()), seed=1)
    assert list(plan.trials[0].point) == [
        "compensation",
        "bench.variation.day_to_day.static_torque",
        "bench.gear.preload.shares.static_torque",
        "cycles",
    ]
    assert plan.trials[0].set_by_operator == ("bench.gear.preload.shares.static_torque",)
    assert "0.5" in plan.trials[0].setup[0]
    text = path.read_text(encoding="utf-8")
    for comment in ("# A protocol of before.", "# ours", "# both", "# to be swept"):
        assert comment in text
    assert "{{not this}}" in text


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize(("text", "kind"), [(FORMER, "bench"), (PROTOCOL, "protocol")])
def test_the_text_says_what_the_migrated_values_are(tmp_path: Path, text, kind, end):
    """The table of migrations works on plain values and on an editor's document alike."""
    plain = tomllib.loads(text)
    assert migrate(plain, kind)
    found, new, _ = migrated(file(tmp_path, text.replace("\n", end)))
    assert found == kind
    assert tomllib.loads(new) == {**plain, "schema": NEWEST[kind]}
    assert ("\r\n" in new) == (end == "\r\n")
    assert new.count("\n") == new.count(end)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            FORMER.replace("trial = 0.002", "trial = 0.002\nday_to_day = { static_torque = 0.1 }"),
            "variation.static_torque: BY HAND",
        ),
        (FORMER.replace("static_share", f"{SHARES}\nstatic_share"), "static_share: BY HAND"),
        (PROTOCOL.replace("variation.static_torque", "variation.trial"), "is a table of the bench"),
        (
            PROTOCOL.replace('"bench.variation.static_torque"', "bench.variation.static_torque"),
            "written as tables, it is left to you",
        ),
        (
            PROTOCOL.replace(
                "cycles =", '"bench.variation.day_to_day.static_torque" = [0.5]\ncycles ='
            ),
            "matrix.bench.variation.static_torque: BY HAND: is given as bench.variation.day_to_day",
        ),
    ],
)
def test_what_a_person_must_decide_is_said_and_nothing_is_written(
    tmp_path: Path, capsys, text: str, message: str
):
    path = file(tmp_path, text)
    assert migrate_files([path], None, check=False) is ExitCode.TRIALS_FAILED
    assert path.read_bytes() == text.encode()
    said = capsys.readouterr()
    assert message in said.out
    assert "not written" in said.err


def test_check_writes_nothing_and_output_goes_beside(tmp_path: Path):
    path, beside = file(tmp_path, FORMER), tmp_path / "new.toml"
    assert migrate_files([path], None, check=True) is ExitCode.TRIALS_FAILED
    assert migrate_files([path], beside, check=False) is ExitCode.DONE
    assert path.read_bytes() == FORMER.encode()
    assert load_bench(str(beside)) == load_bench(str(path))
    with pytest.raises(UsageError, match="is there already"):
        migrate_files([path], beside, check=False)
    assert {each.name for each in tmp_path.iterdir()} == {"own.toml", "new.toml"}


def test_one_unreadable_file_and_none_is_written(tmp_path: Path):
    good, bad = file(tmp_path, FORMER), file(tmp_path, "x = ]", "bad.toml")
    with pytest.raises(ProtocolError, match=r"bad\.toml:1:5"):
        migrate_files([good, bad], None, check=False)
    assert good.read_bytes() == FORMER.encode()


def test_what_is_shipped_has_the_present_schema(capsys):
    files = sorted(SHIPPED.rglob("*.toml"))
    assert migrate_files(files, None, check=True) is ExitCode.DONE
    assert len(files) > 10


@pytest.mark.parametrize(
    ("schema", "message"),
    [("9", r"written for schema 9.*reads up to \d.*newer campaign"), ("0", "no schema"),
     ('"2"', "no schema"), ("true", "no schema")],
)  # fmt: skip
def test_a_schema_that_is_not_known_is_refused_at_its_place(tmp_path: Path, schema, message):
    bench = file(tmp_path, f"schema = {schema}\n{PRESENT}")
    head = '[[test]]\nname = "a"\nkind = "stabilization"\nbench = '
    named = file(tmp_path, f'{head}"own.toml"\n', "named.toml")
    protocol = file(tmp_path, f'schema = {schema}\n{head}"simulink"\n', "own-schema.toml")
    with pytest.raises(ProtocolError, match=rf"own.toml:1:10: .*{message}"):
        load_bench(str(bench))
    with pytest.raises(ProtocolError, match=rf"own.toml:1:10: .*{message}"):
        load_protocol(named, experiments(), shipped=protocols_folder())
    with pytest.raises(ProtocolError, match=rf"own-schema.toml:1:10: .*{message}"):
        load_protocol(protocol, experiments(), shipped=protocols_folder())
    with pytest.raises(ProtocolError, match=message):
        migrate_files([bench], None, check=False)


def test_saying_the_schema_changes_no_trial(tmp_path: Path):
    head = '[[test]]\nname = "a"\nkind = "stabilization"\nbench = "own.toml"\n'
    plans = []
    for mark in ("", "schema = 2\n", "schema = 1\n"):
        file(tmp_path, mark + PRESENT)
        path = file(tmp_path, mark + head, "p.toml")
        plans.append(make_plan(load_protocol(path, experiments(), shipped=SHIPPED), seed=1))
    assert len({plan.fingerprint for plan in plans}) == 1
    assert len({plan.trials[0].fingerprint for plan in plans}) == 1


def test_every_schema_has_its_migration():
    for kind, steps in MIGRATIONS.items():
        assert len(steps) == NEWEST[kind] - 1


def test_a_migrated_document_is_still_one_of_tomlkit():
    document = tomlkit.parse(FORMER)
    migrate(document, "bench")
    Bench.model_validate(tomllib.loads(document.as_string()))


DOTTED = """\
variation.coulomb_torque = 0.05
variation.trial = 0
motor.x = 1
gear.preload.static_share = 0
"""


@pytest.mark.parametrize("lines", [DOTTED.splitlines(), DOTTED.splitlines()[::-1]])
def test_dotted_keys_are_migrated_or_left_to_a_person(tmp_path: Path, capsys, lines):
    text = "\n".join(lines)
    path = file(tmp_path, text)
    code = migrate_files([path], None, check=False)
    if code is ExitCode.TRIALS_FAILED:
        assert path.read_text(encoding="utf-8") == text
        assert "variation.coulomb_torque: BY HAND" in capsys.readouterr().out
    else:
        plain = tomllib.loads(text)
        migrate(plain, "bench")
        assert tomllib.loads(path.read_text(encoding="utf-8")) == {**plain, "schema": 2}


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_a_comment_on_a_line_that_goes_gets_a_line_of_its_own(tmp_path: Path, end: str):
    text = FORMER.replace("viscous_friction = 0.01", "viscous_friction = 0 # not measured", 1)
    text = text.replace("static_torque = 0.02", 'static_torque = 0.02 # a "quoted" # one')
    text = text.replace("trial = 0.002", "trial = 0.002 # not measured")
    path = file(tmp_path, text.replace("\n", end))
    assert migrate_files([path], None, check=False) is ExitCode.DONE
    lines = path.read_bytes().decode().split(end)
    assert lines.count("# not measured") == 1
    assert "relative = 0.002 # not measured" in lines
    assert 'static_torque = 0.02 # a "quoted" # one' in lines
    kept = [line.partition("#")[2] for line in text.splitlines() if "#" in line]
    assert sorted(kept) == sorted(line.partition("#")[2] for line in lines if "#" in line)


def test_a_protocol_says_which_of_its_benches_are_left_behind(tmp_path: Path, capsys):
    bench, path = file(tmp_path, FORMER), file(tmp_path, PROTOCOL, "days.toml")
    said = "days.toml: names benches of an older schema; migrate them, too: own.toml"
    assert migrate_files([path], None, check=False) is ExitCode.DONE
    assert said in capsys.readouterr().err
    assert migrate_files([path, bench], None, check=False) is ExitCode.DONE
    assert "older schema" not in capsys.readouterr().err
