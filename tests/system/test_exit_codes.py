"""What goes wrong besides the run never hides how the run itself ended."""

from __future__ import annotations

import io
import signal
from dataclasses import replace
from pathlib import Path

import pytest

from campaign.archive.writing.writer import RunWriter
from campaign.backends.sim import SimBackend
from campaign.cli.ask import NotStartedError
from campaign.cli.prepare import Request
from campaign.cli.run import run_protocol
from campaign.cli.run_options import DEFAULTS, RunOptions
from campaign.errors import ArchiveError, ExitCode, UsageError, worst_exit_code
from campaign.execution.safety import AbortedError
from campaign.recording import Ending, Outcome, SafeState
from tests.system.user import SEA, write

WAYS = {
    ExitCode.DONE: {},
    ExitCode.TRIALS_FAILED: {"execute": Ending(Outcome.DIVERGED, "infinite")},
    ExitCode.LIMIT_OR_FAULT: {"execute": Ending(Outcome.LIMIT, "too fast")},
    ExitCode.NOT_SAFE: {"make_safe": SafeState.NOT_CONFIRMED},
}
"""What the backend answers in a run that ends with this code."""


def run(
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    code: ExitCode,
    report_error: BaseException | None = None,
    report_code: ExitCode = ExitCode.DONE,
) -> ExitCode:
    """The exit code of a run that by itself ends with `code`."""
    for method, answer in WAYS[code].items():  # else it does what it does
        monkeypatch.setattr(SimBackend, method, lambda *arguments, _a=answer: _a)

    def report_run(*arguments: object, **more: object) -> tuple[Path, ExitCode]:
        if report_error is not None:
            raise report_error
        return folder / "report.html", report_code

    monkeypatch.setattr("campaign.cli.report.report_run", report_run)
    request = Request(str(write(folder, SEA)))
    return run_protocol(request, folder / "results", RunOptions(workers=1, report=True))


@pytest.mark.parametrize(
    ("code", "error", "expected"),
    [
        (ExitCode.NOT_SAFE, ArchiveError("damaged"), ExitCode.NOT_SAFE),
        (ExitCode.LIMIT_OR_FAULT, ArchiveError("damaged"), ExitCode.LIMIT_OR_FAULT),
        (ExitCode.LIMIT_OR_FAULT, UsageError("bad template"), ExitCode.LIMIT_OR_FAULT),
        (ExitCode.TRIALS_FAILED, UsageError("bad template"), ExitCode.USAGE),
        (ExitCode.DONE, ArchiveError("damaged"), ExitCode.ARCHIVE),
        (ExitCode.NOT_SAFE, ZeroDivisionError("oops"), ExitCode.NOT_SAFE),
        (ExitCode.TRIALS_FAILED, ZeroDivisionError("oops"), ExitCode.TRIALS_FAILED),
        (ExitCode.NOT_SAFE, KeyboardInterrupt(), ExitCode.NOT_SAFE),
        (ExitCode.DONE, KeyboardInterrupt(), ExitCode.INTERRUPTED),
        (ExitCode.LIMIT_OR_FAULT, None, ExitCode.LIMIT_OR_FAULT),
    ],
)
def test_a_report_that_fails_does_not_hide_how_the_run_ended(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    code: ExitCode,
    error: BaseException | None,
    expected: ExitCode,
):
    assert run(tmp_path, monkeypatch, code, error) is expected
    shown = capsys.readouterr()
    assert shown.out.endswith(".nxs\n")
    assert ("no report" in shown.err) == (error is not None)
    assert str(error or "") in shown.err


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        (ExitCode.DONE, ExitCode.NO_RESULT),
        (ExitCode.TRIALS_FAILED, ExitCode.NO_RESULT),
        (ExitCode.LIMIT_OR_FAULT, ExitCode.LIMIT_OR_FAULT),
        (ExitCode.NOT_SAFE, ExitCode.NOT_SAFE),
    ],
)
def test_a_test_without_a_result_comes_before_trials_that_failed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: ExitCode, expected: ExitCode
):
    assert run(tmp_path, monkeypatch, code, report_code=ExitCode.NO_RESULT) is expected


@pytest.mark.parametrize(
    "worse", [ExitCode.NOT_SAFE, ExitCode.INTERRUPTED, ExitCode.ARCHIVE, ExitCode.USAGE]
)
def test_what_hides_that_a_test_has_no_result(worse: ExitCode):
    assert worst_exit_code([ExitCode.NO_RESULT, ExitCode.TRIALS_FAILED, worse]) is worse


@pytest.mark.slow
def test_a_bug_in_the_report_of_a_good_run_is_shown_as_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    with pytest.raises(ZeroDivisionError):
        run(tmp_path, monkeypatch, ExitCode.DONE, ZeroDivisionError("oops"))


def test_a_stop_while_the_bench_is_being_connected_is_an_orderly_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    def connect(backend: SimBackend) -> SimBackend:
        signal.raise_signal(signal.SIGINT)
        return backend

    asked_to_rest = []
    monkeypatch.setattr(SimBackend, "__enter__", connect)
    monkeypatch.setattr(
        SimBackend, "make_safe", lambda backend: asked_to_rest.append(1) or SafeState.CONFIRMED
    )
    request = Request(str(write(tmp_path, SEA)))
    code = run_protocol(request, tmp_path / "results", RunOptions(workers=1))
    assert code is ExitCode.INTERRUPTED
    assert asked_to_rest == [1]
    assert capsys.readouterr().out.endswith(".nxs\n")


def fail_to_let_go(*arguments: object) -> None:
    raise OSError("the port is gone")


def test_a_backend_that_cannot_let_go_hides_neither_the_code_nor_the_archive(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setattr(SimBackend, "__exit__", fail_to_let_go)
    assert run(tmp_path, monkeypatch, ExitCode.NOT_SAFE) is ExitCode.NOT_SAFE
    shown = capsys.readouterr()
    assert shown.out.endswith(".nxs\n")
    assert "could not let go of the bench: OSError: the port is gone" in shown.err


def no_room(*arguments: object) -> RunWriter:
    raise UsageError("no room")


def test_results_that_cannot_be_kept_are_said_before_a_bench_is_looked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(SimBackend, "__enter__", lambda backend: pytest.fail("it was connected"))
    (tmp_path / "results").write_text("no folder")
    request = Request(str(write(tmp_path, SEA)))
    with pytest.raises(UsageError, match="is not a folder"):
        run_protocol(request, tmp_path / "results", RunOptions(workers=1))


def test_an_archive_that_cannot_be_begun_is_said_with_the_bench_at_rest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    asked_to_rest = []
    monkeypatch.setattr(
        SimBackend, "make_safe", lambda backend: asked_to_rest.append(1) or SafeState.CONFIRMED
    )
    monkeypatch.setattr(SimBackend, "__exit__", fail_to_let_go)
    monkeypatch.setattr(RunWriter, "create", no_room)
    request = Request(str(write(tmp_path, SEA)))
    with pytest.raises(UsageError, match="no room"):
        run_protocol(request, tmp_path / "results", RunOptions(workers=1))
    assert asked_to_rest == [1]
    assert "the port is gone" in capsys.readouterr().err


def test_a_run_that_is_stopped_at_once_says_what_is_kept_and_how_to_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def insist(*arguments: object) -> Ending:
        return Ending(Outcome.COMPLETED)

    def interrupted(*arguments: object, **more: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(SimBackend, "execute", insist)
    monkeypatch.setattr("campaign.execution.progress.Ledger.end", interrupted)
    monkeypatch.chdir(tmp_path)
    request = Request(str(write(tmp_path, SEA)))
    with pytest.raises(AbortedError) as aborted:
        run_protocol(request, Path("results"), RunOptions(workers=1))
    (folder,) = (tmp_path / "results").glob("*.partial")
    said = str(aborted.value)
    assert f"the finished trials are in results/{folder.name}" in said
    assert said.splitlines()[1:] == [
        f"  campaign report {folder.stem}",
        f"  campaign resume {folder.stem}",
    ]


def attended(monkeypatch: pytest.MonkeyPatch) -> None:
    from campaign.backends import sim

    kind = replace(sim.BACKEND, live=True, several=False)
    monkeypatch.setattr("campaign.cli.prepare.find_backend", lambda name: kind)


def test_a_real_bench_does_not_move_before_somebody_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    attended(monkeypatch)
    request = Request(str(write(tmp_path, SEA)))
    results = tmp_path / "results"
    monkeypatch.setattr("sys.stdin", io.StringIO("yes\n"))  # no terminal, whatever it holds
    with pytest.raises(UsageError, match="--yes"):
        run_protocol(request, results, DEFAULTS)
    monkeypatch.setattr("campaign.cli.ask.has_terminal", lambda: True)
    monkeypatch.setattr("sys.stdin", io.StringIO("no\n"))
    with pytest.raises(NotStartedError, match="nothing has moved"):
        run_protocol(request, results, DEFAULTS)
    assert not results.exists()
    assert "sea: 2 trials" in capsys.readouterr().err
    monkeypatch.setattr("sys.stdin", io.StringIO("yes\n"))
    assert run_protocol(request, results, DEFAULTS) is ExitCode.DONE
    request = Request(str(write(tmp_path, SEA)))
    monkeypatch.setattr("sys.stdin", io.StringIO(""))
    assert run_protocol(request, results, RunOptions(yes=True)) is ExitCode.DONE
