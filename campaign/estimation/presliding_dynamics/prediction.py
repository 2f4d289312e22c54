"""Share of an unseen motion that a fitted plant predicts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from campaign.estimation.presliding_dynamics.channel import Channel
from campaign.estimation.presliding_dynamics.fit_result import Grid, JointFit
from campaign.estimation.presliding_dynamics.record import Record, measured


def unexplained(fit: JointFit, record: Record) -> float:
    """Rms of what the fitted plant misses of another record, over that of the record's own motion.

    Of its first channel, offset and drift taken out of both. Nothing is fitted but those.
    """
    grid = Grid.of(record, fit.plant)
    channels = tuple(
        Channel.of(name, samples, there, 1.0, np.ones(1))
        for name, samples, there in measured(record)
    )
    own = 1 if record.at_rest else 3
    shared = fit.vector[: len(fit.parameters.names)]
    other = replace(
        fit,
        records=(record,),
        parameters=replace(fit.parameters, factors=0, own=(own,)),
        vector=np.append(shared, np.zeros(own)),
        channels=(channels,),
        grids=(grid,),
        taken=np.zeros(0),
        doubt_answers=(np.zeros((len(channels), len(record.torque), 0)),),
    )
    first, answer = channels[0], other.answers(0)[0]
    missed = first.left(first.samples - answer)
    return float(np.linalg.norm(missed) / np.linalg.norm(first.left(first.samples)))
