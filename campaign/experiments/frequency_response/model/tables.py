"""Tables and figures of identified responses: orders, modes, margins, two masses."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from campaign.arrays import Array, ComplexArray
from campaign.estimate import Estimate
from campaign.estimation.frequency.drive import TwoMass
from campaign.estimation.frequency.one_inertia import METHOD as RIGID_METHOD
from campaign.estimation.frequency.orders import order_of
from campaign.estimation.frequency.two_mass import METHOD
from campaign.estimation.frequency.two_mass_model import Side
from campaign.experiments.frequency_response.figures import closed_loop_figures
from campaign.experiments.frequency_response.model.frequency_fit import FrequencyFit, Masses
from campaign.experiments.frequency_response.tables import Sweep, margin_tables
from campaign.experiments.responses.figures import (
    FittedResponse,
    coherence_figure,
    response_figures,
)
from campaign.experiments.responses.tables import NAME, SENSOR
from campaign.result import Column, Figure, Mark, Table
from campaign.text import words


def fits_table(found: Sequence[FrequencyFit], masses: Masses) -> Table:
    """Function chosen for each response, and the two masses beside it."""
    rows: list[dict[str, Any]] = []
    for each in found:
        for side, chosen in each.fits.items():
            up, down = order_of(chosen.fit)
            delay = chosen.fit.scatter[-1, -1] ** 0.5
            late = Estimate.without_interval("delay", chosen.fit.delay, "s", chosen.fit.misfit)
            if not chosen.fit.misfit:
                low, high = (chosen.fit.delay + sign * 1.96 * delay for sign in (-1.0, 1.0))
                late = Estimate("delay", chosen.fit.delay, "s", low, high, 0.95)
            rows.append(
                {
                    "source": each.source.name,
                    "side": side,
                    "order": f"{up} / {down}",
                    "excess": chosen.fit.excess,
                    "delay": late,
                    "condition": chosen.fit.condition,
                    "says": str(chosen.fit.misfit) or "fits",
                }
            )
        drive = masses.drive
        if drive is not None and masses.source is each.source:
            sides = ", ".join(masses.places)
            rows.append(
                {
                    "source": each.source.name,
                    "side": sides,
                    "order": drive_name(drive),
                    "excess": drive.excess,
                    "condition": drive.condition,
                    "says": str(drive.misfit) or "fits",
                }
            )
    return Table(
        "functions",
        "Functions fitted, with a delay",
        (
            NAME,
            SENSOR,
            Column("order", "Order", exact=True),
            Column("excess", "Square over expected", exact=True),
            Column("delay", "Delay", "s", "ms"),
            Column("condition", "Condition", exact=True),
            Column("says", "Verdict", exact=True),
        ),
        tuple(rows),
        note="Condition number of the weighted Jacobian with columns of one length: large where "
        "parameters are hardly separated. Order of numerator and denominator by Schwarz' "
        "criterion. A function that leaves more than scatter is a misfit: what follows from it "
        "has no interval.",
    )


def modes_table(found: Sequence[FrequencyFit]) -> Table:
    """Resonances and antiresonances; no rows without any."""
    entries: list[tuple[str, str, str, Estimate, Estimate | None]] = []
    for each in found:
        for side, modes in each.modes.items():
            for mode in modes:
                kind = "antiresonance" if mode.is_zero else "resonance"
                entries.append((each.source.name, side, kind, mode.frequency, mode.damping))
    smooth = "on top of a smooth response"
    for each in found:
        for side, one in each.local.items():
            own, kind = (each.source.name, side), f"resonance, {smooth}"
            entries.append((*own, kind, one.frequency, one.damping_ratio))
            entries.append((*own, f"anti{kind}", one.antiresonance, None))
    names = ("source", "side", "kind", "frequency", "damping")
    return Table(
        "modes",
        "Resonances and antiresonances",
        (
            NAME,
            SENSOR,
            Column("kind", "Kind", exact=True),
            Column("frequency", "Frequency", "Hz", "Hz"),
            Column("damping", "Damping ratio", ""),
        ),
        tuple(dict(zip(names, each, strict=True)) for each in entries),
    )


def loop_tables(found: Sequence[FrequencyFit]) -> Iterator[Table]:
    """Bandwidth and margins of each loop, as of a sweep of sines."""
    loops = [
        Sweep({NAME.name: each.source.name}, "closed", each.source.name, each.source.closed, servo)
        for each in found
        if each.source.closed is not None and (servo := each.margins) is not None
    ]
    if loops:
        yield from margin_tables(loops, (NAME,))


def masses_table(masses: Masses) -> Iterator[Table]:
    """Drive of the response, and of the axis if friction makes it different.

    Nothing if it is no model of the response, and for one inertia without friction's part.
    """
    drive, axis = masses.drive, masses.axis
    if drive is None or axis is None or drive.misfit or (drive.rigid and not masses.is_bent):
        return
    columns: tuple[Column, ...] = (
        Column("motor_inertia", "Driven inertia", "kg m^2", "kg m^2"),
        Column("load_inertia", "Inertia behind the spring", "kg m^2", "kg m^2"),
        Column("total_inertia", "Sum", "kg m^2", "kg m^2"),
        Column("stiffness", "Stiffness", "N m/rad", "N m/rad"),
        Column("damping", "Damping", "N m s/rad", "N m s/rad"),
        Column("resonance", "Resonance", "Hz", "Hz"),
        Column("resonance_damping", "Its damping ratio"),
        Column("antiresonance", "Antiresonance", "Hz", "Hz"),
        Column("inertia_ratio", "Inertia ratio"),
    )
    spring = (
        " A spring that holds the driven inertia is part of the model: friction before it slides."
        if drive.grounded
        else ""
    )
    if drive.rigid:
        columns = tuple(each for each in columns if each.name == "total_inertia")
    rows = {"the axis": axis}
    if masses.is_bent:
        rows = {"the response": drive, **rows}
        spring += (
            " Of the response: at this excitation, by scatter alone. Of the axis: with the "
            "effect of friction, by other excitations or the odd distortion."
        )
    yield Table(
        "one-inertia" if drive.rigid else "two-masses",
        "One inertia" if drive.rigid else "Two inertias on a spring",
        (*columns, Column("of", "Of", exact=True)),
        tuple(
            {**{column.name: each.estimates[column.name] for column in columns}, "of": whose}
            for whose, each in rows.items()
        ),
        note=f"{RIGID_METHOD if drive.rigid else METHOD}.{spring}",
    )


def drive_name(drive: TwoMass) -> str:
    """Name of the fitted drive, in words."""
    return "one inertia" if drive.rigid else "two inertias"


def correlations_table(correlations: Mapping[tuple[str, str], float]) -> Table:
    """Correlations of the two-mass numbers, the largest first; no rows without any."""
    falling = sorted(correlations.items(), key=lambda each: -abs(each[1]))
    return Table(
        "correlations",
        "Correlation of the numbers of the two inertias",
        (
            Column("one", "Number"),
            Column("other", "and"),
            Column("share", "Correlation", exact=True),
        ),
        tuple(
            {"one": words(one), "other": words(other), "share": share}
            for (one, other), share in falling
        ),
        note="By scatter alone: what a wrong torque constant or friction does, moves them as well.",
    )


FINE = 800
"""Frequencies at which a fitted function is drawn."""


def figures(found: Sequence[FrequencyFit], masses: Masses) -> Iterator[Figure]:
    """All figures, the most informative first."""
    sources = [each.source for each in found]
    yield from response_figures(
        sources,
        {
            (index, side): _fitted(each, side, masses)
            for index, each in enumerate(found)
            for side in each.source.responses
        },
    )
    loops = [(each.source.name, each.source.closed, each.margins) for each in found]
    closed = [(name, name, loop) for name, loop, _ in loops if loop is not None]
    if closed:
        margins = [servo for _, loop, servo in loops if loop is not None]
        yield from closed_loop_figures(closed, margins)
    yield coherence_figure(sources)


def _fitted(each: FrequencyFit, side: Side, masses: Masses) -> FittedResponse:
    lines: list[tuple[str, Array, ComplexArray]] = []
    fit = each.fits.get(side)
    if fit is not None:
        label = "rational function" + (", misfit" if fit.fit.misfit else "")
        fine = np.geomspace(fit.fit.lowest, fit.fit.highest, FINE)
        lines.append((label, fine, fit.fit.value(fine)))
    place = masses.places.get(side)
    if masses.drive is not None and masses.source is each.source and place is not None:
        label = drive_name(masses.drive) + (", misfit" if masses.drive.misfit else "")
        measured = each.source.responses[side]
        first = max(masses.lowest, measured.frequency[0])
        fine = np.geomspace(first, measured.frequency[-1], FINE)
        lines.append((label, fine, masses.drive.value(fine, place)))
    modes = [mode for mode in each.modes.get(side, ()) if mode.frequency.has_interval]
    marks = tuple(Mark(f"{mode.frequency.value:.3g} Hz", x=mode.frequency.value) for mode in modes)
    return FittedResponse(lines, marks, None if fit is None else fit.fit.value)
