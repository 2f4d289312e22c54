"""Frequency response of any motion: modes, margins, distortion, and the two masses of a drive.

Sines, repeated odd multisines and any other recording each give a response; a rational function
with a delay tells its modes, and two inertias on a spring what the sensors' places allow.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Literal

from pydantic import Field

from campaign.estimate import Estimate, Origin
from campaign.identification.frequency.welch import Estimator
from campaign.identifying.frequency.figures import figures
from campaign.identifying.frequency.found import Band, Found, Masses, best_source, found_in, masses
from campaign.identifying.frequency.signals import Excited, usable
from campaign.identifying.frequency.sources import Reading, sources
from campaign.identifying.frequency.tables import (
    distortion_table,
    fits_table,
    margins_table,
    masses_table,
    modes_table,
    sources_table,
)
from campaign.identifying.method import Identified, Material, Method, Parameter
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.result import Amount, Conclusion, Finding, Result
from campaign.units import Frequency, Time

TORQUE_CONSTANT = "motor.torque_constant"
LOUDER = "excite with more torque, or record longer, around the antiresonance and the resonance"
LOWER = "excite further below the antiresonance, above what friction holds"
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
"""Of a two-mass drive: attribute, meaning, unit, what to measure next."""
APPENDAGE = {
    "load_inertia": "appendage.inertia",
    "antiresonance": "appendage.frequency",
    "antiresonance_damping": "appendage.damping_ratio",
}
"""Keys of the bench for an elastic part that the sensor sees only through the load."""


class FrequencyResponseOptions(Options):
    """Options of a frequency response."""

    excited: Excited = "auto"
    """input: the torque was decided outside of any loop; reference: a loop made it, and the command
    is what came into that from outside; auto: as the trials' modes say."""
    estimator: Estimator = "H1"
    """Of recordings whose torque was decided outside: H1 (noise on the rate), H2 (on the torque),
    Hv (on both)."""
    resolution: Frequency | None = Field(default=None, gt=0)
    """Of averaged spectra; absent: a sixteenth of all that was recorded is one segment."""
    period: Time | None = Field(default=None, gt=0)
    """Of a multisine in recordings of which no command says it."""
    lowest: Frequency = Field(default=0.0, ge=0)
    """Lowest frequency that is fitted: friction bends responses below."""
    highest: Frequency = Field(default=1e5, gt=0)
    """Highest frequency that is fitted."""
    order: int = Field(default=6, ge=1, le=8)
    """Highest order of a denominator that is tried."""
    place: Literal["auto", "driven", "behind"] = "auto"
    """Where the load's sensor is: on the inertia that the torque drives, or behind the spring."""


def _identify(material: Material, options: FrequencyResponseOptions) -> Identified:
    how = Reading(options.excited, options.estimator, options.resolution, options.period)
    measured, remarks = sources(material.trials, material.bench, how)
    if not measured:
        raise ValueError(" ".join(remarks) or "no trial gives a response")
    band = Band(options.lowest, options.highest, options.order)
    found = [found_in(each, band) for each in measured]
    best = best_source(found)
    found.sort(key=lambda each: each is not best)  # what tells most comes first
    torque = _torque_uncertainty(material.bench)
    told = masses(best, material.bench, options.place, band, torque, found)
    parameters = tuple(_parameters(told, best))
    tables = (
        sources_table(found),
        masses_table(told),
        modes_table(found),
        margins_table(found),
        distortion_table(found),
        fits_table(found),
    )
    return Identified(
        parameters,
        Result(
            tables=tuple(each for each in tables if each is not None and each.rows),
            figures=tuple(figures(found, told)),
            findings=tuple(_findings(found, parameters)),
            notes=tuple(_notes(found, told, remarks)),
            conclusions=tuple(_conclusions(best, told)),
        ),
    )


def _torque_uncertainty(bench: Bench) -> float | None:
    """Relative, of the torque constant; None where nobody has said it."""
    known = bench.known_uncertainty(TORQUE_CONSTANT)
    if known is None or bench.motor is None:
        return None
    return known / bench.motor.torque_constant


def _parameters(told: Masses, best: Found | None) -> Iterator[Parameter]:
    if told.drive is None:
        return
    hangs_on_load = dict(told.places) == {"load": "motor"}
    if told.drive.misfit:
        reason = f"misfit: {told.drive.misfit}"
        local = _local(told, best)
        for name, meaning, unit, advice in MEANINGS:
            nothing = Estimate.without_interval(name, math.nan, unit, reason)
            estimate = local.get(name, nothing)
            key = APPENDAGE.get(name, "") if hangs_on_load and estimate.has_interval else ""
            yield Parameter(estimate, meaning, unit, key, advice)
        return
    keys = {"total_inertia": "axis.inertia", **(APPENDAGE if hangs_on_load else {})}
    for name, meaning, unit, advice in MEANINGS:
        estimate = getattr(told.drive, name)
        usable_ = estimate.origin is Origin.MEASURED and estimate.has_interval
        usable_ = usable_ and estimate.value > 0
        key = keys.get(name, "") if usable_ else ""
        if told.bent and name in ("total_inertia", "load_inertia"):
            key = ""
        yield Parameter(estimate, meaning, unit, key, advice)


def _local(told: Masses, best: Found | None) -> dict[str, Estimate]:
    """A mode on top of a smooth response, where no model of the whole drive fits, by name.

    Its antiresonance is that of a part behind the spring only for a sensor at the driven inertia.
    """
    modes = {} if best is None else best.local
    if len(modes) != 1:
        return {}
    mode = next(iter(modes.values()))
    found = {"resonance": mode.frequency, "resonance_damping": mode.damping_ratio}
    if "motor" in told.places.values():
        found["antiresonance"] = mode.antiresonance
    return {name: replace(each, name=name) for name, each in found.items()}


def _findings(found: Sequence[Found], parameters: Sequence[Parameter]) -> Iterator[Finding]:
    for each in parameters:
        yield Finding.of(each.estimate, {})
    for one in found:
        conditions = {"response": one.source.name}
        if one.margins is not None:
            for margin in ("bandwidth", "phase_margin", "gain_margin"):
                yield Finding.of(getattr(one.margins, margin), conditions)


def _notes(found: Sequence[Found], told: Masses, remarks: Sequence[str]) -> Iterator[str]:
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
    if told.reason:
        yield f"Two inertias on a spring are not determined: {told.reason}."
    if told.bent:
        yield told.bent
    if told.lowest:
        yield (
            f"Two inertias on a spring were fitted from {told.lowest:.3g} Hz on: further down, "
            "what the drive answers is not theirs alone, as friction makes it."
        )
    if told.how:
        place = "at the driven inertia" if "motor" in told.places.values() else "behind the spring"
        yield f"The load's sensor is taken to be {place}: {told.how}."
    yield (
        "A response of a drive with friction holds for its excitation. Below the breakaway torque "
        "friction is a spring: what looks like a mode there is that of the inertia on its bristles."
    )


def _conclusions(best: Found | None, told: Masses) -> Iterator[Conclusion]:
    drive = told.drive
    if drive is not None and drive.resonance.has_interval:
        parts: list[str | Amount] = ["The drive resonates at ", Amount(drive.resonance, "Hz")]
        if drive.antiresonance.has_interval:
            parts += [", with an antiresonance at ", Amount(drive.antiresonance, "Hz")]
        if drive.total_inertia.has_interval:
            parts += ["; all of it has an inertia of ", Amount(drive.total_inertia, "kg m^2")]
        yield Conclusion((*parts, "."))
    if best is None or best.margins is None:
        return
    margins = best.margins
    if margins.phase_margin.has_interval:
        margin = Amount(margins.phase_margin, "deg")
        yield Conclusion(("The rate loop has a phase margin of ", margin, "."))


METHOD = Method(
    name="frequency_response",
    summary="Response of torque to rate: modes, margins, distortion, two masses on a spring",
    options=FrequencyResponseOptions,
    suits=usable,
    identify=_identify,
)
