"""Defects of torque, force or current: clipping, sign, delay, copies.

The torque accelerates a mass and overcomes friction: a sum of terms of the rate. They explain the
torque at the right delay; at others only as far as the motion is correlated with itself.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from campaign.importing.defects.defect import (
    LONGEST,
    NO_FILTER,
    Array,
    Defect,
    correlation,
    is_sure,
    nearest_low,
    rows_in_words,
    runs,
    step_size,
)

SAME = 0.999
"""Least share of a channel's variance that another explains if both are one signal."""
BLOCK = 0.005
"""Least averaging time (s): the acceleration of single samples is mostly noise."""
MOST = 400_000
"""Maximum number of averaging blocks; a longer recording has longer blocks."""
EXPLAINED = 0.95
"""Least share of the torque that the motion explains at a valid delay."""
CONSTANT = 1e-9
"""Standard deviation of a term, relative to its size, below which it is constant."""
RISE = 0.05
"""Width of the friction reversal, relative to the largest rate."""


def of_drive(name: str, values: Array) -> Iterator[Defect]:
    """Clipping of a torque, a force or a current: runs of samples at the extreme."""
    known = values[np.isfinite(values)]
    if len(known) < 100 or np.ptp(known) == 0:
        return
    peak = float(np.abs(known).max())
    for extreme in (float(known.max()), float(known.min())):
        at = values == extreme
        if abs(extreme) < 0.5 * peak or at.mean() < 0.005:
            continue
        long = [(first, last) for first, last in runs(at) if last - first >= 4]
        if _repeats(values):
            long = [each for each in long if _cut(values, each)]
        rows = sum(last - first + 1 for first, last in long)
        if rows < 0.005 * len(values):
            continue
        what = (
            f"{name} stands at its extreme {extreme:.6g} for {100 * rows / len(values):.3g} % of "
            f"the samples, first in {rows_in_words(*long[0])}"
        )
        ends = (long[0][0], long[-1][1])
        yield Defect("clipping", (name,), what, ends, extreme)


def _repeats(values: Array) -> bool:
    """Whether samples away from the extremes often repeat the value before.

    Noise seldom does; a plateau in a channel without repeats is thus clipping.
    """
    same = np.diff(values) == 0
    at = (values == np.nanmax(values)) | (values == np.nanmin(values))
    elsewhere = ~at[1:] & ~at[:-1]
    return bool(same[elsewhere].sum() > 0.02 * elsewhere.sum())


def _cut(values: Array, stretch: tuple[int, int]) -> bool:
    """Whether a channel enters and leaves a plateau with full slope instead of settling at it."""
    first, last = stretch
    before, after = values[max(0, first - 4) : first + 1], values[last : last + 5]
    if len(before) < 4 or len(after) < 4:
        return False
    # Settling halves the distance every few samples; a clipped signal has its full slope.
    entering, leaving = np.abs(np.diff(before)), np.abs(np.diff(after))
    return bool(
        entering[-1] > 0.25 * entering.max() > 0
        and leaving[0] > 0.25 * leaving.max() > 0
        and np.all(np.diff(before) * np.sign(values[first]) > 0)
        and np.all(np.diff(after) * np.sign(values[first]) < 0)
    )


def of_drive_sign(
    time: Array, angle: Array | None, rate: Array, torque: Array, names: tuple[str, str]
) -> Iterator[Defect]:
    """Sign defect of a drive that removes energy from the motion; a negative mass proves it.

    Braking alone proves nothing: if most of the torque is inertial, a late rate makes stored
    energy look lost. The sign of the mass is independent of the delay of the rate.

    Args:
        angle: shape (n,); if it does not return, gravity may have driven.
        names: of torque and rate.
    """
    known = np.isfinite(rate) & np.isfinite(torque)
    if known.sum() < 100 or (angle is not None and _hardly_moves(angle)):
        return
    power = torque[known] * rate[known]
    whole = float(np.abs(power).sum())
    # Random power averages to 1 / sqrt(number of samples) of its size.
    if whole <= 0 or float(power.sum()) > -0.2 * whole:
        return
    mass = _mass_sign(time, rate, torque)
    if mass > 0:
        return
    back = _turns(rate[known]) and angle is not None and _comes_back(angle[known])
    torque_name, rate_name = names
    share = float(power.sum()) / whole
    what = (
        f"{torque_name} brakes the motion of {rate_name} ({100 * share:.0f} % of the exchanged "
        "power): its sign, or that of the rate, is swapped"
    )
    proven = back and mass < 0
    if not proven:
        what += "; or something else drove, such as gravity or the hull"
    yield Defect("sign", names, what, (0, len(time) - 1), share, noted=not proven)


def _mass_sign(time: Array, rate: Array, torque: Array) -> int:
    """Sign of the estimated mass; 0 if the estimate is not significant.

    Impulse = mass * change of rate + friction, over stretches of some samples.
    """
    wide = max(4, min(32, len(time) // 100))
    known = np.isfinite(rate) & np.isfinite(torque)
    steps = np.diff(time)
    impulse, moved, rubbed = (
        np.concatenate([[0.0], np.cumsum(0.5 * (each[1:] + each[:-1]) * steps)])
        for each in (np.where(known, x, 0.0) for x in (torque, rate, np.sign(rate)))
    )
    places = np.arange(0, len(time) - wide, wide)
    places = places[known[places] & known[places + wide]]
    if len(places) < 12:
        return 0
    impulses = impulse[places + wide] - impulse[places]
    terms = np.column_stack(
        [each[places + wide] - each[places] for each in (rate, moved, rubbed, time)]
    )
    scale = np.abs(terms).max(axis=0)
    if scale[0] == 0:
        return 0
    terms /= np.where(scale > 0, scale, 1.0)
    solution, *_ = np.linalg.lstsq(terms, impulses, rcond=1e-9)
    left = impulses - terms @ solution
    inverse = np.linalg.pinv(terms.T @ terms)[0, 0]
    error = math.sqrt(max(float(left @ left) / len(impulses) * float(inverse), 0.0))
    return int(np.sign(solution[0])) if abs(solution[0]) > 6 * error else 0


def _hardly_moves(angle: Array) -> bool:
    """Whether the angle moves by less than 20 of its steps: its derivative is quantization."""
    known = angle[np.isfinite(angle)]
    return not len(known) or float(np.ptp(known)) < 20 * step_size(angle)


def _turns(rate: Array) -> bool:
    """Whether it moves in both directions, each for over a tenth of the time in motion."""
    moving = np.abs(rate) > 0.1 * float(np.abs(rate).max())
    ahead = float((rate[moving] > 0).mean()) if moving.any() else 0.0
    return 0.1 < ahead < 0.9


def _comes_back(angle: Array) -> bool:
    known = angle[np.isfinite(angle)]
    return len(known) > 1 and abs(float(known[-1] - known[0])) < 0.2 * float(np.ptp(known))


def of_twins(names: tuple[str, str], one: Array, two: Array) -> Iterator[Defect]:
    """Defect of two channels, shapes (n,), that are one signal: two = factor one + offset."""
    known = np.isfinite(one) & np.isfinite(two)
    if known.sum() < 20 or np.ptp(one[known]) == 0 or np.ptp(two[known]) == 0:
        return
    likeness = float(np.corrcoef(one[known], two[known])[0, 1])
    if not math.isfinite(likeness) or likeness**2 < SAME:
        return
    factor, offset = (float(x) for x in np.polyfit(one[known], two[known], 1))
    what = (
        f"{names[1]} is {factor:.5g} times {names[0]} {'+' if offset >= 0 else '-'} "
        f"{abs(offset):.3g} (R² {likeness**2:.5f}): one signal, not two measurements"
    )
    yield Defect("twice", names, what, (0, len(one) - 1), factor, noted=True)


def of_drive_delay(
    time: Array, rate: Array, torque: Array, names: tuple[str, str]
) -> Iterator[Defect]:
    """Delay (s) of a torque after its motion, if it is longer than a filter's.

    Args:
        time, rate, torque: shape (n,), the times even.
        names: of torque and rate.
    """
    n = len(time)
    if n < 100 or not np.isfinite(rate + torque).all():
        return
    step = float(time[-1] - time[0]) / (n - 1)
    if step <= 0:
        return
    size = max(1, round(BLOCK / step), math.ceil(n / MOST))
    count = n // size
    most = min(count // 5, math.ceil(LONGEST / (size * step)))
    if most < 3:
        return
    v, tau = (each[: count * size].reshape(count, size).mean(axis=1) for each in (rate, torque))
    explained, left = _explained(v, tau, most)
    now = float(left[most])
    peak = nearest_low(np.where(explained < EXPLAINED, 1.0, left), most, 0.0)
    if explained[peak] < EXPLAINED or not 0 < peak < 2 * most:
        return
    lag = (peak - most) * size * step
    if abs(lag) < NO_FILTER or not is_sure(left[peak], now):
        return
    one, two = names
    where = "after" if lag > 0 else "before"
    what = (
        f"{one} comes {abs(lag):.3g} s {where} the motion of {two}, which explains "
        f"{100 * explained[peak]:.3g} % of it then, and {100 * explained[most]:.3g} % as it is"
    )
    yield Defect("delay", names, what, (0, n - 1), lag)


def _explained(rate: Array, torque: Array, most: int) -> tuple[Array, Array]:
    """Share of a torque that a motion explains, by delay from -most to most blocks: (2 most + 1,).

    The terms are acceleration, rate, its sign, and a constant. 0 if the torque hardly changes. Also
    the rest, as a share of the variance of the whole torque: near 0 for a steady part.
    """
    width = len(rate) - 2 * most
    rise = RISE * float(np.abs(rate).max()) or 1.0
    parts = np.stack([rate, np.gradient(rate), np.tanh(rate / rise)])
    parts = parts[:, most : most + width]
    reach = np.abs(parts).max(axis=1)
    parts = parts - parts.mean(axis=1, keepdims=True)
    scale = np.sqrt(np.mean(parts**2, axis=1))
    # A term that is constant except for its last digits, as the sign in one direction, is ignored.
    varies = scale > CONSTANT * reach
    parts = parts * (varies / np.where(varies, scale, 1.0))[:, None]
    products = np.stack([correlation(torque, part) for part in parts])
    whole = parts @ parts.T
    centered = torque - torque.mean()
    sums, squares = (np.concatenate([[0.0], np.cumsum(each)]) for each in (centered, centered**2))
    gone = sums[width:] - sums[:-width]
    variance = squares[width:] - squares[:-width] - gone**2 / width
    fitted = np.einsum("jk,jk->k", products, np.linalg.pinv(whole, rcond=1e-9) @ products)
    whole_torque = max(float(squares[-1]) * width / len(torque), 1e-300)
    telling = variance > 0.5 * whole_torque
    share: Array = np.where(telling, fitted / np.maximum(variance, 0.5 * whole_torque), 0.0)
    left: Array = np.maximum(variance - fitted, 0.0) / np.maximum(variance, whole_torque)
    return np.minimum(share, 1.0), left
