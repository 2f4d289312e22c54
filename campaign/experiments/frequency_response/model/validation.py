"""Validation of models on unseen responses and recordings."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from campaign.arrays import Array, ComplexArray
from campaign.estimate import Estimate
from campaign.estimation.frequency.drive import TwoMass
from campaign.estimation.frequency.measured_response import MeasuredResponse
from campaign.estimation.frequency.output_error import Simulated, output_error, simulated_output
from campaign.estimation.frequency.prediction import HeldAgainst, held_against
from campaign.estimation.frequency.rational import RationalFit
from campaign.estimation.frequency.two_mass_model import Side
from campaign.experiments.frequency_response.model.frequency_fit import Band, FrequencyFit, Masses
from campaign.experiments.frequency_response.model.tables import drive_name
from campaign.experiments.interface import TrialData
from campaign.experiments.responses.signals import (
    ResponseOptions,
    Signals,
    signals,
    whole_stretches,
)
from campaign.experiments.responses.sources import Source, fitted_part, sources
from campaign.physics.bench import Bench
from campaign.reason import Reason
from campaign.signals import MultiSine
from campaign.units import torque_text

FUNCTION = "rational function"
FEWEST_LINES = 3
"""Fewest frequencies of a prediction that is compared with a response."""
OTHER_SIZE = 1.2
"""Ratio of two excitations' rms above which responses with friction differ."""


@dataclass(frozen=True)
class Model:
    """Fitted response of one sensor, of any kind.

    Attributes:
        source: source of the fit; `side`: the sensor.
        lowest, highest: band of the fit (Hz).
        value, jacobian: response (n,), its derivative by the parameters (n, p); of frequency (Hz).
        covariance: of the parameters, shape (p, p).
        poles: (rad/s).
        misfit: why it is no model of its source; none if it may be one.
    """

    name: str
    source: Source
    side: Side
    lowest: float
    highest: float
    value: Callable[[Array], ComplexArray]
    jacobian: Callable[[Array], ComplexArray]
    covariance: Array
    poles: ComplexArray
    misfit: Reason

    @property
    def band(self) -> tuple[float, float]:
        """Ends of the fitted band (Hz), widened by rounding: both ends are lines."""
        return self.lowest / (1.0 + 1e-9), self.highest * (1.0 + 1e-9)


@dataclass(frozen=True)
class Prediction:
    """One response that was not fitted, and one model.

    Attributes:
        source: source of the unseen response.
        output: relative error of the simulated output there; None without a simulation.
        first: simulated output of the first recording.
        is_angle: whether the output is an angle, and no rate.
    """

    source: Source
    model: Model
    against: HeldAgainst
    output: Estimate | None
    first: Simulated | None
    is_angle: bool = False


@dataclass(frozen=True)
class Validation:
    """All predictions, the simulated outputs of fitted recordings, and sentences.

    Attributes:
        own: by model: relative error of the output simulated from its own recordings.
    """

    predictions: tuple[Prediction, ...] = ()
    own: tuple[tuple[Model, Estimate], ...] = ()
    remarks: tuple[str, ...] = ()


def models(found: Sequence[FrequencyFit], told: Masses, band: Band) -> Iterator[Model]:
    """All fitted models, those of the two masses after the functions of their source."""
    for each in found:
        for side, chosen in each.fits.items():
            fit = chosen.fit
            yield Model(
                FUNCTION, each.source, side, fit.lowest, fit.highest, fit.value,
                partial(_slope, fit), fit.scatter, fit.poles, fit.misfit,
            )  # fmt: skip
        if told.drive is not None and told.source is each.source:
            yield from _masses(told, told.drive, each.source, band)


def _slope(fit: RationalFit, frequency: Array) -> ComplexArray:
    """Derivative of a fitted function by its parameters, shape (n, p)."""
    return np.asarray(fit.value(frequency)[:, None] * fit.log_jacobian(frequency))


def _masses(told: Masses, drive: TwoMass, source: Source, band: Band) -> Iterator[Model]:
    if drive.misfit and not drive.covariance.size:
        return
    for side, place in told.places.items():
        part = fitted_part(source, side, max(band.lowest, told.lowest), band.highest)
        ends = float(part.frequency[0]), float(part.frequency[-1])
        poles = np.polynomial.polynomial.polyroots(drive.polynomials(place)[1])
        yield Model(
            drive_name(drive), source, side, *ends, partial(drive.value, side=place),
            partial(drive.jacobian, side=place), drive.covariance,
            np.asarray(poles, dtype=complex), drive.misfit,
        )  # fmt: skip


def validated(
    fitted: Sequence[TrialData],
    unseen: Sequence[TrialData],
    bench: Bench,
    how: ResponseOptions,
    fits: Sequence[Model],
) -> Validation:
    """Compare models with unseen responses and with their own recordings.

    Raises ValueError if the validation has no response.
    """
    own = tuple(_own(fitted, bench, how, fits))
    if not unseen:
        return Validation(own=own)
    responses, remarks = sources(unseen, bench, how)
    remarks += _same_course(fitted, unseen)
    if not responses:
        raise ValueError(f"of the validation {' '.join(remarks) or 'no trial gives a response'}")
    predictions = []
    for source in responses:
        for side, measured in source.responses.items():
            for model in _nearest(fits, source, side):
                one = _predicted(source, model, measured, unseen, bench, how)
                if one is None:
                    remarks.append(
                        f"{source.name}: too few frequencies lie where models were fitted."
                    )
                    continue
                predictions.append(one)
                remarks += _other_size(source, model.source)
    return Validation(tuple(predictions), own, tuple(dict.fromkeys(remarks)))


def _same_course(fitted: Sequence[TrialData], unseen: Sequence[TrialData]) -> list[str]:
    """Remark on unseen multisines with fitted phases: distortion repeats, and only noise is new."""
    own = {str(each.trial.task.command) for each in fitted if _is_multisine(each)}
    again = [each for each in unseen if _is_multisine(each) and str(each.trial.task.command) in own]
    if not again:
        return []
    remark = (
        f"{len(again)} of its {len(unseen)} trials have a multisine that the model was fitted to, "
        "with the same phases. What friction adds repeats itself, so that differences look too "
        "small. Other phases (another seed) would show them."
    )
    return [remark]


def _is_multisine(trial: TrialData) -> bool:
    return isinstance(trial.trial.task.command, MultiSine)


def _nearest(fits: Sequence[Model], source: Source, side: Side) -> list[Model]:
    """Model of each name with the most similar excitation; the first if sizes are unknown."""
    nearest = []
    for name in dict.fromkeys(each.name for each in fits):
        some = [each for each in fits if each.name == name and each.side == side]
        if some:
            nearest.append(min(some, key=lambda each: size_difference(each.source, source)))
    return nearest


def size_difference(one: Source, other: Source) -> float:
    """Difference of two excitations in size, as a logarithm; infinite if one has no size."""
    if one.rms <= 0 or other.rms <= 0:
        return math.inf
    return abs(math.log(one.rms / other.rms))


def _other_size(source: Source, fitted: Source) -> Iterator[str]:
    if math.log(OTHER_SIZE) < size_difference(source, fitted) < math.inf:
        yield (
            f"{source.name}: its torque has an rms of {torque_text(source.rms)}, that of what was "
            f"fitted ({fitted.name}) {torque_text(fitted.rms)}: with friction the response differs."
        )


def _predicted(
    source: Source,
    model: Model,
    measured: MeasuredResponse,
    unseen: Sequence[TrialData],
    bench: Bench,
    how: ResponseOptions,
) -> Prediction | None:
    part = measured.between(*model.band).at(slice(None, None, source.every))
    if len(part.frequency) < FEWEST_LINES:
        return None
    at = part.frequency
    against = held_against(part, model.value(at), model.jacobian(at), model.covariance)
    trials = [each for each in unseen if each.trial.number in source.trials]
    simulated = _simulated(trials, bench, how, model)
    if not simulated:
        return Prediction(source, model, against, None, None)
    error = output_error("output_error", simulated, model.lowest)
    is_angle = signals(trials[0], bench, how.excited).is_angle(model.side)
    return Prediction(source, model, against, error, simulated[0], is_angle)


def _own(
    fitted: Sequence[TrialData], bench: Bench, how: ResponseOptions, fits: Sequence[Model]
) -> Iterator[tuple[Model, Estimate]]:
    for model in fits:
        trials = [each for each in fitted if each.trial.number in model.source.trials]
        simulated = _simulated(trials, bench, how, model)
        if simulated:
            yield model, output_error("output_error", simulated, model.lowest)


def _simulated(
    trials: Sequence[TrialData], bench: Bench, how: ResponseOptions, model: Model
) -> list[Simulated]:
    """Outputs simulated from the recorded torque, beside the recorded ones; short stretches are
    left out.
    """
    outputs = []
    for trial in trials:
        try:
            recorded = signals(trial, bench, how.excited)
        except ValueError:
            continue
        if model.side in recorded.answers:
            outputs += list(_stretches(recorded, model))
    return outputs


def _stretches(told: Signals, model: Model) -> Iterator[Simulated]:
    answer, is_angle = told.answers[model.side], told.is_angle(model.side)

    def response(frequency: Array) -> ComplexArray:
        value = model.value(frequency)
        return np.asarray(value / (2j * np.pi * frequency) if is_angle else value)

    poles = np.append(model.poles, 0.0) if is_angle else model.poles
    for cut in whole_stretches([told.torque, answer], 2):
        band = model.lowest, model.highest
        try:
            one = simulated_output(told.torque[cut], answer[cut], told.rate, response, poles, *band)
        except ValueError:
            continue  # too short
        yield Simulated(one.time + float(told.time[cut][0]), one.measured, one.simulated)
