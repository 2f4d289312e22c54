"""Torque of a drive without sensor noise, and its uncertainty.

A simulation that is fed with a noisy torque answers to the noise as well: what is fitted is too
stiff, too damped and too heavy, by the noise's share of the power (Soderstrom, "Errors-in-variables
methods in system identification", Automatica 43, 2007). But the torque is what drive and load make
of a command that is known, and nearly linearly so: it is regressed on past commands. What is left
to doubt of it then is no noise any more, but a few smooth directions, whose factors a joint fit of
the motion finds together with the plant. Friction that yields makes the load's motion, and through
back-EMF the torque, no linear answer to the command: for that the torque is regressed on the motion
as well, once a first fit can tell that without noise.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from campaign.arrays import Array

PER_PERIOD = 3.0
"""Lags in a period of the highest frequency: more would tell the same."""
FINE = 2.0
"""Such lags up to which each sample is one of its own: a drive answers within them, to a command
as to the back-EMF of a motion."""
MOST_FINE = 30
"""samples up to there at most."""
LAGS = 60
"""of the command: 20 periods of the highest frequency. Back-EMF makes the torque remember what the
load does, for as long as a lightly damped mode rings; a memory too short is a torque that is wrong,
and one too long costs time only."""
PER_LAG = 4
"""Shortest trial over the longest lag, at least."""
ALIKE = 1e-9
"""Share of a column that must be its own, or it is told by the ones before."""
FAINT = 0.003
"""Share of a direction within the band below which it is left out: it moves nothing."""
CLEAN = 0.1
"""Bias that the torque's noise makes over the scatter that it makes, below which a torque is taken
as it was measured: a share of noise makes a bias of its square, and a scatter that falls with how
many samples tell it. The regression leaves out more then, as friction is not linear."""
ABOVE = 1.5
"""of the highest frequency: from there on a torque has nothing but the noise of its sensor."""


@dataclass(frozen=True)
class Driven:
    """What a drive did in one trial that began at rest.

    Attributes:
        torque: measured (N m), shape (n,).
        command: what was asked of it (N m), at any time (s) from 0 on.
        motion: of the load as a fit tells it, rate or angle, shape (n,); None before any fit.
    """

    torque: Array
    command: Callable[[Array], Array]
    motion: Array | None = None


def driven_torques(
    trials: Sequence[Driven], step: float, highest: float
) -> list[tuple[Array, Array]]:
    """Torque of each trial, shape (n,), and the columns that it may be off by, shape (n, m).

    Their factors are standard normal, and the same in all trials. step: between samples (s);
    highest: frequency up to which the torque matters (Hz). Raises ValueError where the trials are
    too short.
    """
    lengths = [len(each.torque) for each in trials]
    places = np.cumsum(lengths)[:-1]
    torque = np.concatenate([each.torque for each in trials])
    offsets = np.repeat(np.eye(len(trials)) / np.sqrt(lengths), lengths, axis=0)
    fine, lags = _lags(min(lengths), step, highest)
    columns = np.concatenate([_past(_commanded(each, step), lags) for each in trials])
    if motions := [each.motion for each in trials if each.motion is not None]:
        columns = np.hstack([columns, np.concatenate([_past(each, fine) for each in motions])])
    moving = _directions(columns - offsets @ (offsets.T @ columns), places, step, highest)
    size = moving.T @ torque
    found = offsets @ (offsets.T @ torque) + moving @ size
    left = np.split(torque - found, places)
    noise, telling = _noise(left, step, 0.0, highest, len(size))
    if not np.isfinite(noise):
        raise ValueError("too few samples to separate a torque from its noise: record longer")
    # What is left within the band may be torque that is no linear answer; above it, it is noise.
    sensor = min(noise, _noise(left, step, ABOVE * highest, np.inf)[0])
    if sensor * telling <= CLEAN * float(np.linalg.norm(size)):
        return [(each.torque, np.zeros((len(each.torque), 0))) for each in trials]
    # Offsets are free in a fit as it is.
    return list(zip(np.split(found, places), np.split(noise * moving, places), strict=True))


def _lags(shortest: int, step: float, highest: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """In samples: all of the first ones; and those with more, as far apart as the band allows."""
    lag = max(1, int(1.0 / (PER_PERIOD * highest * step)))
    fine = min(int(FINE * lag), MOST_FINE)
    count = min(LAGS, shortest // (PER_LAG * lag))
    first = np.arange(fine)
    return first, np.append(first, fine + lag * np.arange(max(count, 1)))


def _commanded(trial: Driven, step: float) -> Array:
    return np.asarray(trial.command(step * np.arange(float(len(trial.torque)))), dtype=float)


def _past(values: Array, lags: NDArray[np.intp]) -> Array:
    """At all lags, shape (n, lags): 0 before the beginning."""
    place = np.subtract.outer(np.arange(len(values)), lags)
    return np.where(place < 0, 0.0, values[np.maximum(place, 0)])


def _noise(
    left: Sequence[Array], step: float, low: float, high: float, taken: int = 0
) -> tuple[float, float]:
    """Deviation of white noise that is as large between two frequencies, and how many tell it.

    The deviation is per sample, and infinite where nothing tells it. taken: how many have gone into
    a regression.
    """
    energy, count = 0.0, 0.0
    for part in left:
        spectrum = np.abs(np.fft.rfft(part - np.mean(part))) ** 2
        frequency = np.fft.rfftfreq(len(part), step)
        inside = (frequency > low) & (frequency <= high)
        energy += 2.0 * float(np.sum(spectrum[inside])) / len(part)
        count += 2.0 * float(np.sum(inside))
    if count - taken < 1.0:
        return np.inf, count
    return float(np.sqrt(energy / (count - taken))), count


def _directions(columns: Array, places: Array, step: float, highest: float) -> Array:
    """An orthonormal basis of what columns (n, k) can be within the band, shape (n, m)."""
    basis, triangle = np.linalg.qr(columns)
    own = np.abs(np.diag(triangle)) / np.linalg.norm(triangle, axis=0).clip(np.finfo(float).tiny)
    basis = basis[:, own > ALIKE]
    shown = []
    for part in np.split(basis, places):
        spectrum = np.fft.rfft(part, axis=0)
        spectrum[np.fft.rfftfreq(len(part), step) > highest] = 0.0
        shown.append(np.fft.irfft(spectrum, len(part), axis=0))
    _, sizes, ways = np.linalg.svd(np.concatenate(shown), full_matrices=False)
    return np.asarray(basis @ ways[sizes > FAINT].T)
