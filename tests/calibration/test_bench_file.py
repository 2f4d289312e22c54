"""The calibrated bench is the input bench, its comments included, but for what was fitted."""

from __future__ import annotations

import difflib
import tomllib
from pathlib import Path

import pytest

from campaign.calibration.document import bench_text
from campaign.physics.bench import Bench
from campaign.physics.bench_fingerprint import why_altered

from .laboratory import BENCH, problem, write

KNOWN = {
    "document": "table.toml",
    "fitted": ["A.1", "B.1/x"],
    "values": {"axis.inertia": {"interval": ["34 kg m^2", "36500 g m^2"], "origin": "fitted"}},
}


def changed(folder: Path, bench: str = BENCH) -> tuple[list[str], str]:
    """Lines that are new, and the whole text."""
    made = problem(write(folder, bench=bench))
    text = bench_text(made.calibration.bench, made.space, (35.25, 12.125), KNOWN)
    lines = difflib.ndiff(bench.splitlines(), text.splitlines())
    return [line[2:] for line in lines if line.startswith("+ ") and line != "+ "], text


def test_only_what_was_fitted_changes_and_keeps_its_unit(tmp_path: Path) -> None:
    lines, text = changed(tmp_path)
    assert lines[:3] == ["[known]", 'document = "table.toml"', 'fitted = ["A.1", "B.1/x"]']
    assert lines[3].startswith("fingerprint = ")
    assert lines[4:] == [
        "[known.values]",
        '"axis.inertia" = {interval = ["34 kg m^2", "36500 g m^2"], origin = "fitted"}',
        'inertia = "35250 g m^2"        # a guess',
        'viscous_friction = "12.125 N m s/rad"  # another',
    ]
    bench = Bench.model_validate(tomllib.loads(text))
    assert bench.known.fitted == ("A.1", "B.1/x")
    assert bench.known_uncertainty("axis.inertia") == pytest.approx(2.5 / (2 * 1.959964))


def test_the_fingerprint_is_that_of_the_fitted_bench(tmp_path: Path) -> None:
    """Whoever then changes the bench by hand has another bench."""
    _, text = changed(tmp_path)
    bench = Bench.model_validate(tomllib.loads(text))
    assert [why_altered(bench, name) for name in ("none", "static")] == ["", ""]
    by_hand = Bench.model_validate(tomllib.loads(text.replace("35250 g m^2", "35251 g m^2")))
    assert "not the 'smooth' that was described" in why_altered(by_hand)


@pytest.mark.parametrize(
    "before",
    [
        BENCH + '[known]  # by hand\nfitted = ["C.3"]\nseen = ["D.4"]\n',
        BENCH
        + '[known.values]\n"axis.inertia" = { standard_uncertainty = "9 %" }\n'
        + "[known.values.'gear.ratio'] # of the data sheet\nstandard_uncertainty = 0.1\n",
        'known = { fitted = ["C.3"], seen = ["D.4"] }\n' + BENCH,
        'known.fitted = ["C.3"]\nknown.seen = ["D.4"]\n' + BENCH,
    ],
    ids=["table", "values", "inline", "dotted"],
)
def test_what_was_known_before_is_replaced_where_it_stands(tmp_path: Path, before: str) -> None:
    _, text = changed(tmp_path, before)
    bench = Bench.model_validate(tomllib.loads(text))
    assert "C.3" not in text
    assert bench.known.fitted == ("A.1", "B.1/x")
    assert bench.known.seen == (("D.4",) if "D.4" in before else ())
    assert bench.known_uncertainty("axis.inertia") == pytest.approx(2.5 / (2 * 1.959964))
    if "gear.ratio" in before:
        assert bench.known_uncertainty("gear.ratio") == 0.1
    assert why_altered(bench, "static") == ""
    for comment in ("# by hand", "# of the data sheet", "# a guess"):
        if comment in before:
            assert comment in text


@pytest.mark.parametrize(
    "name", ["name = 'smooth'  # = \"x\"", 'description = "°²\\n"\nname = "smooth"']
)
def test_any_spelling_of_the_name(tmp_path: Path, name: str) -> None:
    bench = BENCH.replace('name = "smooth"                # no dry friction', name)
    lines, text = changed(tmp_path, bench)
    assert len(lines) == 8
    assert tomllib.loads(text)["axis"]["inertia"] == "35250 g m^2"


def test_windows_line_ends_stay(tmp_path: Path) -> None:
    made = problem(write(tmp_path))
    (tmp_path / "bench.toml").write_bytes(BENCH.replace("\n", "\r\n").encode())
    made = problem(tmp_path / "calibrate.toml")
    text = bench_text(made.calibration.bench, made.space, (35.25, 12.125), KNOWN)
    assert text.count("\n") == text.count("\r\n") > BENCH.count("\n")
