"""The cache of compiled functions must never outlive the source it was compiled from."""

from __future__ import annotations

import shutil
from pathlib import Path

import campaign.physics
from campaign.physics.compiled import digest_of_sources

PHYSICS = Path(campaign.physics.__file__).parent


def test_every_edit_of_a_physics_source_names_another_folder(tmp_path: Path) -> None:
    copy = tmp_path / "physics"
    shutil.copytree(PHYSICS, copy, ignore=shutil.ignore_patterns("__pycache__"))
    before = digest_of_sources(copy)
    assert before == digest_of_sources(PHYSICS)
    for name in ("engine.py", "step_function.py", "friction/lugre.py"):
        source = copy / name
        text = source.read_text(encoding="utf-8")
        source.write_text(text + "\n", encoding="utf-8")
        assert digest_of_sources(copy) != before, name
        source.write_text(text, encoding="utf-8")
    assert digest_of_sources(copy) == before


def test_what_is_no_source_changes_nothing(tmp_path: Path) -> None:
    (tmp_path / "engine.py").write_text("x = 1\n", encoding="utf-8")
    before = digest_of_sources(tmp_path)
    (tmp_path / "notes.txt").write_text("nothing", encoding="utf-8")
    assert digest_of_sources(tmp_path) == before
    (tmp_path / "engine.py").rename(tmp_path / "motor.py")
    assert digest_of_sources(tmp_path) != before
