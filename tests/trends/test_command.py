"""`campaign trend` as it is typed."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest

from campaign.cli import trend as command
from campaign.cli.trend import trend_of_archives
from campaign.errors import ExitCode, UsageError
from campaign.identify import experiments_by_model


@pytest.fixture
def unwritten(monkeypatch: pytest.MonkeyPatch) -> None:
    """No page is drawn, which takes seconds."""
    monkeypatch.setattr(command, "write_trends", lambda found, output, *_: output)


def typed(
    results: Path, names: Sequence[str], output: Path | None = None, models: Sequence[str] = ()
) -> tuple[Path, ExitCode]:
    return trend_of_archives(names, results, output, "time", models)


@pytest.mark.slow
@pytest.mark.usefixtures("unwritten")
def test_what_is_declared_comes_first_and_the_rest_says_what_would_be_seen(runs: Path, capsys):
    page, code = typed(runs, [f"drift-{n}" for n in (7, 1, 2, 3, 6, 5, 4, 0)])
    assert code is ExitCode.DONE
    assert page == runs / "drift-7-trend-over-time"
    out = capsys.readouterr().out
    assert "3 are declared to" in out
    assert "Breakaway torque" in out
    assert "N·m per month" in out
    table = [line.split("\t") for line in out.splitlines() if "\t" in line]
    assert table[0] == ["no significant trend", "detectable, per month", "detectable jump"]
    assert all("N·m/rad" in row[1] for row in table[1:])


@pytest.mark.slow
@pytest.mark.usefixtures("unwritten")
def test_damaged_runs_are_named_and_the_code_says_so(runs: Path, tmp_path: Path, capsys):
    for n in range(4):
        shutil.copy(runs / f"still-{n}.nxs", tmp_path / f"still-{n}.nxs")
    broken = tmp_path / "still-2.nxs"
    data = bytearray(broken.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 4000] = bytes(4000)
    broken.write_bytes(bytes(data))
    _, code = typed(tmp_path, [f"still-{n}" for n in range(4)])
    assert code is ExitCode.ARCHIVE
    out, err = capsys.readouterr()
    assert "still-2" in err
    assert "jumped is not determined: that takes 5 runs" in " ".join(out.split())


@pytest.mark.slow
@pytest.mark.usefixtures("unwritten")
def test_unknown_models_are_refused_with_what_there_is(runs: Path):
    with pytest.raises(UsageError, match="inverse_dynamics"):
        typed(runs, ["still-0", "still-1", "still-2"], models=["guesswork"])


@pytest.mark.slow
def test_the_page_holds_the_command_and_no_folder_of_anybody(runs: Path, tmp_path: Path):
    names = [str(runs / f"still-{n}.nxs") for n in range(5)]
    page, _ = typed(runs, names, tmp_path / "out")
    data = json.loads((tmp_path / "out" / "trend.json").read_text(encoding="utf-8"))
    told = "campaign trend still-0.nxs still-1.nxs ... still-4.nxs --over 'time'"
    assert data["command"] == told
    assert str(runs) not in page.read_text(encoding="utf-8")
    assert len(data["content"]["runs"]) == 5


@pytest.mark.slow
def test_parameters_of_a_model_are_followed_by_the_structure_of_the_first_run(
    runs: Path, tmp_path: Path
):
    assert "inverse_dynamics" in experiments_by_model()
    names = [f"drift-{n}" for n in range(3)]
    typed(runs, names, tmp_path / "out", ["inverse_dynamics"])
    data = json.loads((tmp_path / "out" / "trend.json").read_text(encoding="utf-8"))
    data = data["content"]
    own = [each for each in data["numbers"] if each["test"] == "inverse_dynamics"]
    refused = [text for text in data["problems"] if "inverse_dynamics" in text]
    assert own or len(refused) == 3
