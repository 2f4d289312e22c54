"""The cache of compiled functions must never outlive the source it was compiled from."""

from __future__ import annotations

import json
import os
import shutil
import stat
from contextlib import nullcontext
from pathlib import Path

import pytest

import campaign.physics
from campaign.cli.compile_engine import compiling_meanwhile
from campaign.execution import first_start
from campaign.physics import compilation as compiled_module
from campaign.physics.compilation import (
    cache_folder,
    compiled,
    digest_of_sources,
    distrust,
    inlined,
)
from tests.packages import FILM, Packages

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


STEP = """
import json
import numpy as np
from campaign.physics.friction import friction_models
from campaign.physics.step_function import Motion, compiled_step, single_step
step = friction_models()["grease"].step
torque, change = single_step(step, np.array([3.0]), np.zeros(0), Motion.at(1.0, 1.0, step=1e-3))
print(json.dumps([torque, compiled_step(step, 1, 1, 1, 0).cache_hits]))
"""
"""The torque of grease that yields at 3 N m, sliding at 1 rad/s, and whether it was kept."""

HELPERS = {
    "a module of the package": {
        "grease_film/film.py": FILM.replace("FACTOR = 1.0", "from grease_film.deep import FACTOR"),
        "grease_film/deep.py": "FACTOR = 1.0\n",
    },
    "a module that a helper kept on disk calls": {
        "grease_film/film.py": FILM.replace("FACTOR = 1.0", "from grease_film.deep import FACTOR")
        .replace("import numba", "from campaign.physics.compilation import compiled")
        .replace("numba.njit", "compiled"),
        "grease_film/deep.py": "FACTOR = 1.0\n",
    },
    "another folder on the path": {
        "grease_film/film.py": FILM.replace("FACTOR = 1.0", "from films.thin import FACTOR"),
        "films/thin.py": "FACTOR = 1.0\n",
    },
    "another module of the distribution": {
        "grease_film/film.py": FILM.replace("FACTOR = 1.0", "from films import FACTOR"),
        "films.py": "FACTOR = 1.0\n",
    },
}


def torque(packages: Packages) -> tuple[float, int]:
    done = packages.python(STEP)
    assert done.returncode == 0, done.stderr
    value, hits = json.loads(done.stdout)
    return value, hits


@pytest.mark.slow
@pytest.mark.parametrize("place", HELPERS)
def test_machine_code_of_a_plug_in_follows_every_helper(tmp_path: Path, place: str) -> None:
    """It went on giving 3 N m after the helper said 2.0, in every process to come."""
    packages = Packages(tmp_path / ("site-packages" if "distribution" in place else "packages"))
    files = HELPERS[place]
    packages.grease()
    for name, text in files.items():
        write(packages.folder / name, text)
    if "distribution" in place:
        about = packages.folder / "grease_film-1.0.dist-info"
        listed = ("grease_film/__init__.py", *files)
        write(about / "RECORD", "".join(f"{name},,\n" for name in listed))
    assert torque(packages) == (3.0, 0)
    assert torque(packages) == (3.0, 1), "what was compiled is kept"
    write(packages.folder / list(files)[-1], "FACTOR = 2.0\n")
    assert torque(packages) == (6.0, 0)
    assert torque(packages) == (6.0, 1)


@pytest.mark.slow
def test_another_library_starts_afresh(tmp_path: Path) -> None:
    packages = Packages(tmp_path / "packages")
    packages.grease()
    assert [torque(packages)[1], torque(packages)[1]] == [0, 1]
    packages.declare("another_library", "")
    assert torque(packages) == (3.0, 0)


@pytest.mark.slow
def test_a_source_that_was_edited_while_the_process_ran_is_not_kept(tmp_path: Path) -> None:
    """Its machine code would be that of before the edit, under the hash of after it.

    The time of the file is what a kernel that counts in ticks may write.
    """
    packages = Packages(tmp_path / "packages")
    packages.grease()
    edited = f"""
import os
from pathlib import Path
from campaign.physics.compilation import _IMPORTED_AT
import grease_film.film
film = Path(grease_film.film.__file__)
film.write_text({FILM.replace("1.0", "2.00")!r})
os.utime(film, (_IMPORTED_AT - 0.01, _IMPORTED_AT - 0.01))
{STEP}"""
    done = packages.python(edited)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == [3.0, 0]
    assert torque(packages) == (6.0, 0)


@pytest.mark.slow
def test_what_compiled_code_alone_calls_refuses_python() -> None:
    """It has no code for Python: a call would end the process."""

    @inlined
    def half(x: float) -> float:
        return 0.5 * x

    @compiled
    def quarter(x: float) -> float:
        return half(half(x))

    assert quarter(1.0) == 0.25
    with pytest.raises(TypeError, match="half is called by compiled code alone"):
        half(1.0)


def test_a_function_without_a_file_is_compiled_and_not_kept() -> None:
    def twice(x: float) -> float:
        return 2.0 * x

    twice.__module__ = "__nowhere__"
    assert cache_folder("__nowhere__") is None
    assert compiled(twice)(1.5) == 3.0


posix = pytest.mark.skipif(os.name != "posix", reason="modes and owners are of POSIX")


def kept(folder: Path) -> Path:
    """A file of machine code in a folder as it is made."""
    folder.mkdir(mode=0o700)
    (folder / "physics").mkdir()
    (folder / "physics").chmod(0o755)
    file = folder / "physics" / "engine.nbi"
    file.touch()
    file.chmod(0o644)
    return file


@posix
@pytest.mark.parametrize(
    ("folder_mode", "file_mode", "why"),
    [
        (0o700, 0o644, ""),
        (0o755, 0o644, ""),
        (0o700, 0o664, ""),  # by a umask of 002, where nobody else can enter
        (0o755, 0o664, "engine.nbi can be written by other users"),
        (0o700, 0o666, "engine.nbi can be written by other users"),
        (0o755, 0o666, "engine.nbi can be written by other users"),
        (0o770, 0o644, "cache can be written by other users"),
        (0o777, 0o644, "cache can be written by other users"),
        (0o1777, 0o644, "cache can be written by other users"),
    ],
)
def test_machine_code_that_others_can_write_is_not_trusted(
    tmp_path: Path, folder_mode: int, file_mode: int, why: str
) -> None:
    kept(tmp_path / "cache").chmod(file_mode)
    (tmp_path / "cache").chmod(folder_mode)
    (tmp_path / "link").symlink_to(tmp_path / "cache")
    for folder in (tmp_path / "cache", tmp_path / "link"):
        assert distrust(folder).endswith(why)
        assert bool(distrust(folder)) is bool(why)


@posix
def test_links_among_machine_code_and_other_owners_are_not_trusted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept(tmp_path / "linked")
    (tmp_path / "linked" / "more").symlink_to(tmp_path)
    assert distrust(tmp_path / "linked").endswith("more is a link")
    kept(tmp_path / "cache")
    another = os.geteuid() + 1
    monkeypatch.setattr(os, "geteuid", lambda: another)
    assert distrust(tmp_path / "cache").endswith("cache belongs to another user")


@posix
def test_a_cache_that_others_can_write_is_not_used_and_it_is_said_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(compiled_module, "_user_cache", lambda: tmp_path / "compiled")
    monkeypatch.setattr(first_start, "FirstStart", nullcontext)
    folder = cache_folder.__wrapped__("campaign.physics.engine")
    assert folder.parent == tmp_path / "compiled"
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    folder.chmod(0o777)
    distrust.cache_clear()
    other = cache_folder.__wrapped__("campaign.physics.engine")
    assert other.parent != tmp_path / "compiled"
    other.rmdir()
    with compiling_meanwhile("sim"):
        pass
    said = " ".join(capsys.readouterr().err.split())
    assert said.count("can be written by other users; remove that folder") == 1


@pytest.mark.slow
@posix
def test_planted_machine_code_is_not_loaded(tmp_path: Path) -> None:
    packages = Packages(tmp_path / "packages")
    packages.grease()
    assert [torque(packages)[1], torque(packages)[1]] == [0, 1]
    for file in (tmp_path / "cache").rglob("*grease*.nbi"):
        file.chmod(0o666)
    assert torque(packages) == (3.0, 0)


def write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
