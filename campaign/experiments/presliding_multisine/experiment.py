"""Presliding multisine: stiffness, damping and inertia from small motions below breakaway.

In open loop, an odd random-phase multisine of torque moves the load on its bristles, at several
amplitudes so small that nothing slips. The simulation of the whole motion is fitted to all trials
at once. A torque ramp shows stiffness only; this determines the damping, too.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from campaign.channels import DRIVE_TORQUE, GYRO_RATE
from campaign.estimate import Estimate
from campaign.estimation.presliding_dynamics.fit import first_fit
from campaign.estimation.presliding_dynamics.presliding_fit import (
    PreslidingDynamics,
    identify_presliding_dynamics,
)
from campaign.experiments.interface import Experiment, Model, TestData, TrialData, bench_of, metrics
from campaign.experiments.presliding_multisine.dynamics import (
    BY_TORQUE,
    QUANTITIES,
    assumed_of,
    damping_figure,
    estimates_of,
    figures_of,
    remarks,
    table_of,
)
from campaign.experiments.presliding_multisine.parameters import identified
from campaign.experiments.presliding_multisine.small_motions import (
    PreslidingMultisineOptions,
    PreslidingOptions,
    is_planned,
    options_of,
    records_of,
    span_of,
    usable,
)
from campaign.experiments.shared.captions import trials_of
from campaign.experiments.shared.common import conditions, number_of, of_each_place
from campaign.experiments.shared.multisine import (
    PER_LINE,
    below_breakaway,
    first_slip,
    odd_multisine,
)
from campaign.experiments.shared.systematic import with_scale
from campaign.physics.bench import Bench
from campaign.result import Cell, Finding, Result
from campaign.trial import Task, TrialRequest
from campaign.units import torque_text

OWN = ("amplitude", "realisation")
"""Point keys that differ between trials of one group."""
DAMPING = "damping_at_rest"
BETWEEN_SAMPLES = 1
"""Columns of torque uncertainty that every commanded torque has."""
FASTEST = 0.5
"""Largest amplitude over the slip torque of an interface, for a trial below breakaway."""


def _trials(options: PreslidingMultisineOptions, bench: Bench) -> Iterator[TrialRequest]:
    if options.sample_rate < PER_LINE * options.highest * (1.0 - 1e-9):
        raise ValueError(
            f"a line at {options.highest:.4g} Hz needs a sample_rate of {PER_LINE:g} times that; "
            "raise sample_rate or lower highest"
        )
    duration = options.periods / options.lowest
    number = 0
    for realisation in range(1, options.realisations + 1):
        for amplitude in options.amplitudes:
            if amplitude <= 0:
                raise ValueError("amplitudes are positive")
            number += 1
            yield TrialRequest(
                Task(
                    mode="torque",
                    command=odd_multisine(
                        amplitude, options.lowest, options.highest, (options.seed, number)
                    ),
                    duration=duration,
                    window=(0.0, duration),
                    sample_rate=options.sample_rate,
                ),
                point={"amplitude": amplitude, "realisation": realisation},
            )


def _warnings(options: PreslidingMultisineOptions, bench: Bench) -> Iterable[str]:
    slip = first_slip(bench)
    if slip is not None and max(options.amplitudes) > FASTEST * slip[0]:
        yield (
            f"an interface slips at about {torque_text(slip[0])}: with amplitudes above half of "
            "that friction is no single bristle's, and no interval can be given; lower amplitudes"
        )
    if len(options.amplitudes) < 2:
        yield (
            "a single amplitude cannot show whether friction stays below breakaway: "
            "write at least two amplitudes"
        )


def _told(found: PreslidingDynamics, items: Sequence[TrialData]) -> dict[str, Estimate]:
    """Estimates by name; those of an imported torque with its scale uncertainty."""
    estimates = estimates_of(found, bench_of(items[0].trial))
    return estimates | {
        name: with_scale(estimates[name], items[0], DRIVE_TORQUE)
        for name in BY_TORQUE
        if name in estimates and estimates[name].has_interval
    }


def _fit(items: Sequence[TrialData]) -> PreslidingDynamics:
    records = records_of(items)
    assumed = assumed_of(bench_of(items[0].trial), span_of(items, records))
    if any(each.doubts.shape[1] > BETWEEN_SAMPLES for each in records):  # noise is removed
        first = first_fit(records, assumed)
        records = records_of(items, [first.answers(each)[0] for each in range(len(records))])
    return identify_presliding_dynamics(records, assumed)


def _measure(data: TrialData) -> Sequence[Estimate]:
    """Estimates of this trial alone."""
    return tuple(_told(_fit([data]), [data]).values())


def _analyse(data: TestData) -> Result:
    """Result of each place of the sweep; a model is fitted to all small motions together."""
    if data.model is not None:
        return _of_group(data, data.trials)
    return of_each_place(data.completed(), OWN, partial(_of_group, data))


def _of_group(data: TestData, group: Sequence[TrialData]) -> Result:
    """Result of the trials of one place of the sweep, or of all that a model suits."""
    rows: list[dict[str, Cell]] = []
    notes: list[str] = []
    single: list[tuple[float, Estimate]] = []
    planned = all(map(is_planned, group))
    for item in group if planned else ():  # others may be long, and many
        amplitude = number_of(item.trial, "amplitude")
        try:
            own = metrics(item, _measure)
        except ValueError as error:
            notes.append(f"{item.trial.label}: {error}.")
            continue
        rows.append({"amplitude": amplitude, **own})
        if own[DAMPING].has_interval:
            single.append((amplitude, own[DAMPING]))
    try:
        fit = _fit(group)
    except ValueError as error:
        text = f"No fit of all trials together: {error}."
        tables = (table_of(rows),) if rows else ()
        return Result(tables, notes=(*notes, text))
    joint = _told(fit, group)
    place = {k: v for k, v in conditions(group[0]).items() if k not in OWN}
    shown = trials_of(group)
    figures = list(figures_of(fit))
    sizes = [each.amplitude for each in fit.fit.records]
    numbers = [joint[name] for name in QUANTITIES if name in joint]
    if single or (not planned and len(numbers) == len(QUANTITIES) and joint[DAMPING].has_interval):
        ratio = (data.model or options_of(group[0])).damping_ratio
        amplitudes = np.array([each for each, _ in single] or sizes)
        alone = [each for _, each in single]
        figures.append(damping_figure(amplitudes, alone, joint, ratio))
    result = Result(
        (table_of([*rows, {"amplitude": "all", **joint}]),),
        tuple(replace(each, trials=shown) for each in figures),
        tuple(Finding.of(each, place) for each in numbers),
        (*notes, *remarks(fit)),
    )
    if data.model is None:
        return result
    parameters, missed, more = identified(data, fit, joint, planned)
    return replace(
        result, tables=(*result.tables, missed), notes=(*result.notes, *more), identified=parameters
    )


EXPERIMENT = Experiment(
    name="presliding_multisine",
    summary="stiffness, damping and inertia from small motions below breakaway",
    options=PreslidingMultisineOptions,
    trials=_trials,
    analyse=_analyse,
    measure=_measure,
    fit=below_breakaway,
    warnings=_warnings,
    requires={DRIVE_TORQUE: "the torque that moves the load", GYRO_RATE: "how the load answers"},
    model=Model(
        name="presliding",
        summary="stiffness, damping and inertia from small motions below breakaway",
        options=PreslidingOptions,
        suits=usable,
    ),
)
