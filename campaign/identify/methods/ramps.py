"""Torque ramps: the interfaces of friction that slip one after the other, and their stiffness.

Small motions show the sum over all interfaces before any of them slips. A ramp up to sliding goes
on to where the weaker ones have slipped, and so shows what the strongest has by itself, and how
much of the torque is the others'. Damping it does not show: nothing is fast on a ramp.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

from campaign.channels import DRIVE_TORQUE, GYRO_RATE
from campaign.errors import ArchiveError
from campaign.estimate import Estimate
from campaign.estimation.intervals import of_repeats
from campaign.experiments.breakaway.experiment import EXPERIMENT as RAMP
from campaign.experiments.breakaway.experiment import curve_of
from campaign.experiments.breakaway.means import mean
from campaign.experiments.interface import Model, TestData, TrialData, measured, metrics
from campaign.experiments.preparing.unusable import not_measured, notes_on
from campaign.options import Options
from campaign.parameter import Identified, Parameter
from campaign.reason import Cause
from campaign.result import Amount, Cell, Column, Conclusion, Finding, RecordingDoubt, Result, Table

BREAKAWAY = "breakaway_torque"
STRONGEST = "strongest_stiffness"
WEAKER = "weaker_share"
OF_ONE_RAMP = Cause("scatter of ramps", "its ramps scatter")
OF_A_RAMP = {BREAKAWAY: BREAKAWAY, STRONGEST: "bristle_stiffness"}
"""Numbers of the rig by what an analysis of one ramp calls them."""
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


class RampsOptions(Options):
    """Ramps have no options of their own: those of their trials say it all."""


def usable(trials: Sequence[TrialData]) -> tuple[Sequence[TrialData], str]:
    """Trials of `breakaway` with torque and rate, or why there are none."""
    needed = {DRIVE_TORQUE, GYRO_RATE}
    found = [t for t in trials if t.trial.kind == RAMP.name and needed <= t.channel_names()]
    why = f"no trial of {RAMP.name} has {DRIVE_TORQUE} and {GYRO_RATE}"
    return found, "" if found else why


def _analyse(data: TestData) -> Result:
    found: dict[str, list[Estimate]] = {name: [] for name in OF_A_RAMP}
    shares: list[float] = []
    doubts: list[RecordingDoubt] = []
    rows: list[dict[str, Cell]] = []
    for trial in data.trials:
        try:
            own = metrics(trial, partial(measured, RAMP))
            share = _weaker_share(trial, own)
        except ArchiveError:
            raise
        except (Exception, SystemExit) as error:  # noqa: BLE001 - of one ramp, whatever it is
            doubts.append(not_measured(trial.trial, error))
            continue
        for name, metric in OF_A_RAMP.items():
            found[name] += [own[metric]] if metric in own else []
        shares += [] if share is None else [share]
        shown = {name: own.get(metric) for name, metric in OF_A_RAMP.items()}
        rows.append({"trial": trial.trial.number, **shown, WEAKER: share})
    notes = list(notes_on(doubts, len(data.trials)))
    if not found[BREAKAWAY]:
        raise ValueError("; ".join(note.rstrip(".") for note in notes) or "no ramp shows breakaway")
    told = tuple(_parameters(found, shares, notes))
    return Result(
        tables=(_table(rows),),
        findings=tuple(Finding.of(each.estimate, {}) for each in told),
        notes=tuple(notes),
        conclusions=tuple(_conclusions({e.estimate.name: e.estimate for e in told})),
        identified=Identified(
            told,
        ),
    )


def _weaker_share(trial: TrialData, own: dict[str, Estimate]) -> float | None:
    """Share of the torque that a ramp's weaker interfaces carry: 0 where it shows only one."""
    if OF_A_RAMP[STRONGEST] not in own:
        return None
    interfaces = curve_of(trial, own[BREAKAWAY].value).interfaces
    return sum(each.torque for each in interfaces[1:]) / sum(each.torque for each in interfaces)


def _parameters(
    found: dict[str, list[Estimate]], shares: Sequence[float], notes: list[str]
) -> Iterator[Parameter]:
    for name, metric in OF_A_RAMP.items():
        if found[name]:
            one = mean(metric, found[name])
            yield Parameter(replace(one, name=name), MEANINGS[name], advice=ADVICE[name])
    seen = [share for share in shares if share > 0.0]
    if 0 < len(seen) < len(shares):
        notes.append(
            f"{len(seen)} of {len(shares)} ramps show that some interfaces slip before the others; "
            "that share is not told, since the other ramps do not."
        )
    elif seen:
        share = of_repeats(WEAKER, seen, "", "ramps")
        yield Parameter(share, MEANINGS[WEAKER], "percent", advice=ADVICE[WEAKER])


def _table(rows: Sequence[dict[str, Cell]]) -> Table:
    return Table(
        "ramps",
        "What each ramp shows",
        (
            Column("trial", "Trial", exact=True),
            Column(BREAKAWAY, "Breakaway torque", "N m", "N m"),
            Column(STRONGEST, "Stiffness of the strongest interface", "N m/rad", "N m/rad"),
            Column(WEAKER, "Share of weaker ones", "", "percent", reason=OF_ONE_RAMP()),
        ),
        tuple(rows),
        note="Of a ramp that shows one interface alone the share of weaker ones is 0.",
    )


def _conclusions(told: dict[str, Estimate]) -> Iterator[Conclusion]:
    if STRONGEST in told and WEAKER in told:
        yield Conclusion(
            (
                "On ramps the interface that carries most has a stiffness of ",
                Amount(told[STRONGEST]),
                "; others, which carry ",
                Amount(told[WEAKER], "percent"),
                " of the torque, have slipped before.",
            )
        )


METHOD = Model(
    name="ramps",
    summary="stiffness of the interface that slips last, and what the others carry, from ramps",
    options=RampsOptions,
    suits=usable,
    analyse=_analyse,
)
