"""Conclusions of a frequency response: bandwidth, margins, elastic mode."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

from campaign.estimate import Estimate
from campaign.experiments.shared.common import loop_words
from campaign.experiments.shared.conclusion_parts import (
    Parts,
    Settings,
    between,
    conclusion,
    determined,
    listed,
    of,
    setting,
    varied,
)
from campaign.result import Amount, Conclusion, Finding, Value

READ = {"bandwidth": "", "phase_margin": "deg", "gain_margin": ""}
"""What is read of a closed loop, with the unit that it is shown in."""
WORDS = {"bandwidth": "bandwidth", "phase_margin": "phase margin", "gain_margin": "gain margin"}


def closed_loop_conclusions(
    findings: Sequence[Finding],
    span: tuple[float, float],
    extrapolated: Collection[str],
    settings: Settings,
) -> tuple[Conclusion, ...]:
    """Of bandwidth and margins by compensation, and of what compensation changes in them.

    Args:
        span: lowest and highest frequency of the sweeps (Hz).
        extrapolated: compensations of which a gain margin lies beyond its sweep.
    """
    read = [each for each in findings if each.quantity in READ]
    if not read:
        return ()
    paths = varied([_but_compensation(each) for each in read])
    swept = ("Swept from ", setting(span[0], "Hz"), " to ", setting(span[1], "Hz"), ", ")
    if paths:
        return tuple(_loops_over_sweep(read, swept, [*paths, "compensation"], settings))
    return tuple(_loops(findings, swept, extrapolated))


def open_loop_conclusions(
    modes: Sequence[Mapping[str, object]], span: tuple[float, float]
) -> tuple[Conclusion, ...]:
    """Of the elastic modes that were found, one row each; a row without a frequency has none."""
    swept: Parts = ("From ", setting(span[0], "Hz"), " to ", setting(span[1], "Hz"))
    told: list[Parts] = []
    for mode in modes[:3]:
        found = [mode.get(name) for name in ("frequency", "antiresonance", "damping_ratio")]
        known = [each for each in found if isinstance(each, Estimate)]
        if len(known) < 3:
            told.append((f"{loop_words(str(mode.get('compensation')))} none shows",))
            continue
        told.append(
            (
                "at ",
                Amount(known[0]),
                ", with an antiresonance at ",
                Amount(known[1]),
                " and a damping ratio of ",
                Amount(known[2]),
            )
        )
    return (conclusion(*swept, " the first elastic mode: ", listed(told, "; ", "; ")),)


def _but_compensation(finding: Finding) -> dict[str, Value]:
    return {k: v for k, v in finding.conditions.items() if k != "compensation"}


def _loops(
    findings: Sequence[Finding], swept: Parts, extrapolated: Collection[str]
) -> Iterator[Conclusion]:
    methods = list(dict.fromkeys(e.conditions["compensation"] for e in findings))
    shown = [name for name in methods if name == "none"] or methods
    changes = [
        (f"{loop_words(name)} ", *listed(moved))
        for name in methods
        if (moved := list(_changes(findings, name)))
    ]
    start = swept
    if changes:
        words = "difference from the loop without compensation: "
        yield conclusion(*start, words, listed(changes, "; ", "; "))
        start = ()
    for name in shown[:2]:
        told = [
            (f"{WORDS[q]} ", Amount(each.known, READ[q]))
            for q in READ
            for each in of(findings, q, compensation=name)
        ]
        yield conclusion(*start, f"the loop {loop_words(name)} has ", listed(told))
        start = ()
    beyond = [loop_words(name) for name in methods if name in extrapolated]
    if beyond and len(shown) == 1:
        loops = listed([(each,) for each in beyond])
        words = "Beyond the sweep, and so extrapolated, are the gain margins of the loop "
        yield conclusion(words, loops)


def _changes(findings: Sequence[Finding], name: Value) -> Iterator[Parts]:
    for quantity, display in READ.items():
        for each in of(findings, f"{quantity}_change", compensation=name):
            yield (f"{WORDS[quantity]} ", Amount(each.known, display), _unsure(each.known))


def _unsure(change: Estimate) -> str:
    """What to say of a change whose interval holds none, or that has no interval."""
    low, high = change.combined
    if not determined(change):
        return ""
    if low is None or high is None:
        return " without an interval" if not change.has_interval else ""
    return " (none that the data show)" if low <= 0 <= high else ""


def _loops_over_sweep(
    read: Sequence[Finding], swept: Parts, paths: Sequence[str], settings: Settings
) -> Iterator[Conclusion]:
    start = swept
    for quantity, display in READ.items():
        own = of(read, quantity)
        if own:
            told = between(own, settings, paths, display)
            yield conclusion(*start, f"the {WORDS[quantity]} of the loops is ", told)
            start = ()
