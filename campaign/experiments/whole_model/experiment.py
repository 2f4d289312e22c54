"""Friction models along any motion, fitted through the engine and compared.

Each friction model runs along the measured rate with its own state; inertia, delay and linear terms
are fitted with it. Numbers of the friction model that the motion does not determine fill in a bench
file as settings; other undetermined numbers are in no bench file.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from pydantic import Field

from campaign.estimate import Origin
from campaign.estimation.gate import admitted
from campaign.experiments.any_motion.inverse_fit import find as find_inverse
from campaign.experiments.any_motion.motions import (
    MotionPiece,
    read,
    usable,
    with_constants,
    with_slowest,
)
from campaign.experiments.interface import TestData
from campaign.experiments.shared.recorded_motion import of_any_motion
from campaign.experiments.whole_model.doubts import derived
from campaign.experiments.whole_model.parts import telling_parts
from campaign.experiments.whole_model.residuals import USUAL
from campaign.experiments.whole_model.tables_and_figures import figures, models_table, values_table
from campaign.experiments.whole_model.whole_model_fit import Fit, find
from campaign.options import Options
from campaign.parameter import IdentifiedRig, Parameter, Unseen
from campaign.reason import Cause, Reason
from campaign.result import Finding, Result
from campaign.text import words
from campaign.units import Frequency, Time

FRICTION = "friction.load"
LEFT_OPEN = "the motion leaves it open"
PARTS = Cause(
    "parts of the motion",
    "fitted to {used:.0f} of {recorded:.0f} s, in the {parts} parts most informative on friction: "
    "a fit of all takes too long",
)
STILL = 0.25
"""Share of the standstill rate of a plain regression; friction curves begin below that rate."""
LINEAR = ("spring", "gravity", "cogging")
"""Prefixes of regression terms that no friction model replaces."""
ADVICE = {
    "inertia": "move with more acceleration at the same speeds",
    "spring": "move over more of the travel",
}


class WholeModelOptions(Options):
    """Options of whole models."""

    low_pass: Frequency | None = Field(default=None, gt=0)
    """As in `inverse_dynamics`."""
    decimation: int | None = Field(default=None, ge=1, le=1000)
    """As in `inverse_dynamics`."""
    skip: Time = Field(default=0.0, ge=0)
    """As in `inverse_dynamics`."""
    starts: int = Field(default=2, ge=1, le=50)
    """Fits of each model, the first from plain inverse dynamics and the others at random."""
    model: str = ""
    """Model whose parameters are reported; absent: the best one."""
    models: tuple[str, ...] = Field(default=USUAL, min_length=1)
    """Friction models to fit; the first also with equal directions."""


def _identify(data: TestData, options: WholeModelOptions) -> Result:
    data.say("the motion")
    filtering, whole, unseen = read(data, options.low_pass, options.decimation, options.skip)
    moves = with_slowest(filtering, whole, None)
    pieces = telling_parts(whole, moves)
    if pieces is not whole:  # parts begin after the skipped samples
        unseen = tuple(each.part(slice(moves.skip, None)) for each in unseen)
        moves = replace(moves, skip=0)
    filtering = replace(moves, slowest=STILL * moves.slowest)
    regression = find_inverse(pieces, unseen, moves, linear=data.bench.is_linear)
    terms = regression.best.structure.terms
    extra = tuple(term for term in terms if term.name.startswith(LINEAR))
    held = regression.instruments
    known = held.delay if held is not None and held.of_wanted else None
    found = find(
        pieces, unseen, filtering, extra, options.starts, data.say, known=known,
        bristles=regression.bristles, names=options.models, wanted=options.model,
    )  # fmt: skip
    best = found.fits[found.best]
    parameters = tuple(_parameters(best, data))
    return Result(
        tables=(models_table(found), *(values_table(each) for each in found.fits)),
        figures=tuple(figures(found, regression, unseen)),
        findings=tuple(Finding.of(each.estimate, {}) for each in parameters),
        notes=(*_alike(found.as_good), *_notes(best)),
        identified=IdentifiedRig(
            parameters,
            correlations=best.fit.correlation,
            settings=_settings(best, parameters),
            again={"model": best.model.name},
            unseen=Unseen(best.validation.value) if best.validation is not None else None,
            left_out=_left_out(whole, pieces),
        ),
    )


def _left_out(whole: Sequence[MotionPiece], parts: Sequence[MotionPiece]) -> tuple[Reason, ...]:
    """Reason for a fit to parts of long recordings; empty for a fit to all."""
    if parts is whole:
        return ()
    used, recorded = (
        sum(len(each.motion.time) / each.motion.sample_rate for each in side)
        for side in (parts, whole)
    )
    return (PARTS(used=used, recorded=recorded, parts=len(parts)),)


def _parameters(best: Fit, data: TestData) -> Iterator[Parameter]:
    numbers = {each.name: each for each in best.model.numbers}
    meanings = {each.name: each.meaning for each in best.model.numbers}
    meanings |= {term.name: term.meaning for term in best.extra}
    meanings["inertia"] = "What resists acceleration."
    meanings["delay"] = "By how much the force acts later than it is recorded."
    for name, estimate in best.fit.estimates.items():
        bench = "axis.inertia" if name == "inertia" else ""
        advice = next((text for key, text in ADVICE.items() if name.startswith(key)), "")
        if name in numbers:
            advice = numbers[name].advice
            bench = numbers[name].key and f"{FRICTION}.{numbers[name].key}"
        display = "ms" if name == "delay" else ""
        one = admitted(with_constants(estimate, data))
        yield Parameter(one, meanings.get(name, ""), display, bench, advice)
    for each in best.model.derived:
        one = admitted(with_constants(derived(each, best.values, best.fit), data))
        yield Parameter(one, each.meaning, "", f"{FRICTION}.{each.key}", each.advice)


def _settings(best: Fit, parameters: Sequence[Parameter]) -> dict[str, tuple[object, str, str]]:
    """Name of the model, and numbers that the motion leaves open, both required by a bench."""
    stated = {each.bench for each in parameters}
    settings: dict[str, tuple[object, str, str]] = {
        f"{FRICTION}.model": (best.model.model, "", "fitted")
    }
    model, values = best.model, best.values
    fitted = {each.key: (values[each.name], each) for each in model.numbers if each.key}
    follow = {each.key: (each.value(values), each) for each in model.derived}
    for key, (value, each) in (fitted | follow).items():
        if f"{FRICTION}.{key}" not in stated:
            estimate = best.fit.estimates.get(each.name)
            why = LEFT_OPEN if estimate is None else estimate.reason
            settings[f"{FRICTION}.{key}"] = (value, each.unit, str(why))
    return settings


def _notes(best: Fit) -> Iterator[str]:
    for name, each in best.fit.estimates.items():
        if each.origin is not Origin.MEASURED:
            yield f"{words(name)} is not known: {each.reason}."
    for (one, two), share in best.fit.correlation.items():
        if abs(share) >= 0.9:
            yield f"{words(one)} and {words(two)} are correlated ({share:.3f})."
    for number in best.model.numbers:
        ratio = best.fit.estimates[number.name]
        low, high = ratio.combined
        if ratio.origin is Origin.MEASURED and high is not None and high < 1.0:
            note = number.below_one
        elif ratio.origin is not Origin.MEASURED or low is None or low <= 1.0:
            note = number.about_one
        else:
            note = ""
        if note:
            yield note
    yield (
        "Each model met the rate that was measured, in steps of the recording; a loop that was "
        "closed on that rate is in the data, and not in the model."
    )


def _alike(as_good: Sequence[str]) -> Iterator[str]:
    if as_good:
        others = " and ".join(f"‘{name}’" for name in as_good)
        yield f"The motion does not distinguish this model from {others}."


EXPERIMENT = of_any_motion(
    name="whole_model",
    summary="friction models of any motion, fitted by simulation and compared",
    options=WholeModelOptions,
    suits=usable,
    identify=_identify,
)
