"""The cache of compiled functions must never outlive the source it was compiled from."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

import campaign.physics
from campaign.physics.compiled import cache_folder, compiled, digest_of_sources
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
        .replace("import numba", "from campaign.physics.compiled import compiled")
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


def test_another_library_starts_afresh(tmp_path: Path) -> None:
    packages = Packages(tmp_path / "packages")
    packages.grease()
    assert [torque(packages)[1], torque(packages)[1]] == [0, 1]
    packages.declare("another_library", "")
    assert torque(packages) == (3.0, 0)


def test_a_source_that_was_edited_while_the_process_ran_is_not_kept(tmp_path: Path) -> None:
    """Its machine code would be that of before the edit, under the hash of after it."""
    packages = Packages(tmp_path / "packages")
    packages.grease()
    edited = f"""
from pathlib import Path
import grease_film.film
Path(grease_film.film.__file__).write_text({FILM.replace("1.0", "2.00")!r})
{STEP}"""
    done = packages.python("import campaign.physics.compiled\n" + edited)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == [3.0, 0]
    assert torque(packages) == (6.0, 0)


def test_a_function_without_a_file_is_compiled_and_not_kept() -> None:
    def twice(x: float) -> float:
        return 2.0 * x

    twice.__module__ = "__nowhere__"
    assert cache_folder("__nowhere__") is None
    assert compiled(twice)(1.5) == 3.0


def write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
