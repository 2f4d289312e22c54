"""Motion of the hull: its rate and angle from the angular acceleration a task prescribes."""

from __future__ import annotations

import numpy as np

from campaign.signals import Array, MultiSine, Polyline, Signal, Sine, Zero


def base_rate(acceleration: Signal, time: Array) -> Array:
    """Rate of the hull (rad/s) at `time` (s), shape (n,).

    A sine acceleration, or a sum of sines, is a steady oscillation: its rate has zero mean, and the
    hull moves at t = 0. Any other acceleration starts from rest.
    """
    match acceleration:
        case Zero():
            return np.zeros_like(time)
        case Sine():
            omega = 2 * np.pi * acceleration.frequency
            return -acceleration.amplitude / omega * np.cos(omega * time + acceleration.phase)
        case MultiSine():
            return acceleration.integral(time, 1)
        case Polyline():
            return _integral(acceleration, time)
    raise TypeError(f"no base motion from {type(acceleration).__name__}")


def _integral(polyline: Polyline, time: Array) -> Array:
    """Exact integral of a polyline from t = 0, shape (n,); it can have steps (equal times)."""
    knots, values = np.array(polyline.times), np.array(polyline.values)
    area = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(knots) * (values[1:] + values[:-1]))])

    def from_first_knot(at: Array) -> Array:
        last = np.maximum(np.searchsorted(knots, at, side="right") - 1, 0)
        passed = at - knots[last]
        return np.asarray(area[last] + 0.5 * passed * (values[last] + polyline.sample(at)))

    return from_first_knot(time) - from_first_knot(np.zeros(1))
