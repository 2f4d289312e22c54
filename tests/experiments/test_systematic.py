"""What no repetition shows: of a size that the bench states, or of none."""

from __future__ import annotations

import pytest

from campaign.estimate import Estimate
from campaign.experiments.shared.systematic import (
    INERTIA,
    TORQUE_CONSTANT,
    known_uncertainty,
    with_systematic,
)
from tests.experiments.laboratory import Tree
from tests.physics.benches import bench

TOLD = Estimate("torque", 20.0, "N m", 19.0, 21.0, 0.95)


def stated(tree: Tree) -> None:
    """A torque constant that is known to 5 %; nothing of the inertia."""
    sigma = "0.0043 N m/A"
    tree["motor"]["torque_constant"] = "0.086 N m/A"
    tree["known"] = {"values": {TORQUE_CONSTANT: {"standard_uncertainty": sigma}}}


def test_a_stated_constant_widens_what_follows_from_it() -> None:
    rig = bench(stated)
    assert known_uncertainty(rig, TORQUE_CONSTANT) == pytest.approx(0.05)
    (part,) = with_systematic(TOLD, rig, TORQUE_CONSTANT, -TOLD.value).systematic
    assert (part.source, part.standard_uncertainty) == ("torque constant", pytest.approx(1.0))


def test_what_nobody_has_stated_is_no_zero() -> None:
    rig = bench(stated)
    assert known_uncertainty(rig, INERTIA) is None
    told = with_systematic(TOLD, rig, INERTIA, 3.0)
    assert told.systematic[0].standard_uncertainty is None
    assert told.combined == (TOLD.low, TOLD.high)
