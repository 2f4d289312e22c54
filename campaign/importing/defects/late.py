"""A torque, a force or a current that comes later, or earlier, than the motion it brings about.

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
    Severity,
    correlation,
    is_sure,
    nearest_low,
)

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
    yield Defect("delay", names, what, (0, n - 1), lag, Severity.REPAIRABLE)


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
