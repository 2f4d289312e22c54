"""Conclusions of a sensitivity study: required accuracy of each parameter."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from campaign.estimate import Estimate
from campaign.experiments.shared.common import method
from campaign.experiments.shared.conclusion_parts import (
    Parts,
    conclusion,
    determined,
    error_words,
    listed,
    of,
    setting,
)
from campaign.result import Amount, Conclusion, Finding

THRESHOLD = "sensitivity_threshold"


def sensitivity_conclusions(
    findings: Sequence[Finding],
    limit: float,
    symbols: Mapping[str, str],
    high_pass: float = 0.0,
) -> tuple[Conclusion, ...]:
    """Of the change of each parameter that is too much, and of the error with the model as it is.

    Args:
        limit: the error that counts as too much (rad).
        symbols: of the parameters, by their name.
        high_pass: through which the bench sees the error (Hz); 0 for none.
    """
    (unchanged, *_) = of(findings, "stabilization_error")
    told = unchanged.conditions
    start: Parts = (
        "At ",
        *(setting(_number(told["frequency"]), "Hz"), ", "),
        *(setting(_number(told["acceleration"]), "rad/s^2", "deg/s^2"), ", "),
    )
    model, most = method(told["compensation"]), setting(limit, "rad", "mrad")
    found = of(findings, THRESHOLD)
    passed = [e for e in found if e.known.kind == "number" and determined(e.known)]
    words = error_words(high_pass)
    as_it_is: Parts = (" leaves an ", *words, " of ", Amount(unchanged.known, "mrad"))
    if not passed or all(each.value == 0 for each in found):
        counts: Parts = ("; more than ", most, " counts as too much")
        return (
            conclusion(*start, f"{model} as it is", as_it_is, counts),
            *_untold(found, symbols),
        )
    passed.sort(key=lambda each: each.value)
    rest = [each for each in found if each not in passed]
    return (
        conclusion(
            *start,
            f"the smallest change of a parameter with which {model} leaves an ",
            *(*words, " of more than ", most, ", which counts as too much: "),
            *(_each(passed, symbols), _order(passed, found, symbols)),
        ),
        *_not_reached(rest, symbols),
        conclusion("As it is the model leaves ", Amount(unchanged.known, "mrad")),
    )


def _untold(found: Sequence[Finding], symbols: Mapping[str, str]) -> Iterator[Conclusion]:
    """Why no change of a parameter is told."""
    if not found:
        yield conclusion("No threshold: it needs every trial")
    elif all(each.value == 0 for each in found):
        yield conclusion("That is too much already: how far a parameter may be off has no meaning")
    else:
        yield from _not_reached(found, symbols)


def _not_reached(found: Sequence[Finding], symbols: Mapping[str, str]) -> Iterator[Conclusion]:
    if found:
        yield conclusion("Too much was not reached by changing ", _each(found, symbols))


def _each(found: Sequence[Finding], symbols: Mapping[str, str]) -> Parts:
    return listed((f"{_symbol(e, symbols)} by ", Amount(e.known, "percent")) for e in found)


def _order(passed: Sequence[Finding], found: Sequence[Finding], symbols: Mapping[str, str]) -> str:
    """Which parameter matters most, if the intervals say so."""
    first = _symbol(passed[0], symbols)
    alike = [
        _symbol(each, symbols)
        for each in found
        if each is not passed[0] and not _surely_below(passed[0].known, each.known)
    ]
    if not alike:
        return f": {first} matters most"
    return f"; whether {first} or {' or '.join(alike)} matters most, the intervals leave open"


def _surely_below(one: Estimate, other: Estimate) -> bool:
    """Whether both intervals lie apart; without an interval nobody can be sure."""
    high, low = one.combined[1], other.combined[0]
    return high is not None and low is not None and high < low


def _symbol(finding: Finding, symbols: Mapping[str, str]) -> str:
    name = str(finding.conditions["parameter"])
    return symbols.get(name, name.replace("_", " "))


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else 0.0
