"""Whether intervals hold the truth as often as they say: counted, pooled by parameter, judged."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from campaign.estimate import Origin
from campaign.result import Finding
from tests.coverage.bounds import bound_of
from tests.coverage.laboratory import Run
from tests.coverage.truths import IN_TORQUE, Truths

CLAIMED = 0.90
"""Coverage of which a parameter must not be significantly short."""
TOO_WIDE = 0.99
STATED = frozenset({"torque constant", "inertia"})
"""Sources of systematic parts that are not judged: what is found is put right by the true ones."""
LEVEL = 0.01
"""of the Holm procedure over all parameters."""
HIDDEN = 0.10
"""Share of cases that may be `not determined` although the bound is below a tenth of the value."""


@dataclass(frozen=True)
class Entry:
    """One estimate beside its truth, both SI; torques are by the true torque constant.

    Attributes:
        parameter: quantity, and what tells it from others of its name.
        low, high: of the interval with all its systematic parts but those of what was stated.
        held: whether that holds the truth; None without one.
        combined: the same of the interval as it is reported.
        bias: distance from the truth over the half-width.
        half_width: over the absolute true value.
        bound: Cramer-Rao bound of the standard deviation over the absolute true value, or None.
    """

    bench: int
    draw: int
    kind: str
    parameter: str
    truth: float
    value: float | None
    low: float | None
    high: float | None
    held: bool | None
    combined: bool | None
    bias: float | None
    half_width: float | None
    bound: float | None
    determined: bool


def entries(run: Run, draw: int) -> list[Entry]:
    """Every finding of a run that has a truth and is one of those that are judged."""
    truths = Truths(run)
    found = []
    for finding in run.result.findings:
        parameter = parameter_of(finding)
        true = truths.of(finding) if parameter else None
        if true is not None and math.isfinite(true):
            found.append(_entry(run, draw, parameter, finding, true, truths.by_stated(finding)))
    return found


def parameter_of(finding: Finding) -> str:
    """The name under which a finding is pooled; empty for one that is not judged.

    Directions stand apart: both of one bench share its scatter. A mean over repeats stands for the
    single ones that it is made of.
    """
    told = finding.conditions
    if told.get("exponent", "free") != "free":
        return f"{finding.quantity} with delta = {told['exponent']}, {told['direction']}"
    if told.get("measurement") is not None:
        return f"{finding.quantity}, one ramp" if told["measurement"] == 1 else ""
    direction = told.get("direction")
    if told.get("statistic") is not None:
        ways = "" if direction is None else f", {direction}"
        return "" if direction == "both" else f"{finding.quantity}, mean of ramps{ways}"
    return f"{finding.quantity}, {direction}" if direction else finding.quantity


def _entry(
    run: Run, draw: int, parameter: str, finding: Finding, true: float, by_stated: float | None
) -> Entry:
    """`by_stated`: what scatter alone leaves between found and true, where that is not `true`."""
    estimate = finding.known
    ratio = run.case.torque_ratio if finding.quantity in IN_TORQUE else 1.0
    determined = estimate.origin is not Origin.NOT_DETERMINED and math.isfinite(estimate.value)
    value = estimate.value * ratio if determined else None
    known = tuple(part for part in estimate.systematic if part.source not in STATED)
    low, high = (_times(end, ratio) for end in replace(estimate, systematic=known).combined)
    closed = low is not None and high is not None
    half = 0.5 * (high - low) if closed and low is not None and high is not None else None
    bound = bound_of(run, finding)
    reckoned = true if by_stated is None else by_stated
    return Entry(
        run.case.number,
        draw,
        run.kind,
        parameter,
        true,
        value,
        low,
        high,
        held=_holds(low, high, reckoned),
        combined=_holds(*estimate.combined, true),
        bias=(value - reckoned) / half if half and value is not None else None,
        half_width=half / abs(true) if half is not None and true else None,
        bound=None if bound is None or not true else bound / abs(true),
        determined=determined,
    )


def _times(end: float | None, ratio: float) -> float | None:
    return None if end is None else end * ratio


def _holds(low: float | None, high: float | None, true: float) -> bool | None:
    """Whether an interval, or a bound, is right; None where there is neither."""
    if low is None and high is None:
        return None
    return (low is None or low <= true) and (high is None or true <= high)


@dataclass(frozen=True)
class Pooled:
    """All of one parameter.

    Attributes:
        held, of: how many intervals hold, of how many.
        reported: the same of the intervals as they are reported.
        p_value: one-sided, of so few holding if 90 % did.
        short: whether that is rejected (Holm over all parameters).
        median_bias: of the distance from the truth over the half-width.
        wider: median of the half-width over that of the Cramer-Rao bound, 1.96 times it.
        hidden: `not determined` of those whose bound is below a tenth of the value, and how many.
    """

    kind: str
    parameter: str
    held: int
    of: int
    reported: tuple[int, int]
    without: int
    undetermined: int
    p_value: float
    short: bool
    median_bias: float | None
    half_width: float | None
    wider: float | None
    hidden: tuple[int, int]

    @property
    def coverage(self) -> float:
        return self.held / self.of if self.of else math.nan

    @property
    def interval(self) -> tuple[float, float]:
        """Of the coverage, 95 % (Clopper and Pearson, Biometrika 26 (1934))."""
        from scipy.stats import beta

        if not self.of:
            return 0.0, 1.0
        low = float(beta.ppf(0.025, self.held, self.of - self.held + 1)) if self.held else 0.0
        more = self.of - self.held
        return low, float(beta.ppf(0.975, self.held + 1, more)) if more else 1.0

    @property
    def too_wide(self) -> bool:
        """Whether even the lowest coverage that fits is above 99 %, or the median width says so."""
        return self.of >= 20 and self.held == self.of and self.interval[0] > 0.9


def pooled(found: Iterable[Entry]) -> tuple[Pooled, ...]:
    """By parameter, judged with Holm's procedure (Scandinavian J. Statistics 6 (1979))."""
    groups: dict[tuple[str, str], list[Entry]] = {}
    for entry in found:
        groups.setdefault((entry.kind, entry.parameter), []).append(entry)
    values = {key: _p_value(own) for key, own in groups.items()}
    judged = [key for key, own in groups.items() if any(e.held is not None for e in own)]
    rejected = holm({key: values[key] for key in judged}, LEVEL)
    return tuple(
        _pool(kind, parameter, own, values[kind, parameter], (kind, parameter) in rejected)
        for (kind, parameter), own in sorted(groups.items())
    )


def holm(p_values: Mapping[Any, float], level: float) -> frozenset[Any]:
    """The hypotheses that are rejected at a familywise `level`."""
    ordered = sorted(p_values, key=lambda key: p_values[key])
    rejected = []
    for place, key in enumerate(ordered):
        if p_values[key] > level / (len(ordered) - place):
            break
        rejected.append(key)
    return frozenset(rejected)


def _p_value(own: Sequence[Entry]) -> float:
    from scipy.stats import binom

    judged = [entry.held for entry in own if entry.held is not None]
    return float(binom.cdf(sum(judged), len(judged), CLAIMED)) if judged else 1.0


def _pool(kind: str, parameter: str, own: Sequence[Entry], p_value: float, short: bool) -> Pooled:
    judged = [entry for entry in own if entry.held is not None]
    telling = [entry for entry in own if entry.bound is not None and entry.bound < HIDDEN]
    return Pooled(
        kind,
        parameter,
        held=sum(bool(entry.held) for entry in judged),
        of=len(judged),
        reported=(
            sum(bool(entry.combined) for entry in judged),
            sum(entry.combined is not None for entry in judged),
        ),
        without=sum(entry.held is None and entry.determined for entry in own),
        undetermined=sum(not entry.determined for entry in own),
        p_value=p_value,
        short=short,
        median_bias=_median(entry.bias for entry in judged),
        half_width=_median(entry.half_width for entry in judged),
        wider=_median(
            entry.half_width / (1.96 * entry.bound)
            for entry in judged
            if entry.bound and entry.half_width is not None
        ),
        hidden=(sum(not entry.determined for entry in telling), len(telling)),
    )


def _median(values: Iterable[float | None]) -> float | None:
    there = [value for value in values if value is not None]
    return float(np.median(there)) if there else None


def as_tree(entry: Entry) -> dict[str, Any]:
    return asdict(entry)
