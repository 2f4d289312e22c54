"""Start values of the joint fit: inertia on a spring, from spectra."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import numpy as np

from campaign.arrays import ComplexArray
from campaign.estimation.least_squares import straight_line
from campaign.estimation.presliding_dynamics.plant import Bristles, Plant
from campaign.estimation.presliding_dynamics.record import Assumptions, Record, measured

GROUPS = 60
"""Groups of neighboring frequencies, even in the logarithm; sums over a group reduce noise."""
FAINT = 5e-4
"""Share of the torque's power below the lowest and above the highest group."""
PASSES = 6
"""Iterations of the weighted regression; each takes its weights from the previous plant."""


def first_plant(records: Sequence[Record], assumed: Assumptions) -> Plant:
    """Start plant from a fit of T = (J jw + d + sigma0 / jw) V at the excited frequencies.

    The fit excludes yielding. Both sides are correlated with the torque, so that noise of the rate
    causes no bias. Weights: Sanathanan and Koerner (IEEE Trans. Autom. Control 8, 1963).
    Raises ValueError if the records show no stiffness.
    """
    parts = [group for record in records for group in _groups(record)]
    rows = np.array([row for row, _, _ in parts])
    power = np.array([each for _, each, _ in parts])
    highest = max(omega for _, _, omega in parts)
    # Dynamic stiffness over the rate in each group; the first value is the measured one.
    plant = power / np.maximum(np.abs(rows[:, 1]), np.finfo(float).tiny)
    fit = np.zeros(3)
    for _ in range(PASSES):
        weight = 1.0 / (plant * np.sqrt(power))
        design, aim = rows * weight[:, None], power * weight
        scale = np.linalg.norm(design, axis=0)
        whole = np.concatenate([design.real, design.imag]) / scale
        sides = np.concatenate([np.real(aim), np.imag(aim)])
        fit = np.linalg.lstsq(whole, sides, rcond=None)[0] / scale
        omega = np.array([each for _, _, each in parts])
        plant = np.abs(fit[0] * 1j * omega + fit[1] + fit[2] / (1j * omega))
        plant = np.maximum(plant, 1e-6 * np.max(plant))
    inertia, damping, stiffness = map(float, fit)
    if not stiffness > 0:
        raise ValueError("the motion shows no stiffness: it does not come back to where it was")
    part = assumed.appendage
    if not inertia > (part.inertia if part else 0.0):
        # The inertia has no effect at high frequencies: use the largest one without an effect.
        inertia = max(stiffness / (4.0 * highest) ** 2, 2.0 * part.inertia if part else 0.0)
    least = 0.02 * 2.0 * np.sqrt(stiffness * inertia)
    compliance = 0.3 / max(record.amplitude for record in records)
    bristles = Bristles(stiffness, max(damping - assumed.viscous, least), compliance)
    return Plant(inertia, (bristles,), assumed.viscous, part)


def _groups(record: Record) -> Iterator[tuple[ComplexArray, float, float]]:
    """For each group: sums of (jw V, V, V / jw) T*, sum of T T*, center frequency (rad/s)."""
    window = np.hanning(len(record.torque))
    channels = {name: values for name, values, _ in measured(record)}
    frequency = np.fft.rfftfreq(len(window), record.step)
    omega = 2.0 * np.pi * np.maximum(frequency, frequency[1])
    torque = np.fft.rfft(window * (record.torque - straight_line(record.torque)))
    answer = channels["rate" if "rate" in channels else "angle"]
    rate = np.fft.rfft(window * (answer - straight_line(answer)))
    if "rate" not in channels:
        rate = 1j * omega * rate
    power = np.abs(torque) ** 2
    power[0] = 0.0
    ends = np.searchsorted(np.cumsum(power) / np.sum(power), [FAINT, 1.0 - FAINT])
    first, last = max(int(ends[0]), 1), min(int(ends[1]), len(omega) - 1)
    edges = np.unique(np.geomspace(first, last + 1, GROUPS + 1).astype(int))
    cross = rate * torque.conj()
    for begin, end in itertools.pairwise(edges):
        products, w = cross[begin:end], omega[begin:end]
        row = np.array([np.sum(1j * w * products), np.sum(products), np.sum(products / (1j * w))])
        yield row, float(np.sum(power[begin:end])), float(np.sqrt(w[0] * w[-1]))
