"""Crossover, margins and poles of the open loop L.

The closed loop is 1 / (1 + L). Every crossing of |L| = 1 and of the negative real axis counts, in
either direction; the worst determines the margin. They are computed on a frequency grid that
follows the poles of open and closed loop, and then refined.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from campaign.physics.open_loop import OpenLoop
from campaign.signals import Array

Complex = NDArray[Any]
"""complex128"""

STANDING = 1e-3
"""1/s; a slower mode neither grows nor decays in any trial. Example: bristles and integral of a
stuck axis, which are in equilibrium at any angle."""
FORGOTTEN = 1e-6
"""Poles of a sampled loop closer to zero are delays; their positions are rounding errors."""
PER_DECADE = 24
NEARLY_STILL = 1e-2
"""Times the lowest frequency of the grid: there L is equal to L at zero frequency."""
BESIDE_POLES = np.array([-8.0, -4.0, -2.0, -1.0, -0.5, 0.5, 1.0, 2.0, 4.0, 8.0])
"""Grid points beside each oscillating pole, in half-widths of its resonance."""
NARROWEST = 1e-4
"""Half-width of a resonance without damping, relative to its frequency."""
LOW_PHASE_MARGIN = math.radians(20.0)
LOW_GAIN_MARGIN = 3.0
"""dB; below either limit a loop is stable with a low margin."""


@dataclass(frozen=True)
class LoopMargins:
    """Margins and poles of one loop, SI; None without such a crossing.

    Attributes:
        crossovers: all frequencies with |L| = 1 (rad/s), rising.
        crossover: the crossover of the phase margin (rad/s).
        phase_margin: smallest rotation of L to -1, in either direction (rad).
        gain_margin: factor nearest to 1 that makes L = -1; below 1 if a *lower* gain makes the loop
            unstable.
        gain_crossing: frequency of the gain margin (rad/s).
        delay_margin: shortest additional delay (s) that makes the loop unstable.
        poles: of the closed loop (1/s), fastest growth first, without those slower than `STANDING`.
        period: s; None for a continuous loop.
    """

    crossovers: tuple[float, ...]
    crossover: float | None
    phase_margin: float | None
    gain_margin: float | None
    gain_crossing: float | None
    delay_margin: float | None
    poles: tuple[complex, ...]
    period: float | None

    @property
    def growth(self) -> float:
        """Real part of the fastest growing pole (1/s)."""
        return self.poles[0].real if self.poles else -math.inf

    @property
    def stable(self) -> bool:
        # Rounding must not make an undamped oscillation unstable.
        return self.growth < STANDING

    @property
    def gain_margin_db(self) -> float | None:
        """20 lg of the gain margin; negative if a lower gain makes the loop unstable."""
        return None if self.gain_margin is None else 20.0 * math.log10(self.gain_margin)

    @property
    def least_damped(self) -> complex | None:
        """The pole with the smallest damping ratio."""
        return min(self.poles, key=lambda pole: -pole.real / abs(pole), default=None)

    @property
    def low(self) -> bool:
        """Stable, with less than 20 deg or less than 3 dB."""
        return self.stable and self.tightness < 1.0

    @property
    def tightness(self) -> float:
        """Worse margin relative to its limit of a low margin; negative if unstable."""
        if not self.stable:
            return -1.0 - self.growth
        phase = math.inf if self.phase_margin is None else self.phase_margin / LOW_PHASE_MARGIN
        gain = math.inf if self.gain_margin_db is None else abs(self.gain_margin_db)
        return min(phase, gain / LOW_GAIN_MARGIN)


class Response:
    """L at any frequency; by the Schur form each frequency needs one triangular solution."""

    def __init__(self, loop: OpenLoop) -> None:
        from scipy.linalg import schur

        self.period = loop.period
        self._t, q = schur(loop.a, output="complex")
        self._b, self._c = q.conj().T @ loop.b, loop.c @ q

    @property
    def poles(self) -> Complex:
        """Poles of the open loop (1/s), shape (n,)."""
        return in_time(np.diag(self._t), self.period)

    def __call__(self, omega: Array) -> Complex:
        """L at `omega` (rad/s), shape (n,)."""
        point = 1j * omega if self.period is None else np.exp(1j * omega * self.period)
        x = np.empty((len(self._b), len(omega)), dtype=complex)
        for i in range(len(self._b) - 1, -1, -1):
            driven = self._b[i] + self._t[i, i + 1 :] @ x[i + 1 :]
            x[i] = driven / (point - self._t[i, i])
        return np.asarray(self._c @ x)


def margins_of(loop: OpenLoop) -> LoopMargins:
    """Margins and poles of `loop`."""
    response = Response(loop)
    poles = in_time(np.linalg.eigvals(loop.closed), loop.period)
    omega = frequency_grid(np.concatenate([response.poles, poles]), loop.period)
    value = response(omega)
    crossovers = _refined(response, omega, value, lambda l: np.log(np.abs(l)))
    margins, delays = _phase_margins(response, crossovers)
    worst = int(np.argmin(margins)) if len(margins) else None
    gain, at = _gain_margin(response, omega, value)
    moving = poles[np.abs(poles) > STANDING]
    moving = moving[np.argsort(-moving.real, kind="stable")]
    return LoopMargins(
        crossovers=tuple(map(float, crossovers)),
        crossover=None if worst is None else float(crossovers[worst]),
        phase_margin=None if worst is None else float(margins[worst]),
        gain_margin=gain,
        gain_crossing=at,
        delay_margin=float(np.min(delays)) if len(delays) else None,
        poles=tuple(map(complex, moving)),
        period=loop.period,
    )


def in_time(poles: Complex, period: float | None) -> Complex:
    """Convert poles of a sampled loop to continuous time (1/s), without delays."""
    if period is None:
        return poles
    kept = poles[np.abs(poles) > FORGOTTEN].astype(complex)
    return np.asarray(np.log(kept) / period)


def frequency_grid(poles: Complex, period: float | None) -> Array:
    """Frequencies (rad/s), rising, which resolve the resonance of every pole."""
    sizes = np.abs(poles)[np.abs(poles) > STANDING]
    low = 0.01 * float(np.min(sizes, initial=100.0))
    high = 100.0 * float(np.max(sizes, initial=100.0)) if period is None else math.pi / period
    low = min(low, 1e-3 * high)
    count = math.ceil(PER_DECADE * math.log10(high / low)) + 1
    oscillating = poles[poles.imag > STANDING]
    widths = np.maximum(np.abs(oscillating.real), NARROWEST * oscillating.imag)
    near = oscillating.imag[:, None] + widths[:, None] * BESIDE_POLES
    near = near[(near > low) & (near < high)]
    # A sampled loop ends at the Nyquist frequency, where L is real and can be negative.
    return np.unique(np.concatenate([np.geomspace(low, high, count), near.ravel(), [high]]))


def _phase_margins(response: Response, crossovers: Array) -> tuple[Array, Array]:
    """Phase margin (rad) and delay margin (s) at each crossover."""
    turn = np.angle(response(crossovers)) + np.pi  # 0 to 2 pi; lag reduces it to 0
    margins = np.minimum(turn, 2.0 * np.pi - turn)
    return margins, turn / crossovers


def _gain_margin(
    response: Response, omega: Array, value: Complex
) -> tuple[float | None, float | None]:
    """Factor nearest to 1 that makes L = -1, and its frequency (rad/s)."""
    crossings = _refined(response, omega, value, lambda l: l.imag)
    # At zero frequency L is real and finite without integrators; at the Nyquist frequency, real.
    still = NEARLY_STILL * omega[0] * np.array([1.0, 2.0])
    first, second = response(still)
    ends = still[:1] if abs(second - first) < 1e-3 * abs(first) else np.empty(0)
    if response.period is not None:
        ends = np.append(ends, omega[-1])
    crossings = np.concatenate([ends, crossings])
    real = response(crossings).real
    crossings, real = crossings[real < 0], real[real < 0]
    if not len(real):
        return None, None
    nearest = int(np.argmin(np.abs(np.log(-real))))
    return float(-1.0 / real[nearest]), float(crossings[nearest])


def _refined(response: Response, omega: Array, value: Complex, sign_of: Any) -> Array:
    """Frequencies at which `sign_of(L)` changes its sign (rad/s), to about nine digits."""
    level = sign_of(value)
    at = np.flatnonzero(np.signbit(level[:-1]) != np.signbit(level[1:]))
    low, high = omega[at], omega[at + 1]
    share = np.linspace(0.0, 1.0, 33)
    rows = np.arange(len(low))
    for _ in range(5):
        if not len(low):
            break
        inner = low[:, None] + (high - low)[:, None] * share
        level = sign_of(response(inner.ravel())).reshape(inner.shape)
        changed = np.signbit(level[:, :-1]) != np.signbit(level[:, 1:])
        first = np.argmax(changed, axis=1)
        low, high = inner[rows, first], inner[rows, first + 1]
    return np.asarray(0.5 * (low + high))
