"""Fit of each response: order, modes, margins, two masses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from campaign.estimation.elastic_mode import ElasticMode, elastic_mode
from campaign.estimation.frequency.best_linear import FEWEST_REALISATIONS
from campaign.estimation.frequency.drive import TwoMass
from campaign.estimation.frequency.extrema import extrema, relative_scatter
from campaign.estimation.frequency.measured_response import MeasuredResponse
from campaign.estimation.frequency.modes import Mode, chosen_modes
from campaign.estimation.frequency.orders import ChosenOrder, chosen_order
from campaign.estimation.frequency.two_mass import two_mass
from campaign.estimation.frequency.two_mass_model import Side
from campaign.estimation.frequency_response import Response, held_by_spring, no_load_at
from campaign.estimation.gate import refused
from campaign.estimation.servo import ServoCharacteristics, characteristics
from campaign.experiments.frequency_response.model.axis_numbers import (
    UNKNOWN,
    Weaker,
    by_rule,
    odd_distortion,
    of_axis,
)
from campaign.experiments.responses.sources import Source, fitted_part
from campaign.physics.bench import Bench
from campaign.reason import NONE, Cause, Reason

TOLD_APART = 10.0
"""Difference of Schwarz' criterion that distinguishes two places of the sensor."""
AMBIGUOUS = Cause(
    "place of the sensor not known",
    "the sensor may be at the driven inertia or behind the spring: say which (place), or excite "
    "up to above the antiresonance",
)
TOO_FEW = Cause(
    "too few realisations",
    "{realisations} realisations give no variance for the weights of a fit; it needs {fewest}",
)
NOTHING_FITTED = Cause("no response fitted", "no response could be fitted")
NO_FIT = Cause("fit failed", "{error}")

NARROWER = (2.0, 4.0, 8.0)
"""Lower ends of narrower bands over the first frequency, if friction bends the response."""
WEAKER = 0.8
"""Share of the strongest excitation below which another one is weaker."""


@dataclass(frozen=True)
class Band:
    """Band of a fit (Hz), and the highest order of a denominator."""

    lowest: float
    highest: float
    order: int


@dataclass(frozen=True)
class FrequencyFit:
    """Fit of one source.

    Attributes:
        fits, modes: by side; sides without a fit are missing. Modes of too few realisations are
            extrema of the response, with friction's part.
        local: modes on top of a response that no function fits, by side.
        margins: of its loop.
        remarks: sentences on missing results and their reasons.
    """

    source: Source
    fits: Mapping[Side, ChosenOrder]
    modes: Mapping[Side, tuple[Mode, ...]]
    local: Mapping[Side, ElasticMode] = field(default_factory=dict)
    margins: ServoCharacteristics | None = None
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class Masses:
    """The two-mass drive, and the assumed places of the sensors.

    Attributes:
        drive: with the response's numbers; None, with a `reason`, if the response fits none.
        axis: the same with numbers of the axis; their intervals include friction's part.
        places: `motor` for a sensor at the driven inertia, `load` behind the spring, by side.
        how: source of the places, in words.
        lowest: lowest fitted frequency (Hz), if the drive is no model of the whole band.
        bent: why the response does not determine numbers of the axis: a sentence.
    """

    drive: TwoMass | None
    source: Source | None
    reason: Reason = NONE
    axis: TwoMass | None = None
    places: Mapping[Side, Side] = field(default_factory=dict)
    how: str = ""
    bent: str = ""
    lowest: float = 0.0

    @property
    def is_bent(self) -> bool:
        """Whether numbers of the axis differ from the response's."""
        return self.axis is not self.drive


def _parts(source: Source, band: Band) -> dict[Side, MeasuredResponse]:
    """Points of a source for a fit in a band, by side."""
    return {side: fitted_part(source, side, band.lowest, band.highest) for side in source.responses}


def found_in(source: Source, band: Band) -> FrequencyFit:
    """Fits, modes and margins of one source."""
    parts = _parts(source, band)
    fits: dict[Side, ChosenOrder] = {}
    remarks: list[str] = []
    modes: dict[Side, tuple[Mode, ...]] = {}
    if few := too_few(source):
        remarks.append(
            f"{source.name}: {few}: no function is fitted. Modes are extrema of the response, "
            "between its lines."
        )
        modes = {side: _extrema(source, side, band) for side in source.best}
    else:
        for side, part in parts.items():
            try:
                fits[side] = chosen_order(part, band.order)
            except ValueError as error:
                remarks.append(f"{source.name}, {side}: {error}.")
    modes |= {side: chosen_modes(fit) for side, fit in fits.items() if not fit.fit.misfit}
    for side, own in modes.items():
        response = parts[side].response
        held = held_by_spring(response)
        modes[side] = tuple(_refused(mode, held or _no_load(response, mode, own)) for mode in own)
    local: dict[Side, ElasticMode] = {}
    for side, part in parts.items():
        if side not in modes and (mode := elastic_mode(part.response)) is not None:
            local[side] = mode
    margins = None if source.closed is None or few else characteristics(source.closed)
    return FrequencyFit(source, fits, modes, local, margins, tuple(remarks))


def _no_load(response: Response, mode: Mode, modes: Sequence[Mode]) -> Reason:
    """Why a mode is that of no load: nothing shows at its frequency, nor at its antiresonance."""
    if not mode.frequency.is_determined:
        return NONE
    at = mode.frequency.value
    zeros = [each.frequency.value for each in modes if each.is_zero]
    below = max((zero for zero in zeros if zero < at), default=at)
    return no_load_at(response, at) and no_load_at(response, at if mode.is_zero else below)


def _refused(mode: Mode, why: Reason) -> Mode:
    if not why:
        return mode
    return replace(mode, frequency=refused(mode.frequency, why), damping=refused(mode.damping, why))


def too_few(source: Source) -> Reason:
    """Why nothing is fitted to repeated multisines; false if there are enough."""
    few = [best.excitation.realisations for best in source.best.values()]
    if min(few, default=FEWEST_REALISATIONS) < FEWEST_REALISATIONS:
        return TOO_FEW(realisations=min(few), fewest=FEWEST_REALISATIONS)
    return NONE


def _extrema(source: Source, side: Side, band: Band) -> tuple[Mode, ...]:
    measured, scatter = source.responses[side], relative_scatter(source.best[side])
    kept = (measured.frequency >= band.lowest) & (measured.frequency <= band.highest)
    modes = extrema(
        measured.frequency[kept],
        np.abs(measured.values[kept]),
        None if scatter is None else scatter[kept],
    )
    # Much friction damps a mode out, and has its own extrema.
    odd = odd_distortion(source)
    return tuple(replace(mode, frequency=by_rule(mode.frequency, odd)) for mode in modes)


def best_source(found: Sequence[FrequencyFit]) -> FrequencyFit | None:
    """Source of the parameters, by: no misfit, most sides, multisines before sines before records.

    Of several multisines the strongest: the share of friction in it is the least.
    """
    fitted = [each for each in found if each.fits]
    if not fitted:
        return None
    ranks = {"multisine": 0, "sines": 1, "records": 2}

    def rank(each: FrequencyFit) -> tuple[bool, int, int, float]:
        misfit = all(fit.fit.misfit for fit in each.fits.values())
        return misfit, -len(each.fits), ranks[each.source.kind], -each.source.rms

    return min(fitted, key=rank)


def masses(
    found: FrequencyFit | None,
    bench: Bench,
    place: str,
    band: Band,
    torque: float | None,
    others: Sequence[FrequencyFit] = (),
) -> Masses:
    """The two-mass drive of the best source.

    Args:
        place: `driven`, `behind` or `auto`, of the load's sensor.
        torque: relative standard uncertainty of the torque constant, if it is known.
        others: further sources: one of less excitation shows friction's effect on the response.
    """
    if found is None:
        return Masses(None, None, NOTHING_FITTED())
    source = found.source
    for part in _parts(source, band).values():
        if why := held_by_spring(part.response):
            return Masses(None, source, why)
    first = min(float(each.frequency[0]) for each in source.responses.values())
    try:
        result = _placed(source, bench, place, band, torque)
        for factor in () if band.lowest > 0 else NARROWER:
            if result.drive is None or not result.drive.misfit:
                break
            higher = replace(band, lowest=factor * first)
            with suppress(ValueError):  # too little of the band is left
                other = _placed(source, bench, place, higher, torque)
                if other.drive is not None and not other.drive.misfit:
                    result, band = replace(other, lowest=higher.lowest), higher
        if result.drive is None or result.drive.misfit:
            return replace(result, axis=result.drive)
        if why := _rigid_on_friction(result, band):
            return Masses(None, source, why)
        return _with_axis(result, source, [each.source for each in others], band)
    except ValueError as error:
        return Masses(None, source, NO_FIT(error=str(error)))


def _rigid_on_friction(result: Masses, band: Band) -> Reason:
    """Why the second inertia of a drive is none: false where it shows in a response."""
    drive, source = result.drive, result.source
    if drive is None or source is None or drive.rigid:
        return NONE
    why, parts = NONE, _parts(source, band)
    for side, place in result.places.items():
        at = drive.estimates["antiresonance" if place == "motor" else "resonance"]
        why = no_load_at(parts[side].response, at.value)
        if not why:
            return NONE
    return why


def _placed(source: Source, bench: Bench, place: str, band: Band, torque: float | None) -> Masses:
    parts = _parts(source, band)
    if "motor" in parts:
        places: dict[Side, Side] = {side: side for side in parts}
        return Masses(two_mass(parts, torque_uncertainty=torque), source, places=places)
    part, how = parts["load"], "as place says"
    if place == "auto" and bench.appendage is not None:
        place, how = "driven", "the bench has an elastic part that hangs on the load"
    tried = {}
    if place in ("auto", "driven"):
        tried["driven"] = two_mass({"motor": part}, torque_uncertainty=torque)
    if place in ("auto", "behind"):
        tried["behind"] = two_mass({"load": part}, torque_uncertainty=torque)
    if place == "auto":
        fits = [name for name, drive in tried.items() if not drive.misfit] or list(tried)
        rigid = [name for name in fits if tried[name].rigid]
        least = min(tried[name].criterion for name in fits)
        if rigid and tried[rigid[0]].criterion < least + TOLD_APART:
            fits = rigid[:1]  # one inertia is driven, wherever its sensor is
        if len(fits) > 1:
            apart = tried["driven"].criterion - tried["behind"].criterion
            if abs(apart) < TOLD_APART:
                return Masses(None, source, AMBIGUOUS())
            fits = ["behind"] if apart > 0 else ["driven"]
        place = fits[0]
        how = "" if tried[place].rigid else "the response fits that place better"
    side: Side = "motor" if place == "driven" else "load"
    return Masses(tried[place], source, places={"load": side}, how=how)


def _with_axis(told: Masses, source: Source, others: Sequence[Source], band: Band) -> Masses:
    """Add numbers of the axis: a response to less excitation determines friction's part in them."""
    if told.drive is None:
        return told
    odd = odd_distortion(source)
    weaker = [each for each in others if each.best and 0 < each.rms < WEAKER * source.rms]
    weaker = [each for each in weaker if odd and set(each.responses) == set(source.responses)]
    tried = []
    for each in weaker:
        with suppress(ValueError):  # too little of the band is left
            tried.append(Weaker(_weaker_drive(told, each, band), source.rms / each.rms))
    axis = of_axis(told.drive, odd, tried)
    bent = ""
    if any(axis.estimates[name].reason in UNKNOWN for name in ("total_inertia", "resonance")):
        bent = (
            f"Odd distortion is {100 * odd:.0f} % of the output: friction distorts the response, "
            "and one amplitude does not determine how much. Repeat it at half or twice the "
            "amplitude. Until then its numbers describe this response, not the axis, and the "
            "bench file gets none of them."
        )
    return replace(told, axis=axis, bent=bent)


def _weaker_drive(told: Masses, other: Source, band: Band) -> TwoMass:
    """Drive of a weaker excitation, in its best-fitting band: friction bends more of it."""
    first = min(float(each.frequency[0]) for each in other.responses.values())
    tried = []
    for lowest in {band.lowest, *(max(factor * first, band.lowest) for factor in NARROWER)}:
        found = _parts(other, replace(band, lowest=lowest))
        parts = {told.places[side]: part for side, part in found.items()}
        with suppress(ValueError):  # too little of the band is left
            tried.append(two_mass(parts, rigid=told.drive is not None and told.drive.rigid))
    if not tried:
        raise ValueError("the weaker excitation has too few frequencies")
    return min(tried, key=lambda each: (bool(each.misfit), each.excess))
