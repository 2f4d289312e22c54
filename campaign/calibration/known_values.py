"""What a calibration determines of the bench: cells, intervals, correlations."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from itertools import combinations
from typing import Any

from campaign.calibration.outcome import CalibrationOutcome
from campaign.calibration.space import Parameter

LEAST_CORRELATION = 0.1
"""below which two values count as told apart."""


def known_entries(
    outcome: CalibrationOutcome, fitted: Iterable[str], document: str
) -> dict[str, Any]:
    """Entries of a bench's table `known`, as TOML has them.

    Every fitted value has an entry: one that the cells do not determine has no interval, and takes
    away the one that an earlier calibration left there.

    Args:
        fitted: the cells, as a bench names them.
        document: whose cells they are, as the bench names it.
    """
    entries: dict[str, Any] = {"document": document, "fitted": list(fitted)}
    entries["values"] = dict(_values(outcome))
    pairs = list(_correlations(outcome))
    return {**entries, "correlations": pairs} if pairs else entries


def _values(outcome: CalibrationOutcome) -> Iterator[tuple[str, dict[str, Any]]]:
    for index, parameter in enumerate(outcome.problem.space.parameters):
        ends = [parameter.unknown.value(end) for end in _ends(outcome, index)]
        for path, factor in parameter.fields:
            entry: dict[str, Any] = {"origin": "fitted"}
            if ends:
                low, high = sorted(factor * end for end in ends)
                entry = {"interval": [parameter.text(low), parameter.text(high)], **entry}
            yield path, entry


def _ends(outcome: CalibrationOutcome, index: int) -> tuple[float, ...]:
    """Of the 95 % interval, in shares of the range; empty where the cells determine nothing.

    It holds wherever parameters are that ended at a bound.
    """
    certainty = outcome.uncertainty
    if certainty is None or certainty.bound[index] or certainty.open[index]:
        return ()
    ends = float(certainty.low[index]), float(certainty.high[index])
    return ends if all(map(math.isfinite, ends)) else ()


def _correlations(outcome: CalibrationOutcome) -> Iterator[list[Any]]:
    """Pairs of paths whose errors go together; fields of one parameter do so wholly."""
    certainty = outcome.uncertainty
    if certainty is None:
        return
    fields = [
        (index, path, factor)
        for index, parameter in enumerate(outcome.problem.space.parameters)
        for path, factor in _determined(outcome, index, parameter)
    ]
    for (i, one, first), (j, other, second) in combinations(fields, 2):
        share = float(certainty.correlation[i, j]) * math.copysign(1.0, first * second)
        if math.isfinite(share) and abs(share) >= LEAST_CORRELATION:
            yield [one, other, round(min(1.0, max(-1.0, share)), 3)]


def _determined(
    outcome: CalibrationOutcome, index: int, parameter: Parameter
) -> tuple[tuple[str, float], ...]:
    return parameter.fields if _ends(outcome, index) else ()
