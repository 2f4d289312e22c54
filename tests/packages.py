"""Packages of a laboratory, installed without pip: a folder on the path, metadata beside it."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from campaign.physics.compilation import cache_folder
from tests.forks import LIBRARIES, MODULES, forks_of

ROOT = Path(__file__).parents[1]

GREASE = '''\
"""A film with a yield torque, as friction model."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from campaign.physics.friction.interface import FrictionModel, FrictionOptions
from campaign.units import Torque

from grease_film.film import share


class GreaseOptions(FrictionOptions):
    """A film with a yield torque."""

    model: Literal["grease"]
    """Grease."""
    yield_torque: Torque
    """Below which nothing moves."""
    order: float = 1.0
    """A matter of numerics."""


def _step(parameters, state, motion):
    return share(parameters[0]) * math.tanh(motion.rate_start / 1e-3), 0.0


FRICTION = FrictionModel(
    name="grease",
    summary="a film with a yield torque",
    options=GreaseOptions,
    parameters=lambda options: np.array([options.yield_torque]),
    state_size=lambda options, step: 0,
    step=_step,
    viscous=lambda options: 0.0,
    steady_state=lambda options, v: options.yield_torque * np.sign(v),
)
'''

FILM = """\
import numba

FACTOR = 1.0

@numba.njit
def share(torque):
    return FACTOR * torque
"""
"""A helper in a file of its own, of which a step function calls a compiled part."""


@dataclass(frozen=True)
class Packages:
    """A folder of packages that are as good as installed, for processes of their own."""

    folder: Path

    def install(
        self,
        name: str,
        files: Mapping[str, str],
        points: Mapping[str, str],
        version: str = "1.0",
    ) -> None:
        """A distribution; `points`: `module:object` by `group/kind`."""
        for path, text in files.items():
            file = self.folder / path
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, encoding="utf-8")
        lines = []
        for point, value in points.items():
            group, _, kind = point.partition("/")
            lines.append(f"[{group}]\n{kind} = {value}\n")
        self.declare(name, "\n".join(lines), version)

    def declare(self, name: str, entry_points: str, version: str = "1.0") -> None:
        """The metadata of a distribution, in place of former one."""
        for old in self.folder.glob(f"{name}-*.dist-info/*"):
            old.unlink()
            if not any(old.parent.iterdir()):
                old.parent.rmdir()
        about = self.folder / f"{name}-{version}.dist-info"
        about.mkdir(parents=True)
        (about / "METADATA").write_text(
            f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n", encoding="utf-8"
        )
        (about / "entry_points.txt").write_text(entry_points, encoding="utf-8")

    def grease(self, version: str = "1.0", film: str = FILM) -> None:
        """A friction model that works, in a package with a helper."""
        files = {
            "grease_film/__init__.py": "",
            "grease_film/model.py": GREASE,
            "grease_film/film.py": film,
        }
        points = {"campaign.friction/grease": "grease_film.model:FRICTION"}
        self.install("grease_film", files, points, version)

    def environment(self) -> dict[str, str]:
        """That of a process that can import them."""
        kept = {k: v for k, v in os.environ.items() if k not in ("COLUMNS", "FORCE_COLOR")}
        return {
            **kept,
            "PYTHONPATH": os.pathsep.join((str(self.folder), str(ROOT))),
            "PYTHONDONTWRITEBYTECODE": "1",  # an edit within a second of the last one counts
            "XDG_CACHE_HOME": str(self._cache()),
            "TERM": "dumb",
        }

    def _cache(self) -> Path:
        """A cache of their own, but for the engine, which would take half a minute to compile."""
        engine = cache_folder("campaign.physics")
        assert engine is not None
        here = self.folder.parent / "cache" / "campaign" / "compiled" / engine.name
        if not here.exists():
            here.parent.mkdir(parents=True)
            here.symlink_to(engine)
        return self.folder.parent / "cache"

    def python(self, code: str) -> subprocess.CompletedProcess[str]:
        """Run `code` without any module of the program; the folder is on the path."""
        return self.campaign("-c", code)

    def campaign(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run a command beside the folder."""
        beside, environment = self.folder.parent, self.environment()
        if sys.platform == "linux":
            imports = LIBRARIES if arguments[0] == "-c" else MODULES
            return forks_of(imports).run(beside, *arguments, environment=environment)
        program = [] if arguments[0] == "-c" else ["-m", "campaign"]
        return subprocess.run(
            [sys.executable, *program, *arguments],
            cwd=beside,
            env=environment,
            capture_output=True,
            text=True,
            encoding="utf-8",
            timeout=300,
            check=False,
        )
