"""Defects between an angle and its rate: factor, sign, delay.

Angle and integrated rate are compared by their travel over stretches of time: a quantized angle
has no derivative from sample to sample, but it has a difference over a stretch.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from campaign.importing.defects.defect import (
    LONGEST,
    NO_FILTER,
    Array,
    Defect,
    correlation,
    is_sure,
    nearest_low,
    step_size,
)

_LIKE = 0.98
"""Least explained share of variance at which a factor between rate and angle is valid."""
_UNEXPLAINED = 0.1
"""Deviation of a factor from 1 above which it is a defect: filters and noise cause some."""

_TURN = {"rad": 2 * math.pi, "deg": 360.0, "turns": 1.0}
_TURN_PER_S = {"rad/s": 2 * math.pi, "deg/s": 360.0, "rpm": 60.0, "turns per s": 1.0}
FACTORS = (
    *(
        (per_s / turn, f"the rate is in {rate}, the angle in {angle}")
        for angle, turn in _TURN.items()
        for rate, per_s in _TURN_PER_S.items()
        if per_s != turn
    ),
    (1000.0, "time is in ms, or the rate in thousandths of the angle's unit"),
    (1e-3, "the angle is in thousandths of the rate's unit"),
)
"""Usual factors between a rate and the derivative of its angle, each with its meaning."""


@dataclass(frozen=True)
class Slope:
    """A rate over the derivative of its angle.

    Attributes:
        factor: with its sign.
        explained: share of variance.
        error: standard error, as a share of the factor.
        travel: total travel of the angle, in its smallest steps; inf without steps.
    """

    factor: float
    explained: float
    error: float
    travel: float


def slope(time: Array, angle: Array, rate: Array) -> Slope | None:
    """The factor between a rate and the derivative of an angle, all shape (n,).

    The stretch length gives the best agreement of both. None if the travel is too small.
    """
    n = len(time)
    if n < 20:
        return None
    known = np.isfinite(angle) & np.isfinite(rate) & np.isfinite(time)
    filled = np.where(known, rate, 0.0)
    gone = np.concatenate([[0.0], np.cumsum(0.5 * (filled[1:] + filled[:-1]) * np.diff(time))])
    lost = np.cumsum(~known)
    least = step_size(angle)
    best: Slope | None = None
    wide = 2
    while wide <= n // 8:
        places = np.arange(0, n - wide, max(1, wide // 2))
        whole = known[places] & (lost[places + wide] == lost[places])
        places = places[whole]
        moved, integrated = (each[places + wide] - each[places] for each in (angle, gone))
        fit = _fit(moved, integrated, least)
        if fit is not None and (best is None or fit.explained > best.explained):
            best = fit
        wide *= 2
    return best


def _fit(moved: Array, told: Array, least: float) -> Slope | None:
    clear = np.abs(moved) > 3 * least
    own, other = float(moved @ moved), float(told @ told)
    if clear.sum() < 8 or own <= 0 or other <= 0:
        return None
    both = float(moved @ told)
    explained = both**2 / (own * other)
    factor = math.copysign(math.sqrt(other / own), both)
    # Stretches overlap by half; those with almost no travel do not count.
    independent = max(2.0, 0.5 * float(clear.sum()))
    error = math.sqrt(max(1 - explained, 0.0) / max(explained, 1e-9) / independent)
    travel = float(np.abs(moved[clear]).sum()) / least if least else math.inf
    return Slope(factor, explained, error, travel)


def of_rate(
    time: Array,
    angle: Array,
    rate: Array,
    names: tuple[str, str] = ("angle", "rate"),
    gear: float | None = None,
) -> Iterator[Defect]:
    """Defects between a rate and its angle, shapes (n,): factor, sign, delay.

    Args:
        names: of the two channels.
        gear: ratio of a gear that may be between them.
    """
    rows = (0, len(time) - 1)
    fit = slope(time, angle, rate)
    if fit is None or fit.travel < 30:
        return
    one, two = names
    if fit.explained < 0.9 and (late := list(delay(time, angle, rate, names))):
        yield from late  # the factor is unknown until the delay is removed
        return
    if fit.explained < 0.5:
        what = (
            f"{two} is not the derivative of {one}: it explains {100 * fit.explained:.2g} % of "
            "how far that moved"
        )
        yield Defect("unrelated", (two, one), what, rows, fit.explained, noted=True)
        return
    if fit.factor < 0 and fit.explained > 0.9:
        what = (
            f"{two} has the opposite sign of the derivative of {one} (factor {fit.factor:.4g}, "
            f"R² {fit.explained:.3f})"
        )
        yield Defect("sign", (two, one), what, rows, fit.factor)
    yield from _factor(fit, names, rows, gear)
    if fit.explained > 0.9:
        delays = delay(time, angle, math.copysign(1.0, fit.factor) * rate, names)
        # Both agree on the travel: a long delay would come from a nearly constant part.
        yield from (each for each in delays if each.noted)


def candidates(factor: float, error: float = 0.0, gear: float | None = None) -> list[str]:
    """Possible causes of a factor other than 1, in words; any integer ratio may be a gear."""
    tolerance = max(0.003, 3 * error)
    size = abs(factor)
    means = [meaning for value, meaning in FACTORS if abs(size / value - 1) <= tolerance]
    for ratio in (size, 1 / size):
        if gear is not None and abs(ratio / gear - 1) <= tolerance:
            means.append(f"they are on the two sides of the gear of {gear:g}")
        elif round(ratio) >= 2 and abs(ratio / round(ratio) - 1) <= tolerance:
            means.append(f"they are on the two sides of a gear of {round(ratio)} (`[gear] ratio`)")
    return means


def _factor(
    found: Slope, names: tuple[str, str], rows: tuple[int, int], gear: float | None
) -> Iterator[Defect]:
    one, two = names
    size = abs(found.factor)
    off = abs(size - 1)
    if found.explained < _LIKE or off <= max(0.03, 4 * found.error):
        return
    relation = f"{two} is {size:.5g} times the derivative of {one} (R² {found.explained:.4f})"
    means = candidates(found.factor, found.error, gear)
    if means:
        what = f"{relation}: {'either ' * (len(means) > 1)}{', or '.join(means)}"
        yield Defect("factor", (two, one), what, rows, size)
    elif off > _UNEXPLAINED:
        severe = found.travel > 100 and not 0.5 < size < 2
        what = f"{relation}, for no usual reason"
        yield Defect("factor", (two, one), what, rows, size, noted=not severe)


def delay(
    time: Array, angle: Array, rate: Array, names: tuple[str, str] = ("angle", "rate")
) -> Iterator[Defect]:
    """Delay (s) of a rate after the derivative of its angle, if at least half a step."""
    known = np.isfinite(angle) & np.isfinite(rate)
    n = len(time)
    step = float(time[-1] - time[0]) / max(n - 1, 1)
    if not known.all() or n < 20 or step <= 0:
        return
    most = min(n // 5, max(200, math.ceil(LONGEST / step)))
    derivative = np.gradient(angle, step)[most : n - most]
    derivative = derivative - derivative.mean()
    width = len(derivative)
    products = correlation(rate, derivative)
    sums, squares = (np.concatenate([[0.0], np.cumsum(each)]) for each in (rate, rate**2))
    mean = (sums[width:] - sums[:-width]) / width
    spread = (squares[width:] - squares[:-width]) / width - mean**2
    # A constant rate correlates with nothing.
    floor = max(1e-9 * float(rate.var()), 1e-300)
    size = np.sqrt(np.maximum(spread, floor)) * max(float(derivative.std()), 1e-150)
    likeness = np.clip(np.where(spread > floor, products / width / size, 0.0), -1.0, 1.0)
    peak = nearest_low(1.0 - np.maximum(likeness, 0.0) ** 2, most, 1e-4)
    at_rest = float(likeness[most])
    if not 0 < peak < 2 * most or likeness[peak] < 0.8:
        return
    # The delay must explain at least a tenth of the disagreement.
    if 1 - likeness[peak] ** 2 > 0.9 * (1 - at_rest**2):
        return
    before, top, after = likeness[peak - 1 : peak + 2]
    bend = before - 2 * top + after
    lag = (peak - most + (0.5 * (before - after) / bend if bend < 0 else 0.0)) * step
    is_long = abs(lag) >= NO_FILTER
    if abs(lag) < 0.5 * step or (
        is_long and not is_sure(1.0 - float(likeness[peak]) ** 2, 1.0 - max(at_rest, 0.0) ** 2)
    ):
        return
    one, two = names
    where = "after" if lag > 0 else "before"
    what = (
        f"{two} comes {1000 * abs(lag):.3g} ms {where} the derivative of {one} "
        f"({abs(lag) / step:.2g} samples): a delay or a filter"
    )
    yield Defect("delay", (two, one), what, (0, n - 1), float(lag), noted=not is_long)
