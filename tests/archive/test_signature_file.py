"""What is signed of a run, and what becomes of the file beside it."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from campaign.archive.layout.run_status import RunStatus
from campaign.archive.layout.signature_file import (
    LARGEST,
    read_signature,
    set_aside_signature,
    signature_path,
    write_signature,
)
from campaign.archive.reading.run_list import find_run, list_runs
from campaign.archive.verification.statement import run_statement
from campaign.archive.writing import resume_run as resuming_module
from campaign.archive.writing.writer import RunWriter
from campaign.errors import ArchiveError, UsageError
from tests.archive.conftest import RESUMED

KEPT = Path(__file__).parent / "kept"


@pytest.fixture
def interrupted(tmp_path: Path, kit) -> Path:
    """A sealed run whose second trial is still to be done, with a signature beside it."""
    writer, _ = kit.begin(tmp_path, 2, [20])
    sealed = writer.seal(RunStatus.INTERRUPTED, "stopped", ended="2026-11-21T09:40:00Z")
    write_signature(sealed, "the first\n")
    return sealed


def test_what_is_not_sealed_has_no_statement(tmp_path: Path):
    with pytest.raises(ArchiveError, match="not a sealed run"):
        run_statement(KEPT / "format-3.partial")
    (tmp_path / "run.nxs").write_bytes(b"nothing")
    with pytest.raises(ArchiveError, match=r"run\.nxs"):
        run_statement(tmp_path / "run.nxs")


def test_a_resume_sets_the_signature_aside_and_the_next_one_takes_another_name(interrupted: Path):
    for number in (1, 2):
        writer = RunWriter.resume(interrupted, **RESUMED)
        aside = interrupted.with_name(f"{interrupted.name}.sig.before-resume-{number}")
        assert aside.read_text() == ("the first\n" if number == 1 else "the second\n")
        assert not signature_path(interrupted).exists()
        writer.seal(RunStatus.INTERRUPTED, "stopped", ended="2026-11-22T09:40:00Z")
        write_signature(interrupted, "the second\n")
    assert len(list(interrupted.parent.glob("*.before-resume-*"))) == 2


def test_a_crash_before_the_signature_was_set_aside_is_made_good_by_the_next_resume(
    interrupted: Path, monkeypatch: pytest.MonkeyPatch
):
    def crash(sealed: Path) -> None:
        assert not sealed.exists(), "the signature goes after its file"
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(resuming_module, "set_aside_signature", crash)
        with pytest.raises(KeyboardInterrupt):
            RunWriter.resume(interrupted, **RESUMED)
    assert signature_path(interrupted).exists()
    RunWriter.resume(interrupted.with_suffix(".partial"), **RESUMED).close()
    assert not signature_path(interrupted).exists()


def test_a_resume_that_fails_leaves_the_signature_where_it_was(interrupted: Path):
    content = bytearray(interrupted.read_bytes())
    content[len(content) // 2] ^= 1
    interrupted.write_bytes(content)
    with pytest.raises(ArchiveError, match="it is as it was"):
        RunWriter.resume(interrupted, **RESUMED)
    assert signature_path(interrupted).read_text() == "the first\n"


def test_signatures_are_no_runs(interrupted: Path):
    set_aside_signature(interrupted, "replaced")
    write_signature(interrupted, "another\n")
    assert [run.path for run in list_runs(interrupted.parent)] == [interrupted]
    assert find_run(interrupted.parent, "2026-11") == interrupted


def test_a_signature_that_is_there_is_not_overwritten(interrupted: Path):
    with pytest.raises(UsageError, match="--replace"):
        write_signature(interrupted, "another\n")
    assert read_signature(interrupted) == "the first\n"
    assert set_aside_signature(interrupted.with_name("other.nxs")) is None


def make_large(path: Path) -> None:
    path.write_bytes(b"x" * (LARGEST + 1))


@pytest.mark.skipif(sys.platform == "win32", reason="no such files")
@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda path: None, "is not signed"),
        (lambda path: path.symlink_to("nowhere"), "is not signed"),
        (make_large, f"more than {LARGEST} bytes"),
        (lambda path: path.mkdir(), "is not a file|directory"),
        (os.mkfifo if hasattr(os, "mkfifo") else None, "is not a file"),
        (lambda path: path.symlink_to("/dev/zero"), "is not a file"),
        (lambda path: path.symlink_to(path.name), "cannot be read"),
    ],
    ids=["none", "dangling", "large", "folder", "pipe", "device", "loop"],
)
def test_what_cannot_be_a_signature_is_said_and_read_in_bounds(tmp_path: Path, make, said):
    sealed = tmp_path / "run.nxs"
    make(signature_path(sealed))
    with pytest.raises(ArchiveError, match=said):
        read_signature(sealed)


def test_a_signature_of_the_largest_size_is_read(tmp_path: Path):
    text = "x" * LARGEST
    write_signature(tmp_path / "run.nxs", text)
    assert read_signature(tmp_path / "run.nxs") == text
