"""The wheel: built, installed where there is no checkout, and used from an empty folder."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest

from campaign.cli.compile_engine import COMPILING
from tests.system.user import ROOT, SEA, campaign, write


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The console script of a fresh environment that has the wheel, and this one's libraries."""
    pytest.importorskip("hatchling")
    folder = tmp_path_factory.mktemp("wheel")
    build = "import sys, hatchling.build as b; print(b.build_wheel(sys.argv[1]))"
    wheel = run([sys.executable, "-c", build, str(folder)], ROOT).split()[-1]
    venv.create(folder / "env", with_pip=False, symlinks=True)
    python = folder / "env" / "bin" / "python"
    site = Path(run([python, "-c", "import sysconfig as s; print(s.get_path('purelib'))"], folder))
    pip = ["-m", "pip", "--python", str(python), "install", "--quiet", "--no-deps", "--no-index"]
    run([sys.executable, *pip, str(folder / wheel)], folder)
    # After the environment's own packages, so that the wheel wins over an editable install.
    (site / "libraries.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    return folder / "env" / "bin" / "campaign"


def run(command: list[str | Path], folder: Path) -> str:
    return done(command, folder).stdout.strip()


def done(command: list[str | Path], folder: Path) -> subprocess.CompletedProcess[str]:
    kept = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "COLUMNS")}
    ended = subprocess.run(
        command, cwd=folder, env=kept, capture_output=True, text=True, timeout=300
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended


@pytest.mark.slow
def test_everything_works_from_a_wheel_in_an_empty_folder(installed: Path, tmp_path: Path):
    where = "import campaign.resources as r; print(r.protocols_folder())"
    shipped = Path(run([installed.with_name("python"), "-c", where], tmp_path))
    assert shipped.is_relative_to(installed.parents[1])
    assert ROOT not in shipped.parents

    run([installed, "init", "."], tmp_path)
    run([installed, "plan", "protocols/quickstart.toml"], tmp_path)
    write(tmp_path, SEA)
    campaign(tmp_path, "run", "protocol.toml", "--results", "ours")
    ran = done([installed, "run", "protocol.toml", "--report"], tmp_path)
    archive = tmp_path / ran.stdout.strip()
    assert archive.is_file()
    # What the same sources have compiled elsewhere is machine code of the wheel's, too.
    assert COMPILING not in ran.stderr
    assert (archive.with_name(f"{archive.stem}-report") / "report.html").is_file()
