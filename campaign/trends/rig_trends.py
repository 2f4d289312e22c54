"""Drift, jumps and correlations of a rig's numbers: one family of decisions."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from campaign.archive import RunReader
from campaign.axis_kind import in_axis_terms
from campaign.channels import TEMPERATURE
from campaign.comparison.circumstances import Change as Circumstance
from campaign.errors import UsageError
from campaign.estimate import Estimate
from campaign.estimation.family import RATE, adjusted, level_of
from campaign.estimation.intervals import LEVEL
from campaign.estimation.trends.changes import Change, Jump, change, detectable, jumps_of
from campaign.estimation.trends.scatter import Mixture
from campaign.experiments.interface import Experiment
from campaign.reason import NONE, Cause, Reason
from campaign.trends.covariates import (
    ORDER,
    TIME,
    Covariate,
    covariate_of,
    together,
)
from campaign.trends.members import (
    LEAST,
    Member,
    changes_before,
    members_of,
    with_exchanged,
)
from campaign.trends.models import TrendFit, fit_models
from campaign.trends.series import SAME_IN_ALL, Series, series_of

Array = NDArray[np.float64]

TELLS_A_SHARE = 0.2
"""Half-width of the mean, as a share of it, up to which an effect is told in percent."""
GO_TOGETHER = 0.7
"""Correlation of time and temperature from which on nobody can tell what a number follows."""
WITHIN = (
    "all of this change lies within the interval of each single run; it may be a shared error that "
    "changes with something else, as one parameter's with another's value"
)
TOO_FEW_KNOWN = Cause("covariate of too few runs", "{covariate} is known of {runs} runs: too few")
NOT_VARYING = Cause("constant covariate", "{covariate} does not vary")
NO_CHANGE_MODEL = Cause("no model of changes", "{error}")
TREND, JUMP = "trend", "jump"


class Verdict(StrEnum):
    """What a number comes to."""

    DRIFTS = "drifts"  # or follows, where it is held against something else than time
    JUMPED = "jumped"
    CHANGED = "changed"  # a drift or a jump: the points do not tell which
    NOT_SHOWN = "no trend shown"  # which does not say that there is none
    NOT_JUDGED = "not judged"  # and `reason` says why


@dataclass(frozen=True)
class TrendSeries:
    """One number, and what became of it.

    Attributes:
        x: of its points, in the unit of the covariate.
        change: None where it is not judged, and `reason` says why.
        adjusted: p values adjusted for the family, by `trend` and `jump`; what was not tested is
            missing.
        detectable: the smallest effects that would have been declared with a probability of 80 %,
            by the same names, in the unit of the series.
        jumps: that were declared, in order.
        cancelled: systematic parts that all points have in common.
        notes: what to keep in mind of it.
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
    def p(self) -> dict[str, float]:
        """As they are, by `trend` and `jump`."""
        if self.change is None:
            return {}
        trend, jump = self.change.trend, self.change.jump
        return {
            **({} if trend is None else {TREND: trend.p}),
            **({} if jump is None else {JUMP: jump.p}),
        }

    @property
    def smallest(self) -> float:
        """Of the adjusted p values; 1 where there is none."""
        return min((self.adjusted or {}).values(), default=1.0)

    @property
    def mean(self) -> Estimate:
        """The number in the middle of what was followed, in the unit that is shown."""
        if self.change is None or self.change.trend is None:
            return Estimate.without_interval("mean", math.nan, self.series.display, self.reason)
        known = self.change.trend.at(float(np.mean(self.x)))
        return self.estimate("mean", known, self.series.display)

    @property
    def share(self) -> float:
        """What one unit (as shown) is of the mean's size; NaN where that says nothing."""
        mean = self.mean
        if not mean.half_width < TELLS_A_SHARE * abs(mean.value):
            return math.nan
        return 1.0 / abs(mean.value)

    def estimate(self, name: str, known: Mixture, unit: str, size: float = 1.0) -> Estimate:
        """A number of the series as it is shown, times `size`."""
        own = size * self.series.scale
        value, ends = known.value, known.interval(LEVEL)
        low, high = sorted(end * own for end in ends)
        method = "scatter between runs and its correlation integrated over"
        return Estimate(name, value * own, unit, low, high, LEVEL, method)


@dataclass(frozen=True)
class Trends:
    """All that runs have in common, held against something.

    Attributes:
        followed: what was declared first.
        level: the p value at which one more would have been declared.
        circumstances: what differs between each run and the one before.
        fitted: by method, what was identified of each run.
        notes: of all of it.
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
        """The surest first."""
        return self.of(Verdict.DRIFTS, Verdict.JUMPED, Verdict.CHANGED)

    @property
    def tested(self) -> int:
        """Size of the family."""
        return sum(len(each.p) for each in self.followed)

    @property
    def judged(self) -> int:
        """How many numbers have a verdict."""
        return sum(each.change is not None for each in self.followed)


def follow(
    runs: Sequence[RunReader],
    experiments: Mapping[str, Experiment],
    over: str = TIME,
    known: Mapping[str, Experiment] | None = None,
    models: Sequence[str] = (),
    exchanged: Sequence[tuple[str, Path]] = (),
) -> Trends:
    """Hold the numbers of runs of one rig against time, or something else.

    Args:
        over: `time`, `order`, `temperature`, a tag that has a number, or one of the numbers.
        models: of `known`, those whose parameters are followed as well.
        exchanged: what was exchanged before which run (`with_exchanged`).

    Raises UsageError for runs and names that nothing can be made of.
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
    found = [_followed(each, covariate) for each in series if each is not covariate.of]
    judged, level = _judged(found, ordered=covariate.ordered)
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
        told = tuple(f"{name}: {covariate.name} is not known" for name in missing)
        points = tuple(p for p, k in zip(series.points, known, strict=True) if k)
        series = replace(series, points=points, left_out=(*series.left_out, *told))
        x = x[known]
        if len(points) >= LEAST and np.ptp(series.values) == 0:
            return TrendSeries(series, x, reason=SAME_IN_ALL())
    n = len(x)
    if n < LEAST:
        return TrendSeries(series, x, reason=TOO_FEW_KNOWN(covariate=covariate.name, runs=n))
    if np.ptp(x) <= 1e-9 * np.max(np.abs(x)):
        return TrendSeries(series, x, reason=NOT_VARYING(covariate=covariate.name))
    own, cancelled, unknown = series.own()
    told_of = (in_axis_terms(source, series.points[0].member.sides) for source in unknown)
    notes = [f"not the same in all runs, with no stated uncertainty: {s}" for s in told_of]
    notes += [series.bare] if series.bare else []
    try:
        found = change(x, series.values, own, jumps=covariate.ordered)
    except (ValueError, np.linalg.LinAlgError) as error:
        return TrendSeries(series, x, reason=NO_CHANGE_MODEL(error=str(error)))
    return TrendSeries(series, x, found, cancelled=cancelled, notes=tuple(notes))


def _judged(found: Sequence[TrendSeries], *, ordered: bool) -> tuple[list[TrendSeries], float]:
    """With verdicts: all p values are one family, whichever shape they ask for."""
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
    found = replace(each, verdict=verdict, adjusted=adjusted, detectable=sizes, jumps=jumps)
    declared = verdict is not Verdict.NOT_SHOWN
    notes = (WITHIN, *each.notes) if declared and _within(found) else each.notes
    return replace(found, notes=notes)


def _within(each: TrendSeries) -> bool:
    """Whether all that a number changes by is less than what a single run leaves open of it."""
    if each.series.bare or each.change is None or each.change.trend is None:
        return False
    slope = each.change.trend.slope.value
    sizes = [abs(jump.size.value) for jump in each.jumps] or [abs(slope) * float(np.ptp(each.x))]
    halves = [point.estimate.half_width for point in each.series.points]
    return max(sizes) < float(np.median(halves))


def _imported(members: Sequence[Member], covariate: Covariate) -> Iterator[str]:
    """A note where times are not those of the recordings."""
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
