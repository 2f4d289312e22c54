"""Limits that the sensors' resolution alone would exceed.

A sensor that toggles between two counts while its axis stands still must not end a trial. What one
count comes to in the channel that a limit is watched in:

- relative angle, motor current: the resolution q itself; drive torque: that of the current, times
  gear ratio and torque constant;
- relative rate: the controller differences the encoder at its own period Tc and filters the result
  (`relative_rate_filter`, pole p = exp(-Tc / filter), 0 without); every d-th value is recorded. A
  count shows as (1 - p) p^k q / Tc, k periods later; its mean over the n recorded samples in which
  the rate is judged is at most

      q / (n Tc) * (1 - p) (1 - p^(n d)) / (1 - p^d)

  With d = 1 and no filter that is q over the judging time; a filter slower than that makes it q
  over the filter's time constant; recording more seldom than controlling (d > 1) makes it larger,
  because what is left out does not average out.

Only a sampled controller has sensors with a resolution; where there is no motor nothing is sensed.
"""

from __future__ import annotations

import math

from campaign.physics.bench import Bench
from campaign.physics.complete import control_rate, limits_of
from campaign.physics.limit_watch import judged_samples
from campaign.physics.limits import Margin, units_of
from campaign.trial import Task

CLOSE = 0.5
"""Share of a limit from which on one count is worth a word."""


def resolution_margins(bench: Bench, task: Task) -> tuple[Margin, ...]:
    """What one count of the sensors comes to beside the limits watched in motion."""
    rate_of_control = control_rate(bench)
    if rate_of_control is None or task.mode in ("prescribed", "spring"):
        return ()
    sensors, limits = bench.sensors, limits_of(bench)
    current = sensors.current.resolution
    torque = current * (bench.torque_per_current or 0.0)  # of no resolution nothing is told
    encoder = sensors.encoder.resolution
    rate = rate_of_one_count(bench, task.sample_rate, rate_of_control)
    units = units_of(bench)
    found = (
        Margin("angle", encoder, limits.angle, units["rad"], "encoder"),
        Margin("rate", rate, limits.rate, units["rad/s"], "encoder"),
        Margin("torque", torque, limits.torque, units["N m"], "current sensor"),
        Margin("current", current, limits.current, "A", "current sensor"),
    )
    return tuple(margin for margin in found if margin.value > 0 and margin.fraction > 0)


def rate_of_one_count(bench: Bench, sample_rate: float, control_rate: float) -> float:
    """Largest mean of the relative rate (rad/s) that one count of the encoder makes.

    `sample_rate` of the recording and `control_rate` in Hz; the mean is over the judging time.
    """
    low_pass = 0.0 if bench.controller is None else bench.controller.relative_rate_filter
    pole = math.exp(-1.0 / (control_rate * low_pass)) if low_pass > 0 else 0.0
    every = max(1, round(control_rate / sample_rate))
    count = judged_samples(limits_of(bench), sample_rate)
    share = (1 - pole) * (1 - pole ** (count * every)) / (1 - pole**every)
    return bench.sensors.encoder.resolution * control_rate / count * share
