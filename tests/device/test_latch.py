"""A stop from outside holds, whatever comes after it, until a person clears just that stop."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from campaign.cli.bench_commands import app
from campaign.device import latch as latch_module
from campaign.device.latch import LatchMemory, new_memory
from campaign.errors import UsageError
from campaign.wire.codes import LatchCause, NakCode, State
from campaign.wire.device import Ack, Latch, Nak, Status
from campaign.wire.host import Bye, Clear, Heartbeat, Hello, Safe, Start, Unlatch
from tests.device.test_controller import HOST, OURS, STRANGER, THEIRS, Rig, trial

STOP = Safe(THEIRS, "eve")


def stopped(rig: Rig) -> Rig:
    rig.send(STOP, client=STRANGER, sequence=7)
    return rig


def events(log: Path) -> list[str]:
    return [json.loads(line)["event"] for line in log.read_text().splitlines()]


@pytest.mark.parametrize("session", [0, THEIRS])
def test_a_stop_from_outside_latches_and_says_by_whom(session: int) -> None:
    rig = Rig()
    rig.start()
    rig.send(Safe(session, "eve"), client=STRANGER, sequence=7)
    assert not rig.controller.machine.drive_on
    latch = rig.latch()
    assert (latch.latched, latch.count, latch.cause) == (True, 1, LatchCause.STOPPED)
    assert latch.by == "eve"
    rig.go_on(0.2)
    assert rig.end().reason == "panic stop by eve"


def test_the_hosts_own_safe_does_not_latch_from_whichever_line_it_comes() -> None:
    rig = Rig()
    rig.start()
    rig.send(Safe(OURS), client=STRANGER, sequence=7)  # its relay's last words, over a new line
    assert rig.controller.state is State.SAFE
    assert not rig.latch().latched


@pytest.mark.parametrize("state", ["idle", "armed", "running", "ended", "fault", "before hello"])
def test_it_latches_in_every_state_and_nothing_arms_any_more(state: str) -> None:
    rig = Rig("over-temperature@time=0.1") if state == "fault" else Rig()
    if state == "idle":
        rig.send(Hello(2, 2, OURS))
    elif state == "armed":
        rig.configure(trial())
    elif state != "before hello":
        rig.start()
        rig.go_on({"running": 0.2, "ended": 1.3, "fault": 0.3}[state])
    stopped(rig)
    assert rig.latch().latched
    if state == "armed":
        assert isinstance(rig.send(Start(9)), Nak)
    rig.go_on(0.2)
    rig.send(Hello(2, 2, OURS))
    rig.send(Clear())
    assert rig.configure(trial()).code is NakCode.LATCHED
    assert rig.latch().latched
    assert not rig.controller.machine.drive_on


def test_only_the_count_that_was_seen_clears_it() -> None:
    rig = stopped(Rig())
    rig.send(Hello(2, 2, OURS))
    assert rig.send(Unlatch(0)).code is NakCode.OTHER_STOP
    rig.send(
        Safe(THEIRS + 1, "mallory"), client=STRANGER, sequence=7
    )  # while somebody looks at the first one
    assert rig.send(Unlatch(1)).code is NakCode.OTHER_STOP
    assert rig.latch().latched
    assert isinstance(rig.send(Unlatch(2)), Ack)
    assert not rig.latch().latched
    assert rig.send(Unlatch(2)).code is NakCode.OTHER_STOP  # it is spent
    rig.send(Clear())
    assert isinstance(rig.configure(trial()), Ack)


def test_one_stop_that_is_sent_until_it_is_confirmed_is_one() -> None:
    rig = Rig()
    for _ in range(5):
        stopped(rig)
    assert rig.latch().count == 1
    for _ in range(2):
        rig.send(Safe(), client=STRANGER, sequence=7)  # nobody's: each may be another one
    assert rig.latch().count == 3


def test_a_stop_is_told_to_all_and_a_hello_is_answered_with_it() -> None:
    rig = Rig()
    rig.start()
    stopped(rig)
    assert isinstance(rig.said[-1][1], Latch)
    assert rig.said[-1][0] is None  # everybody
    rig.go_on(0.2, beating=False)
    rig.send(Hello(2, 2, THEIRS), client=STRANGER)
    assert isinstance(rig.said[-1][1], Latch)
    assert rig.said[-1][0] == STRANGER


def test_it_outlives_a_reset_and_the_program(tmp_path: Path) -> None:
    file = tmp_path / "latch.json"
    new_memory(file)
    rig = Rig("reboot@trial=1@time=0.2", latch=file)
    rig.start()
    stopped(rig)
    rig.controller._switch_on()
    assert rig.latch().latched
    assert rig.configure(trial()).code is NakCode.LATCHED
    again = Rig(latch=file)
    assert (again.latch().latched, again.latch().count, again.latch().by) == (True, 1, "eve")
    again.send(Hello(2, 2, OURS))
    assert isinstance(again.send(Unlatch(1)), Ack)
    assert not Rig(latch=file).latch().latched


def test_the_drive_goes_off_before_it_is_remembered_and_that_before_it_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    order: list[str] = []
    rig = Rig()
    rig.start()
    remember = latch_module.write_atomically

    def write(*arguments: object) -> None:
        order.append("drive on" if rig.controller.machine.drive_on else "drive off")
        order.append("remembered")
        remember(*arguments)

    monkeypatch.setattr(latch_module, "write_atomically", write)
    rig.controller._send = lambda to, what: order.append(type(what).__name__)
    stopped(rig)
    assert order[:3] == ["drive off", "remembered", "Status"]  # of the new state, then the answers
    assert order[-3:] == ["Ack", "Status", "Latch"]


def test_a_memory_that_cannot_be_written_latches_all_the_same(tmp_path: Path) -> None:
    (tmp_path / "nowhere").mkdir()
    file = tmp_path / "nowhere" / "latch.json"
    new_memory(file)
    rig = Rig(latch=file)
    file.unlink()
    (tmp_path / "nowhere").rmdir()
    rig.start()
    stopped(rig)
    assert not rig.controller.machine.drive_on
    assert rig.latch().latched
    nak = rig.send(Unlatch(1))
    assert nak.code is NakCode.NOT_READY  # and clearing has to be remembered first
    assert rig.latch().latched


@pytest.mark.parametrize("rubbish", ["", "{", "[]", '{"latched": 0}', "\xff"])
def test_a_memory_that_cannot_be_read_is_no_memory(tmp_path: Path, rubbish: str) -> None:
    file = tmp_path / "latch.json"
    file.write_bytes(rubbish.encode("latin-1"))
    memory = LatchMemory(file, boot=99)
    assert memory.stop.latched
    assert (memory.stop.count, memory.stop.cause) == (99, LatchCause.NO_MEMORY)


def overwritten(content: Callable[[bytes], bytes]) -> Callable[[Path], object]:
    return lambda file: file.write_bytes(content(file.read_bytes()))


def folder_instead(file: Path) -> None:
    file.unlink()
    file.mkdir()


def link_to_nothing(file: Path) -> None:
    file.unlink()
    file.symlink_to("nothing")


LOSSES: dict[str, Callable[[Path], object]] = {
    "deleted": Path.unlink,
    "emptied": overwritten(lambda content: b""),
    "truncated": overwritten(lambda content: content[: len(content) // 2]),
    "zeroed": overwritten(lambda content: bytes(len(content))),
    "erased": overwritten(lambda content: b"\xff" * len(content)),
    "replaced by a folder": folder_instead,
    "replaced by a link": link_to_nothing,
    "unreadable": lambda file: None,  # whoever may read everything is not kept out by a mode
}


@pytest.mark.parametrize("loss", LOSSES)
def test_a_memory_that_is_lost_after_a_stop_keeps_the_drive_off(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, loss: str
) -> None:
    file = tmp_path / "latch.json"
    new_memory(file)
    rig = Rig(latch=file)
    rig.start()
    stopped(rig)
    LOSSES[loss](file)
    if loss == "unreadable":
        read = Path.read_text

        def refuse(path: Path, *arguments: object, **options: object) -> str:
            if path == file:
                raise PermissionError(13, "Permission denied")
            return read(path, *arguments, **options)  # type: ignore[arg-type]

        monkeypatch.setattr(Path, "read_text", refuse)
    rig = Rig(latch=file)
    rig.send(Hello(2, 2, OURS))
    latch = rig.latch()
    assert (latch.latched, latch.cause) == (True, LatchCause.NO_MEMORY)
    assert rig.configure(trial()).code is NakCode.LATCHED
    rig.send(Clear())
    assert isinstance(rig.send(Start(9)), Nak)
    assert rig.send(Unlatch(1)).code is NakCode.OTHER_STOP  # the stop that was lost
    assert not rig.controller.machine.drive_on
    cleared = rig.send(Unlatch(latch.count))
    if loss == "replaced by a folder":  # which cannot be written
        assert cleared.code is NakCode.NOT_READY
        assert rig.latch().latched
    else:
        rig.send(Clear())
        rig.start()
        assert rig.controller.machine.drive_on


def test_no_beginning_of_a_memory_is_a_memory(tmp_path: Path) -> None:
    file = tmp_path / "latch.json"
    new_memory(file)
    whole = file.read_bytes()
    assert not LatchMemory(file, boot=99).latched
    for length in range(len(whole)):
        file.write_bytes(whole[:length])
        assert LatchMemory(file, boot=99).latched, length


@pytest.mark.parametrize("loss", ["none", "zeroed", "replaced by a folder", "replaced by a link"])
def test_a_new_memory_takes_the_place_of_nothing(tmp_path: Path, loss: str) -> None:
    file = tmp_path / "latch.json"
    new_memory(file)
    LatchMemory(file, boot=1).set(THEIRS, "eve")
    LOSSES.get(loss, str)(file)
    with pytest.raises(FileExistsError):
        new_memory(file)
    assert LatchMemory(file, boot=2).latched


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--latch", "there"), "there exists and may hold a stop; start without --new-latch"),
        (("--latch", "."), "may hold a stop"),
        (("--latch", "none"), "--new-latch needs --latch FILE"),
        ((), "--new-latch needs --latch FILE"),
        (("--latch", "nowhere/latch"), "there is no such folder"),
    ],
)
def test_a_first_start_is_refused_where_it_may_be_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...], told: str
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("campaign.cli.device.Server.serve", lambda server: 0)  # which never ends
    Path("there").write_text("a stop", encoding="utf-8")
    done = CliRunner().invoke(app, ["device", "--bench", "platform", "--new-latch", *options])
    assert isinstance(done.exception, UsageError)
    assert int(done.exception.exit_code) == 2
    assert told in str(done.exception)
    assert "\n" not in str(done.exception)
    assert Path("there").read_text(encoding="utf-8") == "a stop"
    assert [path.name for path in tmp_path.iterdir()] == ["there"]


def test_without_lasting_memory_it_starts_latched_with_a_count_of_this_life() -> None:
    memory = LatchMemory(None, boot=4711)
    assert (memory.latched, memory.message().age) == (True, None)
    assert not memory.clear(0)
    assert memory.clear(4711)
    assert not memory.latched


def test_it_knows_how_long_ago_the_stop_was(tmp_path: Path) -> None:
    now = [1000.0]
    new_memory(tmp_path / "latch")
    memory = LatchMemory(tmp_path / "latch", 1, lambda: now[0])
    memory.set(THEIRS, "eve")
    now[0] += 75.0
    assert LatchMemory(tmp_path / "latch", 2, lambda: now[0]).message().age == 75.0


# Who holds the controller


def test_a_second_host_is_told_who_holds_it_also_between_trials() -> None:
    rig = Rig()
    rig.send(Hello(2, 2, OURS, "ada@lab"))
    rig.beat()
    nak = rig.send(Hello(2, 2, THEIRS, "eve"), client=STRANGER)
    assert nak.code is NakCode.BUSY
    assert "ada@lab" in nak.text
    assert (rig.holder().held, rig.holder().host) == (True, "ada@lab")
    rig.time += 0.2
    assert not rig.holder().held
    assert not isinstance(rig.send(Hello(2, 2, THEIRS, "eve"), client=STRANGER), Nak)


def test_a_foreign_heartbeat_keeps_nothing_alive_and_frees_nothing() -> None:
    rig = Rig()
    rig.start()
    for _ in range(6):
        rig.time += 0.02
        rig.send(Heartbeat(8, 9, 10**6, THEIRS), client=HOST, sequence=0)
        assert isinstance(rig.said[-1][1], Status)
        rig.controller.tick()
    assert rig.controller.state is State.FAULT
    assert rig.controller.machine.ring.first == 0
    assert rig.controller.status().heartbeat == 1


def test_a_heartbeat_of_the_session_counts_on_every_line() -> None:
    rig = Rig()
    rig.start()
    for _ in range(10):
        rig.time += 0.02
        rig.send(Heartbeat(8, 9, 0, OURS), client=STRANGER, sequence=0)
        rig.controller.tick()
    assert rig.controller.state is State.RUNNING


def test_bye_is_as_good_as_silence_and_only_of_the_session_itself() -> None:
    rig = Rig()
    rig.start()
    rig.send(Bye(THEIRS), client=STRANGER, sequence=0)
    rig.controller.tick()
    assert rig.controller.state is State.RUNNING
    rig.send(Bye(OURS), sequence=0)
    rig.controller.tick()
    assert rig.controller.state is State.FAULT
    assert not rig.holder().held


def test_a_program_of_version_1_is_told_so_and_its_stop_is_confirmed() -> None:
    rig = Rig()
    assert rig.send(Hello(1, 1, THEIRS), client=STRANGER).version == 0
    rig.start()
    rig.send(Safe(), client=STRANGER, sequence=7)  # an empty body, as it always was
    status = [m for to, m in rig.said if to == STRANGER and isinstance(m, Status)][-1]
    assert not status.drive_on
    assert rig.latch().latched


def test_what_could_not_be_remembered_is_tried_again(tmp_path: Path) -> None:
    folder = tmp_path / "memory"
    memory = LatchMemory(folder / "latch", boot=1)
    memory.set(THEIRS, "eve")  # there is no such folder yet
    folder.mkdir()
    assert not memory.set(THEIRS, "eve")  # the same stop, sent until it is confirmed
    assert LatchMemory(folder / "latch", boot=2).stop.by == "eve"


@pytest.mark.parametrize("at", ["1e400", "[" * 100_000, "9" * 400])
def test_no_rubbish_in_the_memory_ends_the_controller(tmp_path: Path, at: str) -> None:
    file = tmp_path / "latch"
    file.write_text(f'{{"latched": false, "count": 1, "cause": 0, "by": "x", "at": {at}}}')
    assert LatchMemory(file, boot=99).stop.cause is LatchCause.NO_MEMORY


def test_whatever_is_remembered_of_who_it_was_can_be_told(tmp_path: Path) -> None:
    rig = Rig(latch=tmp_path / "latch")
    (tmp_path / "latch").write_text(
        json.dumps(
            {"latched": True, "count": 1, "cause": 1, "by": "\x1b[2J" + "e" * 999, "at": None}
        )
    )
    rig.controller._switch_on()
    assert rig.latch().by.startswith("?[2Jeee")
