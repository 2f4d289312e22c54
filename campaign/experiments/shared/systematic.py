"""Systematic parts from a bench's own constants.

A torque is a current times the torque constant, and friction is that torque less J times an
acceleration. A bench may state the uncertainty of those constants.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from campaign.estimate import Estimate, Origin, Systematic
from campaign.estimation.intervals import shifted_by
from campaign.experiments.interface import TrialData
from campaign.physics.bench import Bench

TORQUE_CONSTANT = "motor.torque_constant"
INERTIA = "axis.inertia"
SOURCES = {TORQUE_CONSTANT: "torque constant", INERTIA: "inertia"}
"""Name of a constant as the source of a part, by its path in the bench."""


def known_uncertainty(bench: Bench, path: str) -> float | None:
    """Relative standard uncertainty of the bench's value at a dotted path; None: not stated."""
    own = bench.known_uncertainty(path)
    if own is None:
        return None
    value: Any = bench
    for name in path.split("."):
        value = getattr(value, name)
    return own / abs(float(value))


def with_systematic(estimate: Estimate, bench: Bench, path: str, effect: float) -> Estimate:
    """The estimate with the part of one constant of the bench.

    effect: sensitivity dvalue / d ln(constant), in the value's unit. For a torque that follows from
        a current and the torque constant it is the torque itself.
    """
    relative = known_uncertainty(bench, path)
    part = None if relative is None else abs(effect) * relative
    return shifted_by(estimate, SOURCES.get(path, path), part, of_rig=path == TORQUE_CONSTANT)


def shared_parts(found: Iterable[Estimate]) -> tuple[Systematic, ...]:
    """Systematic parts of a mean of estimates: averaging does not reduce them.

    Root mean square of each part over the estimates that state it; unknown if none does.
    """
    sizes: dict[str, list[float]] = {}
    for part in (part for each in found for part in each.systematic):
        own = sizes.setdefault(part.source, [])
        if part.standard_uncertainty is not None:
            own.append(part.standard_uncertainty)
    return tuple(
        Systematic(source, float(np.sqrt(np.mean(np.square(own)))) if own else None)
        for source, own in sizes.items()
    )


SOURCE = "constant of the {} column"


def scale_uncertainty(data: TrialData, channel: str) -> float | None:
    """Relative standard uncertainty of the constant of a column; None: not stated."""
    channels = data.trial.recording.get("channels")
    for each in channels if isinstance(channels, list) else []:
        if isinstance(each, dict) and each.get("name") == channel:
            uncertainty = each.get("relative_uncertainty")
            return float(uncertainty) if isinstance(uncertainty, int | float) else None
    return None


def with_scale(estimate: Estimate, data: TrialData, channel: str) -> Estimate:
    """An estimate proportional to a channel, with the part of that channel's constant."""
    relative = scale_uncertainty(data, channel)
    if relative is None or estimate.origin is Origin.NOT_DETERMINED:
        return estimate
    return shifted_by(estimate, SOURCE.format(channel), abs(estimate.value) * relative, of_rig=True)
