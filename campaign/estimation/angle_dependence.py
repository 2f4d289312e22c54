"""Torque that depends on the angle, such as gravity, from steady stretches.

Within a stretch at one speed friction is constant, except for a drift in time, such as by warming.
A change with the angle that is common to all stretches is not friction. Each stretch has its own
level, so that friction at any speed has no effect on the harmonics. Friction that drifts also
changes with the angle, because the axis turns. Therefore the fit includes a drift of the force and
one of the friction, each a parabola in time, together with the harmonics.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array

FEWEST = 10
"""Fewest stretches."""
BLOCKS = 50
"""Most block means of a stretch, so that long stretches do not dominate."""
SHARE = 0.1
"""Least share of the variation within stretches that the angle explains; the rest may be noise."""
SURE = 5.0
"""Least size of the largest harmonic, in deviations."""


@dataclass(frozen=True)
class OverATurn:
    """Harmonics of one turn.

    Attributes:
        values: of sin q, cos q, sin 2q ... (N m), shape (2 k,).
        covariance: of the values, with stretches as samples, shape (2 k, 2 k).
        share: explained share of the variation within stretches, without drift.
    """

    values: Array
    covariance: Array
    share: float

    @property
    def amplitudes(self) -> tuple[float, ...]:
        """Amplitude of each harmonic (N m)."""
        return tuple(float(each) for each in np.hypot(self.values[::2], self.values[1::2]))

    def at(self, angle: Array) -> Array:
        """Torque at angles (rad), shape (n,)."""
        return np.asarray(_basis(angle, len(self.amplitudes)) @ self.values)

    def doubts(self, angle: Array) -> Array:
        """Errors of the mean over angles (rad), shape (n,): 1 sigma, shape (2 k,).

        Independent of each other, and each common to all stretches.
        """
        sizes, modes = np.linalg.eigh(self.covariance)
        mean = _basis(angle, len(self.amplitudes)).mean(axis=0)
        return np.asarray(mean @ modes * np.sqrt(np.maximum(sizes, 0.0)))


def over_a_turn(stretches: Sequence[tuple[Array, Array, Array]]) -> OverATurn | None:
    """Harmonics from time (s), angle (rad) and torque (N m) of each stretch, shape (n,) each.

    None for few stretches, a small effect of the angle, or one that may be a drift.
    """
    if len(stretches) < FEWEST:
        return None
    means = [tuple(_blocks(each) for each in parts) for parts in stretches]
    first, second = _fitted(means, 1), _fitted(means, 2)
    # Schwarz' criterion, with stretches as samples.
    gain = (1.0 - first.share) / max(1.0 - second.share, 1e-12)
    turn = second if len(means) * np.log(gain) > 2.0 * np.log(len(means)) else first
    error = np.sqrt(np.maximum(np.diag(turn.covariance), 0.0))
    largest = int(np.argmax(np.abs(turn.values)))
    sure = abs(turn.values[largest]) > SURE * error[largest]
    return turn if turn.share > SHARE and sure else None


def _blocks(values: Array) -> Array:
    return np.array([part.mean() for part in np.array_split(values, min(BLOCKS, len(values)))])


def _basis(angle: Array, harmonics: int) -> Array:
    turns = [wave(k * angle) for k in range(1, harmonics + 1) for wave in (np.sin, np.cos)]
    return np.stack(turns, axis=1)


def _fitted(means: Sequence[tuple[Array, ...]], harmonics: int) -> OverATurn:
    parts = []
    last = max(float(np.abs(time).max()) for time, _, _ in means)
    for time, angle, torque in means:
        basis = np.hstack([_basis(angle, harmonics), _drift(time / last, angle)])
        parts.append((basis - basis.mean(axis=0), torque - torque.mean()))
    columns = np.concatenate([basis for basis, _ in parts])
    torque = np.concatenate([each for _, each in parts])
    inverse = np.linalg.pinv(columns.T @ columns, rcond=1e-8)
    values = inverse @ (columns.T @ torque)
    scores = np.stack([_score(*part, inverse, values) for part in parts])
    count, own = len(parts), 2 * harmonics
    covariance = inverse @ (scores.T @ scores) @ inverse * ((count - 1) / count)
    left = float(np.sum((torque - columns @ values) ** 2))
    drift = columns[:, own:]
    without = torque - drift @ np.linalg.lstsq(drift, torque, rcond=None)[0]
    share = 1.0 - left / max(float(without @ without), 1e-300)
    return OverATurn(values[:own], covariance[:own, :own], share)


def _score(basis: Array, torque: Array, inverse: Array, values: Array) -> Array:
    """Score of one stretch, by its residuals of the fit to all others.

    Jackknife (Bell and McCaffrey, Survey Methodology 28 (2002) 169), because the fit follows a few
    long strokes.
    """
    kept = np.eye(len(torque)) - basis @ inverse @ basis.T
    return np.asarray(basis.T @ np.linalg.lstsq(kept, torque - basis @ values, rcond=1e-9)[0])


def _drift(time: Array, angle: Array) -> Array:
    """Columns of the drift of force and of friction against the motion, shape (n, 4)."""
    sign = np.sign(angle[-1] - angle[0])
    return np.stack([time, time**2, sign * time, sign * time**2], axis=1)
