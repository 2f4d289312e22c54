"""What one controller is set to: the hull's motion where it can emulate that, no more than fits."""

from __future__ import annotations

import pytest

from campaign.link.errors import RefusedError
from campaign.link.settings import settings_of
from campaign.wire.configuration import REHEARSAL, configuration_of
from campaign.wire.device import Capabilities, State
from tests.wire.test_configuration import trial


def controller(*features: str, longest: int = 4096) -> Capabilities:
    return Capabilities(
        1, 1, 1, 1, 1, State.IDLE, 0.1, 16, longest, 1e5, name="one", features=features
    )


def test_a_rehearsal_controller_is_told_the_motion_of_the_hull() -> None:
    found = settings_of(trial(), controller(REHEARSAL), emulated=True)
    assert found == configuration_of(trial())
    assert any(name.startswith(f"{REHEARSAL}.") for name in found)


@pytest.mark.parametrize("capabilities", [None, controller("rate")])
def test_no_other_controller_is(capabilities: Capabilities | None) -> None:
    found = settings_of(trial(), capabilities, emulated=False)
    left_out = configuration_of(trial()).keys() - found.keys()
    assert left_out
    assert all(name.startswith(f"{REHEARSAL}.") for name in left_out)
    with pytest.raises(RefusedError, match="only a rehearsal controller"):
        settings_of(trial(), capabilities, emulated=True)


def test_no_array_is_longer_than_the_controller_takes() -> None:
    settings_of(trial(), controller(longest=2), emulated=False)
    with pytest.raises(RefusedError, match=r"has 2 values, and the controller takes 1 at most"):
        settings_of(trial(), controller(longest=1), emulated=False)
