"""Torque that depends on the angle, as gravity does, from steady stretches.

Within a stretch at one speed friction is steady, but for a drift in time as of warming up. What
changes there with the angle, in all stretches alike, is none of it; each stretch keeps a level of
its own, so that no friction goes into the harmonics, whatever it is at which speed. Friction that
drifts changes with the angle as well, as the axis goes on turning: a drift of the force and one of
the friction, each a parabola in time, stand beside the harmonics, which get what these leave.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array

FEWEST = 10
"""stretches."""
BLOCKS = 50
"""means of a stretch at most: long ones do not count for more."""
SHARE = 0.1
"""of what changes within stretches that the angle explains, at least; the rest may be noise."""
SURE = 5.0
"""Deviations by which the largest harmonic differs from zero, at least."""


@dataclass(frozen=True)
class OverATurn:
    """Harmonics of one turn.

    Attributes:
        values: of sin q, cos q, sin 2q ... (N m), shape (2 k,).
        covariance: of them, with stretches as draws, shape (2 k, 2 k).
        share: of what changes within stretches, and does not drift, that they explain.
    """

    values: Array
    covariance: Array
    share: float

    @property
    def amplitudes(self) -> tuple[float, ...]:
        """Of each harmonic (N m)."""
        return tuple(float(each) for each in np.hypot(self.values[::2], self.values[1::2]))

    def at(self, angle: Array) -> Array:
        """The torque at angles (rad), shape (n,)."""
        return np.asarray(_basis(angle, len(self.amplitudes)) @ self.values)

    def doubts(self, angle: Array) -> Array:
        """Means over angles (rad), shape (n,), of what it may be off by: 1 sigma, shape (2 k,).

        Independent of each other, and each shared by all stretches.
        """
        sizes, ways = np.linalg.eigh(self.covariance)
        mean = _basis(angle, len(self.amplitudes)).mean(axis=0)
        return np.asarray(mean @ ways * np.sqrt(np.maximum(sizes, 0.0)))


def over_a_turn(stretches: Sequence[tuple[Array, Array, Array]]) -> OverATurn | None:
    """From time (s), angle (rad) and torque (N m) of each stretch, shape (n,) each.

    None where little goes with the angle, or where it cannot be told from a drift.
    """
    if len(stretches) < FEWEST:
        return None
    means = [tuple(_blocks(each) for each in parts) for parts in stretches]
    first, second = _fitted(means, 1), _fitted(means, 2)
    # Schwarz' criterion, with stretches as draws.
    gain = (1.0 - first.share) / max(1.0 - second.share, 1e-12)
    found = second if len(means) * np.log(gain) > 2.0 * np.log(len(means)) else first
    error = np.sqrt(np.maximum(np.diag(found.covariance), 0.0))
    largest = int(np.argmax(np.abs(found.values)))
    sure = abs(found.values[largest]) > SURE * error[largest]
    return found if found.share > SHARE and sure else None


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
    """Of one stretch, by what it leaves of the fit to all others (jackknife; Bell and McCaffrey,
    Survey Methodology 28 (2002) 169): a few long strokes decide, and the fit follows them.
    """
    kept = np.eye(len(torque)) - basis @ inverse @ basis.T
    return np.asarray(basis.T @ np.linalg.lstsq(kept, torque - basis @ values, rcond=1e-9)[0])


def _drift(time: Array, angle: Array) -> Array:
    """Of the force, and of a friction that acts against the motion, shape (n, 4)."""
    way = np.sign(angle[-1] - angle[0])
    return np.stack([time, time**2, way * time, way * time**2], axis=1)
