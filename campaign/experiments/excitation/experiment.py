"""Excitation: a motion or a torque made to identify from.

Odd random-phase multisines show the response with its noise and distortion, a Fourier series
searched for the lowest condition number shows inertia and friction; chirps, noise and a file of
one's own are for whatever else is to be identified (`campaign identify`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal

from campaign.channels import DRIVE_TORQUE, GYRO_RATE, RELATIVE_ANGLE
from campaign.estimate import Estimate, Window
from campaign.estimation.frequency.best_linear import FEWEST_REALISATIONS
from campaign.experiments.excitation.account import (
    dynamics_of,
    metrics_of,
    options_of,
    response_of,
)
from campaign.experiments.excitation.commands import courses, start_of
from campaign.experiments.excitation.conclusions import dynamics_conclusion, response_conclusion
from campaign.experiments.excitation.figures import (
    command_figure,
    dynamics_figure,
    levels_figure,
    plane_figure,
    response_figure,
)
from campaign.experiments.excitation.options import ExcitationOptions
from campaign.experiments.excitation.tables import (
    distortion_findings,
    dynamics_table,
    reached_tables,
    response_table,
)
from campaign.experiments.interface import Chosen, Experiment, TestData, TrialData, metrics
from campaign.experiments.shared.choices import Choices, share
from campaign.experiments.shared.common import conditions, failures_note, grouped, swept
from campaign.experiments.shared.conclusion_parts import Settings, conclusion
from campaign.experiments.shared.fitting import NO_ROOM, PEAK, usual
from campaign.experiments.shared.rig import MOST, Rig
from campaign.physics.bench import Bench
from campaign.result import Conclusion, Figure, Finding, Result, Table
from campaign.trial import Task, TrialRequest

OWN = ("realisation",)
"""What distinguishes the trials of one group."""
STEADY = "steady"
"""The window that is measured."""
SWING = 0.7
"""of the angle limit that a command of a rate may use up by the experiment's own choice."""
FAVARD = 0.5 * math.pi
"""An integral of zero mean is at most so much larger than its derivative over the lowest omega."""


def _trials(options: ExcitationOptions, bench: Bench) -> Iterator[TrialRequest]:
    moved = (RELATIVE_ANGLE,) if options.signal == "fourier" else (GYRO_RATE,)
    can_use = () if options.signal == "fourier" else (RELATIVE_ANGLE,)
    mode: Literal["rate", "torque"] = options.command
    for course in courses(options, bench):
        yield TrialRequest(
            Task(
                mode=mode,
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


def _fit(options: ExcitationOptions, bench: Bench) -> Mapping[str, Chosen]:
    """Sizes within the limits of the bench, and above its friction."""
    choices, rig = Choices(options), Rig(bench)
    choices.sample_rate(rig)
    if options.signal in ("fourier", "file"):
        return choices.told
    omega = 2.0 * math.pi * options.highest
    if options.command == "torque":
        static = rig.static_torque
        friction = {} if static is None else {f"{PEAK:g} times the static torque": PEAK * static}
        drive = {share("torque", MOST): MOST * rig.torque}
        torque = choices.least("torque", "N m", {**friction, **drive})
        _low_enough(choices, rig, torque)
        return choices.told
    room = SWING * (rig.limits.angle - abs(options.position))
    if room <= 0:
        raise ValueError(NO_ROOM)
    # A signal of that band accelerates no more than a sine of its size at the highest frequency.
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
    """Raise the lowest frequency until a load without friction keeps within the limits."""
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
        yield "a single period tells no noise from distortion: write periods = 2 or more"


def _measure(data: TrialData) -> Sequence[Estimate]:
    """What was commanded, and the largest of what came of it."""
    return tuple(metrics_of(data))


def _analyse(data: TestData) -> Result:
    notes = list(failures_note(data))
    accounts = []
    for item in data.completed():
        try:
            accounts.append((item, metrics(item, _measure)))
        except ValueError as error:
            notes.append(f"{item.trial.label}: {error}.")
    usable = [item for item, _ in accounts]
    if not usable:
        return Result(notes=tuple(notes))
    settings = Settings.of(data, ExcitationOptions)
    several = swept(data, OWN)
    results = []
    groups = list(grouped(usable, OWN).values())
    for number, group in enumerate(groups, start=1):
        suffix = f"-{number}" if len(groups) > 1 else ""
        place = {path: group[0].trial.point.get(path) for path in several}
        told = settings.place({k: v for k, v in conditions(group[0]).items() if k in place})
        results.append(_of_group(group, suffix, told))
    tables = [*reached_tables(accounts), *(t for each in results for t in each.tables)]
    return Result(
        tuple(tables),
        tuple(figure for each in results for figure in each.figures),
        tuple(finding for each in results for finding in each.findings),
        tuple(dict.fromkeys([*notes, *(note for each in results for note in each.notes)])),
        tuple(each for result in results for each in result.conclusions),
        telling=next((f.key for r in results for f in r.figures[1:]), ""),
    )


def _of_group(group: Sequence[TrialData], suffix: str, told: Sequence[Any]) -> Result:
    """Trials of one place of the sweep."""
    options = options_of(group[0].trial)
    figures: list[Figure] = [command_figure(group, suffix)]
    tables: list[Table] = []
    findings: list[Finding] = []
    conclusions: list[Conclusion] = []
    place = {k: v for k, v in conditions(group[0]).items() if k not in OWN}
    try:
        if options.signal == "fourier":
            dynamics = dynamics_of(group)
            tables.append(dynamics_table(dynamics, suffix))
            figures += [dynamics_figure(dynamics, group, suffix), plane_figure(group, suffix)]
            findings += [Finding.of(each, place) for each in dynamics.estimates.values()]
            conclusions.append(dynamics_conclusion(dynamics, told, options.period))
            return Result(tuple(tables), tuple(figures), tuple(findings), (), tuple(conclusions))
        response = response_of(group)
    except ValueError as error:
        text = f"{group[0].trial.label}: {error}"
        return Result((), tuple(figures), notes=(f"{text}.",), conclusions=(conclusion(text),))
    figures.append(response_figure(response, group, suffix))
    if response.best is not None:
        tables.append(response_table(response.best, suffix))
        findings += [Finding.of(each, place) for each in distortion_findings(response.best)]
        if response.best.distortion is not None:
            figures.append(levels_figure(response.best, group, suffix))
    conclusions.append(response_conclusion(response, told, options.command))
    return Result(
        tuple(tables), tuple(figures), tuple(findings), response.remarks, tuple(conclusions)
    )


EXPERIMENT = Experiment(
    name="excitation",
    summary="a motion or torque to identify from: multisine, chirp, noise, Fourier series, file",
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
    can_use={RELATIVE_ANGLE: "largest angle beside its limit"},
)
