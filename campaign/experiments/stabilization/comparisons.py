"""Ratios of stabilization errors: benefit of a method, cost of a preload."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from campaign.estimation.stabilization_error import decrease, quotient
from campaign.experiments.interface import TrialData, bench_of
from campaign.result import Finding, Value


def preload_of(data: TrialData) -> dict[str, Value]:
    """The condition `average_friction` (N m), where the bench has an adjustable preload."""
    gear = bench_of(data.trial).gear
    if gear is None or gear.preload is None:
        return {}
    return {"average_friction": gear.preload.torque}


def compared(errors: Sequence[Finding]) -> Iterator[Finding]:
    """Findings that follow from pairs of errors which differ in one condition alone.

    error_reduction: error without compensation over error with it.
    error_decrease: share by which a method's error is below that of the method `against`.
    error_growth: error at a raised preload over that at the lowest, same method.
    """
    for one in errors:
        for other in errors:
            if one is other or not one.value > 0 or not other.value > 0:
                continue
            if _only_differ_in("compensation", one, other):
                against = other.conditions["compensation"]
                if against == "none":
                    reduction = quotient("error_reduction", other.known, one.known)
                    yield Finding.of(reduction, one.conditions)
                less = decrease("error_decrease", one.known, other.known)
                yield Finding.of(less, {**one.conditions, "against": against})
            elif _only_differ_in("average_friction", one, other) and _lowest(other, errors):
                growth = quotient("error_growth", one.known, other.known)
                yield Finding.of(growth, one.conditions)


def _only_differ_in(name: str, one: Finding, other: Finding) -> bool:
    """Whether all conditions but `name` (and the swept path behind it) are equal."""

    def rest(finding: Finding) -> dict[str, Value]:
        return {k: v for k, v in finding.conditions.items() if k not in (name, *_BEHIND[name])}

    return one.conditions.get(name) != other.conditions.get(name) and rest(one) == rest(other)


_BEHIND = {"compensation": (), "average_friction": ("bench.gear.preload.torque",)}


def _lowest(finding: Finding, errors: Sequence[Finding]) -> bool:
    here = finding.conditions["average_friction"]
    all_of_them = [e.conditions.get("average_friction") for e in errors]
    return here == min(v for v in all_of_them if isinstance(v, int | float))
