"""The kit's checks on the backend `canopen`, with a simulated drive on a virtual bus."""

from __future__ import annotations

import pytest

from campaign.cli.stop import stop_bench
from campaign.errors import ExitCode
from campaign.testing import BackendUnderTest, backend_checks
from tests.canopen_drive.rig import backend, channel, trial
from tests.canopen_drive.simulated import SimulatedDrive

CHECKS = backend_checks()
IN_TIME = "hands_samples_over_in_time"
SWUNG = trial(base_acceleration={"shape": "sine", "amplitude": 0.1, "frequency": 1.0})
LONG = trial(
    duration=20.0,
    window=(0.0, 20.0),
    command={"shape": "sine", "amplitude": 0.1, "frequency": 0.5},
)


def stop_outside(name: str) -> None:
    assert stop_bench(f"can://virtual/{name}?node=5", 1_000_000, 60.0) is ExitCode.DONE


def check(name: str, speed: float) -> None:
    bus, bad = channel(), channel()
    with SimulatedDrive(bus, speed=speed) as drive, SimulatedDrive(bad, speed=speed) as failing:
        failing.on_sync = lambda count: failing.fail(0x2310) if failing.syncs == 150 else None
        CHECKS[name](
            BackendUnderTest(
                open=lambda: backend(bus, heartbeat=5.0 if speed > 1.0 else 2.0),
                possible=LONG if name == "stops_in_mid_trial" else trial(),
                impossible=SWUNG,
                names="task.base_acceleration",
                failing=lambda: backend(bad),
                live=True,
                stop_outside=lambda: stop_outside(bus),
            )
        )
        drive.wait(drive.at_rest_and_off)


@pytest.mark.parametrize("name", [name for name in CHECKS if name != IN_TIME])
def test_canopen_passes(name: str, fast: float) -> None:
    check(name, fast)


@pytest.mark.slow
def test_canopen_hands_samples_over_in_time() -> None:
    check(IN_TIME, 1.0)
