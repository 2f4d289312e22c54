"""One figure by itself, in a folder that may have somebody's own files."""

from __future__ import annotations

import hashlib
from pathlib import Path
from types import ModuleType

import pytest

from campaign.errors import UsageError
from campaign.report.one_figure import WRITTEN, write_figure


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


@pytest.mark.parametrize("kind", ["text", "edited", "link", "folder"])
def test_a_figure_takes_nobody_s_place(made_up: ModuleType, tmp_path: Path, kind: str) -> None:
    run = made_up.made_up_run(tmp_path)

    def write() -> Path:
        wanted = "stabilization/position-error"
        return write_figure(run, wanted, tmp_path / "f", experiments=made_up.EXPERIMENTS)[0]

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


def test_a_figure_that_is_another_now_takes_the_older_one_s_place(
    made_up: ModuleType, tmp_path: Path
) -> None:
    run = made_up.made_up_run(tmp_path)
    wanted, folder = "stabilization/position-error", tmp_path / "f"
    drawn, _ = write_figure(run, wanted, folder, experiments=made_up.EXPERIMENTS)
    # As an earlier version would have drawn it.
    new, older = drawn.read_bytes(), b"<svg/>"
    drawn.write_bytes(older)
    with (folder / WRITTEN).open("a", encoding="utf-8") as marker:
        marker.write(f"{hashlib.sha256(older).hexdigest()}  {drawn.name}\n")
    write_figure(run, wanted, folder, experiments=made_up.EXPERIMENTS)
    assert drawn.read_bytes() == new
