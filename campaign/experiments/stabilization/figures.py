"""Figures of the stabilization test: errors by method, one trial over time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from campaign.channels import COMPENSATION_TORQUE, FRICTION_TORQUE, POINTING_ERROR
from campaign.estimate import Estimate, Window
from campaign.estimation.relative_rate import mean
from campaign.experiments.interface import TrialData
from campaign.experiments.shared.captions import amount
from campaign.experiments.shared.common import conditions, method_label
from campaign.experiments.shared.pointing_error import (
    SHOWN,
    largest_of,
    measured_part,
    whole_cycles_shown,
    window_of,
)
from campaign.experiments.shared.swept_words import words
from campaign.experiments.stabilization.errors import BARE, COMPENSATION, error_figures
from campaign.experiments.stabilization.reversal_figures import TIME, can_be_shown, reversal
from campaign.recording import Recording
from campaign.result import Array, Axis, Cell, Curve, Figure, Mark, Panel
from campaign.signals import Sine
from campaign.trial import canonical_json

ERROR = Axis("Position error", "rad", "mrad")
TORQUE = Axis("Torque", "N m", "N m")
LEFT = Axis("Torque that is left", "N m", "N m")

NUMBERS: Mapping[tuple[float, float], Mapping[str, tuple[str, ...]]] = {
    (0.24, 18.0): {
        "rate": ("5.4", "5.18", "5.8", "5.22"),
        "error": ("5.9", "5.23"),
        "torque": ("5.7", "5.21"),
    },
    (2.0, 36.0): {"error": ("5.10", "5.24")},
}
"""The thesis' figures over time by frequency (Hz) and acceleration (deg/s^2) of the base motion."""


@dataclass(frozen=True)
class Condition:
    """One condition of the sweep, with a trial of each method.

    Attributes:
        trials: by method.
        errors: over all repetitions, by method; only finite ones.
        words: caption text on the condition.
        numbers: figure numbers of the thesis, by content: `rate`, `error`, `torque`.
    """

    trials: Mapping[str, TrialData]
    errors: Mapping[str, Estimate]
    words: str
    numbers: Mapping[str, tuple[str, ...]]

    @property
    def largest(self) -> float:
        """Error without compensation, else the largest error; negative without errors."""
        values = {name: error.value for name, error in self.errors.items()}
        return values.get("none", max(values.values(), default=-1.0))

    @property
    def shown(self) -> tuple[int, ...]:
        """Numbers of its trials."""
        return tuple(item.trial.number for item in self.trials.values())


def stabilization_figures(
    firsts: Sequence[TrialData], paths: Sequence[str], rows: Sequence[Mapping[str, Cell]]
) -> Iterator[Figure]:
    """The errors of the methods, and time histories of one trial per method.

    firsts: first trial of each condition and method. rows: of the table, in the same order.
    """
    if not firsts:
        return
    yield from error_figures(rows, paths, firsts[0].trial)
    place = _telling_place(_places(firsts, rows, paths))
    if any(item.not_kept for item in place.trials.values()):
        return
    yield from _rate_figure(place)
    yield _error_figure(place)
    if any(name != "none" for name in place.trials):
        yield from _torque_figure(place)


def _places(
    firsts: Sequence[TrialData], rows: Sequence[Mapping[str, Cell]], paths: Sequence[str]
) -> list[Condition]:
    """Conditions of the sweep, each with all of its methods."""
    trials: dict[str, dict[str, TrialData]] = {}
    errors: dict[str, dict[str, Estimate]] = {}
    for item, row in zip(firsts, rows, strict=True):
        point = {path: v for path, v in item.trial.point.items() if path != COMPENSATION}
        key, method, error = canonical_json(point), item.trial.task.compensation, row["error"]
        trials.setdefault(key, {}).setdefault(method, item)
        if isinstance(error, Estimate) and np.isfinite(error.value):
            errors.setdefault(key, {}).setdefault(method, error)
    alone = {COMPENSATION, "frequency", "acceleration"} >= set(paths)
    return [
        Condition(
            each,
            errors.get(key, {}),
            _condition_words(next(iter(each.values())), len(trials)),
            _numbers(next(iter(each.values()))) if alone else {},
        )
        for key, each in trials.items()
    ]


def _condition_words(item: TrialData, places: int) -> str:
    """`Shown at 2 Hz, 36 deg/s², one of 7 conditions.`: caption text with all swept values."""
    sine = isinstance(item.trial.task.base_acceleration, Sine)
    stated = conditions(item, *(("frequency", "acceleration") if sine else ()))
    point = {path: value for path, value in stated.items() if path != COMPENSATION}
    text = ", ".join(words(point, item.trial, BARE))
    several = f", one of {places} conditions" if places > 1 else ""
    return f" Shown at {text}{several}." if text else ""


def _numbers(item: TrialData) -> Mapping[str, tuple[str, ...]]:
    motion = item.trial.task.base_acceleration
    if not isinstance(motion, Sine):
        return {}
    own = motion.frequency, float(np.rad2deg(motion.amplitude))
    for condition, numbers in NUMBERS.items():
        if np.allclose(own, condition):
            return numbers
    return {}


def _telling_place(places: Sequence[Condition]) -> Condition:
    """Condition with most methods: one that the thesis draws, else that of the largest error."""
    most = max(len(place.trials) for place in places)
    whole = [place for place in places if len(place.trials) == most]
    drawn = [place for place in whole if place.numbers]
    return max(drawn or whole, key=lambda place: place.largest)


def _cut(data: TrialData) -> Recording:
    """The first cycles of the measuring window, on a time axis that begins with it."""
    window = window_of(data.trial, SHOWN)
    cut = data.recording().window(window.start, window.stop)
    return Recording(cut.time - window.start, cut.channels, cut.events, cut.ending)


def _rate_figure(place: Condition) -> Iterator[Figure]:
    cuts = {name: _cut(item) for name, item in place.trials.items()}
    if not all(can_be_shown(cut) for cut in cuts.values()):
        return
    result = reversal(cuts)
    yield Figure(
        key="relative-rate",
        title="Rate of the load relative to the hull",
        caption="Dotted: a load held still in space. Where the relative rate passes zero, residual "
        "friction moves the load with the hull; overcompensation moves it ahead of the hull. "
        "Titles: largest deviation from the dotted line"
        f"{'; last panel: deviation of each method' if len(cuts) > 1 else ''}. "
        f"{result.words}{place.words}",
        alt="Relative rate over time: the whole motion, one reversal for each compensation method "
        "beside the line of a load held still, and the difference.",
        panels=result.panels,
        thesis=place.numbers.get("rate", ()),
        across=2,
        trials=place.shown,
    )


def _error_figure(place: Condition) -> Figure:
    panels, turned, largest = [], False, 0.0
    for name, item in place.trials.items():
        measured, window = measured_part(item), whole_cycles_shown(item.trial)
        cut = measured.window(window.start, window.stop)
        position = measured[POINTING_ERROR]
        error = cut[POINTING_ERROR] - np.mean(position)
        curve = Curve(cut.time - window.start, error, method_label(name), name)
        title = method_label(name)
        if len(position) and np.isfinite(position).all():
            own = largest_of(position)  # over the whole measurement, as in the table
            title += f": {amount(own, 'rad', 'mrad')}"
            largest = max(largest, own)
        marks = [
            Mark("" if k else "hull reverses", x=time)
            for k, time in enumerate(_reversals(item, window))
        ]
        turned = turned or bool(marks)
        panels.append(Panel(TIME, ERROR, [curve], title, marks))
    limits = (-1.05 * largest, 1.05 * largest)
    spans = [np.ptp(panel.curves[0].y) if panel.curves[0].y.size else np.nan for panel in panels]
    small = [span < SMALL * np.ptp(limits) for span in spans]
    if largest > 0.0:  # one scale, to compare the methods
        panels = [
            panel if alone else replace(panel, y=replace(ERROR, limits=limits))
            for panel, alone in zip(panels, small, strict=True)
        ]
    shared = "All panels have one scale"
    shared += ", except those of errors that would be a line on it." if any(small) else "."
    lines = " Dashed lines: where the hull is to reverse." if turned else ""
    return Figure(
        key="position-error",
        title="Position error by compensation method",
        caption="The beginning of one trial of each method: position error less its mean over all "
        "that is measured. Titles say the largest of that trial, the table the mean of repeats. "
        f"{shared}{lines}{place.words}",
        alt="Position error over time, one panel per compensation method.",
        panels=tuple(panels),
        thesis=place.numbers.get("error", ()),
        across=2,
        trials=place.shown,
    )


def _reversals(item: TrialData, window: Window) -> Array:
    """Times (s) from the start of the window at which the hull is to reverse, shape (n,).

    The rate is zero at the extremes of a sinusoidal acceleration. Empty for another motion, and
    for more than `MOST_REVERSALS`.
    """
    motion = item.trial.task.base_acceleration
    if not isinstance(motion, Sine):
        return np.empty(0)
    halves = 2.0 * motion.frequency
    first = 0.5 - motion.phase / np.pi  # half cycles until the first extreme
    numbers = np.arange(np.ceil(halves * window.start - first), halves * window.stop - first)
    times = (numbers + first) / halves - window.start
    return times if len(times) <= MOST_REVERSALS else np.empty(0)


SMALL = 0.05
"""Share of the common scale below which a curve has its own scale, to stay visible."""
MOST_REVERSALS = 8
"""Most reversals that are marked."""
CHATTER = 3.0
"""Ratio of the total variation of a torque to that of its mean, above which it chatters."""
SMOOTHED = 0.02
"""Window of that mean, as a share of the time shown ..."""
SHORTEST_WINDOW = 5
"""... and its fewest samples."""


def _without_chatter(time: Array, torque: Array, name: str) -> tuple[list[Curve], float]:
    """Curves of a torque: its moving mean before a band of its range; and the window (s).

    The torque of a model with counts of an encoder as input jumps at every count, and its line
    fills an area. A torque without chatter is one curve, with the window 0.
    """
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    whole = Curve(time, torque, method_label(name), name)
    size = 2 * int(0.5 * SMOOTHED * len(torque)) + 1
    if size < SHORTEST_WINDOW or not np.isfinite(torque).all():
        return [whole], 0.0
    average = mean(torque, size)
    known = np.isfinite(average)
    variation = np.abs(np.diff(torque[known])).sum()
    if variation <= CHATTER * np.abs(np.diff(average[known])).sum():
        return [whole], 0.0
    high, low = (
        np.where(known, ends(torque, size), np.nan) for ends in (maximum_filter1d, minimum_filter1d)
    )
    band = Curve(time, high, "", name, "band", y_low=low)
    return [band, replace(whole, y=average)], size * float(np.median(np.diff(time)))


def _chatter_words(windows: Sequence[float]) -> str:
    """Caption sentence on averaged torques; empty without any."""
    if not windows:
        return ""
    return (
        " Where a torque jumps with every count of the encoder, the line is its mean, and the "
        f"shade its range, over {1e3 * max(windows):.3g} ms."
    )


def _torque_figure(place: Condition) -> Iterator[Figure]:
    """Compensation torque and friction of the same trial, one panel for each method, one scale."""
    panels: list[Panel] = []
    left: list[Curve] = []
    windows: list[float] = []
    largest = 0.0
    for name, item in place.trials.items():
        cut = _cut(item)
        if name == "none" or COMPENSATION_TORQUE not in cut.channels:
            continue
        curves, window = _without_chatter(cut.time, cut[COMPENSATION_TORQUE], name)
        windows += [window] if window else []
        if FRICTION_TORQUE in cut.channels:
            friction = cut[FRICTION_TORQUE]
            left.append(replace(curves[-1], y=friction - curves[-1].y))
            curves.insert(0, Curve(cut.time, friction, "true friction", "reference", "thin"))
        shown = np.concatenate([curve.y for curve in curves])
        largest = max(largest, float(np.nanmax(np.abs(shown), initial=0.0)))
        panels.append(Panel(TIME, TORQUE, curves, method_label(name)))
    if not panels:
        return
    torque = replace(TORQUE, limits=(-1.05 * largest, 1.05 * largest)) if largest else TORQUE
    panels = [replace(panel, y=torque) for panel in panels]
    beside = ", beside the friction that acted (known only to a simulation)" if left else ""
    if len(left) > 1:  # the residuals of all methods in one panel
        panels.append(Panel(TIME, LEFT, left, "All: friction less compensation"))
        beside += "; last panel: friction less compensation, on a scale of its own"
    yield Figure(
        key="compensation-torque",
        title="Compensation torque",
        caption=f"Drive torque added by each method{beside}.{_chatter_words(windows)}{place.words}",
        alt="Compensation torque over time, one panel per method, square-like with the sign of the "
        "relative rate.",
        panels=tuple(panels),
        thesis=place.numbers.get("torque", ()),
        across=2,
        trials=tuple(i.trial.number for n, i in place.trials.items() if n != "none"),
    )
