"""Limits that the sensors' resolution alone would exceed.

A sensor that toggles between two counts at rest must not end a trial. One count changes the
channel of a limit by this amount:

- relative angle, motor current: the resolution q itself; drive torque: that of the current, times
  gear ratio and torque constant;
- relative rate: the controller differentiates the encoder at its period Tc and filters the result
  (`relative_rate_filter`, pole p = exp(-Tc / filter), 0 without); every d-th value is recorded. A
  count causes (1 - p) p^k q / Tc, k periods later. Its mean over the n recorded samples of the
  rate check is at most

      q / (n Tc) * (1 - p) (1 - p^(n d)) / (1 - p^d)

  With d = 1 and no filter this is q over the averaging time; with a slower filter it is q over the
  filter's time constant. A recording slower than the controller (d > 1) makes it larger, because
  the omitted values do not average out.

Only a sampled controller has sensors with a resolution; without a motor there is no sensor.
"""

from __future__ import annotations

import math

from campaign.physics.bench import Bench
from campaign.physics.complete import control_rate, limits_of
from campaign.physics.limit_watch import judged_samples
from campaign.physics.limits import Margin, units_of
from campaign.trial import Task

CLOSE = 0.5
"""Share of a limit from which one count is reported."""


def resolution_margins(bench: Bench, task: Task) -> tuple[Margin, ...]:
    """One count of each sensor beside the limits that are monitored during motion."""
    rate_of_control = control_rate(bench)
    if rate_of_control is None or task.mode in ("prescribed", "spring"):
        return ()
    sensors, limits = bench.sensors, limits_of(bench)
    current = sensors.current.resolution
    torque = current * (bench.torque_per_current or 0.0)  # 0 is not reported
    encoder = sensors.encoder.resolution
    rate = rate_of_one_count(bench, task.sample_rate, rate_of_control)
    units = units_of(bench)
    counts = (
        Margin("angle", encoder, limits.angle, units["rad"], "encoder"),
        Margin("rate", rate, limits.rate, units["rad/s"], "encoder"),
        Margin("torque", torque, limits.torque, units["N m"], "current sensor"),
        Margin("current", current, limits.current, "A", "current sensor"),
    )
    return tuple(margin for margin in counts if margin.value > 0 and margin.fraction > 0)


def rate_of_one_count(bench: Bench, sample_rate: float, control_rate: float) -> float:
    """Largest mean of the relative rate (rad/s) that one count of the encoder causes.

    `sample_rate` of the recording and `control_rate` in Hz; the mean is that of the rate check.
    """
    low_pass = 0.0 if bench.controller is None else bench.controller.relative_rate_filter
    pole = math.exp(-1.0 / (control_rate * low_pass)) if low_pass > 0 else 0.0
    every = max(1, round(control_rate / sample_rate))
    count = judged_samples(limits_of(bench), sample_rate)
    share = (1 - pole) * (1 - pole ** (count * every)) / (1 - pole**every)
    return bench.sensors.encoder.resolution * control_rate / count * share
