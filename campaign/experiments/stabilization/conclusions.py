"""Conclusions of a stabilization test: remaining error of each method."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from campaign.estimation.stabilization_error import NO_SCATTER
from campaign.experiments.shared.common import method
from campaign.experiments.shared.conclusion_parts import (
    Parts,
    Settings,
    between,
    conclusion,
    determined,
    ends_of,
    error_words,
    held_at_once,
    listed,
    of,
    of_one_trial,
    one_trial,
    shared,
    shown_by,
    varied,
)
from campaign.result import Amount, Conclusion, Factor, Finding, Value

ERROR, GAIN, GROWTH = "stabilization_error", "error_reduction", "error_growth"
PRELOAD, PRELOAD_PATH = "average_friction", "bench.gear.preload.torque"
"""One and the same number (N m): as a condition of findings, and as it is swept."""
OF_METHOD = ("compensation",)
MOTION = ("motion", "frequency", "acceleration")
ENDED = {
    "limit": "its trial ended at a limit",
    "diverged": "its trial diverged",
    "fault": "a fault ended its trial",
    "interrupted": "its trial was interrupted",
}
NOT_RUN = "it was not executed"
SHIPS = {"ship": "the roll of a ship", "series": "a measured motion"}


def stabilization_conclusions(
    findings: Sequence[Finding],
    settings: Settings,
    ended: Sequence[tuple[Mapping[str, Value], str]] = (),
    high_pass: float = 0.0,
) -> tuple[Conclusion, ...]:
    """Of `stabilization_error` by compensation and place, and of the ratios of such errors.

    ended: conditions and outcome of the trials that did not complete; a method that has no error
        at a place is named with what became of its trial.
    high_pass: through which the bench sees the error (Hz); 0 for none.
    """
    errors = [_told(each) for each in of(findings, ERROR)]
    places = _places(errors)
    if not places:
        return ()
    settings = settings.also(PRELOAD, PRELOAD_PATH)
    gains = [_told(each) for each in of(findings, GAIN)]
    lost = _without_error(errors, ended)
    if len(places) == 1 and all(_rest_of(place) == _rest(places[0][0]) for place, _ in lost):
        told = _at(places[0], gains, high_pass)
        return (conclusion(_condition(errors, settings), ": ", told, _named(lost)),)
    growth = [_told(each) for each in of(findings, GROWTH)]
    return tuple(_over_sweep(errors, places, gains, growth, settings, lost, high_pass))


Lost = Sequence[tuple[Mapping[str, Value], str]]
"""Conditions that have no error, and why."""


def _without_error(errors: Sequence[Finding], ended: Lost) -> Lost:
    """Conditions whose trials all failed, and those that lack at a place where others ran."""
    found = [each.conditions for each in errors]
    lost: list[tuple[Mapping[str, Value], str]] = []
    for conditions, outcome in ended:
        place = dict(conditions)
        if PRELOAD in place:
            place.pop(PRELOAD_PATH, None)
        if place not in found:
            found.append(place)
            lost.append((place, ENDED.get(outcome, NOT_RUN)))
    methods = list(dict.fromkeys(each.get("compensation") for each in found))
    rests = [_rest(place[0]) for place in _places(errors)]
    missing = (
        {"compensation": name, **rest} for rest in rests for name in methods if name is not None
    )
    return [*lost, *((each, NOT_RUN) for each in missing if each not in found)]


def _named(lost: Lost) -> Parts:
    """`; the LuGre model has no error: its trial ended at a limit`, each method once."""
    told: dict[tuple[str, str], int] = {}
    for conditions, why in lost:
        name = conditions.get("compensation")
        words = "the bench without compensation" if name == "none" else method(name)
        told[words, why] = told.get((words, why), 0) + 1
    items = [
        (f"; {words} has no error{f' at {times} places' if times > 1 else ''}: {why}",)
        for (words, why), times in told.items()
    ]
    return listed(items, "", "")


def _told(finding: Finding) -> Finding:
    """The finding without the second name of a condition."""
    if PRELOAD not in finding.conditions:
        return finding
    kept = {name: v for name, v in finding.conditions.items() if name != PRELOAD_PATH}
    return Finding.of(finding.known, kept)


def _rest(finding: Finding) -> dict[str, Value]:
    return _rest_of(finding.conditions)


def _rest_of(conditions: Mapping[str, Value]) -> dict[str, Value]:
    return {name: v for name, v in conditions.items() if name not in OF_METHOD}


def _places(errors: Sequence[Finding]) -> list[list[Finding]]:
    """Errors of one place of the sweep together, each of another method."""
    found: list[list[Finding]] = []
    for each in errors:
        own = next((group for group in found if _rest(group[0]) == _rest(each)), None)
        if own is None:
            found.append([each])
        else:
            own.append(each)
    return found


def _condition(errors: Sequence[Finding], settings: Settings) -> Parts:
    """`At 0.24 Hz, 18 deg/s²`, and what else all errors have in common."""
    common = shared([_rest(each) for each in errors])
    common.pop(PRELOAD, None)  # of the bench as it is
    motion = common.pop("motion", None)
    numbers = tuple((settings.value(n, common.pop(n)),) for n in MOTION[1:] if n in common)
    if motion is not None:
        start: Parts = ("Under ", SHIPS.get(str(motion), str(motion)))
    else:
        start = ("At ", *listed(numbers, last=", ")) if numbers else ("Over the sweep",)
    rest = settings.place(common)
    return (*start, *((", ", *rest) if rest else ()), *one_trial(errors))


def _at(place: Sequence[Finding], gains: Sequence[Finding], high_pass: float) -> Parts:
    """What each method leaves of the error without compensation, at one place."""
    bare = next((e for e in place if e.conditions.get("compensation") == "none"), None)
    methods = [each for each in place if each is not bare]
    if bare is None or not methods:
        named = ((_with(each), " ", Amount(each.known, "mrad")) for each in place)
        alone = "" if bare is not None else "; no trial without compensation says what that gains"
        return ("the ", *error_words(high_pass), " is ", *listed(named), alone)
    without = Amount(bare.known, "mrad")
    items = [
        (_name(each), " leaves ", Amount(each.known, "mrad"), *_factor(each, gains))
        for each in methods
    ]
    start = ("of an ", *error_words(high_pass), " of ", without, " without compensation ")
    return (*start, *listed(items, "; ", "; "))


def _name(finding: Finding) -> str:
    return method(finding.conditions.get("compensation"))


def _with(finding: Finding) -> str:
    bare = finding.conditions.get("compensation") == "none"
    return "without compensation" if bare else f"with {_name(finding)}"


def _factor(finding: Finding, gains: Sequence[Finding]) -> Parts:
    """How many times less than without compensation; nothing where that is not known."""
    own = next((each for each in gains if each.conditions == finding.conditions), None)
    return () if own is None else (", ", Factor(shown_by(own.known), above="less", below="more"))


def _over_sweep(
    errors: Sequence[Finding],
    places: Sequence[Sequence[Finding]],
    gains: Sequence[Finding],
    growth: Sequence[Finding],
    settings: Settings,
    lost: Lost,
    high_pass: float,
) -> Iterator[Conclusion]:
    paths = varied([_rest(place[0]) for place in places])
    bare = of(errors, ERROR, compensation="none")
    reference = bare or errors
    start = _condition(errors, settings)
    ends = ends_of(bare)
    if ends is not None:
        worst = next(place for place in places if ends[1] in place)
        where = {path: ends[1].conditions.get(path) for path in paths}
        alone = _surely_largest(ends[1], bare)
        words = f", where the error is {'' if alone else 'among the '}largest ("
        yield conclusion(start, words, settings.place(where), "): ", _at(worst, gains, high_pass))
        start, high_pass = ("in all",), 0.0  # told once
    said = (", without compensation the " if bare else ", the ", *error_words(high_pass), " is ")
    yield conclusion(start, said, between(reference, settings, paths, "mrad"), _named(lost))
    if growth:
        yield conclusion(_growth(growth, paths, settings))
        return
    known = [each for each in gains if determined(each.known)]
    least = min(known, key=lambda each: each.value, default=None)
    told = [_rest(ends[1])] if ends is not None else []
    if least is not None and _rest(least) not in told:
        yield conclusion(_least(least, len(known), errors, paths, settings))


def _surely_largest(largest: Finding, errors: Sequence[Finding]) -> bool:
    """Whether no other interval reaches the largest error's; where nothing scatters, by value."""
    others = [each.known for each in errors if each is not largest]
    if all(each.reason in NO_SCATTER for each in (largest.known, *others)):
        return all(each.value < largest.value for each in others)
    low = largest.known.combined[0]
    if low is None or of_one_trial(largest.known):
        return False
    tops = [each.combined[1] for each in others]
    return not any(map(of_one_trial, others)) and all(t is not None and t < low for t in tops)


def _least(
    least: Finding,
    count: int,
    errors: Sequence[Finding],
    paths: Sequence[str],
    settings: Settings,
) -> Parts:
    """The method and place that gain least: picked from `count`, and so with a wider interval."""
    own = next(each for each in errors if each.conditions == least.conditions)
    rest = _rest(own)
    bare = next(
        each
        for each in errors
        if each.conditions.get("compensation") == "none" and _rest(each) == rest
    )
    where: Mapping[str, Value] = {path: rest.get(path) for path in paths}
    factor = Factor(held_at_once(shown_by(least.known), count), above="less", below="more")
    return (
        "The smallest ratio of all is that of ",
        _name(own),
        " (",
        *settings.place(where),
        "): ",
        Amount(own.known, "mrad"),
        " of ",
        Amount(bare.known, "mrad"),
        ", ",
        factor,
    )


def _growth(growth: Sequence[Finding], paths: Sequence[str], settings: Settings) -> Parts:
    """What a raised preload does to the error of each method, at the highest of all preloads."""
    top = max(_number(each.conditions[PRELOAD]) for each in growth)
    shown = [each for each in growth if _number(each.conditions[PRELOAD]) == top]
    others = {path: shown[0].conditions.get(path) for path in paths if path != PRELOAD}
    shown = [e for e in shown if all(e.conditions.get(p) == v for p, v in others.items())]
    items = [
        (_with(each), " ", Factor(shown_by(each.known), above="more", below="less"))
        for each in shown
    ]
    where = (" (", *settings.place(others), ")") if others else ()
    return (
        "The error at an average friction of ",
        settings.value(PRELOAD, top),
        ", against that at the lowest",
        *where,
        ": ",
        *listed(items, "; ", "; "),
    )


def _number(value: Value) -> float:
    return float(value) if isinstance(value, int | float) else 0.0
