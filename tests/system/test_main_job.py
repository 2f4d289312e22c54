"""A protocol runs, is archived, and becomes a report: from an empty folder, as a user would."""

from __future__ import annotations

import csv
import json
import re
import shutil
from pathlib import Path

import pytest
import tomlkit

from tests.system.user import SEA, campaign, write


@pytest.fixture(scope="module")
def quickstart(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A folder in which the shipped quick start has run, and the archive."""
    folder = tmp_path_factory.mktemp("quickstart")
    done = campaign(folder, "run", "quickstart", "--report")
    assert done.out.count("\n") == 1, "standard output has the archive's path and nothing else"
    assert "Coulomb friction Tc\tpositive\t25." in done.err, "key numbers beside it"
    assert "22 of 22 intervals hold the true values of the simulated bench." in done.err
    return folder, folder / done.last_line


@pytest.mark.slow
def test_a_run_leaves_one_sealed_archive_and_a_report_where_documented(quickstart):
    folder, archive = quickstart
    report = archive.with_name(f"{archive.stem}-report")
    assert archive.parent == folder / "results"
    results = archive.with_name(f"{archive.stem}-results.nxs")
    assert set(archive.parent.iterdir()) == {archive, report, results}
    assert (report / "report.html").is_file()
    assert (report / "report.json").is_file()
    assert list((report / "tables").glob("*.csv"))
    assert list((report / "figures").glob("*.svg"))


def test_the_demo_opens_with_what_was_found_what_is_true_and_what_compensation_gains(quickstart):
    """The bench's Coulomb friction at the load is 25.2968 N m in the positive direction."""
    _, archive = quickstart
    report = archive.with_name(f"{archive.stem}-report")
    html = (report / "report.html").read_text(encoding="utf-8")
    start = html.index('<section id="opening"')
    opening = html[start : html.index("</section>", start)]
    row = r"Coulomb friction Tc <small>positive</small></th>"
    row += r"<td[^>]*>([\d.]+) ±\s([\d.]+) N·m</td><td[^>]*>([\d.]+) N·m</td>"
    coulomb = re.search(row, opening)
    assert coulomb
    assert abs(float(coulomb[1]) - 25.2968) <= float(coulomb[2]) < 0.3
    assert coulomb[3] == "25.297"
    (held,) = re.findall(r"(\d+) of (\d+) intervals hold the true values", opening)
    assert int(held[1]) >= 20
    assert int(held[0]) >= 0.8 * int(held[1])
    assert "error reduction" in opening
    below = html[start + len(opening) :]
    assert len(re.findall(r"<dt>error reduction, times, \w+</dt><dd>[\d.]+ ±\s[\d.]+<", below)) == 3
    assert '<figure id="' in opening
    assert not (report / "tables" / "scoreboard.csv").exists()
    assert "ublished" not in opening


@pytest.mark.slow
def test_the_scoreboard_reproduces_the_published_stabilization_error(tmp_path: Path):
    archive = tmp_path / campaign(tmp_path, "run", "stabilization", "--report").last_line
    path = archive.with_name(f"{archive.stem}-report") / "tables" / "scoreboard.csv"
    with path.open(encoding="utf-8", newline="") as file:
        lines = list(csv.DictReader(file))
    assert list(lines[0]) == [
        *("table", "row", "column", "unit", "published", "reproduced"),
        *("deviation_percent", "status", "low", "high", "verdict", "source"),
        *("place", "place_low", "place_high", "draws"),
    ]
    none = [line for line in lines if (line["table"], line["row"]) == ("5.2", "none")]
    assert [float(line["published"]) for line in none] == [0.4844]
    assert float(none[0]["reproduced"]) == pytest.approx(0.48841, rel=0.01)
    assert (none[0]["status"], none[0]["source"]) == ("selected", "simulation")


@pytest.mark.slow
def test_the_report_needs_the_archive_alone_and_is_the_same_elsewhere(quickstart, tmp_path: Path):
    _, archive = quickstart
    copy = Path(shutil.copy(archive, tmp_path))
    campaign(tmp_path, "report", copy.name, "--output", "page", start=True)  # other hashes of texts
    first = archive.with_name(f"{archive.stem}-report")
    for file in sorted(path for path in first.rglob("*") if path.is_file()):
        same = tmp_path / "page" / file.relative_to(first)
        assert same.read_bytes() == file.read_bytes(), file.name


@pytest.mark.slow
def test_report_and_identify_take_the_newest_run_when_none_is_named(tmp_path: Path):
    write(tmp_path, SEA)
    campaign(tmp_path, "run", "protocol.toml", "--only", "sea")
    newest = campaign(tmp_path, "run", "protocol.toml").last_line
    page = campaign(tmp_path, "report").last_line
    assert page == str(Path(newest).with_suffix("")) + "-report/report.html"
    refused = campaign(tmp_path, "identify", "--model", "ramps", code=6).err
    assert f"{Path(newest).stem}: no parameter can be identified" in refused


@pytest.mark.slow
def test_own_templates_win_only_when_asked_for(tmp_path: Path):
    write(tmp_path, SEA)
    archive = tmp_path / campaign(tmp_path, "run", "protocol.toml", "--only", "sea").last_line
    (tmp_path / "templates").mkdir()
    write(tmp_path / "templates", "own page of {{ run.name }}\n", "report.html")
    campaign(tmp_path, "report", str(archive), "--output", "packaged")
    campaign(tmp_path, "report", str(archive), "--output", "own", "--templates", "templates")
    assert "own page" not in (tmp_path / "packaged" / "report.html").read_text(encoding="utf-8")
    own = (tmp_path / "own" / "report.html").read_text(encoding="utf-8")
    assert own.strip() == f"own page of {archive.stem}"


def test_list_and_show_say_what_ran(quickstart):
    folder, archive = quickstart
    heading, line = campaign(folder, "list").out.splitlines()
    shown = dict(zip(heading.split("\t"), line.split("\t"), strict=True))
    assert shown["run"] == archive.stem
    assert (shown["status"], shown["failed"], shown["protocol"]) == ("complete", "0", "quickstart")
    unique_beginning = archive.stem[:8]
    show = campaign(folder, "show", unique_beginning).out
    assert archive.stem in show
    for test in ("velocity-map", "breakaway", "stabilization"):
        assert test in show


def test_the_plan_executes_nothing_and_is_what_runs(tmp_path: Path):
    write(
        tmp_path, SEA + '\n[[test]]\nname = "other"\nkind = "stabilization"\nbench = "simulink"\n'
    )
    plan = json.loads(campaign(tmp_path, "plan", "protocol.toml", "--json", "--only", "sea").out)
    assert [path.name for path in tmp_path.iterdir()] == ["protocol.toml"]
    assert [trial["compensation"] for trial in plan["trials"]] == ["none", "lugre"]
    assert plan["duration_s"] == pytest.approx(2 * 2 / 0.24)  # two trials of two cycles at 0.24 Hz
    text = campaign(tmp_path, "plan", "protocol.toml").out
    assert "3 trials" in text
    assert "rate 13%" in text
    assert "of the rate limit" in campaign(tmp_path, "plan", "protocol.toml", "--details").out
    run = campaign(tmp_path, "run", "protocol.toml", "--only", "sea")
    assert run.err.splitlines()[-1].startswith("complete: 2 trials done")


def test_the_plan_warns_of_what_it_can_know_before(tmp_path: Path):
    few = ", ".join(f'"{speed} deg/s"' for speed in (0.1, 0.5, 1, 2, 8))
    write(
        tmp_path,
        f'[[test]]\nname = "m"\nkind = "velocity_map"\nbench = "simulink"\nspeeds = [{few}]\n',
    )
    said = " ".join(campaign(tmp_path, "plan", "protocol.toml").err.split())
    assert "m: 5 speeds cannot determine the 5 parameters" in said
    tree = json.loads(campaign(tmp_path, "plan", "protocol.toml", "--json").out)
    assert len(tree["tests"][0]["warnings"]) == 1


def test_set_changes_a_test_and_the_archive_says_so(tmp_path: Path):
    write(tmp_path, SEA)
    change = 'sea.frequency="0.5 Hz"'
    plan = json.loads(campaign(tmp_path, "plan", "protocol.toml", "--json", "--set", change).out)
    assert plan["duration_s"] == pytest.approx(2 * 2 / 0.5)
    run = campaign(tmp_path, "run", "protocol.toml", "--set", change, "--workers", "1").last_line
    assert change in campaign(tmp_path, "show", run).out


@pytest.mark.slow
def test_init_gives_a_folder_to_start_from_and_never_overwrites(tmp_path: Path):
    campaign(tmp_path, "init", "lab")
    assert (tmp_path / "lab" / "protocols" / "benches" / "simulink.toml").is_file()
    assert (tmp_path / "lab" / "templates" / "report.html").is_file()
    lab = tmp_path / "lab"
    campaign(lab, "plan", "protocols/quickstart.toml")
    write(lab / "protocols", "# mine\n", "quickstart.toml")
    refused = campaign(tmp_path, "init", "lab", code=2)
    assert "nothing was written" in refused.err
    assert (lab / "protocols" / "quickstart.toml").read_text(encoding="utf-8") == "# mine\n"


@pytest.mark.slow
def test_init_writes_protocols_that_fit_a_bench_of_ones_own(tmp_path: Path):
    shipped = (Path(__file__).parents[2] / "protocols/benches/platform.toml").read_text("utf-8")
    small = shipped.replace('angle = "120 deg"', 'angle = "4 deg"')
    assert small != shipped
    write(tmp_path, small, "small-rig.toml")
    said = campaign(tmp_path, "init", "lab", "--bench", "small-rig.toml")
    lab = tmp_path / "lab"
    assert "of bench time" in said.out
    assert not said.err
    assert (lab / "benches" / "small-rig.toml").read_text("utf-8") == small
    plan = json.loads(campaign(lab, "plan", "identify.toml", "--json").out)
    assert {test["kind"] for test in plan["tests"]} >= {"velocity_map", "breakaway"}
    (chosen,) = [test["chosen"] for test in plan["tests"] if test["kind"] == "velocity_map"]
    assert chosen["max_travel"] == "80 % of the angle limit"
    assert "80 % of the angle limit" in (lab / "identify.toml").read_text("utf-8")
    campaign(lab, "plan", "stabilize.toml")
    write(lab, "# mine\n", "identify.toml")
    refused = campaign(tmp_path, "init", "lab", "--bench", "small-rig.toml", code=2)
    assert "nothing was written" in refused.err


@pytest.mark.slow
def test_init_for_a_bench_without_friction_has_a_pilot(tmp_path: Path):
    """Where friction is described the speeds follow from that: no pilot."""
    lines = (Path(__file__).parents[2] / "protocols/benches/platform.toml").read_text("utf-8")
    for name, text in (("known.toml", lines), ("unknown.toml", without_friction(lines))):
        write(tmp_path, text, name)
        folder = name.removesuffix(".toml")
        said = campaign(tmp_path, "init", folder, "--bench", name)
        assert not said.err
        assert ("later stages add at most 30 trials" in said.out) is (name == "unknown.toml")
        plan = json.loads(campaign(tmp_path / folder, "plan", "identify.toml", "--json").out)
        (of_map,) = [test for test in plan["tests"] if test["kind"] == "velocity_map"]
        pilot = name == "unknown.toml"
        assert of_map["options"]["pilot"] is pilot
        assert [stage["most"]["trials"] for stage in of_map["stages"]] == [30] * pilot
        assert len(of_map["trials"]) == (11 if pilot else 41)


def without_friction(text: str) -> str:
    """A bench file without the tables of friction, and what refers to them."""
    document = tomlkit.parse(text)
    for name in ("variation", "known", "compensation"):
        document.pop(name, None)
    document["friction"] = tomlkit.table()
    if "preload" in document["gear"]:
        document["gear"].pop("preload")
    return tomlkit.dumps(document)


@pytest.mark.slow
def test_init_writes_what_a_bench_top_motor_needs(tmp_path: Path):
    """Its loop is fed by an encoder, it turns for ever, it has no hull that swings."""
    page = (Path(__file__).parents[2] / "docs" / "protocols.md").read_text("utf-8")
    write(tmp_path, page.split("```toml sheet\n")[1].split("```")[0], "motor.toml")
    assert not campaign(tmp_path, "init", "lab", "--bench", "motor.toml").err
    lab = tmp_path / "lab"
    assert sorted(path.name for path in lab.rglob("*.toml")) == ["identify.toml", "motor.toml"]
    planned = campaign(lab, "plan", "identify.toml", "--details")
    assert not planned.err  # of its own plan the program has no warning
    assert "70 % of the rate limit" in planned.out
    campaign(tmp_path, "init", "all", "--bench", "motor.toml", "--all")
    assert (tmp_path / "all" / "identify.toml").is_file()
    assert (tmp_path / "all" / "protocols" / "quickstart.toml").is_file()


def test_init_for_a_bench_that_cannot_move_writes_nothing(tmp_path: Path):
    shipped = (Path(__file__).parents[2] / "protocols/benches/platform.toml").read_text("utf-8")
    write(tmp_path, shipped.replace('torque = "2500 N m"', 'torque = "20 N m"'), "weak.toml")
    said = campaign(tmp_path, "init", "lab", "--bench", "weak.toml", code=2).err
    assert "nothing would move" in said
    assert not (tmp_path / "lab").exists()
    write(tmp_path, '[[test]]\nname = "m"\nkind = "velocity_map"\nbench = "weak.toml"\n', "p.toml")
    assert "p.toml:1:1: test 'm'" in campaign(tmp_path, "plan", "p.toml", code=2).err


def test_init_for_a_bench_that_is_wrong_writes_nothing(tmp_path: Path):
    write(tmp_path, 'name = "half"\n', "half.toml")
    assert "half.toml" in campaign(tmp_path, "init", "lab", "--bench", "half.toml", code=2).err
    assert not (tmp_path / "lab").exists()


def test_kinds_show_unit_default_and_meaning(tmp_path: Path):
    kinds = campaign(tmp_path, "kinds").out
    names = ("stabilization", "velocity_map", "breakaway", "lugre", "stribeck", "observer", "sim")
    assert {line.split("\t")[1] for line in kinds.splitlines()} >= set(names)
    options = campaign(tmp_path, "kinds", "stabilization").out.splitlines()
    frequency = next(line.split("\t") for line in options if line.startswith("frequency\t"))
    assert frequency[1:3] == ["Hz", "0.24 Hz"]
    assert frequency[3]


def test_python_m_and_version(tmp_path: Path):
    assert campaign(tmp_path, "--version").out.startswith("campaign 0.")
