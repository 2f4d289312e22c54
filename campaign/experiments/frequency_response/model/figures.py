"""Figures of identified responses with their fits and closed loops."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from campaign.arrays import Array, ComplexArray
from campaign.estimation.frequency.two_mass_model import Side
from campaign.experiments.frequency_response.figures import closed_loop_figures
from campaign.experiments.frequency_response.model.frequency_fit import FrequencyFit, Masses
from campaign.experiments.frequency_response.model.tables import drive_name
from campaign.experiments.responses.figures import (
    FittedResponse,
    coherence_figure,
    response_figures,
)
from campaign.result import Figure, Mark

FINE = 800
"""Frequencies at which a fitted function is drawn."""


def figures(found: Sequence[FrequencyFit], masses: Masses) -> Iterator[Figure]:
    """All of them, the most telling first."""
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
        margins = [told for _, loop, told in loops if loop is not None]
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
