"""Joint output-error fit of a plant below breakaway to the records of several trials.

The fit minimizes the error of the simulated response, not an equation error. Therefore noise of
rate and angle causes no bias (Ljung, "System Identification", 2nd ed., section 7.2). The rate is
compared as a rate, so that the gyro's noise is not integrated. Offset and drift of the gyro and the
encoder's offset are linear: a projection of each record's residuals and Jacobian excludes them.
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
"""Largest number of evaluations from a start; a fit that needs more has not converged."""
FEW = 8
"""Largest number of evaluations with one parameter fixed near the best fit."""
TOLERANCE = 1e-8
"""Relative change of the sum of squares at which a search ends. For 1e5 samples this is 1/1000 of
the change by one deviation of a parameter."""


def fit_presliding_dynamics(
    records: Sequence[Record], assumed: Assumptions | None = None
) -> JointFit:
    """Fit sigma0, sigma1, J and the other free parameters to all records at once.

    Raises ValueError, with the reason, if no start exists or none can be simulated.
    """
    best = search(_reweighted(with_doubts(first_fit(records, assumed))))
    return with_slopes(search(_reweighted(centred(best))))


def first_fit(records: Sequence[Record], assumed: Assumptions | None = None) -> JointFit:
    """First fit, with the given torques and without slopes: sufficient to simulate the motion.

    The search starts from a linear fit of the spectra. Raises as `fit_presliding_dynamics`.
    """
    if not records:
        raise ValueError("there is no record to fit")
    if len({record.doubts.shape[1] for record in records}) > 1:
        raise ValueError("the records differ in how many columns of doubt their torques have")
    known = assumed or Assumptions()
    best: JointFit | None = None
    for start in _starts(first_plant(records, known)):
        try:
            fit = search(_prepared(records, start, known))
        except ValueError:
            continue
        if best is None or fit.cost < best.cost:
            best = fit
        if best.reached:
            break
    if best is None:
        raise ValueError(
            "no start of the fit can be simulated: the load breaks away, or is too fast"
        )
    return best


def _starts(begin: Plant) -> list[Plant]:
    """Start plants: the first one, and for its failure a linear spring with more damping."""
    bristles = begin.bristles[0]
    other: Bristles = replace(bristles, compliance=0.0, damping=2.0 * bristles.damping)
    return [begin, replace(begin, bristles=(other,))]


def _prepared(records: Sequence[Record], first: Plant, assumed: Assumptions) -> JointFit:
    parameters = Parameters.of(records, first, assumed)
    priors = np.zeros(parameters.size)
    priors[len(parameters.names) :] = 1.0
    # The only prior knowledge: viscous friction is of the order of critical damping.
    priors[parameters.names.index("viscous_friction")] = 1.0
    grids = tuple(Grid.of(record, first) for record in records)
    channels = tuple(
        tuple(
            Channel.of(name, samples, valid, white_noise(samples), np.ones(1))
            for name, samples, valid in measured(record)
        )
        for record in records
    )
    # The first search uses the given torque, because free torque errors would fit a wrong plant.
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
    """Minimize the sum of squares from the vector of `fit`; `held`: index of a fixed parameter.

    Raises ValueError if the start cannot be simulated.
    """
    from scipy.optimize import least_squares

    everything = range(len(fit.records))
    doubted = fit.parameters.doubted
    left = [doubted.start + index for index in range(fit.parameters.factors)]
    priors = np.setdiff1d(np.flatnonzero(fit.priors), left)
    free = np.delete(np.arange(fit.parameters.size), left + ([] if held is None else [held]))
    low, high = fit.parameters.bounds()
    # Torque errors are linear: the rest of the vector determines their best factors.
    pairs = [zip(c, d, strict=True) for c, d in zip(fit.channels, fit.doubt_answers, strict=True)]
    columns = np.concatenate([c.left(each) for pair in pairs for c, each in pair])
    solved = np.linalg.inv(columns.T @ columns + np.eye(len(left)))

    def whole(part: Array) -> Array:
        vector = fit.vector.copy()
        vector[free], vector[doubted] = part, fit.taken
        return vector

    def moved(misses: Array) -> Array:
        """Change of the factors of torque errors from `taken`, from the residuals with `taken`."""
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
        result = least_squares(
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
    best = whole(result.x)
    best[doubted] += moved(missed(result.x))
    return replace(
        fit,
        vector=best,
        residuals=tuple(residuals_of(fit, number, best) for number in everything),
        cost=2.0 * float(result.cost),
        reached=result.status > 0,
    )


def _reweighted(fit: JointFit) -> JointFit:
    """Set the deviation of each channel from its residuals."""
    return _with_noise(fit, lambda left: np.ones(1))


def whitened(fit: JointFit) -> JointFit:
    """Repeat the fit with an autoregression as the noise of each channel.

    Akaike's criterion selects its order. Its coefficients follow from the autocorrelation of the
    residuals (Yule and Walker). White noise remains white.
    """
    first = search(_with_noise(centred(fit), autoregression))
    return with_slopes(search(centred(_reweighted(first))))


def _with_noise(fit: JointFit, whitening: Callable[[Array], Array]) -> JointFit:
    """Set the noise of each sensor to that of its median record, for all records.

    Otherwise a record with a model error would count as noisy and hide the error.
    """
    by_channel: dict[str, list[tuple[float, Array]]] = {}
    for group, residuals in zip(fit.channels, fit.residuals, strict=True):
        for channel, left in zip(group, residuals, strict=True):
            own = whitening(left)
            grown = filtered(left, own)
            freedom = max(np.sum(channel.there) - channel.basis.shape[1], 1.0)
            deviation = channel.deviation * float(np.sqrt(grown @ grown / freedom))
            least = 1e-9 * float(np.std(channel.samples))
            # The new filter follows the previous whitening.
            whole = np.convolve(channel.whitening, own)
            by_channel.setdefault(channel.name, []).append((max(deviation, least), whole))
    noise = {
        name: sorted(pairs, key=lambda pair: pair[0])[(len(pairs) - 1) // 2]
        for name, pairs in by_channel.items()
    }
    channels = tuple(
        tuple(Channel.of(c.name, c.samples, c.kept, *noise[c.name]) for c in group)
        for group in fit.channels
    )
    return replace(fit, channels=channels)
