"""Torque of a drive without sensor noise, and its uncertainty.

A simulation with a noisy torque also responds to the noise. Then stiffness, damping and inertia are
too large, by the noise's share of the power (Soderstrom, "Errors-in-variables methods in system
identification", Automatica 43, 2007). But the torque is an almost linear response of drive and load
to a known command. Therefore it is regressed on past commands. The remaining error is not noise: it
lies in a few smooth directions. A joint fit of the motion estimates their factors with the plant.
Yielding friction makes the motion, and through back-EMF the torque, a nonlinear response to the
command. Therefore the torque is also regressed on the noise-free motion of a first fit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from campaign.arrays import Array

PER_PERIOD = 3.0
"""Lags per period of the highest frequency; more lags add no information."""
FINE = 2.0
"""Number of such lags within which every sample is a lag. The drive responds that fast to a command
and to the back-EMF of a motion."""
MOST_FINE = 30
"""Largest number of samples in that range."""
LAGS = 60
"""Lags of the command: 20 periods of the highest frequency. Through back-EMF the torque depends on
past motion for as long as a lightly damped mode rings. Too few lags cause an error of the torque;
too many only take time."""
PER_LAG = 4
"""Least ratio of the shortest trial to the longest lag."""
ALIKE = 1e-9
"""Least share of a column that is independent of the previous ones."""
FAINT = 0.003
"""Share of a direction within the band, below which the direction has no effect and is omitted."""
CLEAN = 0.1
"""Ratio of the bias by the torque's noise to its scatter, below which the measured torque is used.
The bias is proportional to the square of the noise; the scatter decreases with the number of
samples. Below this ratio the error of the regression, with nonlinear friction, is larger."""
ABOVE = 1.5
"""Multiple of the highest frequency above which a torque contains only sensor noise."""


@dataclass(frozen=True)
class Driven:
    """Torque and command of a drive in one trial that begins at rest.

    Attributes:
        torque: measured (N m), shape (n,).
        command: commanded torque (N m) as a function of time (s) from 0 on.
        motion: rate or angle of the load, simulated by a fit, shape (n,); None before any fit.
    """

    torque: Array
    command: Callable[[Array], Array]
    motion: Array | None = None


def driven_torques(
    trials: Sequence[Driven], step: float, highest: float
) -> list[tuple[Array, Array]]:
    """Torque of each trial, shape (n,), and columns of its errors, shape (n, m).

    The columns' factors are standard normal and common to all trials. step: between samples (s);
    highest: highest relevant frequency of the torque (Hz). Raises ValueError for too few samples.
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
    smooth = offsets @ (offsets.T @ torque) + moving @ size
    left = np.split(torque - smooth, places)
    noise, count = _noise(left, step, 0.0, highest, len(size))
    if not np.isfinite(noise):
        raise ValueError("too few samples to separate a torque from its noise: record longer")
    # Residuals within the band may be nonlinear torque; above the band they are noise.
    sensor = min(noise, _noise(left, step, ABOVE * highest, np.inf)[0])
    if sensor * count <= CLEAN * float(np.linalg.norm(size)):
        return [(each.torque, np.zeros((len(each.torque), 0))) for each in trials]
    # Offsets need no columns: they are free in every fit.
    return list(zip(np.split(smooth, places), np.split(noise * moving, places), strict=True))


def _lags(shortest: int, step: float, highest: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Lags in samples: the dense first ones; all lags, the later ones spaced by the band."""
    lag = max(1, int(1.0 / (PER_PERIOD * highest * step)))
    fine = min(int(FINE * lag), MOST_FINE)
    count = min(LAGS, shortest // (PER_LAG * lag))
    first = np.arange(fine)
    return first, np.append(first, fine + lag * np.arange(max(count, 1)))


def _commanded(trial: Driven, step: float) -> Array:
    return np.asarray(trial.command(step * np.arange(float(len(trial.torque)))), dtype=float)


def _past(values: Array, lags: NDArray[np.intp]) -> Array:
    """Values at all lags, shape (n, lags): 0 before the beginning."""
    place = np.subtract.outer(np.arange(len(values)), lags)
    return np.where(place < 0, 0.0, values[np.maximum(place, 0)])


def _noise(
    left: Sequence[Array], step: float, low: float, high: float, taken: int = 0
) -> tuple[float, float]:
    """Deviation of white noise from its power between two frequencies (Hz), and number of values.

    The deviation is per sample, and infinite if not determined. taken: number of fitted parameters.
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
    """Orthonormal basis of columns (n, k) within the band, shape (n, m)."""
    basis, triangle = np.linalg.qr(columns)
    own = np.abs(np.diag(triangle)) / np.linalg.norm(triangle, axis=0).clip(np.finfo(float).tiny)
    basis = basis[:, own > ALIKE]
    shown = []
    for part in np.split(basis, places):
        spectrum = np.fft.rfft(part, axis=0)
        spectrum[np.fft.rfftfreq(len(part), step) > highest] = 0.0
        shown.append(np.fft.irfft(spectrum, len(part), axis=0))
    _, sizes, directions = np.linalg.svd(np.concatenate(shown), full_matrices=False)
    return np.asarray(basis @ directions[sizes > FAINT].T)
