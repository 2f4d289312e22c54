"""Excitation: a motion or torque designed for identification.

Odd random-phase multisines give the response with its noise and distortion. A Fourier series with
the lowest condition number of a search gives inertia and friction. Chirps, noise and user files
serve other identifications (`campaign identify`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

from campaign.channels import DRIVE_TORQUE, GYRO_RATE, RELATIVE_ANGLE
from campaign.estimate import Estimate, Window
from campaign.estimation.frequency.best_linear import FEWEST_REALISATIONS
from campaign.experiments.any_motion.inverse_result import InverseDynamicsOptions, identify
from campaign.experiments.excitation.account import metrics_of, options_of, reached_tables
from campaign.experiments.excitation.commands import courses, start_of
from campaign.experiments.excitation.figures import command_figure, plane_figure
from campaign.experiments.excitation.options import ExcitationOptions
from campaign.experiments.interface import (
    ChosenValue,
    Experiment,
    TestData,
    TrialData,
    bench_of,
    metrics,
)
from campaign.experiments.responses.figures import coherence_figure, response_figures
from campaign.experiments.responses.signals import STEADY, ResponseOptions, usable
from campaign.experiments.responses.sources import sources
from campaign.experiments.responses.tables import distortion_of, distortion_tables, sources_table
from campaign.experiments.shared.common import conditions, joined, of_each_place
from campaign.experiments.shared.default_options import NO_ROOM, torque_above_friction, usual
from campaign.experiments.shared.rig import Rig
from campaign.experiments.shared.rounded_choices import Choices, share
from campaign.physics.bench import Bench
from campaign.result import Finding, Result
from campaign.trial import Task, TrialRequest

OWN = ("realisation",)
"""Conditions in which the trials of one group differ."""
SWING = 0.7
"""Share of the angle limit that the default options of a rate command may use."""
FAVARD = 0.5 * math.pi
"""Largest ratio of an integral of zero mean to its derivative over the lowest omega."""


def _trials(options: ExcitationOptions, bench: Bench) -> Iterator[TrialRequest]:
    moved = (RELATIVE_ANGLE,) if options.signal == "fourier" else (GYRO_RATE,)
    can_use = (GYRO_RATE,) if options.signal == "fourier" else (RELATIVE_ANGLE,)
    for course in courses(options, bench):
        yield TrialRequest(
            Task(
                mode=options.command,
                command=course.command,
                compensation=options.compensation,
                duration=course.duration,
                window=(course.begin, course.duration),
                sample_rate=options.sample_rate,
                start_angle=start_of(options, bench, course),
            ),
            point={} if course.realisation is None else {"realisation": course.realisation},
            note=course.note,
            requires=(DRIVE_TORQUE, *moved),
            can_use=can_use,
            windows=(Window(STEADY, course.begin, course.duration),),
        )


def _fit(options: ExcitationOptions, bench: Bench) -> Mapping[str, ChosenValue]:
    """Sizes within the limits of the bench, and above its friction."""
    choices, rig = Choices(options), Rig(bench)
    choices.sample_rate(rig)
    if options.signal in ("fourier", "file"):
        return choices.told
    omega = 2.0 * math.pi * options.highest
    if options.command == "torque":
        _low_enough(choices, rig, torque_above_friction(choices, rig, "torque"))
        return choices.told
    room = SWING * (rig.limits.angle - abs(options.position))
    if room <= 0:
        raise ValueError(NO_ROOM)
    # A signal of that band accelerates at most as a sine of its size at the highest frequency.
    reasons = {
        "a usual size": usual(20),
        share("rate", 0.5): 0.5 * rig.limits.rate,
        f"its swing is {share('angle', SWING)}": room * 2 * math.pi * options.lowest / FAVARD,
        "what acceleration and torque allow up to the highest frequency": rig.acceleration(
            0.5 * rig.limits.rate
        )
        / omega,
    }
    choices.least("amplitude", "deg/s", reasons)
    return choices.told


def _low_enough(choices: Choices, rig: Rig, torque: float) -> None:
    """Raise the lowest frequency until a frictionless load stays within the limits."""
    if rig.bench.axis.inertia is None:
        return
    free, limits = torque / rig.bench.axis.inertia, rig.limits
    room = SWING * max(limits.angle - abs(choices.options.position), 0.0)
    if not room:
        raise ValueError(NO_ROOM)
    wanted = {
        "a usual size": 0.5,
        f"its swing is {share('angle', SWING)}": math.sqrt(free / room) / (2 * math.pi),
        f"its rate is {share('rate', SWING)}": free / (SWING * limits.rate * 2 * math.pi),
    }
    choices.most("lowest", "Hz", wanted)


def _warnings(options: ExcitationOptions, bench: Bench) -> Iterable[str]:
    if options.signal != "multisine":
        return
    if options.realisations < FEWEST_REALISATIONS:
        yield (
            f"a variance over {options.realisations} realisations is too rough to weigh a fit "
            f"with: write realisations = {FEWEST_REALISATIONS} or more"
        )
    if options.periods < 2:
        yield "a single period does not separate noise from distortion: write periods = 2 or more"


def _measure(data: TrialData) -> Sequence[Estimate]:
    """Numbers of the command and of the reached motion."""
    return tuple(metrics_of(data))


def _analyse(data: TestData) -> Result:
    known = list(data.completed())
    accounts = [(item, metrics(item, _measure)) for item in known]
    commands = of_each_place(known, OWN, lambda group: Result(figures=(command_figure(group),)))
    shaken = [each for each in known if options_of(each.trial).signal != "fourier"]
    results = joined((_responses(shaken), of_each_place(known, OWN, partial(_of_series, data))))
    whole = joined((Result(tuple(reached_tables(accounts))), commands, results))
    return replace(whole, telling=next((figure.key for figure in results.figures), ""))


def _responses(trials: Sequence[TrialData]) -> Result:
    """Frequency responses of all trials but series, as of `campaign identify` without options."""
    if not trials:
        return Result()
    own, why = usable(trials)
    if not own:
        return Result(notes=(f"{why}.",))
    responses, remarks = sources(own, bench_of(own[0].trial), ResponseOptions())
    if not responses:
        return Result(notes=tuple(remarks))
    responses.sort(key=lambda each: each.trials)
    by_number = {each.trial.number: conditions(each) for each in own}
    findings: list[Finding] = []
    for source in responses:
        first, *others = (by_number[number] for number in source.trials)
        place = {
            name: value
            for name, value in first.items()
            if name not in OWN and all(other.get(name) == value for other in others)
        }
        findings += [Finding.of(each, place) for each in distortion_of(source)]
        remarks += source.remarks
    return Result(
        (sources_table(responses), *distortion_tables(responses)),
        (*response_figures(responses), coherence_figure(responses)),
        tuple(findings),
        tuple(remarks),
    )


def _of_series(data: TestData, group: Sequence[TrialData]) -> Result:
    """Inverse dynamics of one sweep point, with the terms for which the series is designed."""
    options = options_of(group[0].trial)
    if options.signal != "fourier":
        return Result()
    place = {k: v for k, v in conditions(group[0]).items() if k not in OWN}
    own = InverseDynamicsOptions(terms=options.terms)
    try:
        inverse = identify(replace(data, trials=tuple(group)), own)
    except ValueError as error:
        return Result(notes=(f"{group[0].trial.label}: {error}.",))
    findings = tuple(replace(each, conditions=place) for each in inverse.findings)
    figures = (*inverse.figures, plane_figure(group))
    return Result(inverse.tables, figures, findings, inverse.notes)


EXPERIMENT = Experiment(
    name="excitation",
    summary="motion or torque for identification: multisine, chirp, noise, Fourier series, file",
    options=ExcitationOptions,
    trials=_trials,
    analyse=_analyse,
    measure=_measure,
    fit=_fit,
    warnings=_warnings,
    requires={
        DRIVE_TORQUE: "what moved the load",
        GYRO_RATE: "how the load answers",
        RELATIVE_ANGLE: "how a series moved it",
    },
    can_use={
        RELATIVE_ANGLE: "largest angle beside its limit",
        GYRO_RATE: "acceleration of the load in space: that of its angle stands in for it",
    },
)
