"""The calibrated bench is the input bench, its comments included, but for what was fitted."""

from __future__ import annotations

import difflib
import tomllib
from pathlib import Path

import pytest

from campaign.calibration.document import bench_text

from .laboratory import BENCH, problem, write


def changed(folder: Path, bench: str = BENCH) -> tuple[list[str], str]:
    """Lines that are new, and the whole text."""
    made = problem(write(folder, bench=bench))
    text = bench_text(made.calibration.bench, made.space, (35.25, 12.125), ["A.1", "B.1/x"])
    lines = difflib.ndiff(bench.splitlines(), text.splitlines())
    return [line[2:] for line in lines if line.startswith("+ ")], text


def test_only_what_was_fitted_changes_and_keeps_its_unit(tmp_path: Path) -> None:
    lines, text = changed(tmp_path)
    assert lines == [
        'fitted = ["A.1", "B.1/x"]',
        'inertia = "35250 g m^2"        # a guess',
        'viscous_friction = "12.125 N m s/rad"  # another',
    ]
    assert tomllib.loads(text)["fitted"] == ["A.1", "B.1/x"]


def test_what_was_fitted_before_is_replaced(tmp_path: Path) -> None:
    bench = 'fitted = [  # earlier\n    "C.3",\n]\n' + BENCH
    lines, text = changed(tmp_path, bench)
    assert lines[0] == 'fitted = ["A.1", "B.1/x"]'
    assert "C.3" not in text


@pytest.mark.parametrize(
    "name", ["name = 'smooth'  # = \"x\"", 'description = "°²\\n"\nname = "smooth"']
)
def test_any_spelling_of_the_name(tmp_path: Path, name: str) -> None:
    bench = BENCH.replace('name = "smooth"                # no dry friction', name)
    lines, text = changed(tmp_path, bench)
    assert len(lines) == 3
    assert tomllib.loads(text)["axis"]["inertia"] == "35250 g m^2"


def test_windows_line_ends_stay(tmp_path: Path) -> None:
    made = problem(write(tmp_path))
    (tmp_path / "bench.toml").write_bytes(BENCH.replace("\n", "\r\n").encode())
    made = problem(tmp_path / "calibrate.toml")
    text = bench_text(made.calibration.bench, made.space, (35.25, 12.125), ["A.1"])
    assert text.count("\n") == text.count("\r\n") == BENCH.count("\n") + 1
