"""Stops that meet another thread or process at the wrong time."""

from __future__ import annotations

import io
import json
import queue
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from campaign.canopen_drive import line
from campaign.canopen_drive import objects as od
from campaign.canopen_drive.address import address_of
from campaign.canopen_drive.client import Answers, Client
from campaign.canopen_drive.drive import Drive, DriveError
from campaign.canopen_drive.ends import End
from campaign.canopen_drive.line import Desk, DirectLine, Latch
from campaign.canopen_drive.relay import Relay
from campaign.canopen_drive.settings import set_pdos
from campaign.recording import Outcome, SafeState
from campaign.wire.messages import Safe, framed
from tests.canopen_drive.rig import LIMITS, backend, channel, execute, trial
from tests.canopen_drive.simulated import SimulatedDrive

Make = Callable[..., tuple[str, SimulatedDrive]]
JOB: dict[str, Any] = {
    "do": "play", "mode": od.PROFILE_VELOCITY, "targets": [3000] * 3000, "period": 0.01,
    "farthest": 2**31, "fastest": 1e9, "strongest": 1e9, "counted": False,
    "patience": 60.0,
}  # fmt: skip


class Deaf(io.RawIOBase):
    """A host that reads nothing: a pipe that is full."""

    def writable(self) -> bool:
        return True

    def write(self, data: Any) -> int:
        threading.Event().wait(60.0)
        return len(data)


@contextmanager
def relay(out: Any = None) -> Iterator[tuple[Relay, SimulatedDrive]]:
    name = channel()
    with SimulatedDrive(name) as drive:
        bus = Drive(address_of(f"can://virtual/{name}?node=5"))
        set_pdos(bus, 5)
        for index in (0x6083, 0x6085):
            drive.put(index, 10**5)
        yield Relay(bus, out or io.BytesIO()), drive
        bus.close()


def states(drive: SimulatedDrive) -> list[str]:
    return [event[1] for event in drive.log if event[0] == "state"]


def test_a_host_that_reads_no_more_is_silent_like_any_other() -> None:
    """Neither a sample nor an answer that it does not take keeps the relay from its work."""
    with relay(Deaf()) as (made, drive):
        made._hello({"heartbeat": 0.4, "silence": 1.0, "who": "x"})
        for work in (made._heartbeats, made._work, made._send):
            threading.Thread(target=work, daemon=True).start()
        beats = []
        drive.network.subscribe(0x77F, lambda *_: beats.append(1))
        made._take({"id": 1, "do": "boots"})  # its answer is stuck
        made._take({"id": 2, **JOB})
        drive.wait(lambda: abs(drive.rate) > 0.1, 10.0)
        drive.wait(drive.at_rest_and_off, 10.0)
        drive.wait(lambda: made._quiet, 10.0)
        count = len(beats)
        time.sleep(0.5)
        assert len(beats) - count <= 1
        made._closed = True


def test_a_trial_that_waits_does_not_begin_after_the_host_has_gone() -> None:
    with relay() as (made, drive):
        made.drive.mapped = True
        assert made.leave()
        made.drive = Drive(address_of(made.drive.address.text))
        assert made._play({"id": 7, **JOB})["end"] == End.STOPPED
        made.drive.close()
        assert "enabled" not in states(drive)


def test_what_something_else_stops_while_it_is_enabled_stays_stopped() -> None:
    """An input of the drive, or a tool: the relay does not start again from the beginning."""
    with relay() as (made, drive):
        fallen = []

        def read(index: int) -> None:
            if index == 0x6041 and drive.state == "switched on" and not fallen:
                fallen.append(len(drive.log))
                drive.become("switch on disabled")

        drive.on_read = read
        end = made._play({"id": 1, **JOB})
        assert fallen
        assert (end["end"], end["safe"]) == (End.DRIVE, True)
        assert "enabled" not in states(drive)


def test_a_latch_of_another_process_is_seen_before_each_word_that_enables() -> None:
    with relay() as (made, drive):
        other = Latch(made.drive.address.file("latch"))

        def read(index: int) -> None:
            if index == 0x6041 and drive.state == "ready" and other.now() is None:
                other.stop("ada")
                other.write()

        drive.on_read = read
        end = made._play({"id": 1, **JOB})
        assert (end["end"], end["why"]) == (End.PANIC_STOP, "panic stop by ada")
        assert "enabled" not in states(drive)


def test_a_stop_while_it_is_enabled_is_no_fault_of_the_drive() -> None:
    with relay() as (made, drive):
        until = made._until

        def stopped(condition: Callable[[], bool], what: str) -> None:
            until(condition, what)
            if what == "state":
                made.halt(End.PANIC_STOP, "panic stop by ada")
                drive.become("quick stop")

        made._until = stopped  # type: ignore[method-assign]
        assert made._play({"id": 1, **JOB})["end"] == End.PANIC_STOP


def test_silence_is_noticed_between_two_heartbeats() -> None:
    """With a long time of the heartbeat as well."""
    with relay() as (made, drive):
        made._hello({"heartbeat": 20.0, "silence": 0.3, "who": "x"})
        made._armed, made._halted = True, None
        threading.Thread(target=made._heartbeats, daemon=True).start()
        drive.wait(lambda: made._halted is not None, 2.0)
        assert made._halted == (End.HOST_SILENT, "")
        made._closed = True


def test_who_clears_a_stop_does_not_lose_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    latch = Latch(tmp_path / "latch.json")
    latch.stop("ada")
    latch.write()
    second, write = threading.Thread(target=latch.stop, args=("bob",)), line.write_whole

    def slow(path: Path, tree: dict[str, Any]) -> None:
        if not tree["latched"]:
            second.start()
            second.join(0.3)
        write(path, tree)

    monkeypatch.setattr(line, "write_whole", slow)
    assert latch.clear(1)
    second.join()
    latch.write()
    found = Latch(tmp_path / "latch.json").now()
    assert found is not None
    assert found[:2] == (2, "bob")


def test_no_quick_stop_follows_a_stop_that_was_cleared(tmp_path: Path) -> None:
    """It would end the next trial, as a fault of the drive."""
    latch, begun, go_on = Latch(tmp_path / "latch.json"), threading.Event(), threading.Event()
    told = []

    class Resting:
        address = SimpleNamespace(rest=1)

        def bring_to_rest(self, patience: float) -> bool:
            begun.set()
            go_on.wait(60.0)
            told.append("quick stop")
            return True

        def look(self) -> Any:
            raise DriveError("nothing")

    desk = Desk(Resting(), latch)  # type: ignore[arg-type]
    desk.feed(framed(Safe(1, "ada"), 1))
    assert begun.wait(60.0)
    threading.Timer(0.3, go_on.set).start()
    assert latch.clear(1)
    assert told == ["quick stop"]
    desk.feed(framed(Safe(1, "ada"), 2))  # sent before the stop was cleared
    latch.wait()
    assert told == ["quick stop"]
    desk.feed(framed(Safe(2, "bob"), 1))
    latch.wait()
    assert len(told) == 2


def test_a_full_disk_does_not_keep_the_drive_moving(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(path: Path, tree: dict[str, Any]) -> None:
        raise OSError("no space left on device")

    def late(drive: Drive, patience: float) -> bool:
        time.sleep(0.3)
        return rest(drive, patience)

    rest = Drive.bring_to_rest
    monkeypatch.setattr(line.Drive, "bring_to_rest", late)
    monkeypatch.setattr(line, "write_whole", full)
    name = channel()
    with SimulatedDrive(name) as drive:
        drive.put(0x6085, 10**5)
        for word in (6, 7, 15):
            drive.control(word)
        direct = DirectLine(address_of(f"can://virtual/{name}?node=5"))
        with pytest.raises(OSError, match="no space"):
            direct.write(framed(Safe(1, "ada"), 1))
        direct.close()
        assert drive.at_rest_and_off()


def test_an_answer_that_comes_too_late_ends_no_trial() -> None:
    lines: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    lines.put(b'{"id": 0, "is": "open"}\n')
    client = Client("x", lambda text: (io.BytesIO(), iter(lines.get, b""), lambda patience: None))  # type: ignore[arg-type, return-value]
    with pytest.raises(DriveError, match="no answer"):
        client.ask("rest", 0.0)
    answers = Answers()
    client.tell("play", answers)
    lines.put(b'{"id": 1, "is": true}\n')
    lines.put(json.dumps({"id": 2, "is": {"end": "played"}}).encode() + b"\n")
    assert answers.get(timeout=5) == {"id": 2, "is": {"end": "played"}}
    assert not client._answers
    lines.put(b"")


def test_a_trial_that_was_between_two_motions_moves_no_more_after_make_safe(drives: Make) -> None:
    name, drive = drives()
    with backend(name) as connected:
        assert execute(connected, trial())[0].outcome is Outcome.COMPLETED
        client, since, made = connected._client, len(drive.log), []
        assert client is not None
        write = client.write

        def interrupted(item: od.Item, value: int) -> None:
            write(item, value)
            if item is od.ACCELERATION and not made:
                made.append(connected.make_safe())

        client.write = interrupted  # type: ignore[method-assign]
        ending, _ = execute(connected, trial())
        assert made == [SafeState.CONFIRMED]
        assert ending.outcome is Outcome.INTERRUPTED
        assert not any(event[0] == "moves" for event in drive.log[since:])
        client.write = write  # type: ignore[method-assign]
        assert execute(connected, trial())[0].outcome is Outcome.COMPLETED


def test_a_limit_that_cannot_be_written_keeps_no_other_from_being_restored(drives: Make) -> None:
    name, drive = drives(stiff=(0x6072,))
    with backend(name) as connected:
        assert execute(connected, trial())[0].outcome is Outcome.COMPLETED
        assert drive.get(0x6080) == 9
    assert drive.get(0x6080) == 3000
    assert drive.get(0x1016, 1) == 0, "it goes into fault when the heartbeat ends"


def test_a_limit_of_less_than_a_unit_of_the_drive_is_none(drives: Make) -> None:
    """To some drives 0 is no limit."""
    name, drive = drives(lacking=(0x607F,))
    bench = {"limits": {**LIMITS, "rate": 0.09}}  # 0.86/min
    with backend(name) as connected:
        first = trial()
        slow = first.model_copy(update={"bench": {**first.bench, **bench}})
        ending, _ = execute(connected, slow)
    assert "limits no speed" in ending.reason
    assert drive.get(0x6080) == 3000


def test_an_answer_that_is_too_short_is_an_error_of_the_drive() -> None:
    """A stop survives it."""
    name = channel()
    with SimulatedDrive(name):
        bus = Drive(address_of(f"can://virtual/{name}?node=5"))
        with pytest.raises(DriveError, match="1001h"):
            bus.read(od.Item(0x1001, 0, "I", "error register"))
        bus.close()
