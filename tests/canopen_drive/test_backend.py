"""What a drive does wrong, and how a trial ends then; its own log says that it stays off."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from campaign.backends.canopen import BACKEND
from campaign.canopen_drive import objects as od
from campaign.canopen_drive import proof
from campaign.canopen_drive.address import address_of
from campaign.canopen_drive.drive import Drive, DriveError
from campaign.canopen_drive.line import Latch
from campaign.cli.status import show_status
from campaign.cli.stop import stop_bench
from campaign.errors import BackendError, ExitCode, UsageError
from campaign.recording import Ending, Fault, Outcome, SafeState
from tests.canopen_drive.rig import BENCH, LIMITS, backend, channel, execute, trial
from tests.canopen_drive.simulated import OFF, PRESLIDING, SimulatedDrive

Make = Callable[..., tuple[str, SimulatedDrive]]
SLOW_SINE = {"shape": "sine", "amplitude": 0.1, "frequency": 0.5}
LONG: dict[str, Any] = {"command": SLOW_SINE, "duration": 30.0, "window": (0.0, 30.0)}


def stays_off(drive: SimulatedDrive, since: int) -> None:
    """From this entry of its log on it has come to rest, and was not enabled."""
    drive.wait(drive.at_rest_and_off)
    states = [event[1] for event in drive.log[since:] if event[0] == "state"]
    assert "enabled" not in states, drive.log[since:]
    places = [event[2] for event in drive.log[since:] if event[0] == "state" and event[1] in OFF]
    for place in places[:1]:  # off: what bristles give back is all that it moves
        assert abs(drive.angle - place) < 3 * PRESLIDING


def ended(name: str, drive: SimulatedDrive, what: Any, **options: Any) -> Ending:
    """How the trial ends on a drive on which `what` happens at its 30th SYNC."""
    with backend(name, **options) as connected:
        first, _ = execute(connected, trial())  # proves the drive
        assert first.outcome is Outcome.COMPLETED, first
        at = len(drive.log)

        def act(count: int) -> None:
            if count == 30:
                drive.on_sync = lambda count: None
                drive.log.append(("happens",))
                what()

        drive.on_sync = act
        ending, _ = execute(connected, trial(2, **LONG))
        assert ("happens",) in drive.log[at:], ending
        at = drive.log.index(("happens",), at)
        stays_off(drive, at)
        return ending


# What happens in a trial


@pytest.mark.parametrize(
    ("code", "fault"),
    [(0x2310, Fault.DRIVE), (0x4210, Fault.OVER_TEMPERATURE), (0x7305, Fault.SENSOR)],
)
def test_an_emergency_message_ends_the_trial_as_the_fault_that_it_names(
    code: int, fault: Fault, drives: Make
) -> None:
    name, drive = drives()
    ending = ended(name, drive, lambda: drive.fail(code), late=3.0)
    assert (ending.outcome, ending.fault) == (Outcome.FAULT, fault)
    assert f"{code:04X}h" in ending.reason
    assert ending.safe_state is SafeState.CONFIRMED


def test_an_emergency_message_of_a_drive_that_goes_on_ends_the_trial(drives: Make) -> None:
    name, drive = drives()
    ending = ended(name, drive, lambda: drive.node.emcy.send(0x3210, 1, b""))
    assert (ending.outcome, ending.fault) == (Outcome.FAULT, Fault.DRIVE)
    assert "3210h" in ending.reason


def test_a_drive_that_leaves_its_state_without_a_word_ends_the_trial(drives: Make) -> None:
    name, drive = drives()
    ending = ended(name, drive, lambda: drive.become("switched on"))
    assert (ending.outcome, ending.fault) == (Outcome.FAULT, Fault.DRIVE)


def test_a_lost_answer_to_sync_is_marked_and_ends_the_trial(drives: Make) -> None:
    name, drive = drives()

    def lose() -> None:
        drive.quirks["frames"] = lambda syncs: 0

    ending = ended(name, drive, lose, late=3.0)
    assert (ending.outcome, ending.fault) == (Outcome.FAULT, Fault.LOST_SAMPLES)
    assert ending.safe_state is SafeState.CONFIRMED


def test_a_doubled_answer_is_no_sample(drives: Make) -> None:
    name, drive = drives()

    def double() -> None:
        drive.quirks["frames"] = lambda syncs: 2

    ending = ended(name, drive, double)
    assert (ending.outcome, ending.fault) == (Outcome.FAULT, Fault.LOST_SAMPLES)


def test_a_drive_that_starts_anew_ends_the_trial(drives: Make) -> None:
    name, drive = drives()

    def reboot() -> None:
        drive.operational = False
        drive.become("switch on disabled")
        drive.network.send_message(0x700 + 5, b"\0")

    ending = ended(name, drive, reboot, late=3.0)
    assert (ending.outcome, ending.fault) == (Outcome.FAULT, Fault.RESET)


def test_a_drive_that_started_anew_between_trials_is_set_and_proved_again(drives: Make) -> None:
    name, drive = drives()
    with backend(name) as connected:
        assert execute(connected, trial())[0].outcome is Outcome.COMPLETED
        drive.operational = False
        for index, sub in ((0x1016, 1), (0x6007, 0), (0x1A00, 0), (0x1600, 0)):
            drive.put(index, 0, sub)
        since = len(drive.log)
        assert execute(connected, trial())[0].outcome is Outcome.COMPLETED
        assert drive.get(0x1016, 1) == 127 << 16 | 5000
        assert drive.get(0x6007) == 3
        assert "fault" in [event[1] for event in drive.log[since:]], "its silence was not tried"


def test_an_internal_limit_ends_the_trial(drives: Make) -> None:
    name, drive = drives()
    ending = ended(name, drive, lambda: drive.quirks.update({"limit bit": True}))
    assert ending.outcome is Outcome.LIMIT


def test_a_runaway_ends_at_the_limit_of_position(drives: Make) -> None:
    name, drive = drives()

    def jump() -> None:
        drive.angle += 1.2

    ending = ended(name, drive, jump)
    assert ending.outcome is Outcome.LIMIT
    assert "position" in ending.reason


def test_a_drive_that_obeys_no_quick_stop_is_not_called_safe(drives: Make) -> None:
    name, drive = drives(**{"ignores quick stop": True})
    bus = Drive(address_of(f"can://virtual/{name}?node=5"))
    for word in (6, 7, 15):
        drive.control(word)
    assert not bus.bring_to_rest(0.5)
    bus.close()


# Before a motion


@pytest.mark.parametrize("lacks", [0x1016, 0x1029, 0x6007, 0x605A, 0x605E])
def test_a_drive_without_a_reaction_is_refused_by_its_name(lacks: int, drives: Make) -> None:
    name, drive = drives(lacking=(lacks,))
    with pytest.raises(BackendError, match=f"{lacks:04X}h"), backend(name):
        pass
    assert "enabled" not in [event[1] for event in drive.log]


def test_a_reaction_that_cannot_be_set_is_refused(drives: Make) -> None:
    name, _ = drives(stiff=(0x6007,))
    with pytest.raises(BackendError, match="6007h"), backend(name):
        pass


def test_a_reaction_that_is_not_kept_is_refused(drives: Make) -> None:
    name, _ = drives(stubborn=(0x605A,))
    with pytest.raises(BackendError, match="605Ah"), backend(name):
        pass


def refused(name: str, drive: SimulatedDrive, what: str, **task: Any) -> None:
    with backend(name) as connected:
        ending, _ = execute(connected, trial(**task))
    assert (ending.outcome, ending.fault) == (Outcome.FAULT, Fault.REFUSED)
    assert what in ending.reason
    assert ending.safe_state is SafeState.CONFIRMED
    stays_off(drive, len(drive.log))


@pytest.mark.parametrize(
    ("lacking", "told"),
    [((0x6085,), "6085h"), ((0x6072, 0x60E0), "6072h"), ((0x607F, 0x6080), "607Fh")],
)
def test_a_drive_without_a_limit_does_not_move(
    lacking: tuple[int, ...], told: str, drives: Make
) -> None:
    name, drive = drives(lacking=lacking)
    refused(name, drive, told)
    assert "enabled" not in [event[1] for event in drive.log]


@pytest.mark.parametrize("quirk", [{"scale": 2}, {"scale": -1}, {"sign": -1}])
def test_a_slow_move_shows_a_wrong_scale_or_sign(quirk: dict[str, int], drives: Make) -> None:
    name, drive = drives(**quirk)
    refused(name, drive, "scale or sign")


@pytest.mark.parametrize("angle", [0.3, -0.3])
def test_a_trial_begins_at_its_start_angle(angle: float, drives: Make) -> None:
    name, _ = drives()
    with backend(name) as connected:
        ending, samples = execute(connected, trial(start_angle=angle))
    assert ending.outcome is Outcome.COMPLETED, ending.reason
    assert samples["relative_angle"][0] == pytest.approx(angle, abs=0.03)


def test_a_start_angle_that_is_far_away_is_refused_before_its_samples_are_late(
    drives: Make,
) -> None:
    """20 rad at 0.5 rad/s."""
    name, drive = drives()
    bench = {**BENCH, "limits": {**LIMITS, "angle": 30.0}}
    refused(name, drive, "turn the load nearer", bench=bench, start_angle=20.0)


def test_another_gear_of_the_bench_is_another_scale_to_confirm(drives: Make) -> None:
    name, drive = drives()
    with backend(name) as connected:
        assert execute(connected, trial())[0].outcome is Outcome.COMPLETED
        drive.quirks["sign"] = -1
        geared = {**BENCH, "gear": {"ratio": 2.0}}
        ending, _ = execute(connected, trial(bench=geared))
    assert "scale or sign" in ending.reason


@pytest.mark.slow
def test_a_drive_that_goes_on_without_a_heartbeat_is_refused(
    drives: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(proof, "REACTION", 0.0)
    name, drive = drives(**{"no reaction": True})
    refused(name, drive, "heartbeat fell silent")


TORQUE: dict[str, Any] = {
    "mode": "torque", "duration": 2.0, "window": (0.0, 2.0),
    "command": {"shape": "polyline", "times": [0.0, 2.0], "values": [0.0, 1.8]},
}  # fmt: skip


def test_torque_needs_a_limit_of_speed_that_acts(drives: Make) -> None:
    name, drive = drives(**{"no speed limit": True})
    refused(name, drive, "no limit of speed was seen to act", **TORQUE)
    fastest = 2 * LIMITS["rate"]
    assert drive.peak_rate < fastest


def test_a_torque_that_moves_nothing_shows_no_limit_of_speed(drives: Make) -> None:
    name, drive = drives(static=2.0, coulomb=1.9)
    refused(name, drive, "no limit of speed was seen to act", **TORQUE)


def test_limits_of_the_bench_are_in_the_drive_during_a_trial_and_its_own_after(
    drives: Make,
) -> None:
    name, drive = drives()
    drive.put(0x60E0, 2000)
    with backend(name) as connected:
        execute(connected, trial())
        found = {index: drive.get(index) for index in (0x6072, 0x60E0, 0x607F, 0x6080)}
        soft = drive.get(0x607D, 1), drive.get(0x607D, 2)
    assert found[0x6072] == 3000  # 6 N m of 2, in per mille
    assert found[0x60E0] == 2000, "its own is narrower"
    assert found[0x607F] == pytest.approx(60e3 / (2 * np.pi), abs=1)  # 1 rad/s in 1e-3/min
    assert found[0x6080] == 9  # 1/min, rounded down
    assert soft == pytest.approx((-(2**20) / (2 * np.pi), 2**20 / (2 * np.pi)), abs=1)
    assert (drive.get(0x6072), drive.get(0x60E0), drive.get(0x6080)) == (5000, 2000, 3000)


def test_a_drive_in_fault_is_not_moved_and_its_fault_is_told(drives: Make) -> None:
    name, drive = drives()
    drive.fail(0x2310)
    with backend(name) as connected:
        ending, _ = execute(connected, trial())
    assert (ending.outcome, ending.fault) == (Outcome.FAULT, Fault.DRIVE)
    assert "2310h" in ending.reason
    assert drive.state == "fault", "nobody has asked to clear it"
    with backend(name, clear_fault=True) as connected:
        ending, _ = execute(connected, trial())
    assert ending.outcome is Outcome.COMPLETED


def test_a_drive_that_another_program_moves_is_left_alone(drives: Make) -> None:
    name, drive = drives()
    for word in (6, 7, 15):
        drive.control(word)
    with pytest.raises(BackendError, match="another program moves it"), backend(name):
        pass
    assert drive.state == "enabled"


EDS = """[DeviceInfo]
VendorNumber=0x{vendor:X}
ProductNumber=0x402
[MandatoryObjects]
SupportedObjects=1
1=0x6064
[6064]
ParameterName=Position actual value
ObjectType=0x7
DataType=0x{kind:04X}
AccessType=ro
PDOMapping=1
"""


@pytest.mark.parametrize(
    ("vendor", "kind", "told"), [(0x2A, 4, ""), (0x2B, 4, "wrong EDS"), (0x2A, 3, "6064h")]
)
def test_an_eds_of_another_drive_is_refused(
    vendor: int, kind: int, told: str, drives: Make, tmp_path: Path
) -> None:
    name, _ = drives()
    path = tmp_path / "drive.eds"
    path.write_text(EDS.format(vendor=vendor, kind=kind))
    if told:
        with pytest.raises(BackendError, match=told), backend(name, eds=str(path)):
            pass
    else:
        with backend(name, eds=str(path)):
            pass


def test_no_drive_is_said_as_what_it_is() -> None:
    with pytest.raises(BackendError, match="no drive answers"), backend(channel()):
        pass


@pytest.mark.parametrize(
    ("port", "told"),
    [
        ("", "needs a drive"),
        ("can0", "can://"),
        ("can://socketcan/can0", "node=N"),
        ("can://socketcan/can0?node=200", "1 to 127"),
        ("can://no-such-interface/x?node=1", "cannot be opened"),
    ],
)
def test_a_port_that_is_none_is_said_with_its_form(port: str, told: str) -> None:
    with pytest.raises(UsageError, match=told), backend("", port=port):
        pass


def test_missing_packages_are_said_once_with_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "can", None)
    with pytest.raises(UsageError, match=r"pip install 'campaign\[canopen\]'"), backend("x"):
        pass


def test_the_controlword_is_not_an_object_to_write(drives: Make) -> None:
    name, drive = drives()
    with backend(name) as connected, pytest.raises(DriveError, match="relay alone"):
        connected._client.write(od.CONTROLWORD, 0x0F)
    assert ("word", 0x0F) not in drive.log


# What it refuses in a plan


@pytest.mark.parametrize(
    ("task", "field"),
    [
        ({"mode": "spring"}, "task.mode"),
        ({"disturbance": SLOW_SINE}, "task.disturbance"),
        ({"base_acceleration": SLOW_SINE}, "task.base_acceleration"),
        ({"compensation": "lugre"}, "task.compensation"),
        ({"sample_rate": 2000.0}, "task.sample_rate"),
        ({"sample_rate": 30.0}, "task.sample_rate"),
    ],
)
def test_a_plan_beyond_drive_or_bus_is_refused_before_a_connection(
    task: dict[str, Any], field: str
) -> None:
    told = backend(channel()).refuses(trial(**task))
    assert told is not None
    assert told.startswith(field)


def test_a_slow_bus_carries_less() -> None:
    slow = backend("x", port="can://virtual/x?node=5&bitrate=125000")
    assert "sample_rate" in str(slow.refuses(trial(sample_rate=200.0)))
    assert slow.refuses(trial(sample_rate=100.0)) is None


def test_more_than_the_promised_rate_needs_a_small_jitter(drives: Make) -> None:
    name, _ = drives()
    fast = trial(sample_rate=500.0)
    assert backend(name).refuses(fast) is None
    with backend(name) as patient:
        assert patient.refuses(fast) is None
    with backend(name, late=1e-9) as strict:
        assert "late" in str(strict.refuses(fast))
        assert strict.refuses(trial()) is None


def test_a_linear_axis_is_refused() -> None:
    linear = {**BENCH, "axis": {"name": "desk", "kind": "linear"}}
    assert "bench.axis.kind" in str(backend("x").refuses(trial(bench=linear)))


# The latch


def test_a_stop_outlives_every_process_of_the_program(drives: Make) -> None:
    name, drive = drives()
    port = f"can://virtual/{name}?node=5"
    assert stop_bench(port, 9600, 60.0) is ExitCode.DONE  # nobody serves it
    with backend(name) as connected:
        stop = connected.panic_stop()
        assert stop is not None
        ending, _ = execute(connected, trial())
        assert ending.outcome is Outcome.INTERRUPTED
        assert "enabled" not in [event[1] for event in drive.log]
        connected.clear_stop(stop.count)
        assert execute(connected, trial())[0].outcome is Outcome.COMPLETED


def test_the_relay_refuses_what_the_host_has_not_heard_of(drives: Make) -> None:
    """A stop that comes between the host's question and its trial."""
    name, drive = drives()
    with backend(name) as connected:
        assert execute(connected, trial())[0].outcome is Outcome.COMPLETED
        since = len(drive.log)
        assert stop_bench(f"can://virtual/{name}?node=5", 9600, 60.0) is ExitCode.DONE
        connected.panic_stop = lambda: None  # type: ignore[method-assign]
        ending, recording = execute(connected, trial())
        assert ending.outcome is Outcome.INTERRUPTED
        assert not len(recording.time)
        assert "enabled" not in [event[1] for event in drive.log[since:]]


def test_status_tells_who_runs_and_who_stopped(
    drives: Make, capsys: pytest.CaptureFixture[str]
) -> None:
    name, _ = drives()
    port = f"can://virtual/{name}?node=5"
    running = backend(name)
    running.introduce("first")
    with running:
        assert show_status(port, 9600, 60.0, as_json=False) is ExitCode.DONE
        assert "run first" in capsys.readouterr().out
        stop_bench(port, 9600, 60.0)
    show_status(port, 9600, 60.0, as_json=False)
    out = capsys.readouterr().out
    assert "stopped by" in out
    assert "held:   no" in out


def test_a_latch_that_cannot_be_read_holds(tmp_path: Path) -> None:
    latch = Latch(tmp_path / "latch.json")
    assert latch.now() is None
    (tmp_path / "latch.json").write_text("{ not json")
    assert latch.now() is not None
    latch.stop("ada")
    latch.write()
    found = Latch(tmp_path / "latch.json").now()
    assert found is not None
    assert found[1] == "ada"


def test_a_second_program_is_refused_the_drive(drives: Make) -> None:
    name, _ = drives()
    address = address_of(f"can://virtual/{name}?node=5")
    assert address.served_at() is None
    with backend(name):
        assert address.served_at() is not None
    assert address.served_at() is None


def test_it_is_known_as_a_live_backend_that_can_be_stopped() -> None:
    assert (BACKEND.name, BACKEND.live, BACKEND.stopped_outside) == ("canopen", True, True)
