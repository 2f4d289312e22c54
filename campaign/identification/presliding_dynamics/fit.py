"""Joint output-error fit of a plant below breakaway to the records of several trials.

What is fitted is the simulated answer, not an equation error: noise of rate and angle then biases
nothing (Ljung, "System Identification", 2nd ed., section 7.2). The rate is compared as a rate, so
that the gyro's noise is not integrated. Offset and slow drift of the gyro and the encoder's offset
are linear, and are taken out of residuals and Jacobian in each record.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from campaign.identification.presliding_dynamics.parameters import LARGEST_OFFSET, Parameters
from campaign.identification.presliding_dynamics.plant import Array, Bristles, Plant
from campaign.identification.presliding_dynamics.record import Assumed, Record, measured
from campaign.identification.presliding_dynamics.simulation import (
    Motion,
    simulate,
    steps_per_sample,
    torque_on_grid,
)
from campaign.identification.presliding_dynamics.start import first_plant

EVALUATIONS = 60
"""of a start at most; a fit that needs more has not converged."""
FEW = 8
"""Likewise, of one with a parameter held near the best fit."""
TOLERANCE = 1e-8
"""Relative change of the sum of squares at which a search ends: of 1e5 samples a hundredth of what
a deviation of a parameter makes."""
DIFFERENCE = 1e-6
"""Step of the Jacobian's differences, in the vector's units."""
ROUNDS = 1
"""in which each channel's deviation is taken from its own residuals."""
MOST_ORDER = 12
"""Of the autoregression of a channel's noise."""
DELAYS = (("rate_delay",), ("angle_delay",))
"""Parameters that move no load: another look at the same motion."""
DRIFT = {"rate": 2, "angle": 1}
"""Coefficients of the polynomial that each channel may be off by: offset, drift."""


@dataclass(frozen=True)
class Channel:
    """A measured channel of a record, and what is taken out of it.

    Attributes:
        name: `rate` or `angle`.
        samples: measured (rad/s or rad), 0 where lost, shape (n,).
        kept: which samples are there.
        there: 1 where a whitened sample is there, else 0, shape (n,).
        basis: orthonormal columns of whitened offset and drift, shape (n, q).
        deviation: of its residuals, whitened (rad/s or rad).
        whitening: 1, -a1, -a2, ... of the autoregression that its noise is taken for.
    """

    name: str
    samples: Array
    kept: NDArray[np.bool_]
    there: Array
    basis: Array
    deviation: float
    whitening: Array

    @classmethod
    def of(
        cls, name: str, samples: Array, kept: NDArray[np.bool_], deviation: float, whitening: Array
    ) -> Channel:
        """With what follows from those: a sample after a lost one cannot be whitened."""
        there = kept.copy()
        for lag in range(1, len(whitening)):
            there[lag:] &= kept[:-lag]
        # The first samples have no past; what is before them is not known to be 0.
        there[: len(whitening) - 1] = False
        powers = np.vander(np.linspace(-1.0, 1.0, len(kept)), DRIFT[name])
        basis = np.linalg.qr(_whitened(powers, whitening) * there[:, None])[0]
        return cls(name, samples, kept, there.astype(float), basis, deviation, whitening)

    def left(self, values: Array) -> Array:
        """What is left of values (n, ...) without offset and drift, whitened, in deviations."""
        shown = (_whitened(values, self.whitening).T * self.there).T
        return np.asarray((shown - self.basis @ (self.basis.T @ shown)) / self.deviation)


def _whitened(values: Array, whitening: Array) -> Array:
    from scipy.signal import lfilter

    return values if len(whitening) == 1 else np.asarray(lfilter(whitening, [1.0], values, axis=0))


@dataclass(frozen=True)
class Fitted:
    """A joint fit.

    Attributes:
        records: that were fitted.
        parameters: layout of the vector.
        vector: where the sum of squares is least.
        channels: of each record.
        grids: torque of each record on its grid, and grid steps per sample.
        residuals: of each record: measured less simulated, without offset and drift, in
            deviations, shape (channels, n).
        jacobians: derivatives of the simulated by the vector, likewise, (channels, n, size).
        priors: derivatives of what is known beforehand, of each record's own above all, (size,).
        cost: sum of squares, priors included.
        reached: whether the search ended in a minimum.
    """

    records: tuple[Record, ...]
    parameters: Parameters
    vector: Array
    channels: tuple[tuple[Channel, ...], ...]
    grids: tuple[tuple[Array, int], ...]
    residuals: tuple[Array, ...]
    jacobians: tuple[Array, ...]
    priors: Array
    cost: float
    reached: bool

    @property
    def plant(self) -> Plant:
        """That fits best."""
        return self.parameters.plant(self.vector)

    def motion(self, number: int, plant: Plant | None = None) -> Motion:
        """Simulated motion of a record, of this plant or of another."""
        return _motion(self, number, self.vector, plant)

    def answers(self, number: int, plant: Plant | None = None) -> Array:
        """Simulated samples of a record's channels, shape (channels, n)."""
        return _answers(self, number, self.vector, plant)

    def largest_yielding(self, number: int) -> float:
        """Largest bristle torque of a record over that at which the bristles slip, as fitted."""
        bent = self.motion(number).bristle_torque[:, 0]
        return float(np.max(np.abs(bent))) * abs(self.plant.bristles[0].compliance)


def fit_presliding_dynamics(
    records: Sequence[Record], assumed: Assumed | None = None, first: Plant | None = None
) -> Fitted:
    """Fit sigma0, sigma1, J and what else is free to all records at once.

    `first`: where the search begins; absent: a linear fit of the spectra. Raises ValueError with
    the reason where there is no start, and where no start leads to a minimum.
    """
    if not records:
        raise ValueError("there is no record to fit")
    known = assumed or Assumed()
    begin = first or first_plant(records, known)
    best: Fitted | None = None
    for start in _starts(begin):
        try:
            found = search(_prepared(records, start, known))
        except ValueError:
            continue
        if best is None or found.cost < best.cost:
            best = found
        if best.reached:
            break
    if best is None:
        raise ValueError(
            "no start of the fit can be simulated: the load breaks away, or is too fast"
        )
    for _ in range(ROUNDS):
        best = search(_reweighted(best))
    return best


def _starts(begin: Plant) -> list[Plant]:
    """The first plant; where that leads nowhere, one of springs and more damping."""
    bristles = begin.bristles[0]
    other: Bristles = replace(bristles, compliance=0.0, damping=2.0 * bristles.damping)
    return [begin, replace(begin, bristles=(other,))]


def _prepared(records: Sequence[Record], first: Plant, assumed: Assumed) -> Fitted:
    parameters = Parameters.of(records, first, assumed)
    priors = np.zeros(parameters.size)
    priors[len(parameters.names) :] = 1.0
    viscous = parameters.index("viscous_friction")
    if viscous is not None:
        priors[viscous] = 1.0  # of the order of critical damping: all that is known beforehand
    grids = []
    for record in records:
        count = steps_per_sample(first, record.step, record.highest_frequency())
        grids.append((torque_on_grid(record.torque, count, assumed.between), count))
    channels = tuple(
        tuple(
            Channel.of(name, samples, there, _noise(samples), np.ones(1))
            for name, samples, there in measured(record)
        )
        for record in records
    )
    start = parameters.start()
    return Fitted(
        tuple(records), parameters, start, channels, tuple(grids), (), (), priors, np.inf, False
    )  # fmt: skip


def _noise(samples: Array) -> float:
    """Deviation of white noise on a smooth course, by second differences; never 0."""
    rough = float(np.std(np.diff(samples, 2))) / np.sqrt(6.0)
    return float(max(rough, 1e-4 * np.std(samples), np.finfo(float).tiny))


def _motion(fit: Fitted, number: int, vector: Array, plant: Plant | None) -> Motion:
    parameters, record = fit.parameters, fit.records[number]
    grid, count = fit.grids[number]
    own = vector[parameters.of_record(number)]
    scale = LARGEST_OFFSET * record.amplitude
    moved = grid + scale * own[0]
    bent, rate = None, 0.0
    if not record.at_rest:
        bent = float(moved[0, 0] + scale * own[1])
        rate = own[2] * scale / parameters.damping_scale
    return simulate(
        plant or parameters.plant(vector),
        moved,
        record.step,
        per_sample=count,
        bristle_torque=bent,
        rate=rate,
    )


def _answers(fit: Fitted, number: int, vector: Array, plant: Plant | None = None) -> Array:
    return _seen(fit, number, _motion(fit, number, vector, plant), vector)


def _seen(fit: Fitted, number: int, motion: Motion, vector: Array) -> Array:
    """What the channels of a record show of a motion, shape (channels, n)."""
    told = []
    for channel in fit.channels[number]:
        at = motion.rate_at if channel.name == "rate" else motion.angle_at
        told.append(at(fit.parameters.delay(vector, channel.name)))
    return np.array(told)


def _residuals(fit: Fitted, number: int, vector: Array) -> Array:
    answers = _answers(fit, number, vector)
    pairs = zip(fit.channels[number], answers, strict=True)
    return np.array([channel.left(channel.samples - told) for channel, told in pairs])


def _jacobian(fit: Fitted, number: int, vector: Array) -> Array:
    """Of the simulated, in deviations, shape (channels, n, size): forward differences."""
    parameters, channels = fit.parameters, fit.channels[number]
    own = parameters.of_record(number)
    here = _motion(fit, number, vector, None)
    answers = _seen(fit, number, here, vector)
    found = np.zeros((len(channels), len(fit.records[number].torque), len(vector)))
    for index in (*range(len(parameters.names)), *range(own.start, own.stop)):
        moved = vector.copy()
        moved[index] += DIFFERENCE
        delay = index < own.start and parameters.names[index : index + 1] in DELAYS
        motion = here if delay else _motion(fit, number, moved, None)
        slope = (_seen(fit, number, motion, moved) - answers) / DIFFERENCE
        found[:, :, index] = [c.left(each) for c, each in zip(channels, slope, strict=True)]
    return found


def search(fit: Fitted, held: int | None = None) -> Fitted:
    """From the vector of `fit` to where the sum of squares is least, with one parameter held.

    Raises ValueError when the start cannot be simulated.
    """
    from scipy.optimize import least_squares

    everything = range(len(fit.records))
    priors = np.flatnonzero(fit.priors)
    free = np.delete(np.arange(fit.parameters.size), [] if held is None else [held])
    low, high = fit.parameters.bounds()

    def whole(part: Array) -> Array:
        vector = fit.vector.copy()
        vector[free] = part
        return vector

    def residuals(part: Array) -> Array:
        vector = whole(part)
        parts = [-_residuals(fit, number, vector).ravel() for number in everything]
        return np.concatenate([*parts, vector[priors] * fit.priors[priors]])

    def jacobian(part: Array) -> Array:
        vector = whole(part)
        size = len(vector)
        parts = [_jacobian(fit, number, vector).reshape(-1, size) for number in everything]
        return np.concatenate([*parts, np.diag(fit.priors)[priors]])[:, free]

    with np.errstate(over="ignore", invalid="ignore"):
        if not np.all(np.isfinite(residuals(fit.vector[free]))):
            raise ValueError("the start of the fit cannot be simulated")
        found = least_squares(
            residuals,
            fit.vector[free],
            jacobian,
            (low[free], high[free]),
            x_scale="jac",
            max_nfev=EVALUATIONS if held is None else FEW,
            ftol=TOLERANCE,
            xtol=TOLERANCE,
            gtol=TOLERANCE,
        )
    best, cost = whole(found.x), 2.0 * float(found.cost)
    if held is not None:
        return replace(fit, vector=best, cost=cost)
    return replace(
        fit,
        vector=best,
        residuals=tuple(_residuals(fit, number, best) for number in everything),
        jacobians=tuple(_jacobian(fit, number, best) for number in everything),
        cost=cost,
        reached=found.status > 0,
    )


def _reweighted(fit: Fitted) -> Fitted:
    """With each channel's deviation as its residuals have it."""
    return _with_noise(fit, lambda left: np.ones(1))


def whitened(fit: Fitted) -> Fitted:
    """The fit again, with the noise of each channel taken for an autoregression.

    Its order is chosen by Akaike's criterion, its coefficients follow from the residuals' own
    correlation (Yule and Walker). White noise is left as it is.
    """
    return search(_reweighted(search(_with_noise(fit, _autoregression))))


def _with_noise(fit: Fitted, whitening: Callable[[Array], Array]) -> Fitted:
    """With the noise of the record that is in the middle: all of them have the same sensors.

    One that the model misses would else be taken for a noisy one, and not be missed.
    """
    seen: dict[str, list[tuple[float, Array]]] = {}
    for group, residuals in zip(fit.channels, fit.residuals, strict=True):
        for channel, left in zip(group, residuals, strict=True):
            filtered = whitening(left)
            grown = _whitened(left, filtered)
            freedom = max(np.sum(channel.there) - channel.basis.shape[1], 1.0)
            deviation = channel.deviation * float(np.sqrt(grown @ grown / freedom))
            least = 1e-9 * float(np.std(channel.samples))
            # What was whitened before is whitened again.
            whole = np.convolve(channel.whitening, filtered)
            seen.setdefault(channel.name, []).append((max(deviation, least), whole))
    noise = {
        name: sorted(each, key=_deviation)[(len(each) - 1) // 2] for name, each in seen.items()
    }
    channels = tuple(
        tuple(Channel.of(c.name, c.samples, c.kept, *noise[c.name]) for c in group)
        for group in fit.channels
    )
    return replace(fit, channels=channels)


def _deviation(noise: tuple[float, Array]) -> float:
    return noise[0]


def _autoregression(residuals: Array) -> Array:
    """1, -a1, ... of residuals (n,), by the recursion of Levinson and Durbin."""
    count = len(residuals)
    most = min(MOST_ORDER, count // 20)
    covariance = np.array([residuals[lag:] @ residuals[: count - lag] for lag in range(most + 1)])
    if not covariance[0] > 0:
        return np.ones(1)
    filters, variance = [np.ones(1)], covariance[0] / count
    scores = [count * np.log(variance)]
    for order in range(1, most + 1):
        last = filters[-1]
        reflection = -(last @ covariance[order:0:-1]) / (count * variance)
        grown = np.append(last, 0.0)
        filters.append(grown + reflection * grown[::-1])
        variance *= max(1.0 - reflection**2, 1e-12)
        scores.append(count * np.log(variance) + 2.0 * order)
    return filters[int(np.argmin(scores))]
