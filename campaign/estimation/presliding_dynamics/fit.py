"""Joint output-error fit of a plant below breakaway to the records of several trials.

What is fitted is the simulated answer, not an equation error: noise of rate and angle then biases
nothing (Ljung, "System Identification", 2nd ed., section 7.2). The rate is compared as a rate, so
that the gyro's noise is not integrated. Offset and slow drift of the gyro and the encoder's offset
are linear, and are taken out of residuals and Jacobian in each record.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from campaign.arrays import Array
from campaign.estimation.presliding_dynamics.channel import (
    Channel,
    autoregression,
    filtered,
    white_noise,
)
from campaign.estimation.presliding_dynamics.fit_result import (
    Grid,
    JointFit,
    centred,
    residuals_of,
    slopes_of,
    with_doubts,
    with_slopes,
)
from campaign.estimation.presliding_dynamics.parameters import Parameters
from campaign.estimation.presliding_dynamics.plant import Bristles, Plant
from campaign.estimation.presliding_dynamics.record import Assumptions, Record, measured
from campaign.estimation.presliding_dynamics.start import first_plant

EVALUATIONS = 60
"""of a start at most; a fit that needs more has not converged."""
FEW = 8
"""Likewise, of one with a parameter held near the best fit."""
TOLERANCE = 1e-8
"""Relative change of the sum of squares at which a search ends: of 1e5 samples a hundredth of what
a deviation of a parameter makes."""
ROUNDS = 1
"""in which each channel's deviation is taken from its own residuals."""


def fit_presliding_dynamics(
    records: Sequence[Record], assumed: Assumptions | None = None
) -> JointFit:
    """Fit sigma0, sigma1, J and what else is free to all records at once.

    Raises ValueError with the reason where there is no start, and where none can be simulated.
    """
    best = first_fit(records, assumed)
    for _ in range(ROUNDS):
        best = search(_reweighted(centred(search(_reweighted(with_doubts(best))))))
    return with_slopes(best)


def first_fit(records: Sequence[Record], assumed: Assumptions | None = None) -> JointFit:
    """Likewise, to torques as they are told, without slopes: enough to tell the motion.

    The search begins at a linear fit of the spectra. Raises ValueError as above.
    """
    if not records:
        raise ValueError("there is no record to fit")
    if len({record.doubts.shape[1] for record in records}) > 1:
        raise ValueError("the records differ in how many columns of doubt their torques have")
    known = assumed or Assumptions()
    best: JointFit | None = None
    for start in _starts(first_plant(records, known)):
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
    return best


def _starts(begin: Plant) -> list[Plant]:
    """The first plant; where that leads nowhere, one of springs and more damping."""
    bristles = begin.bristles[0]
    other: Bristles = replace(bristles, compliance=0.0, damping=2.0 * bristles.damping)
    return [begin, replace(begin, bristles=(other,))]


def _prepared(records: Sequence[Record], first: Plant, assumed: Assumptions) -> JointFit:
    parameters = Parameters.of(records, first, assumed)
    priors = np.zeros(parameters.size)
    priors[len(parameters.names) :] = 1.0
    # Of the order of critical damping: all that is known of it beforehand.
    priors[parameters.names.index("viscous_friction")] = 1.0
    grids = tuple(Grid.of(record, first) for record in records)
    channels = tuple(
        tuple(
            Channel.of(name, samples, there, white_noise(samples), np.ones(1))
            for name, samples, there in measured(record)
        )
        for record in records
    )
    # A first search has the torque as it was told: what that may be off by would fit a wrong plant.
    answers = tuple(
        np.zeros((len(each), *record.doubts.shape))
        for each, record in zip(channels, records, strict=True)
    )
    start = parameters.start()
    return JointFit(
        records=tuple(records),
        parameters=parameters,
        vector=start,
        channels=channels,
        grids=grids,
        doubt_answers=answers,
        taken=np.zeros(parameters.factors),
        residuals=(),
        jacobians=(),
        priors=priors,
        cost=np.inf,
        reached=False,
    )


def search(fit: JointFit, held: int | None = None) -> JointFit:
    """From the vector of `fit` to where the sum of squares is least, with one parameter held.

    Raises ValueError when the start cannot be simulated.
    """
    from scipy.optimize import least_squares

    everything = range(len(fit.records))
    doubted = fit.parameters.doubted
    left = [doubted.start + index for index in range(fit.parameters.factors)]
    priors = np.setdiff1d(np.flatnonzero(fit.priors), left)
    free = np.delete(np.arange(fit.parameters.size), left + ([] if held is None else [held]))
    low, high = fit.parameters.bounds()
    # What the torque is off by is linear: the best of it follows from the rest of the vector.
    pairs = [zip(c, d, strict=True) for c, d in zip(fit.channels, fit.doubt_answers, strict=True)]
    columns = np.concatenate([c.left(each) for pair in pairs for c, each in pair])
    solved = np.linalg.inv(columns.T @ columns + np.eye(len(left)))

    def whole(part: Array) -> Array:
        vector = fit.vector.copy()
        vector[free], vector[doubted] = part, fit.taken
        return vector

    def moved(misses: Array) -> Array:
        """By how much the factors of the doubts are to move, for what is missed with `taken`."""
        return np.asarray(-solved @ (columns.T @ misses + fit.taken))

    def missed(part: Array) -> Array:
        parts = [-residuals_of(fit, number, whole(part)).ravel() for number in everything]
        return np.concatenate(parts)

    def residuals(part: Array) -> Array:
        misses = missed(part)
        by = moved(misses)
        known = whole(part)[priors] * fit.priors[priors]
        return np.concatenate([misses + columns @ by, fit.taken + by, known])

    def jacobian(part: Array) -> Array:
        vector = whole(part)
        size = len(vector)
        parts = [slopes_of(fit, number, vector).reshape(-1, size) for number in everything]
        slopes = np.concatenate(parts)[:, free]
        by = -solved @ (columns.T @ slopes)
        return np.concatenate([slopes + columns @ by, by, np.diag(fit.priors)[priors][:, free]])

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
    best = whole(found.x)
    best[doubted] += moved(missed(found.x))
    return replace(
        fit,
        vector=best,
        residuals=tuple(residuals_of(fit, number, best) for number in everything),
        cost=2.0 * float(found.cost),
        reached=found.status > 0,
    )


def _reweighted(fit: JointFit) -> JointFit:
    """With each channel's deviation as its residuals have it."""
    return _with_noise(fit, lambda left: np.ones(1))


def whitened(fit: JointFit) -> JointFit:
    """The fit again, with the noise of each channel taken for an autoregression.

    Its order is chosen by Akaike's criterion, its coefficients follow from the residuals' own
    correlation (Yule and Walker). White noise is left as it is.
    """
    first = search(_with_noise(centred(fit), autoregression))
    return with_slopes(search(centred(_reweighted(first))))


def _with_noise(fit: JointFit, whitening: Callable[[Array], Array]) -> JointFit:
    """With the noise of the record that is in the middle: all of them have the same sensors.

    One that the model misses would else be taken for a noisy one, and not be missed.
    """
    seen: dict[str, list[tuple[float, Array]]] = {}
    for group, residuals in zip(fit.channels, fit.residuals, strict=True):
        for channel, left in zip(group, residuals, strict=True):
            own = whitening(left)
            grown = filtered(left, own)
            freedom = max(np.sum(channel.there) - channel.basis.shape[1], 1.0)
            deviation = channel.deviation * float(np.sqrt(grown @ grown / freedom))
            least = 1e-9 * float(np.std(channel.samples))
            # What was whitened before is whitened again.
            whole = np.convolve(channel.whitening, own)
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
