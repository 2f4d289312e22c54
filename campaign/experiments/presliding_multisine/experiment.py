"""Presliding multisine: stiffness, damping and inertia from small motions below breakaway.

The loop is open; an odd random-phase multisine of torque shakes the load on its bristles, so little
that nothing slips, at several amplitudes. The simulation of the whole motion is fitted to all
trials at once: unlike a torque ramp, which only shows stiffness, that measures the damping, too.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from pydantic import Field

from campaign.axis_kind import is_linear
from campaign.channels import DRIVE_TORQUE, GYRO_RATE
from campaign.estimate import Estimate
from campaign.estimation.presliding_dynamics.presliding_fit import (
    PreslidingDynamics,
    identify_presliding_dynamics,
)
from campaign.experiments.interface import Experiment, TestData, TrialData, bench_of, metrics
from campaign.experiments.presliding_multisine.dynamics import (
    QUANTITIES,
    assumed_of,
    damping_figure,
    estimates_of,
    figures_of,
    record_of,
    remarks,
    table_of,
    with_torques_known,
)
from campaign.experiments.shared.captions import trials_of
from campaign.experiments.shared.common import conditions, failures_note, grouped
from campaign.experiments.shared.conclusion_parts import conclusion, determined, setting
from campaign.experiments.shared.multisine import (
    PER_LINE,
    below_breakaway,
    first_slip,
    odd_multisine,
)
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.result import Amount, Cell, Conclusion, Finding, Result
from campaign.trial import Task, Trial, TrialRequest
from campaign.units import Frequency, Torque

OWN = ("amplitude", "realisation")
"""What distinguishes the trials of one group."""
FASTEST = 0.5
"""of the torque at which an interface slips: above it a trial hardly is one below breakaway."""


class PreslidingMultisineOptions(Options):
    """Options of a presliding-multisine test."""

    amplitudes: tuple[Torque, ...] = Field(default=(0.5, 1.0, 2.0), min_length=1, max_length=100)
    """Largest torques of the multisine; all of them far below breakaway."""
    lowest: Frequency = Field(default=0.5, gt=0)
    """Lowest line; the others are its odd multiples, and its period is that of the torque."""
    highest: Frequency = Field(default=60.0, gt=0)
    """Highest line, well above the resonance of the load on its bristles."""
    periods: int = Field(default=10, ge=2, le=10_000)
    """Periods of the torque in a trial."""
    realisations: int = Field(default=1, ge=1, le=100)
    """Trials of each amplitude, each with phases of its own."""
    seed: int = Field(default=1, ge=0, lt=2**63)
    """Which phases; with the same seed they are the same."""
    damping_ratio: float = Field(default=0.8, gt=0, le=2.0)
    """Assumed damping ratio that the measured damping is held against (Eq. 4.12)."""
    sample_rate: Frequency = Field(default=1000.0, gt=0, le=100_000)
    """Rate of the recording; at least 8 times the highest line."""


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
        torque = f"{slip[0]:.3g} {'N' if is_linear() else 'N m'}"
        yield (
            f"an interface slips at about {torque}: with amplitudes above half of that friction is "
            "no single bristle's, and no interval can be given; lower amplitudes"
        )
    if len(options.amplitudes) < 2:
        yield (
            "a single amplitude cannot show whether friction stays below breakaway: "
            "write at least two amplitudes"
        )


def _options(trial: Trial) -> PreslidingMultisineOptions:
    return PreslidingMultisineOptions.model_validate(trial.options, context={"si": True})


def _found(items: Sequence[TrialData]) -> dict[str, Estimate]:
    return estimates_of(_fit(items), bench_of(items[0].trial))


def _fit(items: Sequence[TrialData]) -> PreslidingDynamics:
    options, bench = _options(items[0].trial), bench_of(items[0].trial)
    span = options.lowest, options.highest
    records = [record_of(item, 1.0 / options.lowest) for item in items]
    return identify_presliding_dynamics(with_torques_known(items, records), assumed_of(bench, span))


def _measure(data: TrialData) -> Sequence[Estimate]:
    """What this trial says by itself."""
    return tuple(_found([data]).values())


def _analyse(data: TestData) -> Result:
    notes: list[str] = list(failures_note(data))
    groups = list(grouped(data.completed(), own=OWN).values())
    results = [
        _of_group(group, f"-{number}" if len(groups) > 1 else "")
        for number, group in enumerate(groups, start=1)
    ]
    notes += [note for each in results for note in each.notes]
    return Result(
        tuple(table for each in results for table in each.tables),
        tuple(figure for each in results for figure in each.figures),
        tuple(finding for each in results for finding in each.findings),
        tuple(dict.fromkeys(notes)),
        tuple(each for result in results for each in result.conclusions),
    )


def _of_group(group: Sequence[TrialData], suffix: str) -> Result:
    """Trials of one place of the sweep."""
    rows: list[dict[str, Cell]] = []
    notes: list[str] = []
    single: list[tuple[float, Estimate]] = []
    for item in group:
        amplitude = float(str(item.trial.point["amplitude"]))
        try:
            own = metrics(item, _measure)
        except ValueError as error:
            notes.append(f"{item.trial.label}: {error}.")
            continue
        rows.append({"amplitude": amplitude, **own})
        if own["damping_at_rest"].has_interval:
            single.append((amplitude, own["damping_at_rest"]))
    bench, options = bench_of(group[0].trial), _options(group[0].trial)
    try:
        found = _fit(group)
    except ValueError as error:
        text = f"No fit of all trials together: {error}."
        tables = (table_of(rows, suffix),) if rows else ()
        return Result(tables, notes=(*notes, text), conclusions=(conclusion(text.rstrip(".")),))
    joint = estimates_of(found, bench)
    place = {k: v for k, v in conditions(group[0]).items() if k not in OWN}
    shown = trials_of(group)
    figures = list(figures_of(found, suffix, shown))
    if single:
        amplitudes = np.array([each for each, _ in single])
        figures.append(
            damping_figure(
                amplitudes,
                [each for _, each in single],
                joint,
                options.damping_ratio,
                suffix,
                shown,
            )
        )
    return Result(
        (table_of([*rows, {"amplitude": "all", **joint}], suffix),),
        tuple(figures),
        tuple(Finding.of(joint[name], place) for name in QUANTITIES),
        (*notes, *remarks(found)),
        (_conclusion(joint, max(options.amplitudes)),),
    )


def _conclusion(joint: dict[str, Estimate], largest: float) -> Conclusion:
    told = [joint[name] for name in QUANTITIES if name in joint]
    shaken = ("Shaken by torques of up to ", setting(largest, "N m"))
    if len(told) < len(QUANTITIES) or not all(e.has_interval and determined(e) for e in told):
        reason = next((str(e.reason) for e in told if e.reason), "the fit gives no number")
        return conclusion(*shaken, ", the load tells not all of its small motions: ", reason)
    return conclusion(
        *shaken,
        ", the load moves as ",
        Amount(joint["inertia"]),
        " on bristles of stiffness ",
        Amount(joint["stiffness_at_rest"]),
        " and damping ",
        Amount(joint["damping_at_rest"]),
        ", the sums over all interfaces",
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
)
