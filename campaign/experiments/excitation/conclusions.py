"""What excitations come to: how linear the answer was, and what a series told."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from campaign.estimate import Estimate
from campaign.experiments.excitation.account import Dynamics
from campaign.experiments.responses.sources import Source
from campaign.experiments.responses.tables import distortion_of
from campaign.experiments.shared.common import OF_RECORDING
from campaign.experiments.shared.conclusion_parts import (
    Part,
    Parts,
    conclusion,
    determined,
    listed,
    setting,
)
from campaign.result import Amount, Conclusion


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
        parity = each.name.split("_")[0]
        parts.append((Amount(each, "percent"), f" of it is {parity} distortion"))
    yield "; of the rate's RMS, "
    yield from listed(parts)


def dynamics_conclusion(found: Dynamics, told: Sequence[Part], period: float) -> Conclusion:
    """What the series told, and how well it was made for that."""
    where: Parts = (*told, ": ") if told else ()
    items: list[Parts] = []
    for name, each in found.estimates.items():
        words = name.replace("_", " ")
        if words.startswith("coulomb"):
            words = f"Coulomb friction{words.removeprefix('coulomb')}"
        elif words.startswith("viscous"):
            words = f"viscous friction{words.removeprefix('viscous')}"
        items.append((f"{words} ", Amount(each)))
    designed = Estimate.without_interval("designed", found.designed, "", OF_RECORDING())
    reached = Estimate.without_interval("reached", found.fit.likeness, "", OF_RECORDING())
    return conclusion(
        where,
        "the series of ",
        setting(period, "s"),
        " tells ",
        listed(items),
        "; its columns have a condition number of ",
        Amount(reached),
        ", where ",
        Amount(designed),
        " was designed",
    )
