"""Inverse dynamics of any motion: inertia and friction by regression of the force.

The force of a motion is a sum of terms (`estimation.inverse.terms`). Least squares on filtered rows
estimates their coefficients, with deviations that include autocorrelation. Instruments from a
simulated motion check them. The delay is estimated first, then the structure.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Annotated

from pydantic import AfterValidator, Field

from campaign.channels import DRIVE_TORQUE
from campaign.estimate import Estimate, Origin
from campaign.estimation.gate import admitted_together, refused
from campaign.estimation.inverse.presliding_share import HARDLY_SLIDES
from campaign.estimation.inverse.terms import TERMS
from campaign.experiments.any_motion.figures import figures
from campaign.experiments.any_motion.inverse_fit import (
    BENDS,
    PRESLIDING,
    InverseDynamics,
    find,
    repeats,
)
from campaign.experiments.any_motion.motions import force_of, read, with_constants, with_slowest
from campaign.experiments.any_motion.tables import (
    correlated,
    deviations_table,
    instruments_note,
    instruments_table,
    structures_table,
)
from campaign.experiments.interface import TestData
from campaign.experiments.shared.common import correlations
from campaign.experiments.shared.directions import with_offset
from campaign.options import Options
from campaign.parameter import IdentifiedRig, Parameter, Unseen, is_value
from campaign.reason import Cause
from campaign.result import Finding, Result, Table
from campaign.text import words
from campaign.units import AngularRate, Frequency, Time

FRICTION = "friction.load"
BENCH = {
    "coulomb": f"{FRICTION}.coulomb_torque",
    "viscous": f"{FRICTION}.viscous_friction",
    "coulomb_positive": f"{FRICTION}.coulomb_torque",
    "coulomb_negative": f"{FRICTION}.negative.coulomb_torque",
    "viscous_positive": f"{FRICTION}.viscous_friction",
    "viscous_negative": f"{FRICTION}.negative.viscous_friction",
    "inertia": "axis.inertia",
}
"""Bench keys of coefficients: a plain friction model of steady sliding, and the inertia."""
PLAIN = frozenset(BENCH) | {"offset"}
NO_BASE = Cause(
    "no base", "neither inertia nor dry friction is determined, so that nothing beside them is"
)
NO_SLOPE = Cause(
    "no slope",
    "viscous friction beside it is not determined: at rates as low, it may be static friction",
)
SEARCHED = Cause(
    "searched", "it is the best of a search, an eighth of a period apart over the travel"
)
ADVICE = {
    "inertia": "move with more acceleration at the same speeds: a multisine, or shorter ramps",
    "viscous": "move at more, and further apart, steady speeds",
    "coulomb": "reverse more often, and slide more slowly",
    "spring": "move over more of the travel",
    "gravity": "move over more of the travel",
    "offset": "move as much in one direction as in the other",
}
"""What determines a coefficient better, by the beginning of its term's name."""


def _known(name: str) -> str:
    if name not in TERMS:
        raise ValueError(f"there is no term {name[:60]!r}; there are {', '.join(TERMS)}")
    return name


class InverseDynamicsOptions(Options):
    """Options of inverse dynamics."""

    low_pass: Frequency | None = Field(default=None, gt=0)
    """Corner frequency of the motion's zero-phase low-pass; absent: 100 Hz, or a fifth of the
    sample rate if less."""
    decimation: int | None = Field(default=None, ge=1, le=1000)
    """Decimation factor, behind a low-pass; absent: to about 100 Hz."""
    skip: Time = Field(default=0.0, ge=0)
    """Time to omit at the start of each motion."""
    slowest: AngularRate | None = Field(default=None, ge=0)
    """Rows below this rate are standstill, and are omitted; absent: 2 % of the largest rate."""
    delay: Time | None = None
    """Delay of the acting force after the recorded one; absent: it is estimated."""
    terms: tuple[Annotated[str, AfterValidator(_known)], ...] = ()
    """Names of the model's terms; absent: they are selected."""


def identify(data: TestData, options: InverseDynamicsOptions) -> Result:
    """Result of all trials together. Raises ValueError if they determine nothing."""
    data.say("step 1 of 4, the motion")
    filtering, pieces, unseen = read(data, options.low_pass, options.decimation, options.skip)
    filtering = with_slowest(filtering, pieces, options.slowest)
    fit = find(
        pieces,
        unseen,
        filtering,
        delay=options.delay,
        terms=[TERMS[name] for name in options.terms] or None,
        linear=data.bench.is_linear,
        say=data.say,
    )
    parameters = tuple(_parameters(fit, data))
    return Result(
        tables=tuple(_tables(fit)),
        figures=tuple(figures(fit)),
        findings=tuple(Finding.of(each.estimate, {}) for each in parameters),
        notes=tuple(_notes(fit, data)),
        identified=IdentifiedRig(
            parameters,
            correlations=_correlations(fit),
            settings=_settings(parameters, data),
            # The period of a ripple was searched; another recording may not show it.
            again={"terms": tuple(name for name in fit.best.structure.names if name in TERMS)},
            unseen=Unseen(fit.best.validation.value) if fit.best.validation is not None else None,
        ),
    )


def _parameters(found: InverseDynamics, data: TestData) -> Iterator[Parameter]:
    together = {
        name: (other, share)
        for one, two, share in correlated(found)
        for name, other in ((one, two), (two, one))
    }
    scaled = {name: with_constants(one, data) for name, one in found.estimates.items()}
    admitted = _with_slope(admitted_together(scaled, found.matters))
    parameters = with_offset(_with_base(admitted), "coulomb")
    dry = [one for name, one in parameters.items() if name.startswith("coulomb") and name in BENCH]
    slides = _is_plain(found) and not one_way(found) and all(map(is_value, dry))
    for term in found.best.structure.terms:
        one = parameters[term.name]
        bench = BENCH.get(term.name, "") if slides or term.name == "inertia" else ""
        needs = "viscous" if one.reason in NO_SLOPE else term.name
        advice = next((text for key, text in ADVICE.items() if needs.startswith(key)), "")
        if one.reason in HARDLY_SLIDES:
            advice = "raise the force, or move slower and further, until the axis slides"
        elif term.name in together:
            other, share = together[term.name]
            advice = (
                f"the motion hardly separates it from {other} (correlation {share:.2f}): {advice}"
                if advice
                else f"move so that it differs from {other} (correlation {share:.2f})"
            )
        yield Parameter(one, term.meaning, bench=bench, advice=advice)
    if found.period is not None and repeats(found.best.structure):
        period = Estimate.without_interval("position_period", found.period, "rad", SEARCHED())
        yield Parameter(period, "Distance over which force or friction repeats.", "deg")
    late = found.delay
    if late.origin is not Origin.GIVEN:
        yield Parameter(
            late,
            "By how much the force acts later than it is recorded.",
            display="ms",
            advice="record faster, or with sharper reversals",
        )


def _with_slope(told: dict[str, Estimate]) -> dict[str, Estimate]:
    """Refuse dry friction where viscous friction is not determined.

    Dry friction is the intercept of a line over rate; without a slope it may be static friction.
    """
    level = {
        name.replace("viscous", "coulomb")
        for name, one in told.items()
        if name.startswith("viscous") and one.origin is Origin.NOT_DETERMINED
    }
    return told | {
        name: refused(told[name], NO_SLOPE())
        for name in level & told.keys()
        if told[name].origin is Origin.MEASURED
    }


def _with_base(told: dict[str, Estimate]) -> dict[str, Estimate]:
    """Refuse further terms if neither inertia nor dry friction is determined."""
    base = {name for name in told if name == "inertia" or name.startswith("coulomb")}
    if any(told[name].origin is not Origin.NOT_DETERMINED for name in base):
        return told
    further = {name: one for name, one in told.items() if name not in base}
    return told | {
        name: refused(one, NO_BASE())
        for name, one in further.items()
        if one.origin is Origin.MEASURED
    }


def one_way(found: InverseDynamics) -> str:
    """The only direction of the motion; empty if the axis moves in both."""
    names = set(found.best.structure.names)
    directions = [
        direction for direction in ("positive", "negative") if f"coulomb_{direction}" in names
    ]
    return directions[0] if len(directions) == 1 else ""


def _is_plain(found: InverseDynamics) -> bool:
    """Whether the chosen terms are those that a bench's friction model has."""
    return {term.name for term in found.best.structure.terms} <= PLAIN


def _tables(found: InverseDynamics) -> Iterator[Table]:
    yield structures_table(found)
    for number, each in enumerate(found.tried[:2]):
        if each.delay == 0.0 and number != found.chosen:
            name = "both directions alike" if "coulomb" in each.structure.names else "by direction"
            yield deviations_table(f"plain-{number + 1}", f"Plain fit, {name}", each)
    yield deviations_table("chosen", "The chosen model and its deviations", found.best)
    if found.instruments is not None:
        yield instruments_table(found, found.instruments)


def _notes(found: InverseDynamics, data: TestData) -> Iterator[str]:
    filtering = found.filtering
    yield (
        f"Position low-passed at {filtering.low_pass:g} Hz without phase, differentiated twice; "
        f"one of {filtering.decimation} samples is kept behind the same low-pass on both sides; "
        f"{filtering.skip} samples were left out at each beginning."
    )
    held = found.instruments
    if held is None:
        yield f"No instruments: {found.no_instruments}."
    elif not held.of_wanted:
        yield f"No instruments along the wanted motion: {found.no_instruments}."
    if found.biased:
        yield instruments_note(found)
    if found.bristles is not None and not found.biased:
        yield (
            "The axis hardly slides: the inertia is that of a fit with bristles in place of dry "
            f"friction. Its difference to the chosen model is the systematic part {PRESLIDING!r}."
        )
    if any(each.reason in BENDS for each in found.estimates.values()):
        yield (
            "A term that is nonlinear in the rate was added because it predicts better. It "
            "approximates nonlinear friction, most often a Stribeck curve, which `--model "
            "whole_model` fits. Its shares have no intervals."
        )
    late = found.delay
    if math.isnan(late.value):
        yield f"The delay of the force is not determined: {late.reason}."
    if side := one_way(found):
        yield (
            f"The axis moves in the {side} direction only: friction of the other is not known. "
            "Coulomb friction includes every constant force, such as a weight or a sensor's zero. "
            "Friction goes to no bench file."
        )
    if (force := force_of(data.trials[0])) != DRIVE_TORQUE:
        yield (
            f"The force is {force}, measured at the load: what motor and gear need themselves, "
            "their inertia and friction, is not in it."
        )
    for one, two, share in correlated(found):
        yield (
            f"{words(one)} and {words(two)} are correlated ({share:.3f}): "
            "the motion hardly separates them; only their sum is well determined."
        )
    if not _is_plain(found):
        yield (
            "Friction of the chosen model is a sum of terms that mean something together, over the "
            "rates of this motion only; a bench file has no place for it, and gets the inertia. "
            "`--model whole_model` fits the friction models that it has a place for."
        )
    if len(data.trials) > 1:
        yield f"{len(data.trials)} trials were fitted together."


def _correlations(found: InverseDynamics) -> dict[tuple[str, str], float]:
    held = found.instruments
    fit = held.found.fit if found.biased and held is not None else found.fit
    return correlations(found.best.structure.names, fit.correlation)


def _settings(
    parameters: Sequence[Parameter], data: TestData
) -> dict[str, tuple[object, str, str]]:
    """Further bench keys: the plain model; viscous friction 0 if only a bound is known."""
    if "load" in data.bench.friction:
        return {}
    by_name = {each.estimate.name: each for each in parameters}
    coulomb = by_name.get("coulomb", by_name.get("coulomb_positive"))
    if coulomb is None or not coulomb.bench:
        return {}
    settings: dict[str, tuple[object, str, str]] = {
        f"{FRICTION}.model": ("coulomb", "", "the plain friction of steady sliding"),
    }
    for name, each in by_name.items():
        if name in BENCH and name.startswith("viscous") and not each.bench:
            settings[BENCH[name]] = (0.0, "N m s/rad", "of it only an upper bound is known")
    return settings
