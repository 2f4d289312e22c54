"""After a panic stop the drive never comes on again, wherever in a run the stop falls.

Judged from the controller's own log: between "latched" and "cleared" there is no "drive on". No
judgement here depends on how fast the machine is.
"""

from __future__ import annotations

import json
import os
import random
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from campaign.archive.layout.journal import Decision
from campaign.archive.reading.open_run import open_run
from campaign.cli.stop import stop_bench
from campaign.errors import ExitCode
from campaign.wire.codes import Kind
from tests.link.controllers import controller
from tests.link.proxy import proxy
from tests.system.user import Process, begun, campaign, children, program_of, write

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")

PROTOCOL = """\
title = "Short on hardware"

[faults]
default = { do = "retry", times = 2, pause = "1 s" }

[rest]
every = "0.5 s"
pause = "1 s"

[[test]]
name = "sea"
kind = "stabilization"
bench = "simulink"
seed = 7
frequency = "4 Hz"
acceleration = "18 deg/s^2"
cycles = 2
settle_cycles = 1

[test.matrix]
compensation = ["none", "lugre", "static"]
"""
TRIALS = 3
PATIENCE = 900.0
"""s; only for a machine that is very busy, and a test that would never end."""
ON = ("--backend", "serial", "--set", "backend.motion=emulated", "--yes")


@dataclass
class Bench:
    """A rehearsal controller with its log, and the run that it is stopped in."""

    folder: Path
    port: str

    @property
    def log(self) -> list[dict[str, object]]:
        text = (self.folder / "device.log").read_text(encoding="utf-8")
        return [json.loads(line) for line in text.splitlines()]

    def count(self, event: str) -> int:
        return sum(line["event"] == event for line in self.log)

    def stop(self) -> None:
        assert stop_bench(self.port, 2_000_000, PATIENCE) is ExitCode.DONE

    def run(self, port: str = "", *more: str) -> Process:
        return begun(self.folder, "run", "protocol.toml", *ON, "--port", port or self.port, *more)

    def never_on_after_a_stop(self) -> None:
        latched = False
        for line in self.log:
            latched = line["event"] == "latched" or (latched and line["event"] != "cleared")
            assert not (latched and line["event"] == "drive on"), self.log
        assert latched, "it was not stopped"

    def judged(self, process: Process, *, began: bool | None = None) -> None:
        """The run has ended by the stop, and screen, archive, journal and report say so."""
        out, err = process.communicate(timeout=PATIENCE)
        self.never_on_after_a_stop()
        if not out.strip():  # the stop came before the run had begun
            assert began is not True, err
            assert process.returncode == 3, err
            assert "nothing was moved" in err
            assert not list(self.folder.glob("results/*"))
            return
        assert began is not False, err
        assert process.returncode == 130, err
        assert "PANIC STOP by " in err
        run = open_run(self.folder / out.splitlines()[-1])
        assert run.status == "interrupted"
        assert run.reason.startswith("panic stop by ")
        assert "campaign stop" in run.reason  # by whom
        assert run.safe_state == "confirmed"
        decisions = run.story.all(Decision)
        assert [d for d in decisions if d.decision == "panic stop"]


@contextmanager
def bench(folder: Path, *options: str, speed: str = "max", text: str = PROTOCOL) -> Iterator[Bench]:
    write(folder, text)
    (folder / "device.log").touch()
    log = (
        "--log",
        str(folder / "device.log"),
        "--latch",
        str(folder / "latch.json"),
        "--new-latch",
    )
    # On a busy machine heartbeats are late: that is not what is tried here.
    patient = ("--heartbeat-timeout", "20")
    with controller("--speed", speed, *log, *patient, *options, bench="simulink") as port:
        yield Bench(folder, port)


def wait_for(condition: Callable[[], object], process: Process) -> None:
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert process.poll() is None, process.stderr.read()
        assert time.monotonic() < deadline
        time.sleep(0.005)


# Aimed: just before the controller hears a chosen message of the host

AIMS = [
    (Kind.HELLO, 1, False),
    (Kind.SET, 1, True),
    (Kind.SET, 3, True),
    (Kind.ARM, 1, True),
    (Kind.START, 1, True),  # between ARM and START
    (Kind.START, 2, True),
    (Kind.RELEASE, 1, True),  # between the end of a trial and its release
    (Kind.QUERY, 1, None),
    (Kind.QUERY, 4, None),
    (Kind.SAFE, 1, None),  # the host's own, after the last trial
]


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "number", "began"), AIMS)
def test_just_before_a_message(tmp_path: Path, kind: Kind, number: int, began: bool | None) -> None:
    with bench(tmp_path) as rig, proxy(rig.port, kind, number, rig.stop) as line:
        process = rig.run(line.port)
        assert acted(line.acted, process), process.communicate(timeout=60)
        rig.judged(process, began=began)


def acted(event: threading.Event, process: Process) -> bool:
    while process.poll() is None:
        if event.wait(0.02):
            return True
    return event.is_set()


# Where nothing is said


def test_in_a_rest(tmp_path: Path) -> None:
    text = PROTOCOL.replace('pause = "1 s"\n\n[[', 'pause = "100 s"\n\n[[')
    with bench(tmp_path, text=text) as rig:
        process = rig.run()
        lines = iter(process.stderr.readline, "")
        assert any("the bench rests" in line for line in lines)
        rig.stop()
        rig.judged(process, began=True)


def test_in_the_pause_before_a_retry(tmp_path: Path) -> None:
    text = PROTOCOL.replace('times = 2, pause = "1 s"', 'times = 2, pause = "100 s"')
    with bench(tmp_path, "--fault", "limit-switch@trial=1@time=0.1", text=text) as rig:
        process = rig.run()
        lines = iter(process.stderr.readline, "")
        assert any("is executed again in 100 s" in line for line in lines)
        rig.stop()  # in state FAULT
        rig.judged(process, began=True)


def test_at_a_prompt(tmp_path: Path) -> None:
    import pty

    step = '\n[[test.operator]]\ntext = "Look at the gear"\n'
    with bench(tmp_path, text=PROTOCOL + step) as rig:
        terminal, theirs = pty.openpty()
        words = ("run", "protocol.toml", *ON[:-1], "--port", rig.port)
        process = begun(tmp_path, *words, stdin=theirs)
        os.write(terminal, b"yes\n")
        lines = iter(process.stderr.readline, "")
        assert any(line == "  Look at the gear\n" for line in lines)
        rig.stop()
        rig.judged(process, began=True)
        os.close(terminal)
        os.close(theirs)


@pytest.mark.slow
@pytest.mark.parametrize("on", [1, 2])
def test_while_the_host_hangs(tmp_path: Path, on: int) -> None:
    with bench(tmp_path, speed="1") as rig:
        process = rig.run()
        wait_for(lambda: rig.count("drive on") >= on, process)
        program = program_of(process)
        os.kill(program, signal.SIGSTOP)
        rig.stop()
        os.kill(program, signal.SIGCONT)
        rig.judged(process, began=True)


@pytest.mark.slow
def test_while_the_controller_starts_anew(tmp_path: Path) -> None:
    with bench(tmp_path, "--fault", "reboot=1@trial=2@time=0.2") as rig:
        process = rig.run()
        wait_for(lambda: rig.count("switched on") == 2, process)
        rig.stop()
        rig.judged(process, began=True)


@pytest.mark.slow
def test_while_the_line_is_cut(tmp_path: Path) -> None:
    """The host cannot be told then; it finds out as soon as it finds the controller again."""
    text = PROTOCOL.replace("cycles = 2", "cycles = 1000")
    text = text.replace('{ do = "retry", times = 2, pause = "1 s" }', '"abort"')
    with (
        bench(tmp_path, speed="1", text=text) as rig,
        proxy(rig.port, Kind.HEARTBEAT, 10**9, rig.stop) as line,
    ):
        process = rig.run(line.port, "--set", "backend.silence=1 s")
        wait_for(lambda: rig.count("drive on") == 1, process)
        line.cut()
        rig.stop()
        line.mend()
        rig.judged(process, began=True)


@pytest.mark.slow
def test_a_host_that_slept_does_not_stop_who_has_the_controller_now(tmp_path: Path) -> None:
    """As when a laptop is closed in a rest and opened again: it and its relay did not run."""
    text = PROTOCOL.replace('pause = "1 s"\n\n[[', 'pause = "100 s"\n\n[[')
    (tmp_path / "first").mkdir()
    (tmp_path / "second").mkdir()
    log, latch = tmp_path / "device.log", tmp_path / "latch.json"
    options = ("--log", str(log), "--latch", str(latch), "--new-latch", "--heartbeat-timeout", "1")
    with controller("--speed", "1", *options, bench="simulink") as port:
        first, second = Bench(tmp_path / "first", port), Bench(tmp_path / "second", port)
        write(first.folder, text)
        write(second.folder, PROTOCOL.replace("cycles = 2", "cycles = 1000"))
        sleeper = first.run()
        lines = iter(sleeper.stderr.readline, "")
        assert any("the bench rests" in line for line in lines)
        program = program_of(sleeper)
        pids = (sleeper.pid, program, *children(program))
        for pid in pids:
            os.kill(pid, signal.SIGSTOP)
        time.sleep(2.0)  # longer than the controller waits for a heartbeat
        other = second.run()
        wait_for(lambda: log.read_text().count("drive on") == 2, other)
        for pid in pids:
            os.kill(pid, signal.SIGCONT)
        sleeper.send_signal(signal.SIGINT)
        sleeper.communicate(timeout=PATIENCE)
        assert sleeper.returncode in (5, 130)  # nobody there saw the bench safe: it is not theirs
        assert "latched" not in [json.loads(line)["event"] for line in log.read_text().splitlines()]
        assert other.poll() is None
        other.send_signal(signal.SIGINT)
        out, err = other.communicate(timeout=PATIENCE)
        assert open_run(second.folder / out.splitlines()[-1]).reason == "stopped by Ctrl-C", err


# What is done about it


@pytest.mark.slow
def test_nobody_but_a_person_clears_it(tmp_path: Path) -> None:
    with bench(tmp_path) as rig:
        rig.stop()
        refused = campaign(tmp_path, "run", "protocol.toml", *ON, "--port", rig.port, code=3)
        assert "campaign stop" in refused.err
        assert "--clear-stop 1" in refused.err
        assert not (tmp_path / "results").exists()
        wrong = (*ON, "--port", rig.port, "--clear-stop", "7")
        assert "nothing was moved" in campaign(tmp_path, "run", "protocol.toml", *wrong, code=3).err
        assert rig.count("drive on") == 0
        shown = json.loads(campaign(tmp_path, "status", "--port", rig.port, "--json").out)
        assert (shown["latched"], shown["stop"]["count"], shown["held"]) == (True, 1, False)
        right = (*ON, "--port", rig.port, "--clear-stop", "1")
        done = campaign(tmp_path, "run", "protocol.toml", *right)
        run = open_run(tmp_path / done.last_line)
        assert run.status == "complete"
        (told,) = run.story.all(Decision)[:1]
        assert told.decision == "stop cleared"
        assert "campaign stop" in told.reason  # whose stop it was
        assert "by --clear-stop 1" in told.reason
        assert rig.count("cleared") == 1


def test_a_latch_that_is_lost_after_a_stop_does_not_let_the_drive_on(tmp_path: Path) -> None:
    with bench(tmp_path) as rig:
        rig.stop()
    latch = tmp_path / "latch.json"
    latch.unlink()
    options = ("--log", str(tmp_path / "device.log"), "--latch", str(latch))
    with controller("--speed", "max", *options, bench="simulink") as port:
        refused = campaign(tmp_path, "run", "protocol.toml", *ON, "--port", port, code=3)
        assert "--clear-stop" in refused.err
        assert Bench(tmp_path, port).count("drive on") == 0


@pytest.mark.slow
@pytest.mark.parametrize(("answer", "code"), [("clear", 0), ("yes", 3), ("", 3)])
def test_at_a_terminal_it_is_asked_with_when_and_by_whom(
    tmp_path: Path, answer: str, code: int
) -> None:
    """`--yes` is no answer."""
    import pty

    with bench(tmp_path) as rig:
        rig.stop()
        terminal, theirs = pty.openpty()
        words = ("run", "protocol.toml", *ON, "--port", rig.port)
        process = begun(tmp_path, *words, stdin=theirs)
        os.write(terminal, f"{answer}\n".encode())
        _, err = process.communicate(timeout=PATIENCE)
        os.close(terminal)
        os.close(theirs)
        assert process.returncode == code, err
        assert "campaign stop, 0:0" in err  # by whom, and how long ago
        assert rig.count("drive on") == (TRIALS if code == 0 else 0)


@pytest.mark.slow
def test_a_second_host_is_told_who_holds_it_and_disturbs_nothing(tmp_path: Path) -> None:
    with bench(tmp_path, speed="1", text=PROTOCOL.replace("cycles = 2", "cycles = 1000")) as rig:
        process = rig.run()
        wait_for(lambda: rig.count("drive on") == 1, process)
        second = campaign(tmp_path, "run", "protocol.toml", *ON, "--port", rig.port, code=3)
        program = program_of(process)
        assert f"pid {program}" in second.err
        status = campaign(tmp_path, "status", "--port", rig.port).out
        assert f"pid {program}, run " in status
        assert rig.count("drive off") == 0
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=PATIENCE)
        assert open_run(tmp_path / out.splitlines()[-1]).reason == "stopped by Ctrl-C", err
        assert rig.count("latched") == 0


@pytest.mark.slow
def test_the_report_says_it(tmp_path: Path) -> None:
    with bench(tmp_path) as rig, proxy(rig.port, Kind.START, 2, rig.stop) as line:
        process = rig.run(line.port)
        out, _ = process.communicate(timeout=PATIENCE)
    campaign(tmp_path, "report", out.splitlines()[-1])
    (page,) = (tmp_path / "results").glob("*-report/report.html")
    assert "panic stop by " in page.read_text(encoding="utf-8")


@pytest.mark.soak
@pytest.mark.parametrize("batch", range(30))
def test_at_random(tmp_path: Path, batch: int) -> None:
    """300 stops in all: by the clock, by a message, with the host stopped, in resets."""
    for number in range(10):
        chance = random.Random(10_000 + 10 * batch + number)
        folder = tmp_path / str(number)
        folder.mkdir()
        how = chance.choice(["clock", "clock", "message", "message", "hang", "reset"])
        fault = ("--fault", f"reboot={chance.uniform(0.1, 2.0):.2f}@trial=2@time=0.2")
        options = fault if how == "reset" else ()
        with bench(folder, *options, speed=chance.choice(["1", "4", "max"])) as rig:
            at_random(rig, how, chance)


def at_random(rig: Bench, how: str, chance: random.Random) -> None:
    if how == "message":
        kinds = [Kind.SET, Kind.ARM, Kind.START, Kind.RELEASE, Kind.HEARTBEAT, Kind.QUERY]
        number = chance.randint(1, 3)
        with proxy(rig.port, chance.choice(kinds), number, rig.stop) as line:
            process = rig.run(line.port)
            if acted(line.acted, process):
                rig.judged(process)
            else:
                process.communicate(timeout=PATIENCE)
            return
    process = rig.run()
    wait_for(lambda: rig.count("hello") >= 1, process)
    time.sleep(chance.uniform(0.0, 3.0))
    programs = children(process.pid)  # of its guardian; none once the run has ended
    if not programs:
        process.communicate(timeout=PATIENCE)
        return
    (program,) = programs
    if how == "hang":
        os.kill(program, signal.SIGSTOP)
        time.sleep(chance.uniform(0.0, 0.5))
    rig.stop()
    os.kill(program, signal.SIGCONT)
    out, err = process.communicate(timeout=PATIENCE)
    rig.never_on_after_a_stop()
    assert process.returncode in (130, 0), (out, err)
    # Complete is a run that was closing its archive when the stop came.
    assert process.returncode == 130 or rig.count("drive on") >= TRIALS, err
