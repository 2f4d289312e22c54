"""Frequencies at which a measured response needs more points."""

from __future__ import annotations

import numpy as np

from campaign.arrays import Array
from campaign.estimation.frequency_response import Response
from campaign.estimation.servo import characteristics

POINTS = 7
"""Frequencies around each crossing: more than twice as many as a parabola needs."""
GAIN_SHARE = 0.12
"""Half-width around a frequency at -3 dB or 0 dB, relative to it."""
PHASE_SHARE = 0.18
"""Half-width around the phase crossover; larger, because the level changes fast there."""
WIDTHS = 2
"""Number of refined crossings of -3 dB, the lowest first: a resonance may cause several."""
MOST = (WIDTHS + 2) * POINTS
"""Most frequencies of a refinement: around bandwidths and both crossovers."""
NEAREST = 1e-3
"""Relative distance within which a frequency counts as measured already."""


def refinement(closed: Response) -> Array:
    """Frequencies (Hz) to measure in addition to a coarse sweep of a closed loop T, rising, (n,).

    `POINTS` of them, in equal ratios, are around each frequency at which T falls below -3 dB. As
    many are around the gain crossover of L = T / (1 - T) with the phase margin, and around the
    phase crossover with the gain margin, if that is within the sweep. Close crossings of -3 dB and
    0 dB share a band. There are none at crossings that noise hides, and none already measured. Both
    sweeps together are the response to evaluate: with noise of 0.1 to 0.3 % on T, the uncertainty
    of bandwidths of random loops was 0.3 to 1 %.
    """
    loop = characteristics(closed)
    widths = [each.frequency.value for each in loop.crossings if each.level == "-3 dB"]
    centres = widths[:WIDTHS]
    crossover = loop.crossing(loop.phase_margin)
    if crossover is not None and not _served(crossover.frequency.value, centres):
        centres.append(crossover.frequency.value)
    wanted = [_around(centre, GAIN_SHARE) for centre in centres]
    half_turn = loop.crossing(loop.gain_margin)
    if half_turn is not None and not half_turn.extrapolated:
        wanted.append(_around(half_turn.frequency.value, PHASE_SHARE))
    frequencies = np.concatenate([np.empty(0), *wanted])
    apart = np.abs(frequencies[:, None] / closed.frequency - 1.0)
    return np.unique(frequencies[np.all(apart > NEAREST, axis=1)])


def _served(frequency: float, centres: list[float]) -> bool:
    """Whether a frequency lies in the inner half of the band around another center."""
    return any(abs(frequency / centre - 1.0) < 0.5 * GAIN_SHARE for centre in centres)


def _around(centre: float, share: float) -> Array:
    return np.asarray(np.geomspace(centre * (1.0 - share), centre * (1.0 + share), POINTS))
