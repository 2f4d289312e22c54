"""`campaign schema`: every shipped file is valid, and mistakes are found where they are."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft7Validator

from campaign.experiments import experiments
from campaign.importing.json_schema import mapping_schema
from campaign.protocol.json_schema import bench_schema, protocol_schema
from campaign.resources import protocols_folder
from tests.system.user import ROOT, campaign

PROTOCOLS = sorted(protocols_folder().glob("*.toml"))
BENCHES = sorted((protocols_folder() / "benches").glob("*.toml"))
Tree = dict[str, Any]


@pytest.fixture(scope="module")
def protocols() -> Draft7Validator:
    schema = protocol_schema(experiments())
    Draft7Validator.check_schema(schema)
    return Draft7Validator(schema)


@pytest.fixture(scope="module")
def benches() -> Draft7Validator:
    schema = bench_schema()
    Draft7Validator.check_schema(schema)
    return Draft7Validator(schema)


def places(validator: Draft7Validator, tree: Tree) -> set[str]:
    """Where it is wrong: dotted paths."""
    return {".".join(map(str, each.absolute_path)) for each in validator.iter_errors(tree)}


@pytest.mark.parametrize("path", PROTOCOLS, ids=lambda path: path.stem)
def test_a_shipped_protocol_is_valid(protocols: Draft7Validator, path: Path) -> None:
    assert places(protocols, tomllib.loads(path.read_text(encoding="utf-8"))) == set()


@pytest.mark.parametrize("path", BENCHES, ids=lambda path: path.stem)
def test_a_shipped_bench_is_valid(benches: Draft7Validator, path: Path) -> None:
    assert places(benches, tomllib.loads(path.read_text(encoding="utf-8"))) == set()


def put(*keys: str | int, value: Any) -> Callable[[Tree], None]:
    def change(tree: Any) -> None:
        for key in keys[:-1]:
            tree = tree[key]
        tree[keys[-1]] = value

    return change


def drop(*keys: str | int) -> Callable[[Tree], None]:
    def change(tree: Any) -> None:
        for key in keys[:-1]:
            tree = tree[key]
        del tree[keys[-1]]

    return change


@pytest.mark.parametrize(
    ("change", "place"),
    [
        (put("test", 0, "speds", value=[]), "test.0"),
        (put("test", 0, "sample_rate", value=200), "test.0.sample_rate"),
        (put("test", 0, "sample_rate", value="fast"), "test.0.sample_rate"),
        (put("test", 0, "max_travel", value="60"), "test.0.max_travel"),
        (put("test", 0, "kind", value="velocity-map"), "test.0.kind"),
        (put("test", 0, "reproduces", value="5.2"), "test.0.reproduces"),
        (put("test", 0, "repeat", value=0), "test.0.repeat"),
        (put("test", 0, "order", value="random"), "test.0.order"),
        (put("test", 0, "seed", value=-1), "test.0.seed"),
        (put("test", 0, "speeds", value="1 deg/s"), "test.0.speeds"),
        (put("tests", value=[]), ""),
        (put("schema", value=3), "schema"),
        (put("tags", value="quickstart"), "tags"),
        (put("title", value=3), "title"),
        (put("check", value={"test": "velocity-map"}), "check"),
        (drop("test", 1, "kind"), "test.1"),
        (drop("test", 1, "bench"), "test.1"),
    ],
)
def test_a_mistake_in_a_protocol_is_found_where_it_is(
    protocols: Draft7Validator, change: Callable[[Tree], None], place: str
) -> None:
    tree = tomllib.loads((protocols_folder() / "quickstart.toml").read_text(encoding="utf-8"))
    change(tree)
    assert place in places(protocols, tree)


@pytest.mark.parametrize(
    ("change", "place"),
    [
        (put("axis", "inertia", value=35), "axis.inertia"),
        (put("axis", "kind", value="round"), "axis.kind"),
        (put("axis", "inertai", value="35 kg m^2"), "axis"),
        (put("friction", "load", "model", value="lugr"), "friction.load.model"),
        (put("friction", "load", "coulomb_torque", value="much"), "friction.load.coulomb_torque"),
        (put("friction", "load", "coulmb_torque", value="26 N m"), "friction.load"),
        (drop("friction", "load", "model"), "friction.load"),
        (drop("friction", "load", "bristle_stiffness"), "friction.load"),
        (put("compensation", "observer", "gian", value="1 N m s/rad"), "compensation.observer"),
        (put("gear", "lead", value="10 mm/rev"), "gear"),
        (put("sensors", "gyro", "resolution", value=0.1), "sensors.gyro.resolution"),
        (put("limits", "duration", value="ten minutes"), "limits.duration"),
        (put("variation", "day_to_day", value={"coulomb_torque": "2 %"}),
         "variation.day_to_day.coulomb_torque"),
    ],
)  # fmt: skip
def test_a_mistake_in_a_bench_is_found_where_it_is(
    benches: Draft7Validator, change: Callable[[Tree], None], place: str
) -> None:
    path = protocols_folder() / "benches" / "platform.toml"
    tree = tomllib.loads(path.read_text(encoding="utf-8"))
    assert places(benches, tree) == set()
    change(tree)
    assert place in places(benches, tree)


def test_what_a_field_means_is_said_with_its_units(benches: Draft7Validator) -> None:
    inertia = benches.schema["definitions"]["AxisOptions"]["properties"]["inertia"]
    assert inertia["description"].startswith("J: inertia of motor")
    assert "units: kg m^2" in json.dumps(inertia)


MAPPINGS = [
    block
    for block in re.findall(
        r"^```toml\n(.*?)^```$",
        (ROOT / "docs" / "import.md").read_text(encoding="utf-8"),
        re.MULTILINE | re.DOTALL,
    )
    if "[[test.recording]]" in block and "[columns" in block
]


@pytest.mark.parametrize(
    ("change", "place"),
    [
        (put("columns", "pos", "time", "sample_rate", value=1000), "columns.pos.time.sample_rate"),
        (put("columns", "pos", "drive_torque", "unti", value="A"), "columns.pos.drive_torque"),
        (put("columns", "pos", "drive_torque", "sign", value=2), "columns.pos.drive_torque.sign"),
        (put("columns", "pos", value=[]), "columns.pos"),
        (put("test", 0, "recording", 0, "fiel", value="a"), "test.0.recording.0"),
        (drop("test", 0, "recording", 0, "file"), "test.0.recording.0"),
        (put("test", 0, "kind", value="motoin"), "test.0.kind"),
    ],
)
def test_a_mistake_in_a_mapping_is_found_where_it_is(
    change: Callable[[Tree], None], place: str
) -> None:
    schema = mapping_schema(experiments())
    Draft7Validator.check_schema(schema)
    mappings = Draft7Validator(schema)
    trees = [tomllib.loads(text) for text in MAPPINGS]
    assert [places(mappings, tree) for tree in trees] == [set()] * len(trees)
    tree = next(tree for tree in trees if "pos" in tree["columns"])
    change(tree)
    assert place in places(mappings, tree)


@pytest.mark.slow
def test_the_command_prints_each(tmp_path: Path) -> None:
    known = {
        "protocol": "matrix",
        "bench": "inertia",
        "mapping": "sample_rate",
        "report": "findings",
    }
    for of, word in known.items():
        tree = json.loads(campaign(tmp_path, "schema", of).out)
        assert f'"{word}": ' in json.dumps(tree)
    assert "there is no schema of 'maps'" in campaign(tmp_path, "schema", "maps", code=2).err


def test_init_leaves_what_editors_look_for(tmp_path: Path) -> None:
    campaign(tmp_path, "init", "lab")
    rules = tomllib.loads((tmp_path / "lab" / ".taplo.toml").read_text(encoding="utf-8"))["rule"]
    for rule in rules:
        schema = tmp_path / "lab" / rule["schema"]["path"]
        Draft7Validator.check_schema(json.loads(schema.read_text(encoding="utf-8")))
