"""Frequencies at which a measured response needs more points."""

from __future__ import annotations

import numpy as np

from campaign.arrays import Array
from campaign.estimation.frequency_response import Response
from campaign.estimation.servo import characteristics

POINTS = 7
"""around each crossing: a parabola, and more than as many points again to judge it by."""
GAIN_SHARE = 0.12
"""of a frequency at -3 dB or 0 dB: how far to both sides of it is looked."""
PHASE_SHARE = 0.18
"""of the phase crossover: likewise; its margin is read from a level that changes fast."""
WIDTHS = 2
"""Crossings of -3 dB that are looked at, the lowest first: a resonance may make several."""
MOST = (WIDTHS + 2) * POINTS
"""Frequencies of a refinement: around bandwidths and both crossovers."""
NEAREST = 1e-3
"""Relative distance at which a frequency counts as measured already."""


def refinement(closed: Response) -> Array:
    """Frequencies (Hz), rising, that a coarse sweep of a closed loop T lacks; shape (n,).

    `POINTS` of them, in equal ratios, around each frequency at which T falls below -3 dB, and as
    many around the gain crossover of L = T / (1 - T) that leaves the phase margin, and around the
    phase crossover that leaves the gain margin, where it lies within the sweep. One band serves
    -3 dB and 0 dB where they are close. None where noise leaves open whether there is a crossing,
    and none that was measured already. Both sweeps together make the response to evaluate; with
    0.1 to 0.3 % of noise on T, bandwidths of random loops were then known to 0.3 to 1 %.
    """
    found = characteristics(closed)
    widths = [each.frequency.value for each in found.crossings if each.level == "-3 dB"]
    centres = widths[:WIDTHS]
    crossover = found.crossing(found.phase_margin)
    if crossover is not None and not _served(crossover.frequency.value, centres):
        centres.append(crossover.frequency.value)
    wanted = [_around(centre, GAIN_SHARE) for centre in centres]
    half_turn = found.crossing(found.gain_margin)
    if half_turn is not None and not half_turn.extrapolated:
        wanted.append(_around(half_turn.frequency.value, PHASE_SHARE))
    frequencies = np.concatenate([np.empty(0), *wanted])
    apart = np.abs(frequencies[:, None] / closed.frequency - 1.0)
    return np.unique(frequencies[np.all(apart > NEAREST, axis=1)])


def _served(frequency: float, centres: list[float]) -> bool:
    """Whether it lies in the inner half of what is measured around one of the others anyway."""
    return any(abs(frequency / centre - 1.0) < 0.5 * GAIN_SHARE for centre in centres)


def _around(centre: float, share: float) -> Array:
    return np.asarray(np.geomspace(centre * (1.0 - share), centre * (1.0 + share), POINTS))
