"""`campaign fingerprint`, and what a run on another bench than the described one comes to."""

from __future__ import annotations

import csv
import shutil
from pathlib import Path

import pytest

from tests.system.user import ROOT, campaign, write

SEA = """\
[[test]]
name = "sea"
kind = "stabilization"
bench = "bench.toml"
reproduces = ["5.2"]
frequency = "0.24 Hz"
acceleration = "18 deg/s^2"
cycles = 1
settle_cycles = 1
matrix = { compensation = ["none"] }
"""


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    shipped = ROOT / "protocols" / "benches" / "simulink.toml"
    return Path(shutil.copy(shipped, tmp_path / "bench.toml"))


def test_a_bench_is_stated_anew_after_a_change(bench: Path) -> None:
    folder = bench.parent
    assert "altered" not in campaign(folder, "fingerprint", "bench.toml", "--check").out
    before = bench.read_text(encoding="utf-8")
    bench.write_text(before.replace("18000 N m/rad", "9000 N m/rad", 1), encoding="utf-8")
    changed = bench.read_text(encoding="utf-8")
    told = campaign(folder, "fingerprint", "bench.toml", "--check", code=1).out
    assert "altered: the bench is not the 'simulink' that was described" in told
    assert bench.read_text(encoding="utf-8") == changed, "--check writes nothing"
    stated = campaign(folder, "fingerprint", "bench.toml").out
    assert "altered" not in campaign(folder, "fingerprint", "bench.toml", "--check").out
    after = bench.read_text(encoding="utf-8").splitlines()
    other = [line for line in after if line not in changed.splitlines()]
    assert len(other) == 1
    assert other[0].startswith("fingerprint = ")
    assert stated.split()[1] in other[0]


@pytest.mark.parametrize("kind", ["rotary", "linear"])
def test_a_bench_that_says_its_schema_and_nothing_is_known_of(tmp_path: Path, kind: str) -> None:
    bench = tmp_path / "rig.toml"
    text = f'schema = 3\nname = "Rig"\n\n[axis]\nname = "joint"\nkind = "{kind}"\n'
    bench.write_text(text, encoding="utf-8")
    campaign(tmp_path, "fingerprint", "rig.toml")
    after = bench.read_text(encoding="utf-8")
    assert "[known]\nfingerprint = " in after
    assert [line for line in text.splitlines() if line not in after.splitlines()] == []
    assert "altered" not in campaign(tmp_path, "fingerprint", "rig.toml", "--check").out


def test_a_bench_that_is_wrong_is_not_written(bench: Path) -> None:
    text = bench.read_text(encoding="utf-8").replace('"5.8"', '"5.88"')
    bench.write_text(text, encoding="utf-8")
    refused = campaign(bench.parent, "fingerprint", "bench.toml", code=2)
    assert "bench.toml:13:16:" in refused.err
    assert "'5.88' is no cell of 'thesis'; did you mean '5.8'?" in refused.err
    assert bench.read_text(encoding="utf-8") == text


def statuses(folder: Path, *changes: str) -> list[tuple[str, str, str]]:
    """Status, verdict and source of the only number that a run finds."""
    sets = [word for change in changes for word in ("--set", change)]
    archive = folder / campaign(folder, "run", "protocol.toml", "--report", *sets).last_line
    path = archive.with_name(f"{archive.stem}-report") / "tables" / "scoreboard.csv"
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return [(r["status"], r["verdict"], r["source"]) for r in rows]


@pytest.mark.slow
def test_a_status_follows_from_what_was_executed(bench: Path) -> None:
    folder = bench.parent
    write(folder, SEA)
    not_run = [("", "not run", "")] * 2
    found = statuses(folder)
    assert found == [("selected", "differs", "simulation"), *not_run]
    by_hand = statuses(folder, 'sea.bench.friction.load.bristle_stiffness="9000 N m/rad"')
    assert by_hand == [("altered", "differs", "simulation"), *not_run]
    page = next((folder / "results").glob("*/report.html")).parent.parent
    # By time: runs of one second are told apart by a number, which sorts before "report".
    pages = sorted(page.glob("*/report.html"), key=lambda path: path.stat().st_mtime_ns)
    texts = [path.read_text(encoding="utf-8") for path in pages]
    assert [("Altered: sea:" in text) for text in texts] == [False, True]
    assert all("Samples from" in text for text in texts)
