"""Defects of torque, force or current: clipping, sign, delay, copies.

It is what accelerates a mass and overcomes friction: a sum of parts that follow from the rate. At
the right delay they explain it, and at another only as far as a motion is like itself.
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
"""Share of a channel's variance that another explains when both are one signal."""
BLOCK = 0.005
"""s over which samples are averaged at least: an acceleration of single ones is their noise."""
MOST = 400_000
"""blocks of a recording that are looked at; of a longer one they are longer."""
EXPLAINED = 0.95
"""Share of the torque that the motion explains at a delay that is believed."""
CONSTANT = 1e-9
"""of its size, below which a part does not change."""
RISE = 0.05
"""of the largest rate, over which friction turns round."""


def of_drive(name: str, values: Array) -> Iterator[Defect]:
    """Where a torque, a force or a current is clipped: it stands at its extreme."""
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
    """Whether samples beside the extremes have the value of their neighbour, too.

    Noise hardly ever does: then a plateau is one by its being there.
    """
    same = np.diff(values) == 0
    at = (values == np.nanmax(values)) | (values == np.nanmin(values))
    elsewhere = ~at[1:] & ~at[:-1]
    return bool(same[elsewhere].sum() > 0.02 * elsewhere.sum())


def _cut(values: Array, stretch: tuple[int, int]) -> bool:
    """Whether a channel runs into a plateau instead of settling at it, and leaves it likewise."""
    first, last = stretch
    before, after = values[max(0, first - 4) : first + 1], values[last : last + 5]
    if len(before) < 4 or len(after) < 4:
        return False
    # Settling halves what is left with every few samples; what is cut comes with its full slope.
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
    """A drive that takes energy out of a motion, and a mass that accelerates against it.

    Braking alone proves nothing: where most of the torque is the inertia's, a late rate turns what
    is stored into what seems to be lost. A mass has its sign, however late the rate is.

    Args:
        angle: shape (n,); where it does not come back, gravity may have driven.
        names: of torque and rate.
    """
    known = np.isfinite(rate) & np.isfinite(torque)
    if known.sum() < 100 or (angle is not None and _hardly_moves(angle)):
        return
    power = torque[known] * rate[known]
    whole = float(np.abs(power).sum())
    # Power that only scatters cancels down to one over the root of how many samples it has.
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
    """The sign of the mass that torque and rate tell of; 0 where they tell of none.

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
    told = impulse[places + wide] - impulse[places]
    terms = np.column_stack(
        [each[places + wide] - each[places] for each in (rate, moved, rubbed, time)]
    )
    scale = np.abs(terms).max(axis=0)
    if scale[0] == 0:
        return 0
    terms /= np.where(scale > 0, scale, 1.0)
    found, *_ = np.linalg.lstsq(terms, told, rcond=1e-9)
    left = told - terms @ found
    inverse = np.linalg.pinv(terms.T @ terms)[0, 0]
    error = math.sqrt(max(float(left @ left) / len(told) * float(inverse), 0.0))
    return int(np.sign(found[0])) if abs(found[0]) > 6 * error else 0


def _hardly_moves(angle: Array) -> bool:
    """Whether a rate that was made of this angle would be its steps more than its motion."""
    known = angle[np.isfinite(angle)]
    return not len(known) or float(np.ptp(known)) < 20 * step_size(angle)


def _turns(rate: Array) -> bool:
    """Whether it moves both ways, each at least a tenth of the time it moves."""
    moving = np.abs(rate) > 0.1 * float(np.abs(rate).max())
    ahead = float((rate[moving] > 0).mean()) if moving.any() else 0.0
    return 0.1 < ahead < 0.9


def _comes_back(angle: Array) -> bool:
    known = angle[np.isfinite(angle)]
    return len(known) > 1 and abs(float(known[-1] - known[0])) < 0.2 * float(np.ptp(known))


def of_twins(names: tuple[str, str], one: Array, two: Array) -> Iterator[Defect]:
    """Whether two channels, shapes (n,), are one signal: two = factor one + offset."""
    known = np.isfinite(one) & np.isfinite(two)
    if known.sum() < 20 or np.ptp(one[known]) == 0 or np.ptp(two[known]) == 0:
        return
    alike = float(np.corrcoef(one[known], two[known])[0, 1])
    if not math.isfinite(alike) or alike**2 < SAME:
        return
    factor, offset = (float(x) for x in np.polyfit(one[known], two[known], 1))
    what = (
        f"{names[1]} is {factor:.5g} times {names[0]} {'+' if offset >= 0 else '-'} "
        f"{abs(offset):.3g} (R² {alike**2:.5f}): one signal, not two measurements"
    )
    yield Defect("twice", names, what, (0, len(one) - 1), factor, noted=True)


def of_drive_delay(
    time: Array, rate: Array, torque: Array, names: tuple[str, str]
) -> Iterator[Defect]:
    """By how much a torque comes after its motion, s, where that is more than a filter's delay.

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

    By the acceleration, the rate, its sign, and a constant. 0 where the torque hardly changes. And
    what is left, as a share of how the whole torque varies: of a part that is steady, nothing.
    """
    width = len(rate) - 2 * most
    rise = RISE * float(np.abs(rate).max()) or 1.0
    parts = np.stack([rate, np.gradient(rate), np.tanh(rate / rise)])
    parts = parts[:, most : most + width]
    reach = np.abs(parts).max(axis=1)
    parts = parts - parts.mean(axis=1, keepdims=True)
    scale = np.sqrt(np.mean(parts**2, axis=1))
    # What is constant but for its last digits, as the sign of one direction, explains nothing.
    varies = scale > CONSTANT * reach
    parts = parts * (varies / np.where(varies, scale, 1.0))[:, None]
    products = np.stack([correlation(torque, part) for part in parts])
    whole = parts @ parts.T
    about = torque - torque.mean()
    sums, squares = (np.concatenate([[0.0], np.cumsum(each)]) for each in (about, about**2))
    gone = sums[width:] - sums[:-width]
    variance = squares[width:] - squares[:-width] - gone**2 / width
    told = np.einsum("jk,jk->k", products, np.linalg.pinv(whole, rcond=1e-9) @ products)
    whole_torque = max(float(squares[-1]) * width / len(torque), 1e-300)
    telling = variance > 0.5 * whole_torque
    share: Array = np.where(telling, told / np.maximum(variance, 0.5 * whole_torque), 0.0)
    left: Array = np.maximum(variance - told, 0.0) / np.maximum(variance, whole_torque)
    return np.minimum(share, 1.0), left
