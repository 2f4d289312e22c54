"""Test whether one inertia on one bristle explains the records down to noise.

There are two tests of the residuals. Neither takes colored noise for a model error. The first
compares them with the simulated response, band by band (an elastic part, a second inertia, a wrong
delay). The second compares them with the effect of other bristles: several interfaces that slip
at different angles, a falling friction curve, nonlinear springs. Both are score tests (Rao; White,
Econometrica 50, 1982) with the covariance of autocorrelated scores. The shift of the parameters is
the step to a model with these terms.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np

from campaign.arrays import Array
from campaign.estimation.long_run import bandwidths, long_run
from campaign.estimation.presliding_dynamics.fit_result import JointFit, products, with_torque
from campaign.estimation.presliding_dynamics.plant import Bristles
from campaign.reason import NONE, Cause, Reason

BANDS = 10
"""Number of frequency bands of the response, evenly spaced in the logarithm."""
FAINT = 1e-3
"""Share of the response's power below the lowest and above the highest band."""
SLIP_APART = 0.8
"""Relative change of the slip angles of the two halves of a bristle, one up and one down."""
PUSH = 0.02
"""Scale of an additional force, for a finite difference of the response."""
SURELY = 1e-4
"""p value below which the residuals contain a model error, not only noise."""
LIKELY = 0.01
"""p value below which the shift by other shapes is a part of the uncertainty."""
LARGE = 0.02
"""Share of the response above which a model error prevents intervals."""
NOISE = 2.0
"""Multiple of the part that noise explains, subtracted from the part that columns explain. The
noise level is seldom known better."""
ALIKE = 1e-8
"""Least share of a column that is independent of the parameters' columns."""

SHAPES = (
    "interfaces that slip at different angles",
    "friction that falls with the rate",
    "bristles that stiffen",
    "bristles that differ by direction",
    "damping that grows with the rate",
)

ANSWER_MISSED = Cause(
    "answer missed",
    "one inertia on one bristle misses the answer by {share_percent:.2g} %, "
    "most near {frequency:.3g} Hz",
)
SHAPE_MISSED = Cause(
    "shape missed",
    "one bristle misses the answer by {share_percent:.2g} %, as would be by {shape}",
)


@dataclass(frozen=True)
class Band:
    """Residual over simulated response in a band: in phase (real), 90° ahead (imaginary)."""

    frequency: float
    error: complex


@dataclass(frozen=True)
class Misfit:
    """Results of both tests of the residuals.

    Attributes:
        bands: gain error by frequency.
        band_share: rms of the part that the bands explain over rms of the response.
        band_chance: p value of noise as the only cause of this part.
        shape_share, shape_chance: the same for other shapes of the bristles.
        shape: shape of `SHAPES` that alone explains the largest part.
        shift: of the shared parameters with other shapes, in the vector's units, shape (k,); 0 if
            noise also explains the residuals.
    """

    bands: tuple[Band, ...]
    band_share: float
    band_chance: float
    shape_share: float
    shape_chance: float
    shape: str
    shift: Array

    @property
    def reason(self) -> Reason:
        """Reason for no intervals of the fit; `NONE` if it has intervals."""
        if self.band_chance < SURELY and self.band_share > LARGE:
            worst = max(self.bands, key=lambda band: abs(band.error))
            return ANSWER_MISSED(share_percent=100 * self.band_share, frequency=worst.frequency)
        if self.shape_chance < SURELY and self.shape_share > LARGE:
            return SHAPE_MISSED(share_percent=100 * self.shape_share, shape=self.shape)
        return NONE


def misfit_of(plain: JointFit, whitened: JointFit) -> Misfit:
    """Both tests on the residuals of a fit, plain and whitened.

    Plain residuals determine the size of a model error, because an autoregression absorbs much of
    it as noise. The larger p value decides, because short records need the whitened residuals.
    """
    misfit, other = _misfit_of(plain), _misfit_of(whitened)
    shape_chance = max(misfit.shape_chance, other.shape_chance)
    return replace(
        misfit,
        band_chance=max(misfit.band_chance, other.band_chance),
        shape_chance=shape_chance,
        shift=misfit.shift * (shape_chance < LIKELY),
    )


def _misfit_of(fit: JointFit) -> Misfit:
    size = sum(float(np.sum(answer**2)) for answer in _answers(fit))
    places, columns = _band_columns(fit)
    _, chance, explained = _score_test(fit, columns)
    left = sum(np.einsum("cn,cnk->k", r, c) for r, c in zip(fit.residuals, columns, strict=True))
    power = sum(np.einsum("cnk,cnk->k", c, c) for c in columns)
    pairs = (left / np.maximum(power, np.finfo(float).tiny)).reshape(-1, 2)
    bands = tuple(Band(place, complex(*pair)) for place, pair in zip(places, pairs, strict=True))
    shapes = _shape_columns(fit)
    shift, shape_chance, shape_explained = _score_test(fit, shapes)
    alone = [_score_test(fit, [each[:, :, [k]] for each in shapes])[2] for k in range(len(SHAPES))]
    return Misfit(
        bands,
        float(np.sqrt(explained / size)),
        chance,
        float(np.sqrt(shape_explained / size)),
        shape_chance,
        SHAPES[int(np.argmax(alone))],
        shift[: len(fit.parameters.names)],
    )


def _answers(fit: JointFit) -> list[Array]:
    """Simulated responses without offset and drift, in deviations, shape (channels, n)."""
    return [
        np.array([c.left(answer) for c, answer in zip(group, fit.answers(number), strict=True)])
        for number, group in enumerate(fit.channels)
    ]


def _band_columns(fit: JointFit) -> tuple[list[float], list[Array]]:
    """Center of each band (Hz); response in each band, in phase and 90° ahead."""
    answers = _answers(fit)
    low, high = np.inf, 0.0
    for record, answer in zip(fit.records, answers, strict=True):
        power = np.cumsum(np.sum(np.abs(np.fft.rfft(answer)) ** 2, axis=0))
        frequency = np.fft.rfftfreq(answer.shape[1], record.step)
        inside = np.searchsorted(power / power[-1], [FAINT, 1.0 - FAINT])
        low = min(low, float(frequency[max(int(inside[0]), 1)]))
        high = max(high, float(frequency[min(int(inside[1]), len(frequency) - 1)]))
    edges = np.geomspace(low, max(high, 1.1 * low), BANDS + 1)
    columns = []
    for record, answer in zip(fit.records, answers, strict=True):
        spectrum = np.fft.rfft(answer)
        frequency = np.fft.rfftfreq(answer.shape[1], record.step)
        parts = np.zeros((*answer.shape, 2 * BANDS))
        for index, (begin, end) in enumerate(itertools.pairwise(edges)):
            part = spectrum * ((frequency >= begin) & (frequency < end))
            parts[:, :, 2 * index] = np.fft.irfft(part, answer.shape[1])
            parts[:, :, 2 * index + 1] = np.fft.irfft(1j * part, answer.shape[1])
        columns.append(parts)
    return [float(np.sqrt(a * b)) for a, b in itertools.pairwise(edges)], columns


def _shape_columns(fit: JointFit) -> list[Array]:
    """Change of the simulated response by each of `SHAPES`, in deviations."""
    plant, changes = fit.plant, []
    bristles = plant.bristles[0]
    # The force is common to all amplitudes: otherwise larger records would add no information.
    force = fit.parameters.torque
    fastest = max(float(np.max(np.abs(fit.motion(n).rate))) for n in range(len(fit.records)))
    for number, group in enumerate(fit.channels):
        motion = fit.motion(number)
        rate, bent = motion.rate, motion.bristle_torque[:, 0]
        base = fit.answers(number)
        speed = float(np.sqrt(np.mean(rate**2)))
        falling = replace(bristles, coulomb_share=0.7, stribeck_velocity=speed)
        forces = (bent**3 / force**2, bent**2 / force, rate * np.abs(rate) * force / fastest**2)
        other = [
            fit.answers(number, replace(plant, bristles=each))
            for each in (_apart(bristles), (falling,))
        ]
        other += [_pushed(fit, number, each) for each in forces]
        columns = [
            np.array([c.left(a - b) for c, a, b in zip(group, each, base, strict=True)])
            for each in other
        ]
        # A shape that cannot be simulated has no effect.
        kept = [each if np.all(np.isfinite(each)) else np.zeros_like(each) for each in columns]
        changes.append(np.stack(kept, axis=-1))
    return changes


def _apart(bristles: Bristles) -> tuple[Bristles, Bristles]:
    """Two halves of a bristle: one slips at a smaller angle, the other at a larger one."""
    return tuple(  # type: ignore[return-value]
        replace(
            bristles,
            stiffness=0.5 * bristles.stiffness,
            damping=0.5 * bristles.damping,
            compliance=2.0 * bristles.compliance * factor,
        )
        for factor in (1.0 - SLIP_APART, 1.0 + SLIP_APART)
    )


def _pushed(fit: JointFit, number: int, force: Array) -> Array:
    """Response with `PUSH` times an additional friction force on the load, (steps + 1,)."""
    middle = 0.5 * (force[:-1] + force[1:])
    more = PUSH * np.column_stack([force[:-1], middle, force[1:]])
    return with_torque(fit, number, fit.grids[number].torque - more).answers(number)


def _score_test(fit: JointFit, columns: list[Array]) -> tuple[Array, float, float]:
    """Shift of the parameters by additional columns; p value of these columns; sum of squares that
    they explain beyond noise.

    columns: of each record, shape (channels, n, k). Dependent columns have no effect.
    """
    from scipy.special import chdtrc

    size, count = fit.parameters.size, columns[0].shape[-1]
    information = fit.information
    across, square = np.zeros((size, count)), np.zeros((count, count))
    for slopes, more in zip(fit.jacobians, columns, strict=True):
        across += products(slopes, more)
        square += products(more, more)
    onto = np.linalg.solve(information, across)
    own = square - across.T @ onto
    kept = np.diag(own) > ALIKE * np.maximum(np.diag(square), np.finfo(float).tiny)
    if not np.any(kept):
        return np.zeros(size), 1.0, 0.0
    apart = [
        (more - slopes @ onto)[:, :, kept]
        for slopes, more in zip(fit.jacobians, columns, strict=True)
    ]
    pairs = list(zip(fit.residuals, apart, strict=True))
    # Prior values are also measurements, with their own residuals.
    known = fit.priors[:, None] * onto[:, kept]
    total = known.T @ (fit.priors * fit.vector)
    total = sum((np.einsum("cn,cnk->k", *pair) for pair in pairs), start=total)
    inverse = np.linalg.pinv(own[np.ix_(kept, kept)], rcond=1e-9, hermitian=True)
    # The explained part is not noise: in the scores it would hide itself.
    scores = [
        np.einsum("cn,cnk->nk", left - more @ (inverse @ total), more) for left, more in pairs
    ]
    meat = long_run(scores, bandwidths(scores)[1]) + known.T @ known
    scale = np.sqrt(np.diag(meat))
    statistic = float(
        (total / scale)
        @ np.linalg.pinv(meat / np.outer(scale, scale), rcond=1e-9, hermitian=True)
        @ (total / scale)
    )
    step = np.zeros(count)
    step[kept] = inverse @ total
    explained = float(total @ step[kept]) - NOISE * float(np.trace(inverse @ meat))
    return -onto @ step, float(chdtrc(int(np.sum(kept)), statistic)), max(explained, 0.0)
