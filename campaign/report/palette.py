"""Colors, dashes and markers: distinct in greyscale and for color-blind readers.

Each colour has values for the light and the dark page. Both have the 3:1 contrast that WCAG 2.1
(1.4.11) requires of graphics, and text colours the 4.5:1 of 1.4.3.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from campaign.published.status import Status


@dataclass(frozen=True)
class Look:
    """Look of a series in drawings.

    Attributes:
        name: name of its CSS variable on the page.
        light, dark: colour on the light and on the dark page.
        dash: on and off lengths in line widths; empty for a solid line.
        marker: its marker in matplotlib.
    """

    name: str
    light: str
    dark: str
    dash: tuple[float, ...]
    marker: str


PAPER = Look("paper", "#ffffff", "#191c20", (), "")
INK = Look("ink", "#1c1f23", "#e6e8ea", (), "")
MUTED = Look("muted", "#5b626a", "#a3abb3", (), "")
HAIRLINE = Look("hairline", "#d9dde1", "#383e45", (), "")
"""Grid lines and table rules, which have no information of their own."""

_BLUE = ("#0067b0", "#5cb3f2")
_ORANGE = ("#c9540a", "#ff9a56")
_GREEN = ("#0b7a5c", "#3fd0a2")
_GREY = ("#4c5158", "#c3c8ce")
_SLATE = ("#33414f", "#b4c4d4")
_RED = ("#b3202c", "#ff8087")
_PURPLE = ("#8a3f9c", "#c684dc")
_OLIVE = ("#7a6a00", "#d9c84a")
_CYAN = ("#0b7a8c", "#54cfe0")
_BROWN = ("#8f4a12", "#e0a878")
_INDIGO = ("#5a3ea8", "#b9a5f0")
_PINK = ("#b8347c", "#f58fc4")

SERIES = {
    "none": Look("s-none", *_GREY, (), "X"),
    "static": Look("s-static", *_ORANGE, (5.0, 1.6), "s"),
    "lugre": Look("s-lugre", *_BLUE, (9.0, 1.4), "^"),
    "observer": Look("s-observer", *_GREEN, (5.0, 1.4, 1.2, 1.4), "D"),
    "positive": Look("s-positive", *_PURPLE, (7.0, 1.2, 1.2, 1.2), ">"),
    "negative": Look("s-negative", *_OLIVE, (3.2, 1.2), "<"),
    "measured": Look("s-measured", *_SLATE, (), "o"),
    "fit": Look("s-fit", *_RED, (12.0, 1.6), "v"),
    "alternative": Look("s-alternative", *_CYAN, (2.2, 1.2), "d"),
    "reference": Look("s-reference", MUTED.light, MUTED.dark, (1.2, 1.6), "x"),
}
"""Looks of the program's own series, the same in every figure of every report."""

_COLOURS = (_BLUE, _ORANGE, _GREEN, _RED, _GREY, _PINK, _BROWN, _INDIGO)
"""The first five are distinct also for color-blind readers; few charts have more lines."""
_DASHES = (
    (),
    (5.5, 1.8),
    (4.5, 1.2, 1.2, 1.2),
    (1.6, 1.2),
    (8.0, 2.0),
    (5.0, 1.2, 1.2, 1.2, 1.2, 1.2),
    (3.0, 1.0),
    (10.0, 1.2, 2.0, 1.2),
)
_MARKERS = ("o", "s", "D", "^", "v", "P", "X", "d")


def _other(place: int) -> Look:
    """Look of a further series: no two of 64 share dash and marker."""
    round_, within = divmod(place, len(_COLOURS))
    marker = _MARKERS[(within + round_) % len(_MARKERS)]
    return Look(f"s-other-{within + 1}", *_COLOURS[within], _DASHES[within], marker)


OTHERS = tuple(_other(place) for place in range(len(_COLOURS) * len(_MARKERS)))
"""Looks of other series, in the order of their first occurrence in a report."""

STATUS = {
    Status.SIMULATED: Look("st-simulated", *_BLUE, (), "o"),
    Status.PREDICTED: Look("st-predicted", *_GREEN, (), "D"),
    Status.RECOVERED: Look("st-recovered", *_CYAN, (), "s"),
    Status.RECOMPUTED: Look("st-recomputed", *_PURPLE, (), "P"),
    Status.SELECTED: Look("st-selected", *_PINK, (), "*"),
    Status.CALIBRATED: Look("st-calibrated", *_OLIVE, (), "v"),
    Status.ALTERED: Look("st-altered", *_BROWN, (), "^"),
    Status.UNDESCRIBED: Look("st-undescribed", *_INDIGO, (), "<"),
    Status.INCONSISTENT: Look("st-inconsistent", *_RED, (), "X"),
    Status.NOT_REPRODUCIBLE: Look("st-not-reproducible", *_GREY, (), "x"),
}
"""Colour and marker of each status, on the scoreboard and beside every number."""


def looks(series: Iterable[str]) -> dict[str, Look]:
    """Look of each series of one figure, in the order of occurrence."""
    return looks_of_page([series])


def looks_of_page(figures: Iterable[Iterable[str]]) -> dict[str, Look]:
    """Look of each series of a page, the same in all figures.

    figures: names of each figure's series, in the order of the page. A series without a look of its
    own gets the first one that no other series in the same figures has. Two series that never share
    a figure may have the same look.
    """
    chosen: dict[str, Look] = {}
    beside: dict[str, dict[str, None]] = {}
    for names in figures:
        together = dict.fromkeys(names)
        for name in together:
            beside.setdefault(name, {}).update(together)
    chosen |= {name: SERIES[name] for name in beside if name in SERIES}
    for name, others in beside.items():
        if name not in chosen:
            chosen[name] = _unlike([chosen[other] for other in others if other in chosen])
    return chosen


def _unlike(taken: Sequence[Look]) -> Look:
    """Look that differs from all `taken` ones in colour and in dash, thus also in grey.

    Without a free colour, only the dash differs; without a free dash, the pair of dash and marker.
    After 64 series, looks repeat.
    """
    colours, dashes = {look.light for look in taken}, {look.dash for look in taken}
    pairs = {(look.dash, look.marker) for look in taken}
    free = [look for look in OTHERS if (look.dash, look.marker) not in pairs]
    clear = [look for look in free if look.light not in colours and look.dash not in dashes]
    dashed = [look for look in free if look.dash not in dashes]
    return next(iter(clear or dashed or free), OTHERS[len(taken) % len(OTHERS)])


def variables() -> dict[str, tuple[str, str]]:
    """Colour on the light and on the dark page by CSS variable, sorted."""
    all_looks = (PAPER, INK, MUTED, HAIRLINE, *SERIES.values(), *OTHERS, *STATUS.values())
    return {look.name: (look.light, look.dark) for look in sorted(all_looks, key=lambda a: a.name)}
