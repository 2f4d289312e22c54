"""docs/example.ipynb, cell by cell as a notebook executes it, and the figures that it shows."""

from __future__ import annotations

import ast
import json
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest

import campaign
from campaign.errors import UsageError
from tests.archives import simulated_run
from tests.system.user import ROOT
from tests.system.user import campaign as command

CELLS = json.loads((ROOT / "docs" / "example.ipynb").read_text(encoding="utf-8"))["cells"]


def shown(source: str, names: dict[str, Any]) -> Any:
    """Execute a cell; the value of an expression that it ends with, else None."""
    tree = ast.parse(source)
    names["_"] = None
    if isinstance(tree.body[-1], ast.Expr):
        tree.body[-1] = ast.Assign([ast.Name("_", ast.Store())], tree.body[-1].value)
    exec(compile(ast.fix_missing_locations(tree), "cell", "exec"), names)
    return names["_"]


@pytest.mark.slow
def test_the_notebook_runs_and_each_cell_shows_something(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    names: dict[str, Any] = {}
    values = [shown("".join(c["source"]), names) for c in CELLS if c["cell_type"] == "code"]
    assert all(value is not None for value in values)
    forms = [("_repr_svg_", 2), ("_repr_html_", 5)]
    for form, count in forms:
        assert sum(bool(getattr(value, form, str)()) for value in values) == count
    assert (tmp_path / "sea.pdf").read_bytes().startswith(b"%PDF")
    assert "My title" in names["drawing"]._repr_svg_()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drawn")
    simulated_run(folder)
    command(folder, "report", "--output", "report")
    return folder


@pytest.mark.slow
def test_a_figure_has_the_bytes_of_the_report_s_whatever_the_user_s_style(folder: Path) -> None:
    run = campaign.open(results=folder / "results")
    with mpl.rc_context({"font.size": 20, "xtick.color": "red"}):
        svg = run.plot("stabilization/position-error")._repr_svg_()
    (file,) = (folder / "report" / "figures").glob("*position-error.svg")
    assert svg == file.read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_figure_goes_by_its_test_or_key_and_what_is_none_is_said(folder: Path) -> None:
    results = campaign.open(results=folder / "results").results
    svg = results.plot("stabilization/position-error")._repr_svg_()
    assert results.plot("position-error")._repr_svg_() == svg
    assert results.plot()._repr_svg_() == results.plot("stabilization")._repr_svg_()
    with pytest.raises(UsageError, match="'position' is no figure of this run; allowed are stab"):
        results.plot("position")
