"""EMPS from its files to the numbers that docs/identification.md has, where the files are."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from campaign.cli.identify import identify_run
from campaign.cli.import_command import import_recordings
from campaign.errors import ExitCode

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared" / "data" / "emps"
PAGE = (ROOT / "docs" / "identification.md").read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.skipif(not DATA.is_dir(), reason="the EMPS files are not here")
def test_emps_is_as_the_docs_say(tmp_path: Path) -> None:
    for name in ("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat"):
        (tmp_path / name).symlink_to(DATA / name)
    docs = (ROOT / "docs" / "import.md").read_text(encoding="utf-8")
    _, example = docs.split("## A worked example: EMPS\n")
    rig, mapping = re.findall(r"```toml\n(.*?)```", example, re.S)
    # The constant of the data set itself: its published digits need all of it.
    mapping = mapping.replace("35.15065 N/V", "35.15065188248547 N/V")
    (tmp_path / "emps-rig.toml").write_text(rig, encoding="utf-8")
    (tmp_path / "emps.toml").write_text(mapping, encoding="utf-8")
    assert import_recordings([str(tmp_path / "emps.toml")], tmp_path / "results") is ExitCode.DONE
    run = next((tmp_path / "results").glob("*-emps.nxs")).stem
    page, _ = identify_run(
        f"{run}:estimation",
        tmp_path / "results",
        models=("inverse_dynamics",),
        validate=f"{run}:validation",
        settings=('inverse_dynamics.skip="49 ms"',),
    )
    data = json.loads((page.parent / "identification.json").read_text("utf-8"))
    [method] = data["content"]["methods"]
    tables = {t["key"]: t["rows"] for each in data["sections"] for t in each["tables"]}
    alike = [row["value"] for row in tables["plain-1"]]
    assert [f"{float(value):.4f}" for value in alike] == [
        "95.1089", "203.5034", "20.3935", "-3.1648"
    ]  # fmt: skip
    each = {row["term"]: f"{float(row['value']):.4f}" for row in tables["plain-2"]}
    assert each == {
        "mass": "95.1540",
        "viscous_positive": "166.7061",
        "viscous_negative": "240.4236",
        "coulomb_positive": "20.1440",
        "coulomb_negative": "20.6277",
    }
    unseen = [f"{100 * row['validation']['value']:.4f}" for row in tables["structures"][:2]]
    assert unseen == ["5.9824", "5.3649"]
    for number in ("95.1089", "203.5034", "166.7061, 240.4236", *unseen):
        assert number in PAGE
    gains = [row["gain"] for row in tables["structures"][2:]]
    assert all(gain["low"] > 0.01 for gain in gains)  # the delay alone gains more than 1 %
    found = {row["quantity"]: row for row in method["parameters"]}
    for name, told in (("inertia", "94.9 ± 0.7"), ("viscous_positive", "158 ± 12")):
        value, half = (float(number) for number in told.split(" ± "))
        assert told in PAGE
        assert found[name]["value"] == pytest.approx(value, abs=0.06 * half + 0.5)
