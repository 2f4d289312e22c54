"""The tutorial, block by block, as a new user does it."""

from __future__ import annotations

import csv
import re
import shlex
import tomllib
from pathlib import Path

import pytest

from tests.system.user import campaign

PAGE = (Path(__file__).parents[2] / "docs" / "tutorial.md").read_text(encoding="utf-8")
FIRST, SECOND = PAGE.split("## From recordings to a bench file")
TRUE = {"coulomb_torque": 6.0, "static_torque": 8.0, "viscous_friction": 4.0}


def blocks(text: str, kind: str) -> list[str]:
    return re.findall(rf"^```{kind}\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


def followed(folder: Path, lines: str, run: str = "") -> str:
    """Each command of a block in its folder; the path that the last `RUN=` printed."""
    for line in lines.splitlines():
        kept = re.fullmatch(r"RUN=\$\((.*)\)", line)
        words, _, into = (kept[1] if kept else line).replace("$RUN", run).partition(" > ")
        arguments: list[str] = []
        for each in shlex.split(words)[1:]:
            found = sorted(folder.glob(each)) if "*" in each else []
            arguments += [str(path.relative_to(folder)) for path in found] or [each]
        done = campaign(folder, *arguments)
        if kept:
            run = done.last_line
        if into:
            (folder / into).write_text(done.out, encoding="utf-8")
    return run


@pytest.mark.slow
def test_from_a_data_sheet_to_a_compensated_axis(tmp_path: Path) -> None:
    axis, friction, sea = blocks(FIRST, "toml")
    (tmp_path / "my-axis.toml").write_text(axis)
    bare = "".join(line for line in axis.splitlines(True) if not line.startswith("friction = {}"))
    (tmp_path / "rig.toml").write_text(f"{bare}\n{friction}")
    (tmp_path / "sea.toml").write_text(sea)
    run = ""
    for block in blocks(FIRST, "console"):
        run = followed(tmp_path, block, run)
    found = tomllib.loads((tmp_path / "found.toml").read_text())["friction"]["load"]
    for name, value in TRUE.items():
        assert float(found[name].split()[0]) == pytest.approx(value, rel=1e-2)
    (table,) = tmp_path.glob("results/*-sea-report/tables/waves-stabilization-error.csv")
    with table.open(newline="") as rows:
        errors = {row["compensation"]: float(row["error_mrad"]) for row in csv.DictReader(rows)}
    told = dict(
        re.findall(r"^\| (none|guessed values|identified values) \| ([\d.]+) mrad", PAGE, re.M)
    )
    names = {
        "none": "none",
        "guessed values": "stribeck",
        "identified values": "stribeck-identified",
    }
    for words, number in told.items():
        assert errors[names[words]] == pytest.approx(float(number), rel=0.05)
    assert sorted(path.name for path in (tmp_path / "code").iterdir()) == [
        "compensation_stribeck_identified.c",
        "compensation_stribeck_identified_test.c",
    ]
    head = (tmp_path / "code" / "compensation_stribeck_identified.c").read_text()
    assert re.search(r"friction.load.coulomb_torque = \S+ \(95 %: \S+ to \S+; measured\)", head)


@pytest.mark.slow
def test_from_recordings_to_a_bench_file(tmp_path: Path) -> None:
    (rig,) = blocks(SECOND, "toml")
    (tmp_path / "rig.toml").write_text(rig)
    run = ""
    for block in blocks(SECOND, "console"):
        run = followed(tmp_path, block, run)
    found = tomllib.loads((tmp_path / "found.toml").read_text())
    assert {"axis.inertia", "friction.load.coulomb_torque"} <= found["known"]["values"].keys()
