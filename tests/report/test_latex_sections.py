"""Figures and tables of the LaTeX report stay in the section that they are of."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import pytest

from campaign.report.formats import chosen_formats


@pytest.mark.slow
def test_figures_and_tables_do_not_leave_their_section(made_up: ModuleType, tmp_path: Path) -> None:
    """LaTeX floats wait for a place, if need be behind later sections; a barrier holds them."""
    made_up.build(
        made_up.made_up_run(tmp_path), tmp_path / "out", formats=chosen_formats(["latex"])
    )
    floating, sections, barriers, before = False, 0, 0, ""
    for line in (tmp_path / "out" / "report.tex").read_text(encoding="utf-8").splitlines():
        if line.startswith((r"\section", r"\subsection{")):
            assert not floating, line
            sections += 1
        elif line.startswith(r"\subsubsection") and floating:
            assert before == r"\reportbarrier"
            barriers += 1
        floating |= line.startswith((r"\begin{figure}", r"\begin{table}"))
        floating &= line != r"\reportbreak"
        before = line
    assert sections > 4
    assert barriers
