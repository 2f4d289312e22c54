"""Overlaid figures of two runs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import takewhile

from campaign.api.analysis import AnalysedTest
from campaign.report.palette import OTHERS
from campaign.result import Curve, Figure, Panel

PARTS = 8
"""Largest number of panels of an overlay."""
SAMPLES = 20_000
"""Samples above which a figure shows recordings and is not overlaid."""
LOOKS = OTHERS[:2]
"""Looks of the reference and the other run: the first two that no series reserves."""
Letters = tuple[str, str]
"""Letters of the reference and of the other run."""


def overlays(
    reference: AnalysedTest, other: AnalysedTest, letters: Letters
) -> Iterator[Figure | str]:
    """Overlays of the figures of both tests; a sentence with the reason if one is impossible."""
    others = {figure.key: figure for figure in other.result.figures}
    for figure in reference.result.figures:
        if figure.key in others:
            yield _overlay(figure, others[figure.key], letters)


def _overlay(one: Figure, other: Figure, letters: Letters) -> Figure | str:
    if len(one.panels) != len(other.panels) or not all(map(_fits, one.panels, other.panels)):
        return f"“{one.title}” of the two runs has other axes."
    if _samples(one) + _samples(other) > SAMPLES:
        return f"“{one.title}” shows recordings, sample by sample: see both reports."
    if all(_few(panel) for panel in (*one.panels, *other.panels)):
        panels = [_both(a, b, letters) for a, b in zip(one.panels, other.panels, strict=True)]
    elif any(panel.x.unit == "s" for panel in one.panels):
        return f"“{one.title}” has too many curves over time to be laid over each other."
    else:
        panels = [
            _both(part, partner, letters, part.title)
            for a, b in zip(one.panels, other.panels, strict=True)
            for part, partner in _parts(a, b)
        ]
    if len(panels) > PARTS:
        return f"“{one.title}” has too many curves to be laid over each other."
    across = one.across if len(panels) == len(one.panels) else 2
    caption = f"{' and '.join(letters)} over each other."
    if one.caption == other.caption:  # a different caption is of one run only
        caption = f"{caption} {one.caption}"
    return replace(one, panels=tuple(panels), caption=caption, thesis=(), trials=(), across=across)


def _both(one: Panel, other: Panel, letters: Letters, title: str | None = None) -> Panel:
    """One panel with the curves of both runs, each in its own look."""
    curves = tuple(
        _renamed(curve, letter)
        for letter, panel in zip(letters, (one, other), strict=True)
        for curve in panel.curves
    )
    heading = _common(one.title, other.title) if title is None else title
    return replace(one, curves=curves, marks=(), title=heading)


def _parts(one: Panel, other: Panel) -> Iterator[tuple[Panel, Panel]]:
    """Pairs of panels with the common curves, in order; `_few` is true for each panel."""
    others = {_key(curve): curve for curve in other.curves}
    parts: list[list[Curve]] = []
    for curve in one.curves:
        if _key(curve) not in others:
            continue
        if not parts or curve.style in [each.style for each in parts[-1]]:
            parts.append([])
        parts[-1].append(curve)
    for curves in parts:
        head = _common(one.title, other.title)
        title = f"{head}: {_told(curves[0])}" if head else _told(curves[0])
        yield (
            replace(one, curves=tuple(curves), title=title),
            replace(other, curves=tuple(others[_key(each)] for each in curves), title=title),
        )


def _common(one: str, other: str) -> str:
    """Common leading parts of two titles, split at commas; later parts may be results of a run."""
    pieces = zip(one.split(", "), other.split(", "), strict=False)
    return ", ".join(a for a, _ in takewhile(lambda pair: pair[0] == pair[1], pieces))


def _key(curve: Curve) -> tuple[str, str, str]:
    """Key that matches a curve with its partner in the other run."""
    return curve.label, curve.series, curve.style


def _told(curve: Curve) -> str:
    return curve.label or curve.series


def _fits(one: Panel, other: Panel) -> bool:
    """Whether two panels have the same axes."""
    return all(
        (a.label, a.unit, a.scale) == (b.label, b.unit, b.scale)
        for a, b in ((one.x, other.x), (one.y, other.y))
    )


def _few(panel: Panel) -> bool:
    """Whether style alone distinguishes a run's curves: each style occurs once at most."""
    styles = [curve.style for curve in panel.curves]
    return len(styles) == len(set(styles))


def _renamed(curve: Curve, letter: str) -> Curve:
    """Curve in the look of its run; no quantity, so that it shows no published values."""
    label = f"{letter}: {_told(curve)}" if _told(curve) else letter
    return replace(curve, label=label, series=letter, quantity="")


def _samples(figure: Figure) -> int:
    return sum(len(curve.x) for panel in figure.panels for curve in panel.curves)
