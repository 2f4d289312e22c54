"""`campaign calibrate` as a user meets it."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

from tests.calibration.laboratory import BENCH, INERTIA, PROTOCOL, write

from .user import campaign

QUICK = PROTOCOL.replace("starts = 2", "starts = 1")


@pytest.mark.slow
def test_the_calibrated_bench_reproduces_the_table(tmp_path: Path) -> None:
    write(tmp_path, QUICK)
    done = campaign(tmp_path, "calibrate", "calibrate.toml", "--no-leave-one-out")
    assert done.last_line == str(Path("results", "calibrate-calibration.toml"))
    result = tomllib.loads((tmp_path / done.last_line).read_text(encoding="utf-8"))
    assert float(result["parameter"][0]["value"].split()[0]) == pytest.approx(INERTIA, rel=5e-3)
    assert "leave_one_out" not in result
    bench = (tmp_path / "results" / result["calibrated_bench"]).read_text(encoding="utf-8")
    assert 'fitted = ["A.1"]' in bench
    assert "# a guess" in bench
    # The bench as it was, replaced by the calibrated one: an ordinary run agrees with the table.
    write(tmp_path, QUICK, bench)
    (tmp_path / "calibration").mkdir()
    told = (tmp_path / done.last_line).read_text(encoding="utf-8")
    (tmp_path / "calibration" / "bench.toml").write_text(told, encoding="utf-8")
    run = campaign(tmp_path, "run", "calibrate.toml", "--report").last_line
    assert run.endswith(".nxs")
    (board,) = tmp_path.rglob("scoreboard.csv")
    lines = [line.split(",") for line in board.read_text().splitlines() if line.startswith("A.1")]
    assert len(lines) == 4
    assert all(abs(float(line[6])) < 1 and line[7] == "calibrated" for line in lines)
    # t(2) = 4.30265 of what the calibration wrote, and the scatter of the trial.
    part = result["propagation"]["standard_uncertainty"]
    for line in lines:
        half = 0.5 * (float(line[9]) - float(line[8]))
        assert 0.0 <= half / (4.30265 * part["/".join(line[:3])]) - 1.0 < 0.05


@pytest.mark.slow
def test_a_second_calibration_leaves_the_first_alone(tmp_path: Path) -> None:
    write(tmp_path, QUICK.replace("max_evaluations = 30", "max_evaluations = 1"))
    paths = [
        campaign(tmp_path, "calibrate", "calibrate.toml", "--no-leave-one-out", *more).last_line
        for more in ((), (), ("--output", "mine.toml"), ("--output", "mine.toml"))
    ]
    assert [Path(path).name for path in paths] == [
        "calibrate-calibration.toml",
        "calibrate-calibration-2.toml",
        "mine.toml",
        "mine.toml",
    ]
    first, second = (
        re.sub("calibration-2", "calibration", (tmp_path / path).read_text()) for path in paths[:2]
    )
    assert first == second


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("axis.inertia", "axis.inertai", "calibrate.toml:20:8: the bench writes no number"),
        ('lower = "20 kg m^2"', "lower = true", "calibrate.toml:21:9: "),
        ('published = "table.toml"', 'published = "none"', "needs published values"),
        ("10 Hz", "11 Hz", "finds A.1/10.0/error; sweep what these cells need"),
    ],
)
def test_mistakes_are_bad_usage(tmp_path: Path, old: str, new: str, message: str) -> None:
    write(tmp_path, PROTOCOL.replace(old, new))
    assert message in campaign(tmp_path, "calibrate", "calibrate.toml", code=2).err


def test_a_result_that_cannot_be_written_is_refused_first(tmp_path: Path) -> None:
    write(tmp_path, PROTOCOL, BENCH)
    done = campaign(tmp_path, "calibrate", "calibrate.toml", "--output", "bench.toml/x", code=2)
    assert "bench.toml" in done.err
    assert "start 1" not in done.err
