"""A newcomer sees what is an experiment and what helps, and no experiment needs another."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from campaign.experiments import experiments

HELPERS = ("__init__", "analysis", "interface")
ROOM = Path(__file__).parents[2] / "campaign" / "experiments"
FILES = sorted(path for path in ROOM.glob("*.py") if path.stem not in HELPERS)
KINDS = {path.stem: path for path in FILES} | {
    path.parent.name: path for path in sorted(ROOM.glob("*/experiment.py"))
}
"""The file of every experiment, by the name of its file or folder."""
INNER = sorted(ROOM.glob("*/*.py"))


def kind_of(path: Path) -> str:
    """The experiment that a file belongs to, or the folder of what helps."""
    return path.stem if path.parent == ROOM else path.parent.name


def imported(path: Path) -> Iterator[str]:
    """Modules of the room that a file imports, whether by `import`, `from` or within a function."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def kinds_among(names: Iterator[str]) -> set[str]:
    parts = [name.split(".") for name in names if name.startswith("campaign.experiments.")]
    return {part[2] for part in parts} & KINDS.keys()


def test_every_module_of_the_room_is_an_experiment() -> None:
    assert len(KINDS) == len(list(experiments()))
    assert [
        path.name for path in KINDS.values() if "\nEXPERIMENT = " not in path.read_text("utf-8")
    ] == []


DECLARED = {
    "model_properties": {
        "force_rate", "friction_lag", "presliding_hysteresis", "stick_slip", "stribeck_curve",
    },
}  # fmt: skip
"""Table 3.1 is decided by the experiments on friction models that there are."""


@pytest.mark.parametrize("path", [*FILES, *INNER], ids=lambda path: f"{kind_of(path)}.{path.stem}")
def test_no_module_imports_another_experiment(path: Path) -> None:
    kind = kind_of(path)
    assert kinds_among(imported(path)) <= {kind, *DECLARED.get(kind, ())}


def test_an_import_of_an_experiment_would_be_seen(tmp_path: Path) -> None:
    for line in (
        "from campaign.experiments import velocity_map",
        "from campaign.experiments.velocity_map import EXPERIMENT",
        "def late():\n    import campaign.experiments.velocity_map",
    ):
        file = tmp_path / "one.py"
        file.write_text(line, encoding="utf-8")
        assert kinds_among(imported(file)) == {"velocity_map"}, line
