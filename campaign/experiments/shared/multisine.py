"""Odd random-phase multisines, sized for motion below breakaway.

A sum of odd multiples of a lowest frequency, with random phases and equal amplitudes. Even
distortion falls between its lines (Pintelon and Schoukens, "System Identification: A Frequency
Domain Approach", 2nd ed., section 5.2).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from campaign.estimation.excitation_design.multisines import first_passage
from campaign.experiments.interface import ChosenValue
from campaign.experiments.shared.rig import Rig, bristles
from campaign.experiments.shared.rounded_choices import Choices, nice
from campaign.physics.bench import Bench
from campaign.signals import MultiSine

MOST_LINES = 1000
"""Largest number of lines of a multisine."""
PER_PERIOD = 16
"""Points per period of the highest line, for the search of the peak."""
SHARES = (0.05, 0.1, 0.2)
"""of the slowly applied torque at which the first interface slips."""
OF_STATIC = (0.02, 0.04, 0.08)
"""of the static torque, if the bench does not state its presliding."""
BELOW, ABOVE = 25.0, 5.0
"""Factors of lowest and highest line below and above the natural frequency on the bristles."""
PER_LINE = 8.0
"""Smallest number of samples per period of the highest line."""


def odd_multisine(peak: float, lowest: float, highest: float, seed: tuple[int, ...]) -> MultiSine:
    """Odd multiples of `lowest` up to `highest` (Hz), with this peak, from 0 at time 0.

    Phases follow from the seed. Whole periods begin and end at a zero crossing, so that a bench at
    rest gets no jerk. Raises ValueError for no line, or too many.
    """
    count = int((highest / lowest * (1.0 + 1e-9) + 1.0) // 2)
    if not 1 <= count <= MOST_LINES:
        raise ValueError(
            f"odd multiples of {lowest:.4g} Hz up to {highest:.4g} Hz are {count} lines; "
            f"1 to {MOST_LINES} are possible"
        )
    frequencies = lowest * (2.0 * np.arange(count) + 1.0)
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, count)
    course, turn = _course(count, phases)
    scale = peak / float(np.max(np.abs(course)))
    begun = (phases + 2.0 * np.pi * turn * frequencies / lowest) % (2.0 * np.pi)
    return MultiSine(
        amplitudes=(scale,) * count,
        frequencies=tuple(float(f"{f:.12g}") for f in frequencies),
        phases=tuple(map(float, begun)),
    )


def _course(count: int, phases: np.ndarray[Any, Any]) -> tuple[np.ndarray[Any, Any], float]:
    """One period of the sum, and the share of the period at which it first passes 0."""
    points = PER_PERIOD * 2 * count
    spectrum = np.zeros(points // 2 + 1, dtype=complex)
    spectrum[1 : 2 * count : 2] = np.exp(1j * (phases - 0.5 * np.pi))
    course = np.fft.irfft(spectrum, points) * points / 2.0
    odd = 2.0 * np.arange(count) + 1.0

    def value(share: float) -> float:
        return float(np.sum(np.sin(2.0 * np.pi * odd * share + phases)))

    return course, first_passage(course, value)


def first_slip(bench: Bench) -> tuple[float, float] | None:
    """Torque (N m) at which the first interface slips, and stiffness of all (N m/rad), at the load.

    None if the presliding of an interface is not stated.
    """
    known = [each for each in bristles(bench) if each is not None]
    if not known or len(known) < len(bench.friction):
        return None
    stiffness = sum(own for _, own in known)
    return min(angle for angle, _ in known) * stiffness, stiffness


def below_breakaway(options: Any, bench: Bench) -> Mapping[str, ChosenValue]:
    """Amplitudes and frequencies of a multisine, from the bench's bristles."""
    choices, rig = Choices(options), Rig(bench)
    slip, inertia, static = first_slip(bench), bench.axis.inertia, rig.static_torque
    if slip is not None:
        sizes = tuple(nice(share * slip[0], "N m") for share in SHARES)
        percents = ", ".join(f"{100 * share:.0f}" for share in SHARES)
        choices.take("amplitudes", sizes, f"{percents} % of the torque at which an interface slips")
    elif static is not None:
        sizes = tuple(nice(share * static, "N m") for share in OF_STATIC)
        percents = ", ".join(f"{100 * share:.0f}" for share in OF_STATIC)
        choices.take("amplitudes", sizes, f"{percents} % of the static torque")
    rate = choices.sample_rate(rig)
    if slip is not None and inertia is not None:
        natural = math.sqrt(slip[1] / inertia) / (2.0 * math.pi)
        why = f"around the {natural:.3g} Hz of the load on its bristles"
        choices.take("lowest", nice(natural / BELOW, "Hz"), why)
        choices.take("highest", nice(min(ABOVE * natural, rate / PER_LINE), "Hz"), why)
    return choices.told
