"""Torque of a drive without the noise of its sensor, and what it may be off by then.

A simulation that is fed with a noisy torque answers to the noise as well: what is fitted is too
stiff, too damped and too heavy, by the noise's share of the power (Soderstrom, "Errors-in-variables
methods in system identification", Automatica 43, 2007). But the torque is what drive and load make
of a command that is known, and nearly linearly so: it is regressed on past commands. What is left
to doubt of it then is no noise any more, but a few smooth directions, whose factors a joint fit of
the motion finds together with the plant.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from campaign.identification.presliding_dynamics.plant import Array

PER_PERIOD = 3.0
"""Lags in a period of the highest frequency: more would tell the same."""
LAGS = 60
"""of the command: 20 periods of the highest frequency. Back-EMF makes the torque remember what the
load does, for as long as a lightly damped mode rings; a memory too short is a torque that is wrong,
and one too long costs time only."""
FINE = 2
"""Lags up to which every sample is one: a drive answers within them."""
ALIKE = 1e-9
"""Share of a column that must be its own, or it is told by the ones before."""
FAINT = 0.003
"""Share of a direction within the band below which it is left out: it moves nothing."""
CLEAN = 0.03
"""Noise within the band over the torque below which the torque is taken as it was measured: the
noise's share of the power is 1e-3 then, and the regression would leave out more, as friction is
not linear."""


@dataclass(frozen=True)
class Driven:
    """What a drive did in one trial that began at rest.

    Attributes:
        torque: measured (N m), shape (n,).
        command: what was asked of it (N m), at any time (s) from 0 on.
    """

    torque: Array
    command: Callable[[Array], Array]


def driven_torques(
    trials: Sequence[Driven], step: float, highest: float
) -> list[tuple[Array, Array]]:
    """Torque of each trial, shape (n,), and the columns that it may be off by, shape (n, m).

    Their factors are standard normal, and the same in all trials. step: between samples (s);
    highest: frequency up to which the torque matters (Hz).
    """
    lengths = [len(each.torque) for each in trials]
    places = np.cumsum(lengths)[:-1]
    torque = np.concatenate([each.torque for each in trials])
    offsets = np.repeat(np.eye(len(trials)) / np.sqrt(lengths), lengths, axis=0)
    commands = np.concatenate([_commands(each, step, highest) for each in trials])
    moving = _directions(commands - offsets @ (offsets.T @ commands), places, step, highest)
    size = moving.T @ torque
    level = offsets @ (offsets.T @ torque)
    found = level + moving @ size
    count = len(torque)
    noise = float(np.linalg.norm(torque - found)) / np.sqrt(count - len(trials) - len(size))
    within = noise * np.sqrt(min(2.0 * highest * step, 1.0) * count)
    if within <= CLEAN * float(np.linalg.norm(size)):
        return [(each.torque, np.zeros((len(each.torque), 0))) for each in trials]
    # Offsets are free in a fit as it is.
    return list(zip(np.split(found, places), np.split(noise * moving, places), strict=True))


def _commands(trial: Driven, step: float, highest: float) -> Array:
    """At all lags, shape (n, lags): 0 before the beginning."""
    lag = max(1, int(1.0 / (PER_PERIOD * highest * step)))
    lags = [*range(FINE * lag), *range(FINE * lag, LAGS * lag + 1, lag)]
    then = step * np.subtract.outer(np.arange(len(trial.torque)), lags)
    values = trial.command(np.maximum(then, 0.0).ravel()).reshape(then.shape)
    return np.where(then < 0.0, 0.0, values)


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
