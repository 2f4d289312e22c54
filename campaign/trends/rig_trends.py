"""Drifts and jumps of a rig's numbers, as one family of decisions."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from campaign.archive.reading.run_reader import RunReader
from campaign.axis_kind import in_axis_terms
from campaign.channels import TEMPERATURE
from campaign.comparison.circumstances import Change as Circumstance
from campaign.errors import UsageError
from campaign.estimate import Estimate
from campaign.estimation.family import RATE, adjusted, level_of
from campaign.estimation.intervals import LEVEL
from campaign.estimation.trends.changes import Change, Jump, Trend, change, detectable, jumps_of
from campaign.estimation.trends.scatter import Mixture
from campaign.experiments.interface import Experiment
from campaign.reason import NONE, Cause, Reason
from campaign.trends.covariates import ORDER, TIME, Covariate, covariate_of, together
from campaign.trends.members import LEAST, Member, changes_before, members_of, with_exchanged
from campaign.trends.models import TrendFit, fit_models
from campaign.trends.series import SAME_IN_ALL, Series, series_of

Array = NDArray[np.float64]

TELLS_A_SHARE = 0.2
"""Largest relative half-width of the mean for effects in percent."""
GO_TOGETHER = 0.7
"""Correlation of time and temperature above which their effects cannot be separated."""
WITHIN = (
    "all of this change lies within the interval of each single run; it may be a shared error that "
    "changes with something else, as one parameter's with another's value"
)
TOO_FEW_KNOWN = Cause("covariate of too few runs", "{covariate} is known of {runs} runs: too few")
NOT_VARYING = Cause("constant covariate", "{covariate} does not vary")
NO_CHANGE_MODEL = Cause("no model of changes", "{error}")
TREND, JUMP = "trend", "jump"


class Verdict(StrEnum):
    """Verdict on a number."""

    DRIFTS = "drifts"  # or depends on another covariate than time
    JUMPED = "jumped"
    CHANGED = "changed"  # a drift or a jump: the points do not decide
    NOT_SHOWN = "no trend shown"  # does not exclude a trend
    NOT_JUDGED = "not judged"  # `reason` states why


@dataclass(frozen=True)
class TrendSeries:
    """One number and its verdict.

    Attributes:
        x: values of the covariate at its points, in the unit of the covariate.
        change: trend and jump; None if not judged, with `reason`.
        adjusted: p values adjusted for the family, by `trend` and `jump` if tested.
        detectable: smallest effects that are declared with a probability of 80 %, by `trend` and
            `jump`, in the unit of the series.
        jumps: declared jumps, in order.
        cancelled: systematic parts that all points share.
        notes: limitations.
    """

    series: Series
    x: Array
    change: Change | None = None
    reason: Reason = NONE
    verdict: Verdict = Verdict.NOT_JUDGED
    adjusted: Mapping[str, float] | None = None
    detectable: Mapping[str, float] | None = None
    jumps: tuple[Jump, ...] = ()
    cancelled: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def trend(self) -> Trend | None:
        """Line through the points; None if not judged."""
        return None if self.change is None else self.change.trend

    @property
    def jump(self) -> Jump | None:
        """Most likely jump, declared or not; None without a search."""
        return None if self.change is None else self.change.jump

    @property
    def p(self) -> dict[str, float]:
        """Unadjusted p values, by `trend` and `jump`."""
        changes = {TREND: self.trend, JUMP: self.jump}
        return {name: each.p for name, each in changes.items() if each is not None}

    @property
    def smallest(self) -> float:
        """Smallest adjusted p value; 1 without any."""
        return min((self.adjusted or {}).values(), default=1.0)

    @property
    def mean(self) -> Estimate:
        """Fitted value at the mean of `x`, in the display unit."""
        if self.trend is None:
            return Estimate.without_interval("mean", math.nan, self.series.display, self.reason)
        known = self.trend.at(float(np.mean(self.x)))
        return self.estimate("mean", known, self.series.display)

    @property
    def share(self) -> float:
        """One display unit over the size of the mean; NaN if the mean is too uncertain."""
        mean = self.mean
        if not mean.half_width < TELLS_A_SHARE * abs(mean.value):
            return math.nan
        return 1.0 / abs(mean.value)

    def estimate(self, name: str, known: Mixture, unit: str, size: float = 1.0) -> Estimate:
        """Estimate, in the display unit, of `size` times a mixture in the unit of the series."""
        own = size * self.series.scale
        value, ends = known.value, known.interval(LEVEL)
        low, high = sorted(end * own for end in ends)
        method = "scatter between runs and its correlation integrated over"
        return Estimate(name, value * own, unit, low, high, LEVEL, method)


@dataclass(frozen=True)
class Trends:
    """Trends of the common numbers of runs over a covariate.

    Attributes:
        followed: all numbers, the declared ones first.
        level: p value at which one more number would be declared.
        circumstances: differences of each run from the previous run.
        fitted: parameters of the runs by method.
        notes: limitations of all numbers.
    """

    members: tuple[Member, ...]
    covariate: Covariate
    followed: tuple[TrendSeries, ...]
    level: float
    circumstances: tuple[tuple[Circumstance, ...], ...]
    fitted: tuple[TrendFit, ...] = ()
    notes: tuple[str, ...] = ()

    def of(self, *verdicts: Verdict) -> tuple[TrendSeries, ...]:
        return tuple(each for each in self.followed if each.verdict in verdicts)

    @property
    def declared(self) -> tuple[TrendSeries, ...]:
        """Declared numbers, smallest p value first."""
        return self.of(Verdict.DRIFTS, Verdict.JUMPED, Verdict.CHANGED)

    @property
    def tested(self) -> int:
        """Size of the family: count of p values."""
        return sum(len(each.p) for each in self.followed)

    @property
    def judged(self) -> int:
        """Count of numbers with a verdict."""
        return sum(each.change is not None for each in self.followed)


def follow(
    runs: Sequence[RunReader],
    experiments: Mapping[str, Experiment],
    over: str = TIME,
    known: Mapping[str, Experiment] | None = None,
    models: Sequence[str] = (),
    exchanged: Sequence[tuple[str, Path]] = (),
) -> Trends:
    """Estimate the trends of the numbers of one rig's runs over a covariate.

    Args:
        over: `time`, `order`, `temperature`, a tag with a number, or one of the numbers.
        models: names in `known`, whose parameters are included.
        exchanged: pieces exchanged before a run (`with_exchanged`).

    Raises UsageError for unusable runs and unknown names.
    """
    members = with_exchanged(members_of(runs, experiments), exchanged)
    series = series_of(members)
    fitted: tuple[TrendFit, ...] = ()
    if models and known is not None:
        fitted = fit_models(members, known, models)
        series += [each for one in fitted for each in one.series]
    if not series:
        raise UsageError("the runs found nothing that could be followed")
    covariate = covariate_of(over, members, series)
    followed = [_followed(each, covariate) for each in series if each is not covariate.of]
    judged, level = _judged(followed, ordered=covariate.ordered)
    judged.sort(key=lambda each: (list(Verdict).index(each.verdict) > 2, each.smallest))
    notes = tuple(_notes(members, covariate, series))
    return Trends(members, covariate, tuple(judged), level, changes_before(members), fitted, notes)


def _followed(series: Series, covariate: Covariate) -> TrendSeries:
    x = np.array([covariate.at(point.member, point.test) for point in series.points])
    if series.reason:
        return TrendSeries(series, x, reason=series.reason)
    known = np.isfinite(x)
    if not known.all():
        missing = [p.member.name for p, k in zip(series.points, known, strict=True) if not k]
        missing_texts = tuple(f"{name}: {covariate.name} is not known" for name in missing)
        points = tuple(p for p, k in zip(series.points, known, strict=True) if k)
        series = replace(series, points=points, left_out=(*series.left_out, *missing_texts))
        x = x[known]
        if len(points) >= LEAST and np.ptp(series.values) == 0:
            return TrendSeries(series, x, reason=SAME_IN_ALL())
    n = len(x)
    if n < LEAST:
        return TrendSeries(series, x, reason=TOO_FEW_KNOWN(covariate=covariate.name, runs=n))
    if np.ptp(x) <= 1e-9 * np.max(np.abs(x)):
        return TrendSeries(series, x, reason=NOT_VARYING(covariate=covariate.name))
    own, cancelled, unknown = series.own()
    sources = (in_axis_terms(source, series.points[0].member.sides) for source in unknown)
    notes = [f"not the same in all runs, with no stated uncertainty: {s}" for s in sources]
    notes += [series.bare] if series.bare else []
    try:
        fit = change(x, series.values, own, jumps=covariate.ordered)
    except (ValueError, np.linalg.LinAlgError) as error:
        return TrendSeries(series, x, reason=NO_CHANGE_MODEL(error=str(error)))
    return TrendSeries(series, x, fit, cancelled=cancelled, notes=tuple(notes))


def _judged(found: Sequence[TrendSeries], *, ordered: bool) -> tuple[list[TrendSeries], float]:
    """Series with verdicts, and level; all p values of trends and jumps are one family."""
    tested = [(i, name, p) for i, each in enumerate(found) for name, p in each.p.items()]
    ps = [p for _, _, p in tested]
    level = level_of(ps)
    own: dict[int, dict[str, float]] = {}
    for (i, name, _), p in zip(tested, adjusted(ps), strict=True):
        own.setdefault(i, {})[name] = p
    return [
        each if each.change is None else _with(each, each.change, own[i], level, ordered=ordered)
        for i, each in enumerate(found)
    ], level


def _with(
    each: TrendSeries, change: Change, adjusted: Mapping[str, float], level: float, *, ordered: bool
) -> TrendSeries:
    verdict = Verdict.NOT_SHOWN
    jumps: tuple[Jump, ...] = ()
    if min(adjusted.values()) <= RATE:
        shape = change.shape if ordered and change.jump is not None else "line"
        verdict = {"line": Verdict.DRIFTS, "jump": Verdict.JUMPED}.get(shape, Verdict.CHANGED)
    if verdict is Verdict.JUMPED and change.jump is not None:
        more = jumps_of(each.series.values, each.series.own()[0], level)
        jumps = more or (change.jump,)
    sizes = {}
    if change.trend is not None:
        sizes[TREND] = detectable(change.trend.slope, level)
    if change.jump is not None:
        sizes[JUMP] = detectable(change.jump.clearest, level / change.jump.places)
    with_verdict = replace(each, verdict=verdict, adjusted=adjusted, detectable=sizes, jumps=jumps)
    declared = verdict is not Verdict.NOT_SHOWN
    notes = (WITHIN, *each.notes) if declared and _within(with_verdict) else each.notes
    return replace(with_verdict, notes=notes)


def _within(each: TrendSeries) -> bool:
    """Whether the largest change is below the median half-width of the runs' intervals."""
    if each.series.bare or each.trend is None:
        return False
    slope = each.trend.slope.value
    sizes = [abs(jump.size.value) for jump in each.jumps] or [abs(slope) * float(np.ptp(each.x))]
    halves = [point.estimate.half_width for point in each.series.points]
    return max(sizes) < float(np.median(halves))


def _imported(members: Sequence[Member], covariate: Covariate) -> Iterator[str]:
    """Note on imported runs, because their times are not the times of the recordings."""
    imported = sum(each.run.header.source == "recording" for each in members)
    if covariate.name == TIME and imported:
        yield (
            f"{imported} of the runs were imported: their times are those of the import. "
            'Write when they were recorded into their mappings, as in `tags = ["day = 3"]`, and '
            "follow that (`--over day`), or their order (`--over order`)."
        )


def _notes(
    members: Sequence[Member], covariate: Covariate, series: Sequence[Series]
) -> Iterator[str]:
    yield from _imported(members, covariate)
    if covariate.of is not None:
        yield (
            f"Numbers of one test share its errors, so that another of {covariate.of.test} may "
            "seem to follow this one without having anything to do with it."
        )
    elif covariate.name in (TIME, ORDER, TEMPERATURE):
        name = TEMPERATURE if covariate.ordered else TIME
        try:
            other = covariate_of(name, members, series)
        except UsageError:
            return
        share = together(members, covariate, other)
        if abs(share) > GO_TOGETHER:
            yield (
                f"Time and temperature are correlated in these runs ({share:.2f}): a trend over "
                "one appears as a trend over the other. These runs do not separate them."
            )
