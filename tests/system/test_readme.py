"""The README's commands that follow from each other, run one after the other as it has them."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from tests.system.user import campaign

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
LINES = README.split("## Identify a rig")[1].split("```console\n")[1].split("```")[0].splitlines()
"""Commands of that section, with their comments."""
SMALLER = (
    "--set", "response.realisations=2", "--set", 'response.matrix.amplitude=["9 deg/s"]',
    "--set", "dynamics.periods=2", "--set", 'dynamics.period="4 s"',
)  # fmt: skip
"""Fewer and shorter trials than the shipped ones: how good the numbers are is tried elsewhere."""


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str]]:
    """A folder with the run of the section's first command, and a later one."""
    folder = tmp_path_factory.mktemp("readme")
    run = campaign(folder, *shlex.split(LINES[0], comments=True)[1:], *SMALLER).last_line
    only = ("--only", "dynamics", *SMALLER[4:])
    later = campaign(folder, "run", "excitation", *only, "--set", "dynamics.seed=7").last_line
    return folder, {"<run>": Path(run).stem, "<later run>": Path(later).stem}


@pytest.mark.slow
@pytest.mark.parametrize("line", [line for line in LINES if line.startswith("campaign identify")])
def test_a_rig_is_identified_from_what_the_first_command_made(runs, line: str) -> None:
    folder, names = runs
    for name, run in names.items():
        line = line.replace(name, run)
    done = campaign(folder, *shlex.split(line, comments=True)[1:])
    assert done.last_line.endswith("identification.html")
    assert "--output" not in line or (folder / "rig.toml").is_file()
