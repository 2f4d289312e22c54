"""Parameters from ramps: breakaway, and interfaces that slip one after the other.

Small motions show the sum over all interfaces before any of them slips. A ramp up to sliding goes
on to where the weaker ones have slipped, and so shows what the strongest has by itself, and how
much of the torque is the others'. Damping it does not show: nothing is fast on a ramp.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from campaign.estimation.intervals import of_repeats, shifted_by
from campaign.estimation.presliding import Presliding
from campaign.experiments.breakaway.means import CAUSES, Ramps, means_of
from campaign.experiments.interface import TrialData
from campaign.parameter import Parameter

BREAKAWAY, STRONGEST = "breakaway_torque", "strongest_stiffness"
WEAKER = "weaker_share"
OF_RAMPS = {BREAKAWAY: BREAKAWAY, STRONGEST: "bristle_stiffness"}
"""Numbers of the rig by the quantity that the ramps measure."""
MEANINGS = {
    BREAKAWAY: "Torque at which the load begins to slide.",
    STRONGEST: "Stiffness of the interface that carries the largest torque, by itself.",
    WEAKER: "Share of the torque that other interfaces carry, which slip before that one.",
}
ADVICE = {
    BREAKAWAY: "more ramps",
    STRONGEST: "more ramps, and faster ones where noise hides the beginning",
    WEAKER: "more, and slower, ramps",
}


def parameters_of(
    groups: Sequence[Ramps], curve_of: Callable[[TrialData, float], Presliding], notes: list[str]
) -> Iterator[Parameter]:
    """Of all ramps together, those of both directions where there are two.

    curve_of: the curve of bristles of a ramp that slides at a torque (N m).
    """
    ramps = Ramps(
        tuple(item for each in groups for item in each.trials),
        tuple(place for each in groups for place in each.places),
        tuple(own for each in groups for own in each.found),
    )
    if not ramps.found:
        return
    mean, *_ = means_of(ramps).values()
    for name, quantity in OF_RAMPS.items():
        if quantity in mean:
            yield Parameter(replace(mean[quantity], name=name), MEANINGS[name], advice=ADVICE[name])
    shares = list(_weaker_shares(ramps, curve_of, notes))
    seen = [share for share in shares if share > 0.0]
    if 0 < len(seen) < len(shares):
        notes.append(
            f"{len(seen)} of {len(shares)} ramps show that some interfaces slip before the others; "
            "that share is not stated, since the other ramps do not."
        )
    elif seen:
        share = of_repeats(WEAKER, seen, "", "ramps")
        for cause in CAUSES:  # at 2 N m/s the interval alone held in 31 of 40 draws
            share = shifted_by(share, cause, None)
        yield Parameter(share, MEANINGS[WEAKER], "percent", advice=ADVICE[WEAKER])


def _weaker_shares(
    ramps: Ramps, curve_of: Callable[[TrialData, float], Presliding], notes: list[str]
) -> Iterator[float]:
    """Share of the torque that each ramp's weaker interfaces carry: 0 where it shows only one."""
    for item, own in zip(ramps.trials, ramps.found, strict=True):
        if OF_RAMPS[STRONGEST] not in own:
            continue
        try:
            torques = [e.torque for e in curve_of(item, own[BREAKAWAY].value).interfaces]
        except (ValueError, ArithmeticError) as error:  # of metrics that another version archived
            notes.append(f"{item.trial.label} shows no interfaces: {error}.")
            continue
        yield sum(torques[1:]) / sum(torques)
