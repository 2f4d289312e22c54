"""A run of another format: refused in one line by whatever reads it, and left as it was."""

import json
import shutil
from pathlib import Path

import h5py
import pytest

from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.summarise import summarise
from campaign.archive.verification.statement import run_statement
from campaign.archive.verification.verify_run import verify_run
from campaign.archive.writing.writer import RunWriter
from campaign.errors import ArchiveError, ExitCode
from tests.archive.conftest import RESUMED
from tests.archive.forging import put_integer
from tests.archive.test_kept import KEPT
from tests.system.user import campaign


def made(folder: Path, name: str, version: int) -> Path:
    """A copy of a kept run that says it is of that format."""
    path = folder / name
    if path.suffix == ".nxs":
        shutil.copy(KEPT / name, path)
        with h5py.File(path, "r+") as file:
            put_integer(file, "run/provenance/format", version)
        return path
    shutil.copytree(KEPT / name, path)
    document = json.loads((path / "run.json").read_text())
    (path / "run.json").write_text(json.dumps({**document, "format": version}))
    return path


@pytest.fixture(params=["format-3.nxs", "format-3.partial"])
def name(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.mark.parametrize("version", [0, 1, 2, 4])
def test_an_earlier_and_a_later_format_are_refused_by_whatever_reads_it(tmp_path, name, version):
    path = made(tmp_path, name, version)
    what = f"has format {version}, and this program reads format 3 alone; read it with"
    for read in (open_run, lambda path: RunWriter.resume(path, RESUMED)):
        with pytest.raises(ArchiveError, match=what) as error:
            read(path)
        assert str(error.value).startswith(str(path))
    assert what in summarise(path).problem
    [problem] = verify_run(path).problems
    assert what in problem.reason
    if path.is_file():
        with pytest.raises(ArchiveError, match=what):
            run_statement(path)


def test_nothing_is_changed_of_it(tmp_path, name):
    path = made(tmp_path, name, 2)
    files = [path] if path.is_file() else sorted(path.iterdir())
    before = [file.read_bytes() for file in files]
    with pytest.raises(ArchiveError):
        RunWriter.resume(path, RESUMED)
    assert [file.read_bytes() for file in files] == before


@pytest.mark.parametrize(
    "command", [("show",), ("report",), ("export", "--to", "csv"), ("resume",)]
)
def test_the_command_line_says_so_in_one_line(tmp_path, name, command):
    path = made(tmp_path, name, 2)
    done = campaign(tmp_path, command[0], str(path), *command[1:], code=int(ExitCode.ARCHIVE))
    assert done.out == ""
    [line] = done.err.splitlines()
    assert "has format 2, and this program reads format 3 alone" in line
