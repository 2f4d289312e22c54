"""Runs of a folder's protocol in this process: executed, stopped in a trial, gone on with."""

from __future__ import annotations

import signal
import time
from pathlib import Path
from typing import Any

import pytest

from campaign.backends.sim import SimBackend
from campaign.cli.prepare import Request
from campaign.cli.resume import resume_run
from campaign.cli.run import Remarks, run_protocol
from campaign.cli.run_options import RunOptions
from campaign.errors import ExitCode
from campaign.recording import Ending
from tests.system.user import write

BENCH = (Path(__file__).parents[2] / "protocols/benches/simulink.toml").read_text(encoding="utf-8")


class Laboratory:
    """A folder with a protocol and its bench."""

    def __init__(
        self, folder: Path, patch: pytest.MonkeyPatch, protocol: str, bench: str = BENCH
    ) -> None:
        self.folder, self.results, self.patch = folder, folder / "results", patch
        self.protocol = write(folder, protocol)
        self.bench = write(folder, bench, "bench.toml")

    def executed(
        self,
        into: str = "results",
        workers: int = 1,
        remarks: Remarks | None = None,
        **request: Any,
    ) -> tuple[ExitCode, Path]:
        """The exit code of a run, and its archive. `request`: as of `Request`."""
        results = self.folder / into
        before = set(results.glob("*.nxs"))
        code = run_protocol(
            Request(str(self.protocol), **request),
            results,
            RunOptions(workers, yes=True),
            remarks=remarks,
        )
        (archive,) = set(results.glob("*.nxs")) - before
        return code, archive

    def stopped_in(self, number: int, ending: Ending | None = None, **request: Any) -> Path:
        """A run that Ctrl-C, or the given ending, meets in a trial."""
        execute = SimBackend.execute

        def stop(backend, trial, recorder, stopped):
            if trial.number != number:
                return execute(backend, trial, recorder, stopped)
            if ending is None:
                signal.raise_signal(signal.SIGINT)
                while not stopped():  # the handler is the main thread's, this may be another
                    time.sleep(0.001)
            ended = execute(backend, trial, recorder, stopped)
            return ending or ended

        with self.patch.context() as patch:
            patch.setattr(SimBackend, "execute", stop)
            patch.setattr(SimBackend, "most_together", 1)  # each trial by itself
            return self.executed(**request)[1]

    def resume(self, archive: Path, *, accept: bool = False) -> ExitCode:
        return resume_run(
            str(archive),
            archive.parent,
            RunOptions(workers=1, yes=True),
            accept_changes=accept,
        )


def disturb(patch: pytest.MonkeyPatch) -> None:
    """From now on the first rate of each block of a simulated trial is off by 1e-12 rad/s."""
    execute = SimBackend.execute

    def with_an_error(backend, trial, recorder, stopped):
        class Disturbed:
            start, event = recorder.start, recorder.event

            @staticmethod
            def append(time, block):
                block = block.copy()
                block[2, 0] += 1e-12
                recorder.append(time, block)

        return execute(backend, trial, Disturbed(), stopped)

    patch.setattr(SimBackend, "execute", with_an_error)
