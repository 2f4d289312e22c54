"""Tests analysed and drawn in several processes: the same page, and nobody is left behind."""

from __future__ import annotations

import importlib.util
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import pytest

from campaign.api.analysis import TestAnalysis, analyse_run
from campaign.archive.layout.journal_summary import Lines, read_lines
from campaign.archive.reading import sealed_run, summarise
from campaign.archive.reading.open_run import open_run
from campaign.experiments import experiments
from campaign.report import processes
from campaign.report.build import render
from campaign.report.content.document import Document, document_of
from campaign.report.page.drawings import drawings_of
from campaign.report.processes import workers
from campaign.resources import templates_folder
from campaign.result import Result
from tests.system.user import campaign, environment, write

PROTOCOL = """
title = "Two tests"

[[test]]
name = "calm"
kind = "stabilization"
bench = "simulink"
cycles = 1
settle_cycles = 1
frequency = "5 Hz"

[[test]]
name = "steps"
kind = "step_response"
bench = "simulink"
"""


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("two-tests")
    protocol = write(folder, PROTOCOL)
    campaign(folder, "run", protocol)
    (found,) = (folder / "results").glob("*.nxs")
    return found


def page_of(archive: Path, count: int) -> tuple[str, dict[str, str]]:
    run = open_run(archive)
    with workers(run, count) as at_work:
        html, folder, _ = render(
            run, archive.parent, experiments(), templates_folder(), at_work=at_work
        )
    return html, folder.files


@pytest.mark.slow
def test_two_processes_make_the_page_that_one_makes(archive: Path) -> None:
    run = open_run(archive)
    with workers(run, 2) as two:
        found = two.found
        document = document_of(run, experiments(), found=found)
        drawings = drawings_of(document.tests, document.published)
        awaited = two.draw(drawings)
        drawn = {key: awaited(key) for key in drawings}
    assert found.keys() == {"calm", "steps"}
    assert {test for test, _ in drawn} == {"calm", "steps"}
    assert drawn == {key: drawing.made() for key, drawing in drawings.items()}
    assert page_of(archive, 2) == page_of(archive, 1)


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 2])
def test_what_was_found_is_told_once_and_the_page_is_the_same(archive: Path, count: int) -> None:
    told: list[Document] = []
    run = open_run(archive)
    with workers(run, count) as at_work:
        html, folder, report = render(
            run,
            archive.parent,
            experiments(),
            templates_folder(),
            at_work=at_work,
            when_found=told.append,
        )
    (document,) = told
    assert document is report.layout.document
    assert (html, folder.files) == page_of(archive, 1)


def test_what_is_found_is_waited_for_when_it_is_asked_for(
    archive: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Until then, whoever asks for it has time for something else."""
    begun: list[Future[object]] = []

    def begin(*_: object) -> Future[object]:
        begun.append(Future())
        return begun[-1]

    monkeypatch.setattr(processes.ProcessPoolExecutor, "submit", begin)
    with workers(open_run(archive), 2) as two:
        assert len(begun) == 2  # at once: nobody has asked for anything yet
        found = two.found
        assert len(begun) == 2
        for each in begun:
            each.set_result(TestAnalysis(Result(), (), "", ()))
        assert set(found) == {"calm", "steps"}


def test_a_test_that_is_found_is_gone_on_with_before_the_last_is(archive: Path) -> None:
    run = open_run(archive)
    asked: list[str] = []

    class Awaited(Mapping[str, TestAnalysis]):
        """As of processes: it has a length when all of them are ready."""

        def __getitem__(self, name: str) -> TestAnalysis:
            asked.append(name)
            return TestAnalysis(Result(), (), "", ())

        def __iter__(self) -> Iterator[str]:
            raise AssertionError("all are waited for")

        def __len__(self) -> int:
            raise AssertionError("all are waited for")

    tests = analyse_run(run, experiments(), found=Awaited())
    assert [each.name for each in tests] == asked == ["calm", "steps"]


def test_the_journal_is_parsed_once_for_a_report(
    archive: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parsed: list[bytes] = []

    def counted(content: bytes, *, lean: bool = False) -> Lines:
        parsed.append(content)
        return read_lines(content, lean=lean)

    for module in (sealed_run, summarise):
        monkeypatch.setattr(module, "read_lines", counted)
    run = open_run(archive)
    document_of(run, experiments())
    assert parsed == [run.story.content]


@pytest.mark.slow
def test_what_processes_need_is_imported_before_they_begin() -> None:
    """Experiments of the program and all that draws, in the process that the others are made of."""
    code = (
        "import sys, campaign.report.preload\n"
        "from campaign.experiments import experiments\n"
        "before = set(sys.modules)\n"
        "shipped = [n for n in experiments() if experiments().plug_in(n) is None]\n"
        "assert len(shipped) > 10\n"
        "all(experiments()[name] for name in shipped)\n"
        "import matplotlib.figure, matplotlib.projections, scipy.stats\n"
        "import campaign.report.drawing.figures, campaign.report.processes\n"
        "print(sorted(set(sys.modules) - before))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
    assert [importlib.util.find_spec(name) is not None for name in processes.PRELOADED] == [True]


@pytest.mark.slow
def test_a_process_that_dies_costs_no_more_than_time(
    archive: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def dead(*_: object) -> Future[object]:
        future: Future[object] = Future()
        future.set_exception(BrokenProcessPool())
        return future

    whole = page_of(archive, 1)
    monkeypatch.setattr(processes.ProcessPoolExecutor, "submit", dead)
    with workers(open_run(archive), 2) as two:
        assert two.found == {}
    assert page_of(archive, 2) == whole


IMPORTED_LATE = """
import sys

import campaign.cli.report

print(*sorted({"matplotlib", "jinja2", "campaign.report.build"} & sys.modules.keys()))
"""


@pytest.mark.slow
def test_processes_are_begun_before_what_makes_a_page_is_imported() -> None:
    """They analyse while it is; half a second of every report, where there are two processors."""
    command = [sys.executable, "-c", IMPORTED_LATE]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment())
    assert done.stdout.split() == []


STRANDED = """
import multiprocessing, os, signal, sys, time
from campaign.processes import process_pool

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # whatever began it may ignore it
    with process_pool(2, (), time.sleep, 0) as pool:
        waiting = [pool.submit(time.sleep, 600) for _ in range(2)]
        pids = [process.pid for process in multiprocessing.active_children()]
        while not all(each.running() for each in waiting):
            time.sleep(0.05)
        print(*pids, flush=True)
        sys.stdin.read(1)
        os.kill(os.getpid(), getattr(signal, sys.argv[1]))
        time.sleep(600)
"""


@pytest.mark.parametrize("how", ["SIGKILL", "SIGINT"])
def test_no_process_outlives_the_one_that_began_it(tmp_path: Path, how: str) -> None:
    script = tmp_path / "stranded.py"
    script.write_text(STRANDED, encoding="utf-8")
    with subprocess.Popen(
        [sys.executable, str(script), how],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=environment(),
        text=True,
    ) as parent:
        assert parent.stdout
        pids = [int(pid) for pid in parent.stdout.readline().split()]
        assert len(pids) == 2
        assert all(_lives(pid) for pid in pids)
        parent.communicate("x", timeout=120)
        assert parent.returncode == -getattr(signal, how)
    limit = time.monotonic() + 120
    while any(_lives(pid) for pid in pids) and time.monotonic() < limit:
        time.sleep(0.05)
    assert not any(_lives(pid) for pid in pids)


def _lives(pid: int) -> bool:
    """Whether there is such a process that has not ended; its parent may still have to hear it."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    state = Path(f"/proc/{pid}/stat")
    return not state.exists() or state.read_text().rpartition(")")[2].split()[0] != "Z"
