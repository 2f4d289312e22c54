"""Stopping and clearing a fault never lead nearer to operation enabled (CiA 402-2, figure 7)."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from campaign.canopen_drive import objects as od
from campaign.canopen_drive.address import address_of
from campaign.canopen_drive.drive import Drive
from campaign.canopen_drive.state import ENABLING, State, reset_words, state_of, stop_word
from tests.canopen_drive.rig import channel
from tests.canopen_drive.simulated import OFF, STATUS, SimulatedDrive

Make = Callable[..., tuple[str, SimulatedDrive]]
NEARNESS = {
    "fault": 0, "fault reaction": 0, "switch on disabled": 0, "quick stop": 0, "ready": 1,
    "switched on": 2, "enabled": 3,
}  # fmt: skip
NAMES = {State.ENABLED: "enabled"}


def mask(name: str) -> int:
    return 0x4F if name in ("switch on disabled", "fault", "fault reaction") else 0x6F


def test_every_statusword_has_the_state_of_the_standard() -> None:
    for word in range(0x10000):
        found = state_of(word)
        fitting = [name for name, status in STATUS.items() if not (word ^ status) & mask(name)]
        expected = fitting[0] if fitting else ("not ready" if not word & 0x4F else None)
        told = None if found is None else NAMES.get(found, found.text)
        assert told == expected, f"{word:04X}h"


def words(state: State | None) -> set[int]:
    stops = {stop_word(state, at_rest=rest) for rest in (False, True)}
    return stops | set(reset_words(state))


@pytest.mark.parametrize("option", range(8))
def test_no_word_of_a_stop_enables_whatever_the_state_is_by_now(option: int) -> None:
    """As read, and as it may be by the time that the word arrives."""
    with SimulatedDrive(channel()) as drive:
        drive.put(0x605A, option)
        for read in (*State, None):
            for word in words(read):
                for actual in STATUS:
                    drive.state, drive.last = actual, 0
                    drive.control(word)
                    assert NEARNESS[drive.state] <= NEARNESS[actual], (read, word, actual)


def test_no_state_as_read_lets_an_enabled_drive_coast() -> None:
    """It may be enabled by now: only a quick stop that stands is switched off."""
    for read in (*State, None):
        assert stop_word(read, at_rest=False) == 0x0002
        assert stop_word(read, at_rest=True) == (0x0002 if read is not State.QUICK_STOP else 0)


def test_only_three_states_have_a_way_on() -> None:
    assert set(ENABLING) == {State.SWITCH_ON_DISABLED, State.READY, State.SWITCHED_ON}


def rig(name: str) -> Drive:
    return Drive(address_of(f"can://virtual/{name}?node=5"))


def moving(drive: SimulatedDrive) -> None:
    """Enabled at 0.3 rad/s without a host."""
    drive.put(0x6060, 3)
    drive.put(0x60FF, 3000)
    drive.put(0x6083, 10**6)
    drive.put(0x6085, 10**5)
    for word in (6, 7, 15):
        drive.control(word)
    drive.wait(lambda: drive.rate > 0.1)


def nearest(drive: SimulatedDrive, since: int) -> int:
    return max((NEARNESS[e[1]] for e in drive.log[since:] if e[0] == "state"), default=0)


@pytest.mark.parametrize("option", range(8))
def test_a_moving_drive_comes_to_rest_with_each_quick_stop_option(
    option: int, drives: Make
) -> None:
    name, drive = drives()
    bus = rig(name)
    drive.put(0x605A, option)
    moving(drive)
    since = len(drive.log)
    assert bus.bring_to_rest(60.0)
    assert drive.at_rest_and_off()
    assert nearest(drive, since) == 0
    bus.close()


PASSES: dict[str, Callable[[SimulatedDrive], None]] = {
    "enabled meanwhile": lambda drive: drive.become("enabled"),
    "a fault meanwhile": lambda drive: drive.fail(0x2310),
    "switched on meanwhile": lambda drive: drive.become("switched on"),
    "stopped meanwhile": lambda drive: drive.become("quick stop"),
}


@pytest.mark.parametrize("option", [0, 6])
@pytest.mark.parametrize("what", PASSES)
@pytest.mark.parametrize("before", ["switched on", "enabled", "quick stop"])
def test_a_state_that_passes_between_two_readings(what: str, before: str, option: int) -> None:
    """Something else changes the state as soon as it was read, three times."""
    name = channel()
    with SimulatedDrive(name) as drive:
        bus = rig(name)
        drive.put(0x605A, option)
        drive.put(0x6085, 10**6)
        drive.become(before)
        left = [3]

        def read(index: int) -> None:
            if index == 0x6041 and left[0]:
                left[0] -= 1
                PASSES[what](drive)
                drive.log.append(("outside",))

        drive.on_read = read
        assert bus.bring_to_rest(60.0)
        assert drive.state in OFF
        ours = [event[1] for event in drive.log if event[0] == "word"]
        assert set(ours) <= {0x0000, 0x0002}
        after = len(drive.log) - 1 - drive.log[::-1].index(("outside",))
        assert nearest(drive, after) == 0
        bus.close()


def test_it_is_not_at_rest_while_it_coasts(drives: Make) -> None:
    """605Ah of 0: off at once, and still moving."""
    name, drive = drives(coulomb=0.02, static=0.02, viscous=0.0)
    bus = rig(name)
    drive.put(0x605A, 0)
    moving(drive)
    assert bus.bring_to_rest(60.0)
    off = [event[:2] for event in drive.log].index(("state", "switch on disabled"))
    assert "rest" in [event[0] for event in drive.log[off:]], "seen at rest before it was"
    assert not drive.moves
    bus.close()


def test_clearing_a_fault_ends_in_switch_on_disabled() -> None:
    name = channel()
    with SimulatedDrive(name) as drive:
        bus = rig(name)
        drive.fail(0x2310)
        for word in reset_words(bus.look()[0]):
            bus.write(od.CONTROLWORD, word)
        assert drive.state == "switch on disabled"
        assert nearest(drive, 0) == 0
        bus.close()
