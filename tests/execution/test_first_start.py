"""The first start: compiled in the background, by processes of which none stays behind."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from dataclasses import asdict

import pytest

from campaign.backends.sim import SimBackend, SimOptions
from campaign.cli.compile_engine import COMPILING, compiling_meanwhile, wait_until_compiled
from campaign.execution import first_start
from campaign.execution.first_start import FirstStart, Helpers, make_all
from campaign.physics import machine_code
from campaign.physics.machine_code import LANES, CompiledPart, Part
from campaign.protocol.bench_file import load_bench
from campaign.trial import Task, Trial

ALONE, TOGETHER = "engine, one trial", "engine, together"


@pytest.fixture(autouse=True)
def small_engine(monkeypatch: pytest.MonkeyPatch) -> list[str | int]:
    """An engine of one part for each width; what is made, and what is noted, in order."""
    made: list[str | int] = []

    def parts(width, benches):
        name = ALONE if width == 1 else TOGETHER
        yield Part(name, lambda: made.append(name))

    monkeypatch.setattr(first_start, "parts", parts)
    monkeypatch.setattr(first_start, "engine", lambda width, bench: next(parts(width, [bench])))
    for module in (first_start, machine_code):
        monkeypatch.setattr(module, "note_made", made.append)
        monkeypatch.setattr(module, "is_made", made.__contains__)
    return made


def helper(monkeypatch: pytest.MonkeyPatch, program: str) -> list[subprocess.Popen[str]]:
    """Processes that run `program` in place of the compiler."""
    started: list[subprocess.Popen[str]] = []

    def start(width: int, *only: str) -> subprocess.Popen[str]:
        assert (width, *only) in {(LANES,), (1, "engine"), (LANES, "engine")}
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
    line = json.dumps(asdict(CompiledPart(TOGETHER, 30.0, compiled=True)))
    helper(monkeypatch, f"print({line!r})")
    told: list[CompiledPart] = []
    with Helpers() as helpers:
        make_all(told.append, helpers)
    assert small_engine == [ALONE, 1, TOGETHER, LANES]
    assert [made.name for made in told] == [ALONE, TOGETHER]
    assert told[1] == CompiledPart(TOGETHER, 30.0, compiled=True)


def test_a_helper_that_hangs_is_ended_and_what_it_had_to_make_is_made_here(
    monkeypatch, small_engine
):
    started = helper(monkeypatch, "import time; time.sleep(20)")
    monkeypatch.setattr(first_start, "LONGEST", 0.1)
    with Helpers() as helpers:
        make_all(lambda made: None, helpers)
        assert [each.wait(10) for each in started] == [-signal.SIGKILL]
    assert small_engine == [ALONE, 1, TOGETHER, LANES]


def test_what_a_helper_did_not_make_is_made_here(monkeypatch, small_engine):
    helper(monkeypatch, "raise SystemExit(1)")
    told: list[CompiledPart] = []
    with Helpers() as helpers:
        make_all(told.append, helpers)
    assert small_engine == [ALONE, 1, TOGETHER, LANES]
    assert [made.name for made in told] == [ALONE, TOGETHER]


def test_helpers_do_not_stay_behind(monkeypatch):
    started = helper(monkeypatch, "import time; time.sleep(20)")
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


def planned(count: int, duration: float) -> list[Trial]:
    """Trials of one structure."""
    bench = load_bench("linear").model_dump(mode="json")
    task = Task(mode="rate", duration=duration, window=(0.0, 0.0), sample_rate=1000.0)
    return [
        Trial(number=number, test="test", kind="kind", seed=number, bench=bench, task=task)
        for number in range(1, count + 1)
    ]


def test_a_first_start_is_waited_for_and_says_what_for(monkeypatch, capsys, small_engine):
    helper(monkeypatch, "")
    backend = SimBackend(SimOptions())
    monkeypatch.setattr(backend, "make_ready", lambda trials: small_engine.append("models"))
    with compiling_meanwhile("sim") as first:
        assert first is not None
        assert first.is_busy
        wait_until_compiled(first, backend, planned(5, 1.0))
        assert not first.is_busy
    assert capsys.readouterr().err == f"{COMPILING}\n"
    assert small_engine == ["models", ALONE, 1], "and no engine for few steps side by side"
    assert backend.most_together == 1
    with compiling_meanwhile("sim") as second:
        wait_until_compiled(second, backend, planned(5, 1.0))
    assert capsys.readouterr().err == ""
    assert small_engine == ["models", ALONE, 1], "what is there is not made again"


@pytest.mark.parametrize(("count", "blocks"), [(4, True), (3, False)])
def test_where_blocks_save_more_than_they_cost_they_are_made(
    monkeypatch, small_engine, count, blocks
):
    """Fewer than `fewest_together` trials never go side by side, however long they are."""
    helper(monkeypatch, "")
    backend = SimBackend(SimOptions())
    monkeypatch.setattr(backend, "make_ready", lambda trials: None)
    with compiling_meanwhile("sim") as first:
        wait_until_compiled(first, backend, planned(count, 1e5))
    assert small_engine == ([ALONE, 1, TOGETHER, LANES] if blocks else [ALONE, 1])
    assert backend.most_together == (LANES if blocks else 1)


def test_where_the_engine_for_blocks_is_there_it_is_used(monkeypatch, small_engine):
    small_engine.extend((1, LANES))
    backend = SimBackend(SimOptions())
    with compiling_meanwhile("sim") as first:
        wait_until_compiled(first, backend, planned(5, 1.0))
    assert backend.most_together == LANES


def test_a_failure_to_compile_ahead_costs_nothing_else(monkeypatch):
    helper(monkeypatch, "")

    def broken():
        raise OSError("no room")

    with FirstStart() as first:
        first.wait(broken)
    assert not first.is_busy


def test_a_backend_that_simulates_nothing_compiles_nothing():
    with compiling_meanwhile("serial") as first:
        assert first is None
