"""`campaign new`: each kind installs, passes its own test, and is the page of the documentation."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from campaign.cli.new_package import POINTS, package_files
from tests.system.user import ROOT, campaign

PAGES = ROOT / "docs" / "developers"
NAMES = {kind: f"my_{kind}" for kind in POINTS}


@pytest.mark.slow
def test_each_installs_passes_its_own_test_and_is_listed(tmp_path: Path) -> None:
    pytest.importorskip("hatchling")
    for kind, name in NAMES.items():
        made = campaign(tmp_path, "new", kind, name, "--output", "made")
        assert f"now: pip install -e {Path('made', name)}; pytest" in made.out
    folders = [f"made/{name}" for name in NAMES.values()]
    pip = ["pip", "install", "--quiet", "--no-deps", "--no-index", "--no-build-isolation"]
    python(tmp_path, *pip, "--target", "installed", *folders)
    done = python(tmp_path, "pytest", "-q", "-p", "no:cacheprovider", "-W", "error", *folders)
    assert re.search(r"\d\d passed", done)
    listed = python(tmp_path, "campaign", "kinds")
    for kind, name in NAMES.items():
        assert re.search(rf"\t{name}\t.* \(of {name.replace('_', '-')} 1.0\)$", listed, re.M), kind
        assert name in python(tmp_path, "campaign", "kinds", name)


def python(folder: Path, *arguments: str) -> str:
    """What a module prints where the packages are installed."""
    path = os.pathsep.join((str(folder / "installed"), str(ROOT)))
    done = subprocess.run(
        [sys.executable, "-m", *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": path, "TERM": "dumb"},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.parametrize(
    ("page", "kind", "name", "headings"),
    [
        (
            "adding-an-experiment.md",
            "experiment",
            "coast_down",
            {"python": "coast_down.py", "python test": "tests/test_coast_down.py"},
        ),
        (
            "writing-a-backend.md",
            "backend",
            "tx1",
            {"python tx1.py": "tx1.py", "python test": "tests/test_tx1.py"},
        ),
        (
            "plug-ins.md",
            "model",
            "grease",
            {
                "toml pyproject.toml": "pyproject.toml",
                "python grease.py": "grease.py",
                "python tests/test_grease.py": "tests/test_grease.py",
            },
        ),
        ("plug-ins.md", "format", "sheet", {"python sheet.py": "sheet.py"}),
    ],
)
def test_a_page_shows_what_is_written(
    page: str, kind: str, name: str, headings: dict[str, str]
) -> None:
    text = (PAGES / page).read_text(encoding="utf-8")
    blocks = dict(re.findall(r"^```([^\n]*)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL))
    files = package_files(kind, name)
    for heading, path in headings.items():
        assert blocks[heading] == files[path], path
    assert blocks.get("toml", "") in files["pyproject.toml"]


def test_a_name_that_is_none_is_refused_and_nothing_is_overwritten(tmp_path: Path) -> None:
    for name in ("Grease", "a-b", "_a", "class", "numpy", "campaign", "../a"):
        assert f"'{name}' is " in campaign(tmp_path, "new", "model", name, code=2).err
    assert "there are experiment, model" in campaign(tmp_path, "new", "robot", "r2", code=2).err
    assert not list(tmp_path.iterdir())
    (tmp_path / "mine").mkdir()
    assert "is there already" in campaign(tmp_path, "new", "model", "mine", code=2).err
