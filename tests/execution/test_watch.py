"""`campaign run --watch`: what is drawn, and that no terminal is ever in the way of the run."""

from __future__ import annotations

import os
import pty
import select
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_list import find_run
from campaign.channels import info
from campaign.execution.progress import Progress
from campaign.execution.watch_display import AFTERWARDS, MOST, Trace, WatchDisplay, drawn
from campaign.trial import Task, Trial
from tests.forks import Begun
from tests.link.controllers import controller
from tests.system.user import SEA, begun, campaign, environment, forks

pytest.importorskip("plotext")

TASK = Task(mode="rate", duration=10.0, window=(0.0, 10.0), sample_rate=1000.0)
TRIAL = Trial(number=1, test="sea", kind="motion", seed=1, bench={}, task=TASK)
CHANNELS = (info("command", "rate"), *map(info, ("relative_rate", "motor_current", "gyro_rate")))
BRAILLE = "⠀⣿"


def handed(seen: Callable[..., None], trial: Trial, first: int, last: int) -> None:
    """Samples of four channels, a sine each."""
    at = np.arange(first, last) / 1000.0
    seen(trial, CHANNELS, at, np.sin(at + np.arange(4.0)[:, None]))


def lines_of(trace: Trace) -> list[str]:
    return drawn(trace, trace.samples(), 80, 24)


def has_curve(text: str) -> bool:
    return any(BRAILLE[0] < letter <= BRAILLE[1] for letter in text)


def test_a_running_trial_is_drawn_over_all_of_its_time_the_channels_it_needs_first() -> None:
    trial = TRIAL.model_copy(update={"requires": {"gyro_rate": "the rate"}})
    trace = Trace(trial, CHANNELS, 0.0)
    for first in range(0, 2000, 200):
        live = 1e-3 * first + 0.25
        handed(
            lambda t, c, at, block, now=live: trace.add(at, block, now), trial, first, first + 200
        )
    lines = lines_of(trace)
    assert [each.name for each in trace.channels] == ["gyro_rate", "command", "relative_rate"]
    assert lines[0].startswith("sea: trial-00001")
    assert AFTERWARDS not in lines[0]
    assert not trace.is_over
    assert "(deg/s)" in lines[1]
    assert has_curve("".join(lines))
    assert not has_curve("".join(line[30:] for line in lines)), "8 of 10 s are still to come"
    assert len(lines) <= 24
    assert max(map(len, lines)) <= 80


def test_what_is_delivered_at_the_end_says_so_and_much_of_it_is_thinned() -> None:
    trace = Trace(TRIAL, CHANNELS, 0.0)
    handed(lambda t, c, at, block: trace.add(at, block, 0.1), TRIAL, 0, 10_000)
    assert AFTERWARDS in lines_of(trace)[0]
    assert trace.is_over
    for first in range(0, 200_000, 1000):
        handed(lambda t, c, at, block: trace.add(at, block, 0.1), TRIAL, first, first + 1000)
    assert trace.samples().shape[1] <= MOST
    assert np.all(np.diff(trace.samples()[0][-100:]) > 0)


def test_undefined_samples_and_no_samples_draw_nothing_and_break_nothing() -> None:
    trace = Trace(TRIAL, CHANNELS, 0.0)
    trace.add(np.arange(3.0), np.full((4, 3), np.nan), 3.0)
    assert not has_curve("".join(lines_of(trace)))


@pytest.mark.slow
def test_a_terminal_that_takes_nothing_holds_up_neither_samples_nor_progress() -> None:
    taken, terminal = os.pipe()
    display = WatchDisplay(terminal, lambda: os.terminal_size((200, 60)))
    progress = Progress(9, 1, 0, 0, (TRIAL,))

    def tell(number: int) -> None:
        handed(display.seen, TRIAL.model_copy(update={"number": number}), 0, 10_000)
        display(replace(progress, done=number))

    def run_on() -> None:
        number = 0
        while select.select([], [terminal], [], 0)[1]:  # until the pipe takes no more
            number += 1
            tell(number)
            time.sleep(0.01)
        for more in range(20):  # whose pictures nothing takes
            tell(number + more)
        with display.hidden():
            pass
        display.end()

    # What waited for the terminal would wait for ever.
    thread = threading.Thread(target=run_on, daemon=True)
    thread.start()
    thread.join(120.0)
    assert not thread.is_alive()
    os.close(taken)  # whoever writes is told so


def on_terminal(folder: Path, terminal: str, *arguments: str) -> str:
    """`campaign` with a terminal as standard error: what that was sent.

    The run must be complete, and named at the end, whatever the terminal.
    """
    ours, theirs = pty.openpty()
    term = {"TERM": "dumb" if terminal == "dumb" else "xterm", "COLUMNS": "100", "LINES": "40"}
    running = Begun(forks(), folder, *arguments, stderr=theirs, environment=environment() | term)
    os.close(theirs)
    shown = b""
    try:
        while got := os.read(ours, 64 if terminal == "slow" else 65536):
            shown += got
            if terminal == "gone" and has_curve(shown.decode(errors="replace")):
                break
            time.sleep(0.01 if terminal == "slow" else 0)
    except OSError:
        pass  # nobody writes any more
    os.close(ours)
    out, _ = running.communicate(timeout=120)
    assert running.returncode == 0
    assert out.strip().endswith(".nxs")
    assert open_run(find_run(folder / "results")).status is RunStatus.COMPLETE
    return shown.decode(errors="replace")


@pytest.mark.slow
@pytest.mark.parametrize("terminal", ["quick", "slow", "dumb", "gone"])
def test_a_run_on_a_terminal(tmp_path: Path, terminal: str) -> None:
    (tmp_path / "sea.toml").write_text(SEA, encoding="utf-8")
    text = on_terminal(tmp_path, terminal, "run", "sea.toml", "--watch")
    if terminal in ("quick", "slow"):
        assert has_curve(text)
        assert AFTERWARDS in text
        assert "complete: 2 trials done" in text
    if terminal == "dumb":
        assert "this terminal cannot show pictures" in " ".join(text.split())
        assert "\x1b[" not in text


LIVE = SEA.replace("cycles = 1\n", 'cycles = 1\nfrequency = "1 Hz"\n', 1)


PACE = ("--speed", "1", "--heartbeat-timeout", "10")


def live(port: str) -> tuple[str, ...]:
    return ("--backend", "serial", "--port", port, "--set", "backend.motion=emulated", "--yes")


@pytest.mark.slow
def test_a_live_bench_is_watched_as_it_moves_and_waits_for_no_terminal(tmp_path: Path) -> None:
    """2 s of samples a trial, sent at their pace; a host that falls silent finds the drive off."""
    (tmp_path / "sea.toml").write_text(LIVE, encoding="utf-8")
    seen: dict[int, np.ndarray] = {}
    with controller(*PACE, bench="simulink", pty=True) as port:
        for terminal in ("slow", "dumb", "gone"):
            text = on_terminal(tmp_path, terminal, "run", "sea.toml", "--watch", *live(port))
            assert has_curve(text) == (terminal != "dumb")
            assert AFTERWARDS not in text
            assert "Rate of the hull" in text or terminal in ("dumb", "gone")  # the second channel
            for at, trial in enumerate(open_run(find_run(tmp_path / "results")).trials):
                told = trial.ending.telemetry
                assert not told["lost_records"]
                samples = trial.recording()["gyro_rate"]
                np.testing.assert_array_equal(seen.setdefault(at, samples), samples)
    assert len(seen) == 2


@pytest.mark.slow
def test_resume_is_watched_as_run_is(tmp_path: Path) -> None:
    (tmp_path / "sea.toml").write_text(LIVE, encoding="utf-8")
    with controller(*PACE, bench="simulink", pty=True) as port:
        process = begun(tmp_path, "run", "sea.toml", *live(port))
        with process:
            while not list(tmp_path.glob("results/*.partial")):
                time.sleep(0.1)
            time.sleep(1.0)
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=60)
        text = on_terminal(tmp_path, "quick", "resume", "2", "--yes", "--watch")
    assert has_curve(text)
    assert AFTERWARDS not in text


def test_nothing_is_begun_that_could_not_be_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sea.toml").write_text(SEA, encoding="utf-8")
    done = campaign(tmp_path, "run", "sea.toml", "--watch", "--executor", "dask:here", code=2)
    assert "leave --executor out" in done.err
    assert not (tmp_path / "results").exists()
