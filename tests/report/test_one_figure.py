"""One figure by itself, in a folder that may have somebody's own files."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path
from types import ModuleType

import pytest

from campaign.errors import UsageError
from campaign.report.drawing.figures import Column
from campaign.report.one_figure import ALL, WRITTEN, write_figures


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["text", "edited", "link", "folder"])
def test_a_figure_takes_nobody_s_place(made_up: ModuleType, tmp_path: Path, kind: str) -> None:
    run = made_up.made_up_run(tmp_path)

    def write() -> Path:
        wanted = "stabilization/position-error"
        (drawn,), _ = write_figures(run, wanted, tmp_path / "f", experiments=made_up.EXPERIMENTS)
        return drawn

    other, drawn = tmp_path / "other.svg", tmp_path / "f" / "figure-5.9.svg"
    other.write_text("mine")
    if kind == "edited":
        assert write() == drawn == write()  # what was written here may be written again
        drawn.write_text(drawn.read_text(encoding="utf-8") + "<!-- mine -->")
    else:
        drawn.parent.mkdir()
        if kind == "folder":
            drawn.mkdir()
        elif kind == "link":
            drawn.symlink_to(other)
        else:
            drawn.write_text("mine")
    before = contents(tmp_path / "f")
    with pytest.raises(UsageError, match=r"figure-5\.9\.svg is there already and was not written"):
        write()
    assert contents(tmp_path / "f") == before
    assert other.read_text() == "mine"


@pytest.mark.slow
def test_a_figure_that_is_another_now_takes_the_older_one_s_place(
    made_up: ModuleType, tmp_path: Path
) -> None:
    run = made_up.made_up_run(tmp_path)
    wanted, folder = "stabilization/position-error", tmp_path / "f"
    (drawn,), _ = write_figures(run, wanted, folder, experiments=made_up.EXPERIMENTS)
    # As an earlier version would have drawn it.
    new, older = drawn.read_bytes(), b"<svg/>"
    drawn.write_bytes(older)
    with (folder / WRITTEN).open("a", encoding="utf-8") as marker:
        marker.write(f"{hashlib.sha256(older).hexdigest()}  {drawn.name}\n")
    write_figures(run, wanted, folder, experiments=made_up.EXPERIMENTS)
    assert drawn.read_bytes() == new


@pytest.mark.slow
@pytest.mark.parametrize(("column", "wide"), [("single", 88.0), ("double", 180.0)])
def test_figures_for_a_column_have_its_width_and_lettering_for_print(
    made_up: ModuleType, tmp_path: Path, column: Column, wide: float
) -> None:
    run = made_up.made_up_run(tmp_path)
    drawings, _ = write_figures(
        run, ALL, tmp_path / "f", experiments=made_up.EXPERIMENTS, column=column
    )
    assert len(drawings) == 3
    for drawn in drawings:
        assert drawn.stem.endswith(f"-{column}")
        assert drawn.with_suffix(".pdf").read_bytes().startswith(b"%PDF")
        assert drawn.with_suffix(".csv").is_file()
        svg = drawn.read_text(encoding="utf-8")
        told = re.search(r'<svg [^>]*width="([\d.]+)pt"', svg)
        assert told is not None
        assert float(told[1]) / 72 * 25.4 == pytest.approx(wide, abs=0.1)
        sizes = {float(size) for size in re.findall(r"font(?:-size)?: ?(?:bold )?([\d.]+)px", svg)}
        assert sizes
        assert min(sizes) >= 7, drawn.name
        assert max(sizes) <= 9, drawn.name


@pytest.mark.slow
def test_several_panels_have_letters(made_up: ModuleType, tmp_path: Path) -> None:
    run, wanted = made_up.made_up_run(tmp_path), "stabilization/position-error"
    (drawn,), _ = write_figures(run, wanted, tmp_path, experiments=made_up.EXPERIMENTS)
    svg = drawn.read_text(encoding="utf-8")
    assert [f"({each})" in svg for each in "abcde"] == [True] * 4 + [False]
