"""Relative rate of a load under base motion, whole and near reversals."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from campaign.channels import BASE_RATE, GYRO_RATE, RELATIVE_ANGLE, RELATIVE_RATE, missing
from campaign.estimation.relative_rate import RelativeRate, relative_rate
from campaign.experiments.shared.captions import duration
from campaign.experiments.shared.common import method_label
from campaign.experiments.shared.pointing_error import rate_of
from campaign.recording import Recording
from campaign.result import Array, Axis, Curve, Mark, Panel
from campaign.units import angle_text, rate_text

TIME = Axis("Time", "s", "s")
RATE = Axis("Rate relative to the hull", "rad/s", "deg/s")
AWAY = Axis("Rate off the dotted line", "rad/s", "deg/s")
BEFORE = 0.0133
"""Time before the reversal in a zoom, as a share of the time shown ..."""
AT_LEAST = 0.04
"""... and at least (s), because the sticking time does not fall with the period ..."""
MOST = 0.08
"""... and at most, which keeps the next reversal out of the zoom: for a sine shown for 1.5 cycles
it is 0.33 of the time shown away."""
WIDER = (1.0, 1.7, 3.0, 5.0)
"""Factors on the width of the zoom, tried in order until every load is seen to break loose."""
AFTER = 2.0
"""Time after the reversal, as a share of that before it."""
SEEN = 0.05
"""Rate that must be resolved, as a share of the zoom's half height."""
FILTERED = 0.15
"""Longest filter, as a share of the zoom's time ..."""
WHOLE = (0.01, 0.02)
"""... and for the whole motion: rate that must be resolved, as a share of the hull's largest, and
longest filter, as a share of the time shown."""
HELD = "held still in space"
SHORTEST = 10
"""Fewest samples of a recording that is shown."""
SLOW = 0.15
"""Share of the zoom's half height below which the load counts as moving with the hull."""


@dataclass(frozen=True)
class Zoom:
    """Section around a reversal: start, middle and stop (s), half the height (rad/s)."""

    start: float
    middle: float
    stop: float
    height: float

    def of(self, time: Array) -> NDArray[np.bool_]:
        return np.asarray((time >= self.start) & (time <= self.stop))


@dataclass(frozen=True)
class Slow:
    """Interval (s) of a slow load; `cut` if it extends beyond the shown or known samples."""

    start: float
    stop: float
    cut: bool

    @property
    def words(self) -> str:
        return f"{'over ' if self.cut else ''}{duration(self.stop - self.start)}"


@dataclass(frozen=True)
class MethodRate:
    """The relative rate of one method in the zoom.

    Attributes:
        time: s, shape (n,); also of `held`, the rate of a load held still in space (rad/s).
        rate: from the sensor that resolves it.
        slow: interval of a slow load; None without one, and if the sensor is too coarse.
    """

    time: Array
    held: Array
    rate: RelativeRate
    slow: Slow | None

    @property
    def farthest(self) -> float:
        """Largest deviation from a load held still (rad/s); NaN without values."""
        away = np.abs(self.rate.values - self.held)
        return float(np.nanmax(away)) if np.isfinite(away).any() else math.nan


@dataclass(frozen=True)
class Reversal:
    """Panels of the relative rate, and sentences for their caption (`words`)."""

    panels: tuple[Panel, ...]
    words: str


def can_be_shown(cut: Recording) -> bool:
    """Whether a recording has enough samples, both rates, and a moving hull."""
    if missing((BASE_RATE, RELATIVE_RATE), cut.channels) or len(cut.time) < SHORTEST:
        return False
    return bool(np.nanmax(np.abs(cut[BASE_RATE]), initial=0.0) > 0)


def reversal(cuts: Mapping[str, Recording]) -> Reversal:
    """Panels of the whole motion with the first method, then one reversal for each method.

    The last panel compares the deviations of several methods from a load held still.

    cuts: by method, each on its own time axis; each `can_be_shown`.
    """
    name, first = next(iter(cuts.items()))
    largest, span = float(np.nanmax(np.abs(first[BASE_RATE]))), float(np.ptp(first.time))
    whole = _seen(first, WHOLE[0] * largest, WHOLE[1] * span)
    zoom, shown = _zoomed(cuts, first)
    panels = [
        _whole_panel(name, first, whole, zoom),
        *(_zoom_panel(method, each, zoom) for method, each in shown.items()),
        *_away_panel(shown, zoom),
    ]
    sentences = (
        *_filter_words(whole, list(shown.values())),
        _slow_words(list(shown.values()), zoom),
        _blind_words(first, list(shown.values()), zoom),
    )
    return Reversal(tuple(panels), " ".join(filter(None, sentences)))


def _zoomed(cuts: Mapping[str, Recording], first: Recording) -> tuple[Zoom, dict[str, MethodRate]]:
    """Smallest zoom that cuts no slow interval, else the widest one; rates by method in it."""
    for wider in WIDER:
        zoom = _zoom(first, wider)
        shown = {method: _near(cut, zoom) for method, cut in cuts.items()}
        if not any(each.slow is not None and each.slow.cut for each in shown.values()):
            break
    return zoom, shown


def _zoom(recording: Recording, wider: float) -> Zoom:
    """Zoom around the middle one of the hull's reversals, by a factor `wider`."""
    time, rate = recording.time, recording[BASE_RATE]
    changes = np.flatnonzero(np.diff(np.sign(rate)) != 0)
    span = float(np.ptp(time))
    middle = float(time[changes[len(changes) // 2]]) if len(changes) else 0.5 * span
    before = min(wider * max(BEFORE * span, AT_LEAST), MOST * span)
    start, stop = middle - before, middle + AFTER * before
    inside = (time >= start) & (time <= middle + before)
    return Zoom(start, middle, stop, float(np.nanmax(np.abs(rate[inside]), initial=0.0)) or 1.0)


def _seen(cut: Recording, finest: float, longest: float) -> RelativeRate:
    """Relative rate that resolves `finest` (rad/s), filtered over at most `longest` (s)."""
    angle, gyro = (
        cut[name] if name in cut.channels else None for name in (RELATIVE_ANGLE, GYRO_RATE)
    )
    step = 1.0 / rate_of(cut)
    return relative_rate(cut[RELATIVE_RATE], angle, gyro, cut[BASE_RATE], step, finest, longest)


def _near(cut: Recording, zoom: Zoom) -> MethodRate:
    rate = _seen(cut, SEEN * zoom.height, FILTERED * (zoom.stop - zoom.start))
    inside = zoom.of(cut.time)
    time, values = cut.time[inside], rate.values[inside]
    seen = rate.finest < SLOW * zoom.height
    slow = _slow(time, values, zoom) if seen else None
    return MethodRate(time, -cut[BASE_RATE][inside], replace(rate, values=values), slow)


def _slow(time: Array, rate: Array, zoom: Zoom) -> Slow | None:
    """Slow interval nearest to the reversal; None if the load is never slow."""
    slow = np.abs(rate) < SLOW * zoom.height
    places = np.flatnonzero(slow)
    if not len(places):
        return None
    start = stop = int(places[np.argmin(np.abs(time[places] - zoom.middle))])
    while start > 0 and slow[start - 1]:
        start -= 1
    while stop < len(slow) - 1 and slow[stop + 1]:
        stop += 1
    cut = start == 0 or stop == len(slow) - 1
    cut = cut or not np.isfinite(rate[[start - 1, stop + 1]]).all()
    return Slow(float(time[start]), float(time[stop]), cut)


def _whole_panel(name: str, cut: Recording, rate: RelativeRate, zoom: Zoom) -> Panel:
    curves = [
        Curve(cut.time, rate.values, method_label(name), name),
        Curve(cut.time, -cut[BASE_RATE], HELD, "reference", "thin"),
    ]
    mark = Mark("zoom", x=zoom.start, until=zoom.stop)
    return Panel(TIME, RATE, curves, f"Whole motion: {method_label(name)}", [mark])


def _zoom_panel(name: str, shown: MethodRate, zoom: Zoom) -> Panel:
    time = replace(TIME, limits=(zoom.start, zoom.stop))
    rate = replace(RATE, limits=(-zoom.height, zoom.height))
    curves = [
        Curve(shown.time, shown.held, HELD, "reference", "thin"),
        Curve(shown.time, shown.rate.values, method_label(name), name),
    ]
    marks = []
    if shown.slow is not None:
        label, slow = f"slow for {shown.slow.words}", shown.slow
        marks.append(Mark(label, x=slow.start, until=slow.stop, series=name))
    title = method_label(name)
    if np.isfinite(shown.farthest):
        title += f": {rate_text(shown.farthest, '.2g')} off"
    return Panel(time, rate, curves, title, marks)


def _away_panel(shown: Mapping[str, MethodRate], zoom: Zoom) -> Iterator[Panel]:
    """Deviations of all methods from a load held still in one panel; nothing for one method."""
    curves = [
        Curve(each.time, each.rate.values - each.held, method_label(name), name)
        for name, each in shown.items()
        if np.isfinite(each.farthest)
    ]
    if len(curves) > 1:
        time = replace(TIME, limits=(zoom.start, zoom.stop))
        yield Panel(time, AWAY, curves, "All, less a load held still")


def _filter_words(whole: RelativeRate, shown: Sequence[MethodRate]) -> Iterator[str]:
    """Caption sentences on the filters of the rates; nothing on unfiltered rates."""
    zooms = list(dict.fromkeys(_how(each.rate) for each in shown))
    if zooms == [_how(whole)]:
        yield f"All rates are {zooms[0]}." if zooms[0] else ""
        return
    if _how(whole):
        yield f"The whole motion is {_how(whole)}."
    for how in filter(None, zooms):
        yield f"{'The zooms are' if len(zooms) == 1 else 'Zooms are'} {how}."


def _how(rate: RelativeRate) -> str:
    if rate.sensor == "gyro":
        averaged = f", averaged over {duration(rate.window)}" if rate.window else ""
        return (
            f"the difference of the rates of load and hull in space{averaged}, because counts of "
            "the encoder are too coarse"
        )
    if not rate.window:
        return ""
    return (
        f"the slope of a line through {duration(rate.window)} of the encoder's samples, a filter "
        f"without delay that resolves {rate_text(rate.finest, '.2g')}"
    )


def _slow_words(shown: Sequence[MethodRate], zoom: Zoom) -> str:
    """Caption sentence on the shaded interval, and on that of a load held still."""
    if all(each.slow is None for each in shown):
        return ""
    held = _slow(shown[0].time, shown[0].held, zoom)
    beside = f"; a load held still is for {held.words}" if held else ""
    limit = rate_text(SLOW * zoom.height, ".2g")
    return f"Shaded: while the load is slower than {limit} relative to the hull{beside}."


def _blind_words(first: Recording, shown: Sequence[MethodRate], zoom: Zoom) -> str:
    """Caption sentence on the time in which the encoder cannot show whether the load sticks."""
    count = max((each.rate.blind for each in shown), default=0.0)
    if not count:
        return ""
    moved = np.cumsum(first[BASE_RATE]) / rate_of(first)
    at = int(np.argmin(np.abs(first.time - zoom.middle)))
    beyond = np.abs(moved - moved[at]) >= count
    after, before = beyond[at:], beyond[at::-1]
    if not after.any() or not before.any():
        return ""
    time = (int(np.argmax(after)) + int(np.argmax(before))) / rate_of(first)
    return (
        f"For {duration(time)} around the reversal the hull moves by less than one count of the "
        f"encoder ({angle_text(count, '.2g')}). Whether the load sticks then cannot be seen."
    )
