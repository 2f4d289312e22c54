"""What ships with the program is found, copied whole, and never overwrites."""

from __future__ import annotations

from pathlib import Path

import pytest

from campaign.errors import UsageError
from campaign.resources import copy_shipped, protocols_folder, shipped_protocols, templates_folder


def test_every_shipped_file_is_copied_as_it_is(tmp_path: Path):
    written = copy_shipped(tmp_path / "new" / "lab")
    assert tmp_path / "new" / "lab" / "protocols" / "benches" / "simulink.toml" in written
    for folder in (protocols_folder(), templates_folder()):
        for source in (path for path in folder.rglob("*") if path.is_file()):
            copy = tmp_path / "new" / "lab" / source.relative_to(folder.parent)
            assert copy.read_bytes() == source.read_bytes()


def test_one_file_in_the_way_stops_the_whole_copy(tmp_path: Path):
    taken = tmp_path / "templates" / "report.html"
    taken.parent.mkdir()
    taken.write_text("mine", encoding="utf-8")
    with pytest.raises(UsageError, match="nothing was written"):
        copy_shipped(tmp_path)
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == [taken]


def test_a_folder_that_cannot_be_made_is_a_usage_error(tmp_path: Path):
    (tmp_path / "file").touch()
    with pytest.raises(UsageError, match="cannot be written"):
        copy_shipped(tmp_path / "file" / "lab")


def test_the_documented_protocols_ship():
    expected = {"quickstart", "velocity_map", "breakaway", "stabilization"}
    assert set(shipped_protocols()) >= expected
