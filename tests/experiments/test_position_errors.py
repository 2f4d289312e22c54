"""The position error over time: its cycles, its mean, and its largest, as the table has it."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.recording import Channel, Ending, Outcome, Recording
from tests.experiments.laboratory import Done, analyse, trials
from tests.physics.benches import bench


@pytest.mark.parametrize(("cycles", "shown"), [(1, 1), (2, 2), (3, 2)])
def test_an_error_is_shown_in_whole_cycles_off_the_mean_of_all(cycles: int, shown: int) -> None:
    """One and a half cycles of this error have a mean of 0.21 mrad, and another largest error."""
    options = {"frequency": "0.25 Hz", "cycles": cycles, "settle_cycles": 1}
    trial = trials("stabilization", bench(), options)[0]
    time = np.arange(0.0, trial.task.duration, 0.01)
    error = 1e-3 * np.sin(2 * np.pi * 0.25 * (time - trial.task.window[0]))
    samples = {
        "pointing_error": Channel("pointing_error", "rad", "pointing_error", "rad", error + 5e-3)
    }
    recording = Recording(time, samples, (), Ending(Outcome.COMPLETED))
    result = analyse("stabilization", [Done(trial, recording.ending, recording)])
    (panel,) = next(f for f in result.figures if f.key == "position-error").panels
    (curve,) = panel.curves
    assert np.ptp(curve.x) == pytest.approx(shown / 0.25, abs=0.011)
    assert (curve.x[0], curve.y[0]) == pytest.approx((0.0, 0.0), abs=1e-6)
    (told,) = result.tables[0].rows
    assert panel.title == f"no compensation: {1e3 * told['peak'].value:#.3g} mrad"
