"""Conclusions of an excitation test: linearity, and results of a series."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from campaign.estimate import Estimate
from campaign.experiments.responses.sources import Source
from campaign.experiments.responses.tables import distortion_of
from campaign.experiments.shared.conclusion_parts import (
    Part,
    Parts,
    conclusion,
    determined,
    listed,
    setting,
)
from campaign.result import Amount, Conclusion, Finding
from campaign.text import words


def response_conclusion(source: Source, told: Sequence[Part]) -> Conclusion:
    """Over which band the response is known, and what friction adds to it."""
    measured = next(iter(source.responses.values()))
    where: Parts = (*told, ": ") if told else ()
    low, high = float(measured.frequency[0]), float(measured.frequency[-1])
    band: Parts = (setting(low, "Hz"), " to ", setting(high, "Hz"))
    start = "the response of the rate to the drive torque is known from "
    return conclusion(where, start, band, tuple(_distortion(distortion_of(source))))


def _distortion(found: Sequence[Estimate]) -> Iterator[Part]:
    known = [each for each in found if determined(each)]
    if not known:
        return
    parts: list[Parts] = []
    for each in known:
        parity, is_ = each.name.split("_")[0], "" if parts else "is "
        parts.append((f"{parity} distortion {is_}", Amount(each, "percent")))
    yield "; of the rate's RMS, "
    yield from listed(parts)


def dynamics_conclusion(
    found: Sequence[Finding], told: Sequence[Part], period: float
) -> Conclusion:
    """What the series told."""
    where: Parts = (*told, ": ") if told else ()
    items: list[Parts] = []
    for each in found:
        name = words(each.quantity)
        if name.startswith("coulomb"):
            name = f"Coulomb friction{name.removeprefix('coulomb')}"
        elif name.startswith("viscous"):
            name = f"viscous friction{name.removeprefix('viscous')}"
        items.append((f"{name} ", Amount(each.known)))
    return conclusion(where, "the series of ", setting(period, "s"), " tells ", listed(items))
