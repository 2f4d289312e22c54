"""Frequency response of any motion: modes, margins, distortion, two masses.

Sines, repeated odd multisines and any other recording each give a response. A rational function
with a delay determines its modes; two inertias on a spring, what the sensors' places allow.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Literal

from pydantic import Field

from campaign.estimate import Estimate, Origin
from campaign.estimation.frequency.best_linear import FEWEST_REALISATIONS
from campaign.estimation.frequency.one_inertia import RIGID
from campaign.estimation.frequency.two_mass_model import Side
from campaign.estimation.gate import admitted, admitted_together, refused
from campaign.estimation.intervals import MODEL_MISFIT
from campaign.experiments.frequency_response.model.axis_numbers import by_rule, odd_distortion
from campaign.experiments.frequency_response.model.frequency_fit import (
    Band,
    FrequencyFit,
    Masses,
    best_source,
    found_in,
    masses,
    too_few,
)
from campaign.experiments.frequency_response.model.tables import (
    correlations_table,
    figures,
    fits_table,
    loop_tables,
    masses_table,
    modes_table,
)
from campaign.experiments.frequency_response.model.validation import Validation, models, validated
from campaign.experiments.frequency_response.model.validation_figures import (
    residual_figures,
    validation_figures,
    validation_tables,
)
from campaign.experiments.interface import Model, TestData
from campaign.experiments.responses.signals import ResponseOptions, usable
from campaign.experiments.responses.sources import sources
from campaign.experiments.responses.tables import distortion_tables, sources_table
from campaign.experiments.shared.recorded_motion import validation_of
from campaign.experiments.shared.systematic import TORQUE_CONSTANT, known_uncertainty
from campaign.parameter import IdentifiedRig, Parameter, Unseen
from campaign.result import Finding, Result
from campaign.text import words
from campaign.units import Frequency

LOUDER = "excite with more torque, or record longer, around the antiresonance and the resonance"
AMPLITUDES = "measure at a second amplitude, half of this or twice as much"
MORE_PHASES = (
    f"record {FEWEST_REALISATIONS} realisations with other phases, which also determine "
    "inertias and stiffness"
)
LOWER = "excite further below the antiresonance, above what friction holds"
SURELY = 3.0
"""Standard deviations by which a reported delay lies below zero."""
MEANINGS = (
    ("total_inertia", "Inertia of the whole drive, seen at the load.", "kg m^2", LOWER),
    ("motor_inertia", "Inertia that the torque drives directly.", "kg m^2", LOUDER),
    ("load_inertia", "Inertia behind the spring.", "kg m^2", LOUDER),
    ("stiffness", "Stiffness of the spring between the two inertias.", "N m/rad", LOUDER),
    ("damping", "Damping of that spring.", "N m s/rad", LOUDER),
    ("resonance", "Frequency at which both inertias swing against each other.", "Hz", LOUDER),
    ("resonance_damping", "Damping ratio of that resonance.", "", LOUDER),
    ("antiresonance", "Frequency of what lies behind the spring alone.", "Hz", LOUDER),
    ("antiresonance_damping", "Damping ratio of what lies behind the spring alone.", "", LOUDER),
)
"""Numbers of a two-mass drive: attribute, meaning, unit, what to measure next."""
APPENDAGE = {
    "load_inertia": "appendage.inertia",
    "antiresonance": "appendage.frequency",
    "antiresonance_damping": "appendage.damping_ratio",
}
"""Keys of the bench for an elastic part that the sensor sees only through the load."""


class FrequencyResponseOptions(ResponseOptions):
    """Options of a frequency response."""

    lowest: Frequency = Field(default=0.0, ge=0)
    """Lowest fitted frequency; friction distorts responses below it."""
    highest: Frequency = Field(default=1e5, gt=0)
    """Highest fitted frequency."""
    order: int = Field(default=6, ge=1, le=8)
    """Highest order of a denominator to try."""
    place: Literal["auto", "driven", "behind"] = "auto"
    """Position of the load's sensor: on the inertia that the torque drives, or behind the
    spring."""


def identified(data: TestData) -> Result:
    """Modes, margins and inertias. Raises ValueError if no trial gives a response."""
    options: FrequencyResponseOptions = data.model
    measured, remarks = sources(data.trials, data.bench, options)
    if not measured:
        raise ValueError(" ".join(dict.fromkeys(remarks)) or "no trial gives a response")
    band = Band(options.lowest, options.highest, options.order)
    fitted = [found_in(each, band) for each in measured]
    best = best_source(fitted)
    fitted.sort(key=lambda each: (each is not best, -each.source.rms))  # most informative first
    torque = known_uncertainty(data.bench, TORQUE_CONSTANT)
    two_masses = masses(best, data.bench, options.place, band, torque, fitted)
    parameters = tuple(_parameters(two_masses, best or fitted[0]))
    correlations = _correlations(two_masses, parameters)
    fits = tuple(models(fitted, two_masses, band))
    validation = validated(data.trials, validation_of(data, usable), data.bench, options, fits)
    tables = (
        sources_table([each.source for each in fitted]),
        *masses_table(two_masses),
        correlations_table(correlations),
        modes_table(fitted),
        *loop_tables(fitted),
        *distortion_tables([each.source for each in fitted]),
        fits_table(fitted, two_masses),
        *validation_tables(validation),
    )
    return Result(
        tables=tuple(each for each in tables if each.rows),
        figures=(
            *validation_figures(validation),
            *figures(fitted, two_masses),
            *residual_figures(fitted, fits),
        ),
        findings=tuple(_findings(fitted, parameters)),
        notes=(
            *_undetermined(parameters),
            *_notes(fitted, two_masses, remarks),
            *(f"Of the validation: {each}" for each in validation.remarks),
        ),
        identified=IdentifiedRig(parameters, correlations=correlations, unseen=_unseen(validation)),
    )


def _unseen(validation: Validation) -> Unseen | None:
    """Error of the best model's output for unseen torque."""
    outputs = [each.output for each in validation.predictions if each.output is not None]
    return Unseen(min(each.value for each in outputs), "motion") if outputs else None


def _correlations(told: Masses, parameters: Sequence[Parameter]) -> Mapping[tuple[str, str], float]:
    """Correlations by scatter, of the numbers with an interval."""
    if told.drive is None:
        return {}
    names = {each.estimate.name for each in parameters if each.estimate.has_interval}
    return {pair: share for pair, share in told.drive.correlations.items() if {*pair} <= names}


def _parameters(told: Masses, best: FrequencyFit) -> Iterator[Parameter]:
    hangs_on_load = dict(told.places) == {"load": "motor"}
    if told.drive is None or told.axis is None or told.drive.misfit:
        few = too_few(best.source)
        reason = few or told.reason
        if told.drive is not None:
            reason = MODEL_MISFIT(why=told.drive.misfit)
        odd = 0.0 if few else odd_distortion(best.source)  # extrema have friction's part already
        local = {name: by_rule(each, odd) for name, each in _local(told, best).items()}
        for name, meaning, unit, advice in MEANINGS:
            nothing = Estimate.without_interval(name, math.nan, unit, reason)
            estimate = admitted(local.get(name, nothing))
            key = APPENDAGE.get(name, "") if hangs_on_load and estimate.has_interval else ""
            yield Parameter(estimate, meaning, unit, key, MORE_PHASES if few else advice)
        return
    keys = {"total_inertia": "axis.inertia", **(APPENDAGE if hangs_on_load else {})}
    passed = admitted_together({each[0]: told.axis.estimates[each[0]] for each in MEANINGS}, {})
    for mode in ("resonance", "antiresonance"):
        if not passed[mode].is_determined:  # nor is the damping of what is not there
            name = f"{mode}_damping"
            passed[name] = refused(passed[name], passed[mode].reason)
    for name, meaning, unit, advice in MEANINGS:
        # Friction may leave only a damping open; then the other numbers are reported.
        key = "" if told.bent else keys.get(name, "")
        yield Parameter(passed[name], meaning, unit, key, AMPLITUDES if told.bent else advice)


def _local(told: Masses, best: FrequencyFit) -> dict[str, Estimate]:
    """Numbers of a mode by name, without a model of the whole drive: extrema, of too few
    realisations, else a mode on top of a smooth response.

    The antiresonance of the latter is that of a part behind the spring only for a sensor at the
    driven inertia. Only that sensor shows an extremum below the resonance.
    """
    if too_few(best.source):
        extrema = best.modes.get("motor", best.modes.get("load", ()))
        return {one.name: one for mode in extrema for one in (mode.frequency, mode.damping)}
    if not best.local:
        return {}
    side: Side = "motor" if "motor" in best.local else "load"
    mode = best.local[side]
    estimates = {"resonance": mode.frequency, "resonance_damping": mode.damping_ratio}
    if side == "motor" or told.places.get(side) == "motor":
        estimates["antiresonance"] = mode.antiresonance
    return {name: replace(each, name=name) for name, each in estimates.items()}


def _findings(found: Sequence[FrequencyFit], parameters: Sequence[Parameter]) -> Iterator[Finding]:
    for each in parameters:
        yield Finding.of(each.estimate, {})
    for one in found:
        conditions = {"response": one.source.name}
        if one.margins is not None:
            for margin in ("bandwidth", "phase_margin", "gain_margin"):
                yield Finding.of(getattr(one.margins, margin), conditions)


def _notes(found: Sequence[FrequencyFit], told: Masses, remarks: Sequence[str]) -> Iterator[str]:
    yield from remarks
    for each in found:
        yield from each.source.remarks
        yield from each.remarks
    if told.drive is not None and told.drive.misfit:
        yield (
            f"Two inertias on a spring are no model of this response: {told.drive.misfit}. Narrow "
            "the band (lowest, highest) to where friction does not bend it, or excite it by "
            "repeated multisines, whose scatter holds what friction does."
        )
    yield from _early(found)
    if told.reason:
        yield f"Two inertias on a spring are not determined: {told.reason}."
    if told.bent:
        yield told.bent
    if told.lowest:
        yield (
            f"Two inertias on a spring were fitted from {told.lowest:.3g} Hz on: further down, "
            "what the drive answers is not theirs alone, as friction makes it."
        )
    if told.drive is not None and told.drive.rigid:
        yield f"Two inertias are not determined: {RIGID()}."
    if told.how:
        place = "at the driven inertia" if "motor" in told.places.values() else "behind the spring"
        yield f"The load's sensor is taken to be {place}: {told.how}."
    yield (
        "A response of a drive with friction holds for its excitation. Below the breakaway torque "
        "friction is a spring: what looks like a mode there is that of the inertia on its bristles."
    )


def _early(found: Sequence[FrequencyFit]) -> Iterator[str]:
    """Notes on rates that respond before their torque, which no drive does."""
    for each in found:
        for side, chosen in each.fits.items():
            fit = chosen.fit
            if fit.misfit or fit.delay + SURELY * float(fit.scatter[-1, -1]) ** 0.5 >= 0:
                continue
            yield (
                f"{each.source.name}, {side}: the rate answers {-1e6 * fit.delay:.0f} us before "
                "the torque. Friction shifts its phase (a second amplitude shows it), the torque "
                "is recorded late, or a controller holds it between samples. Then gain and inertia "
                "may be off by a few percent at the highest frequencies, which no scatter shows. "
                "A lower highest line, or a faster controller, makes it small."
            )


def _undetermined(parameters: Sequence[Parameter]) -> Iterator[str]:
    """Notes, if no number is determined: which, why, and what to measure."""
    if any(each.estimate.origin is Origin.MEASURED for each in parameters):
        return
    alike: dict[tuple[str, str], list[str]] = {}
    for each in parameters:
        why = str(each.estimate.reason), each.advice
        alike.setdefault(why, []).append(words(each.estimate.name))
    for (reason, advice), names in alike.items():
        yield f"Not determined: {', '.join(names)}. Reason: {reason}. To measure: {advice}."


MODEL = Model(
    name="frequency_response",
    summary="response from torque to rate: modes, margins, distortion, two masses on a spring",
    options=FrequencyResponseOptions,
    suits=usable,
)
