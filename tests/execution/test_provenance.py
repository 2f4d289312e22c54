"""Where a run comes from."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from campaign.execution.provenance import git_revision, own_versions, shaping, versions


def git(folder: Path, *arguments: str) -> str:
    identity = ["-c", "user.name=test", "-c", "user.email=test@example.org"]
    command = ["git", "-C", str(folder), *identity, *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


@pytest.mark.skipif(shutil.which("git") is None, reason="needs git")
def test_the_revision_of_a_tracked_protocol_says_when_something_was_changed(tmp_path: Path):
    protocol = tmp_path / "protocol.toml"
    protocol.write_text("a = 1\n", encoding="utf-8")
    git(tmp_path, "init", "--quiet")
    assert git_revision(protocol) == "", "not tracked"
    git(tmp_path, "add", "protocol.toml")
    git(tmp_path, "commit", "--quiet", "-m", "first")
    head = git(tmp_path, "rev-parse", "HEAD")
    assert git_revision(protocol) == head
    protocol.write_text("a = 2\n", encoding="utf-8")
    assert git_revision(protocol) == f"{head}-dirty"


def test_without_git_there_is_no_revision(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    assert git_revision(tmp_path / "protocol.toml") == ""


def test_what_shapes_the_samples_is_versioned():
    assert {"campaign", "python", "numpy", "numba", "llvmlite", "h5py"} <= versions().keys()


def test_what_of_the_program_is_numbered_is_in_every_archive():
    own = {"engine", "format", "wire", "bench schema", "protocol schema"}
    assert own == own_versions().keys() <= versions().keys()
    assert all(number.isdigit() for number in own_versions().values())


def test_a_resume_compares_what_may_change_a_sample_and_no_more():
    was = {"engine": "1", "numba": "0.61", "format": "2", "pint": "0.25", "wire": "1"}
    assert shaping(was) == {"engine": "1", "numba": "0.61"}
    assert {"campaign", "python", "engine", "numba"} <= shaping(versions()).keys()
