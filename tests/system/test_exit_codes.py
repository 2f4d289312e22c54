"""What goes wrong besides the run never hides how the run itself ended."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

from campaign.backends.sim import SimBackend
from campaign.cli.prepare import Request
from campaign.cli.run import run_protocol
from campaign.errors import ArchiveError, ExitCode, UsageError
from campaign.trial import Ending, Outcome, SafeState
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
) -> ExitCode:
    """The exit code of a run that by itself ends with `code`."""
    answers = {"execute": Ending(Outcome.COMPLETED), **WAYS[code]}
    for method, answer in answers.items():
        monkeypatch.setattr(SimBackend, method, lambda *arguments, _a=answer: _a)

    def report_run(*arguments: object, **more: object) -> Path:
        if report_error is not None:
            raise report_error
        return folder / "report.html"

    monkeypatch.setattr("campaign.cli.report.report_run", report_run)
    request = Request(str(write(folder, SEA)))
    return run_protocol(request, folder / "results", workers=1, report=True)


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
    code = run_protocol(request, tmp_path / "results", workers=1, report=False)
    assert code is ExitCode.INTERRUPTED
    assert asked_to_rest == [1]
    assert capsys.readouterr().out.endswith(".nxs\n")
