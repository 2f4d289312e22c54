"""The first start: compiled in the background, by processes of which none stays behind."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from dataclasses import asdict

import pytest

from campaign.cli.compiling import COMPILING, compiling_meanwhile, wait_until_compiled
from campaign.execution import first_start
from campaign.execution.first_start import FirstStart, Helpers, make_all
from campaign.physics.machine_code import LANES, Made, Part

ALONE, TOGETHER = "engine, one trial", "engine, together"


@pytest.fixture(autouse=True)
def small_engine(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """An engine of one part for each width; what is made, and what is noted, in order."""
    made: list[str] = []

    def parts(width, benches):
        name = ALONE if width == 1 else TOGETHER
        yield Part(name, lambda: made.append(name))

    monkeypatch.setattr(first_start, "parts", parts)
    monkeypatch.setattr(first_start, "note_all_made", lambda: made.append("all"))
    monkeypatch.setattr(first_start, "all_made", lambda: "all" in made)
    return made


def helper(monkeypatch: pytest.MonkeyPatch, program: str) -> list[subprocess.Popen[str]]:
    """Processes that run `program` in place of the compiler."""
    started: list[subprocess.Popen[str]] = []

    def start(width: int) -> subprocess.Popen[str]:
        assert width == LANES
        process = subprocess.Popen(
            [sys.executable, "-c", program], stdout=subprocess.PIPE, encoding="utf-8"
        )
        started.append(process)
        return process

    monkeypatch.setattr(Helpers, "_start", staticmethod(start))
    monkeypatch.setattr(first_start.os, "cpu_count", lambda: 2)
    monkeypatch.setattr(first_start, "folder", lambda: "somewhere")
    return started


def test_what_a_helper_compiled_is_loaded_and_told_with_what_it_took(monkeypatch, small_engine):
    line = json.dumps(asdict(Made(TOGETHER, 30.0, compiled=True)))
    helper(monkeypatch, f"print({line!r})")
    told: list[Made] = []
    with Helpers() as helpers:
        make_all(told.append, helpers)
    assert small_engine == [ALONE, TOGETHER, "all"]
    assert [made.name for made in told] == [ALONE, TOGETHER]
    assert told[1] == Made(TOGETHER, 30.0, compiled=True)


def test_what_a_helper_did_not_make_is_made_here(monkeypatch, small_engine):
    helper(monkeypatch, "raise SystemExit(1)")
    told: list[Made] = []
    with Helpers() as helpers:
        make_all(told.append, helpers)
    assert small_engine == [ALONE, TOGETHER, "all"]
    assert [made.name for made in told] == [ALONE, TOGETHER]


def test_helpers_do_not_stay_behind(monkeypatch):
    started = helper(monkeypatch, "import time; time.sleep(600)")
    with Helpers():
        assert started[0].poll() is None
    assert started[0].returncode


def test_a_helper_ends_with_whoever_started_it():
    """However that ended: killed, it could end nobody."""
    process = Helpers._start(LANES)
    process.stdin.close()
    assert process.wait(120) == 1
    process.stdout.close()


@pytest.mark.parametrize(("processors", "folder"), [(1, "somewhere"), (2, None)])
def test_helpers_that_would_not_help_are_not_started(monkeypatch, processors, folder):
    started = helper(monkeypatch, "")
    monkeypatch.setattr(first_start.os, "cpu_count", lambda: processors)
    monkeypatch.setattr(first_start, "folder", lambda: folder)
    with Helpers() as helpers:
        assert helpers.wait() == {}
    assert started == []


def test_a_first_start_is_waited_for_and_says_what_for(monkeypatch, capsys, small_engine):
    helper(monkeypatch, "")
    go_on = threading.Event()

    def slow(told, helpers):
        go_on.wait(60)
        small_engine.append("all")

    monkeypatch.setattr(first_start, "make_all", slow)
    with compiling_meanwhile("sim") as first:
        assert first is not None
        assert first.is_busy
        threading.Timer(0.2, go_on.set).start()
        wait_until_compiled(first)
        assert not first.is_busy
    assert capsys.readouterr().err == f"{COMPILING}\n"
    with compiling_meanwhile("sim") as second:
        wait_until_compiled(second)
    assert capsys.readouterr().err == ""
    assert small_engine == ["all"], "what is there is not made again"


def test_a_failure_to_compile_ahead_costs_nothing_else(monkeypatch):
    helper(monkeypatch, "")

    def broken(told, helpers):
        raise OSError("no room")

    monkeypatch.setattr(first_start, "make_all", broken)
    with FirstStart() as first:
        first.wait()
    assert not first.is_busy


def test_a_backend_that_simulates_nothing_compiles_nothing():
    with compiling_meanwhile("serial") as first:
        assert first is None
