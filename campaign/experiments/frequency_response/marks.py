"""Bandwidth and margins as marks in a Bode diagram, by method."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from campaign.estimate import Estimate
from campaign.estimation.frequency_response import Response
from campaign.estimation.servo import Crossing, ServoCharacteristics
from campaign.experiments.frequency_response.tables import QUANTITIES, Sweep, method
from campaign.experiments.shared.common import short_label
from campaign.result import Array, Axis, Curve, Figure, Mark, Panel, ends_of

LABELLED = 4
"""Most curves whose dots have a label; with more, only the table has the numbers."""
SIDE_BY_SIDE = 8
"""Most sweeps beside each other."""
TURN = 2.0 * np.pi
"""One turn (rad)."""
PLOTTED = -3.0
"""Level of the bandwidth (dB)."""


@dataclass(frozen=True)
class BodeContent:
    """Curves and marks in the two panels of a Bode diagram."""

    gain: list[Curve] = field(default_factory=list)
    phase: list[Curve] = field(default_factory=list)
    gain_marks: list[Mark] = field(default_factory=list)
    phase_marks: list[Mark] = field(default_factory=list)


Named = tuple[str, str, Response]
"""Label, series and response of one curve."""
Found = Sequence[ServoCharacteristics | None]


def bandwidths(sweeps: Sequence[Named], found: Found, names: Sequence[str]) -> BodeContent:
    """A dot where each gain passes -3 dB, with the interval of its frequency."""
    drawn = BodeContent()
    for (_, series, _), read, name in zip(sweeps, found, names, strict=True):
        if read is None:
            continue
        width = read.bandwidth
        if width.kind != "number":
            if math.isfinite(width.value):
                sign = "≥" if width.kind == "at least" else "≤"
                label = f"{name} {sign} {width.value:.3g} Hz"
                drawn.gain_marks.append(Mark(label, x=width.value, series=series))
            continue
        if not width.is_determined:
            continue
        low, high = width.combined
        if low is not None and high is not None:
            level = np.array([PLOTTED, PLOTTED])
            drawn.gain.append(Curve(np.array([low, high]), level, "", series, "thin"))
        label = _label(name, f"{width.value:.3g} Hz", len(sweeps))
        drawn.gain_marks.append(Mark(label, x=width.value, y=PLOTTED, point=True, series=series))
    return drawn


def margins(
    loops: Sequence[Named], phases: Sequence[Array], found: Found, names: Sequence[str]
) -> BodeContent:
    """Margins as distances from 0 dB and from -180 deg, at their frequencies.

    phases: phase of each loop as drawn (rad).
    """
    drawn = BodeContent()
    for (_, series, loop), shown, read, name in zip(loops, phases, found, names, strict=True):
        if read is None:
            continue
        if read.phase_margin.is_determined and (at := read.crossing(read.phase_margin)) is not None:
            _phase_margin(drawn, at, loop, shown, series, _name(name, len(loops)))
        gain = read.gain_margin
        if gain.kind == "at least":
            label = f"{_name(name, len(loops))}gain margin ≥ {gain.value:.3g} dB".strip()
            drawn.gain_marks.append(Mark(label, y=-gain.value, series=series))
        elif gain.is_determined and (at := read.crossing(gain)) is not None:
            _gain_margin(drawn, at, series, _name(name, len(loops)))
    return drawn


def _phase_margin(
    drawn: BodeContent, at: Crossing, loop: Response, shown: Array, series: str, name: str
) -> None:
    assert at.margin is not None  # noqa: S101 (for the type checker; the caller looked)
    frequency, margin = at.frequency.value, at.margin
    phase = float(np.interp(math.log(frequency), np.log(loop.frequency), shown))
    # The margin and the drawn phase may be of different branches.
    base = -np.pi + TURN * round((phase - (margin.value - np.pi)) / TURN)
    drawn.phase.append(_distance(frequency, base, base + margin.value, series))
    drawn.phase.append(_dot(frequency, base, margin, 1.0, series))
    label = f"{name}{np.rad2deg(margin.value):.3g}°"
    y = base + margin.value
    drawn.phase_marks.append(Mark(label, x=frequency, y=y, point=True, series=series))


def _gain_margin(drawn: BodeContent, at: Crossing, series: str, name: str) -> None:
    assert at.margin is not None  # noqa: S101 (for the type checker; the caller looked)
    frequency, margin = at.frequency.value, at.margin
    drawn.gain.append(_distance(frequency, 0.0, -margin.value, series))
    drawn.gain.append(_dot(frequency, 0.0, margin, -1.0, series))
    label = f"{name}{margin.value:.3g} dB"
    drawn.gain_marks.append(Mark(label, x=frequency, y=-margin.value, point=True, series=series))


def _distance(frequency: float, start: float, stop: float, series: str) -> Curve:
    return Curve(np.array([frequency] * 2), np.array([start, stop]), "", series, "thin")


def _dot(frequency: float, base: float, margin: Estimate, sign: float, series: str) -> Curve:
    """End of a margin, with its interval; `sign` is the direction of the margin from `base`."""
    reach = sorted(base + sign * end for end in ends_of(margin))
    y = np.array([base + sign * margin.value])
    low, high = (np.array([end]) for end in reach)
    return Curve(np.array([frequency]), y, "", series, "points", low=low, high=high)


def _name(name: str, count: int) -> str:
    return f"{name} " if 1 < count <= LABELLED else ""


def _label(name: str, number: str, count: int) -> str:
    return f"{_name(name, count)}{number}" if count <= LABELLED else ""


def servo_figure(sweeps: Sequence[Sweep]) -> Iterator[Figure]:
    """Bandwidth and margins of the closed loops beside each other, with their intervals.

    None for a single loop: its table has the same numbers.
    """
    read = [sweep for sweep in sweeps if sweep.found is not None]
    if not 2 <= len(read) <= SIDE_BY_SIDE:
        return
    names = place_names(read)
    axis = Axis(
        "Compensation" if len(set(map(method, read))) == len(read) else "Sweep",
        limits=(-0.5, len(read) - 0.5),
        places=tuple((float(k), name) for k, name in enumerate(names)),
    )
    panels = []
    for name, label, unit, display in QUANTITIES:
        values = [getattr(sweep.found, name) for sweep in read]
        known = [(k, sweep, each) for k, (sweep, each) in enumerate(zip(read, values, strict=True))]
        known = [(k, sweep, each) for k, sweep, each in known if math.isfinite(each.value)]
        if known:
            panels.append(
                Panel(
                    axis,
                    Axis(label, unit, display),
                    [_beside(k, sweep, each) for k, sweep, each in known],
                    label,
                    [mark for k, sweep, each in known for mark in _bound(k, sweep, each)],
                )
            )
    if not panels:
        return
    yield Figure(
        key="servo-characteristics",
        title="Bandwidth and stability margins",
        caption="Characteristics of the servo loop by compensation, with 95 % intervals.",
        alt="Bandwidth, gain margin and phase margin, a dot with its interval for each sweep.",
        panels=tuple(panels),
        across=3,
    )


def place_names(sweeps: Sequence[Sweep]) -> list[str]:
    """Short name of each sweep: its method, numbered if a method occurs twice."""
    short = [short_label(method(sweep)) for sweep in sweeps]
    if len(set(short)) == len(short):
        return short
    return [f"{name} {k}" for k, name in enumerate(short, start=1)]


def _beside(place: int, sweep: Sweep, found: Estimate) -> Curve:
    return Curve.of(
        [place], [found], "", method(sweep), quantity=found.name, conditions=sweep.place
    )


def _bound(place: int, sweep: Sweep, found: Estimate) -> Iterator[Mark]:
    """Word beside a dot that is a bound, or not determined."""
    if found.kind != "number":
        word: str = found.kind
    elif not found.is_determined:
        word = "not determined"
    else:
        return
    yield Mark(word, x=float(place), y=found.value, point=True, series=method(sweep))
