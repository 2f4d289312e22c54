"""What the figures of a breakaway test say of their bars."""

from __future__ import annotations

import pytest

from campaign.estimate import Systematic
from campaign.estimation.intervals import with_error
from campaign.experiments.breakaway.figures import position_figure
from campaign.experiments.breakaway.means import Ramps
from tests.experiments.laboratory import execute, trials
from tests.experiments.test_breakaway import TWO, platform


@pytest.mark.parametrize("parts", [(), (Systematic("inertia"),), (Systematic("inertia", 2.0),)])
def test_a_caption_says_where_its_bars_are_others_than_the_intervals_of_the_table(
    parts: tuple[Systematic, ...],
) -> None:
    own = with_error("bristle_stiffness", 100.0, "N m/rad", 1.0, 200.0, "", systematic=parts)
    found = {"breakaway_torque": own, "bristle_stiffness": own}
    place = {"position": 0.0, "direction": "positive"}
    (item,) = execute(trials("breakaway", platform(), {**TWO, "positions": ["0 deg"]}))
    figure = position_figure(Ramps((item,), (place,), (found,)), {"mean": found})
    (bars,) = (curve for curve in figure.panels[1].curves if curve.series == "positive")
    assert bars.low is not None
    assert bars.high is not None
    same = (bars.low[0], bars.high[0]) == own.combined
    assert same == ("The bar of the mean" not in figure.caption)
    assert same == (parts != (Systematic("inertia", 2.0),))
