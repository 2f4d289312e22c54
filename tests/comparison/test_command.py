"""`campaign compare` as it is typed."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_list import find_run
from campaign.cli import compare as command
from campaign.cli.compare import compare_archives
from campaign.comparison.run_comparison import compare_runs
from campaign.comparison.tables import sentences
from campaign.errors import ExitCode, UsageError
from campaign.experiments import experiments
from campaign.references.verdict import Verdict


def typed(results: Path, *names: str, **more: object) -> tuple[Path, ExitCode]:
    output = more.get("output")
    return compare_archives(names, results, output, ())  # type: ignore[arg-type]


@pytest.mark.slow
def test_declared_differences_come_first_and_the_code_is_0(
    results: Path, tmp_path: Path, capsys, monkeypatch
):
    monkeypatch.setattr("campaign.report.page.drawings.Drawing.svg", lambda _: "<svg></svg>")
    page, code = typed(results, "before", "after", output=tmp_path / "out")
    assert code is ExitCode.DONE
    assert page == tmp_path / "out" / "comparison.html"
    assert page.is_file()
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("A  ")
    assert any(line.startswith("not judged, ") and "one trial each" in line for line in lines)
    table = [line.split("\t") for line in lines if "\t" in line]
    assert table[0] == ["finding", "A", "B", "change", ""]
    assert table[1][0].startswith("Coulomb friction Tc, direction")
    marks = [row[-1] for row in table[1:]]
    assert marks == sorted(marks, reverse=True)  # `differs` before nothing
    assert marks[0] == "differs"


@pytest.fixture
def unwritten(monkeypatch: pytest.MonkeyPatch) -> None:
    """No page is drawn, which takes seconds."""
    monkeypatch.setattr(command, "write_comparison", lambda found, output, *_: output)


def test_equal_runs_are_said_to_be_in_the_first_line(results: Path):
    runs = [open_run(find_run(results, name)) for name in ("before", "after")]
    (against,) = compare_runs(runs, experiments()).against
    assert not against.equal
    pairs = tuple(replace(pair, other=pair.reference) for pair in against.pairs)
    nothing_alone = replace(against.pairing, only_reference=(), only_other=(), tests=())
    same = replace(against, pairs=pairs, pairing=nothing_alone)
    assert (
        next(sentences(same, 1))
        == f"Equal: all {len(pairs)} numbers are the same to the last digit."
    )
    assert not replace(same, pairs=(*pairs, against.of(Verdict.DIFFERENT)[0])).equal


@pytest.mark.usefixtures("unwritten")
def test_a_terminal_of_80_columns_is_wide_enough(results: Path, tmp_path: Path, monkeypatch):
    lines: list[str] = []

    class Narrow(Console):
        def __init__(self, *_: object) -> None:
            super().__init__(width=80, force_terminal=True, color_system=None, record=True)

        def print(self, *things: object, **more: object) -> None:  # type: ignore[override]
            with self.capture() as caught:
                super().print(*things, **more)  # type: ignore[arg-type]
            lines.extend(caught.get().splitlines())

    monkeypatch.setattr("campaign.cli.output.PlainConsole", Narrow)
    typed(results, "before", "after", output=tmp_path / "out")
    assert any(line.split()[:1] == ["Coulomb"] for line in lines)  # the rest may be in the next one
    assert max(len(line.rstrip()) for line in lines) <= 80


@pytest.mark.usefixtures("unwritten")
def test_it_is_written_beside_the_reference(results: Path, tmp_path: Path):
    for name in ("before", "again", "after"):
        shutil.copy(results / f"{name}.nxs", tmp_path)
    page, _ = typed(tmp_path, "before", "again", "after")
    assert page == tmp_path / "before-against-again-and-1-more-comparison"


def test_a_run_that_is_not_there_is_a_usage_error(results: Path):
    with pytest.raises(UsageError, match="there is no run 'nothing'") as refused:
        typed(results, "before", "nothing")
    assert refused.value.exit_code is ExitCode.USAGE
    with pytest.raises(UsageError, match="two runs or more"):
        typed(results, "before")


@pytest.mark.usefixtures("unwritten")
def test_damage_is_told_with_its_own_code(results: Path, tmp_path: Path, monkeypatch, capsys):
    told: list[Path] = []

    def say(path: Path, damaged: object) -> ExitCode:
        told.append(path)
        return ExitCode.ARCHIVE if path.stem == "again" else ExitCode.DONE

    monkeypatch.setattr(command, "say_damaged", say)
    _, code = typed(results, "before", "again", output=tmp_path / "out")
    assert code is ExitCode.ARCHIVE
    assert [path.stem for path in told] == ["before", "again"]
