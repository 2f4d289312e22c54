"""What each experiment declares of its channels is what its analysis reads, and what it loses."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from campaign.backends.sim import BACKEND as SIM
from campaign.channels import VOCABULARY, explained
from campaign.cli.prepare import check_channels
from campaign.errors import UsageError
from campaign.experiments import experiments
from campaign.physics.bench import Bench
from campaign.result import Figure, Result, Table
from campaign.trial import Trial
from tests.experiments.laboratory import Done, analyse, execute, trials
from tests.physics.benches import bench


def noisy() -> Bench:
    def sampled(tree: dict[str, Any]) -> None:
        tree["controller"]["sample_rate"] = "1 kHz"
        tree["sensors"] = {"gyro": {"noise": "0.01 deg/s"}}
        tree["compensation"]["observer"] = {"gain": "6.2 N m s/rad"}  # 4 Hz, which is stable

    return bench(sampled)


def specimen() -> Bench:
    """Without limits that a load without drive would meet."""

    def unlimited(tree: dict[str, Any]) -> None:
        tree["axis"]["inertia"] = "1 kg m^2"
        tree["limits"] |= {"angle": "1e3 rad", "rate": "100 rad/s", "torque": "1e6 N m"}

    return bench(unlimited)


@dataclass(frozen=True)
class Case:
    """A small test of an experiment that makes everything that the experiment can make."""

    kind: str
    bench: Callable[[], Bench]
    options: dict[str, Any]
    matrix: tuple[dict[str, Any], ...] = ({},)
    also: str = ""

    @property
    def name(self) -> str:
        return self.kind + self.also


SLOW = {"warm_up_cycles": 1, "rest": "0.1 s", "max_time": "3 s", "window_time": "0.3 s"}
SPEEDS = {"speeds": [f"{v} deg/s" for v in (1, 2, 5, 10, 20, 40)], "max_travel": "40 deg"}
MAP = {**SLOW, **SPEEDS, "window_angle": "1 deg"}
ONE_CYCLE = {"cycles": 1, "settle_cycles": 1}
SINES = {"frequencies": ["3 Hz", "10 Hz", "40 Hz", "100 Hz"], "cycles": 4}
RAMP = {"torque_rate": "5 N m/s"}
PULL = {"stiffness": "200 N m/rad", "pull_rate": "0.1 rad/s"}
RAMP = {"torque_rate": "5 N m/s"}
PULL = {"stiffness": "200 N m/rad", "pull_rate": "0.1 rad/s", "duration": "8 s"}
SHAKEN = {
    "amplitudes": ["0.3 N m", "0.6 N m"],
    "lowest": "1 Hz",
    "highest": "40 Hz",
    "periods": 3,
}
WAVES = {"lowest": "1 Hz", "highest": "20 Hz", "amplitude": "8 deg/s"}
SERIES = {"signal": "fourier", "period": "4 s", "search": 10}
CONTACT = {
    "model": "lugre",
    "coulomb_torque": "1 N m",
    "static_torque": "1.5 N m",
    "stribeck_velocity": "0.01 rad/s",
    "viscous_friction": "0.4 N m s/rad",
    "bristle_stiffness": "1e4 N m/rad",
}
CASES = (
    Case("breakaway", bench, {**RAMP, "positions": ["-5 deg", "0 deg", "5 deg"]}),
    Case("component_friction", bench, {**RAMP, "measurements": 2}),
    Case("excitation", bench, {**WAVES, "period": "2 s", "realisations": 3}),
    Case("excitation", bench, {**WAVES, "signal": "chirp", "duration": "10 s"}, also=" chirp"),
    Case("excitation", bench, SERIES, also=" fourier"),
    Case("force_rate", bench, {"torque_rates": ["300 N m/s", "1000 N m/s"]}),
    Case("frequency_response", bench, SINES, ({}, {"compensation": "lugre"})),
    Case("frequency_response", bench, {**SINES, "loop": "open"}, also=" open"),
    Case("friction_lag", bench, {"frequencies": ["5 Hz", "20 Hz"]}),
    Case("model_output", bench, {"compensation": ["static", "lugre"]}),
    Case("model_output", bench, {"vary": ["coulomb_torque", "bristle_damping"]}, also=" varied"),
    Case("model_properties", specimen, {"models": ["dahl"], "sets": {"one": CONTACT}}),
    Case("move", bench, {"angle": "2 deg"}),
    Case(
        "observer_gain",
        noisy,
        {
            **ONE_CYCLE,
            "corners": ["2 Hz", "8 Hz"],
            "disturbance_frequencies": ["4 Hz"],
            "disturbance_cycles": 3,
            "noise_time": "2 s",
        },
    ),
    Case("presliding_hysteresis", bench, {"amplitudes": ["1 mrad"], "frequency": "1 Hz"}),
    Case("presliding_multisine", bench, SHAKEN),
    Case("repeatability", bench, MAP, ({}, {"rest": "0.2 s"})),
    Case(
        "sensitivity",
        bench,
        {
            **ONE_CYCLE,
            "parameters": ["coulomb_torque", "bristle_damping"],
            "changes": [-0.3, 0.3],
            "repeats": 1,
        },
    ),
    Case("stabilization", bench, ONE_CYCLE, ({}, {"compensation": "lugre"})),
    Case("step_response", bench, {}),
    Case("stick_slip", bench, PULL),
    Case("stribeck_curve", bench, {"speeds": ["1 deg/s", "10 deg/s"]}),
    Case("velocity_map", bench, MAP),
)


@dataclass(frozen=True)
class Loss:
    """What there is none of without a channel: whole figures, curves of figures, table columns."""

    figures: tuple[str, ...] = ()
    curves: tuple[str, ...] = ()  # of these figures, some are missing
    columns: tuple[tuple[str, str], ...] = ()
    other_numbers: bool = False  # something else stands in for it


STUCK = Loss(columns=(("stabilization-error", "stuck"),))
RELATIVE = Loss(figures=("relative-rate",))
LOSSES = {
    ("excitation", "gyro_rate"): Loss(other_numbers=True),
    ("excitation", "relative_angle"): Loss(columns=(("reached", "top_angle"),)),
    ("move", "relative_angle"): Loss(columns=(("moves", "reached"), ("moves", "deviation"))),
    ("observer_gain", "friction_torque"): Loss(
        curves=("error",), columns=(("observer-gain", "error_theory"),)
    ),
    ("sensitivity", "compensation_torque"): Loss(figures=("model-dynamic", "model-static")),
    ("sensitivity", "relative_rate"): Loss(figures=("model-static",)),
    ("stabilization", "base_rate"): replace(RELATIVE, columns=STUCK.columns),
    ("stabilization", "relative_rate"): RELATIVE,
    ("stabilization", "relative_angle"): STUCK,
    ("stabilization", "gyro_rate"): STUCK,
    ("stabilization", "compensation_torque"): Loss(figures=("compensation-torque",)),
    ("stabilization", "friction_torque"): Loss(curves=("compensation-torque",)),
    ("step_response", "command"): Loss(curves=("step",)),
    ("stick_slip", "command"): Loss(curves=("stick-slip",)),
    ("stick_slip", "relative_angle"): Loss(
        curves=("stick-slip",), columns=(("stick-slip", "rests"),)
    ),
    ("velocity_map", "command"): Loss(curves=("one-point",)),
    ("velocity_map", "relative_angle"): Loss(),  # this bench has no ripple
    ("repeatability", "relative_angle"): Loss(),
}

NOT_FATAL = {("observer_gain", "load_rate")}
"""Only the trials of noise are in vain: the rest of an old archive can still be analysed."""

PARTLY = {"model_output", "observer_gain"}
"""Kinds whose trials do not all require the same channels: the others are analysed."""

named = pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)


def done(case: Case) -> tuple[Done, ...]:
    return _done(case.name)


@cache
def _done(name: str) -> tuple[Done, ...]:
    (case,) = (case for case in CASES if case.name == name)
    found = execute(trials(case.kind, case.bench(), case.options, case.matrix))
    assert {item.ending.outcome.value for item in found} == {"completed"}
    return found


def analysed(case: Case) -> Result:
    """What all of its trials lead to; read only."""
    return _analysed(case.name)


@cache
def _analysed(name: str) -> Result:
    (case,) = (case for case in CASES if case.name == name)
    return analyse(case.kind, done(case))


def keeping(items: Iterable[Done], keep: Callable[[Trial, str], bool]) -> list[Done]:
    """The same trials with recordings of only some of their channels."""
    kept = []
    for item in items:
        recorded = item.samples.channels.items()
        left = {name: channel for name, channel in recorded if keep(item.trial, name)}
        kept.append(replace(item, samples=replace(item.samples, channels=left)))
    return kept


def plain(found: Any) -> Any:
    """A result as nested lists that can be compared; NaN is equal to itself."""
    if is_dataclass(found):
        return [type(found).__name__, *(plain(getattr(found, f.name)) for f in fields(found))]
    if isinstance(found, np.ndarray):
        return [str(found.dtype), found.shape, found.tobytes()]
    if isinstance(found, dict):
        return {key: plain(value) for key, value in found.items()}
    if isinstance(found, list | tuple):
        return [plain(value) for value in found]
    return repr(found)


def curves_of(figure: Figure) -> list[Any]:
    return [plain(curve) for panel in figure.panels for curve in panel.curves]


def without_columns(table: Table, names: set[str]) -> Any:
    rows = [{k: v for k, v in row.items() if k not in names} for row in table.rows]
    columns = [column for column in table.columns if column.name not in names]
    return plain(replace(table, rows=tuple(rows), columns=tuple(columns)))


ONLY_RECORDED = {"motion"}
"""Nothing executes these; what they do without a channel is tried on recordings of their own."""

ANY_MOTION = {"inverse_dynamics", "whole_model"}
"""Require no channel by itself: one of two forces, and an angle or a rate."""


@pytest.mark.parametrize("kind", experiments())
def test_every_experiment_declares_channels_of_the_vocabulary(kind: str) -> None:
    experiment = experiments()[kind]
    assert experiment.requires or kind in ("move", *ANY_MOTION)
    assert {*experiment.requires, *experiment.can_use} <= set(VOCABULARY)
    if kind in (*ONLY_RECORDED, *ANY_MOTION):
        return
    assert kind in {case.kind for case in CASES}
    for name in experiment.can_use:
        assert (kind, name) in LOSSES


@pytest.mark.slow
@named
def test_the_analysis_reads_nothing_that_is_not_declared(case: Case) -> None:
    whole = analysed(case)
    declared = keeping(done(case), lambda trial, name: name in (*trial.requires, *trial.can_use))
    assert plain(analyse(case.kind, declared)) == plain(whole)


@named
def test_a_trial_declares_what_its_experiment_does(case: Case) -> None:
    experiment = experiments()[case.kind]
    for item in done(case):
        assert {*item.trial.requires} <= {*experiment.requires}
        assert {*item.trial.can_use} <= {*experiment.can_use}


@named
def test_without_a_required_channel_the_analysis_has_nothing_and_the_plan_refuses(
    case: Case,
) -> None:
    required = {name for item in done(case) for name in item.trial.requires}
    for name in required:
        less = keeping(done(case), lambda trial, each, gone=name: each != gone)
        if (case.kind, name) in NOT_FATAL:
            assert all(row["noise"] is None for row in analyse(case.kind, less).tables[0].rows)
        else:
            result = analyse(case.kind, less)
            assert any(f"no {name} was recorded; not analysed" in note for note in result.notes)
            assert not result.findings or case.kind in PARTLY
        with pytest.raises(UsageError) as refusal:
            check_channels(SIM, Lacking(name), [item.trial for item in done(case)])
        (first, *_) = (i.trial for i in done(case) if name in i.trial.requires)
        said = str(refusal.value)
        for word in (first.name, first.test, f"'{case.kind}'", explained(name), "'sim'"):
            assert word in said
        assert "nothing was moved" in said


@pytest.mark.parametrize(("kind", "name"), LOSSES)
def test_an_optional_channel_costs_what_is_said_of_it_and_no_more(kind: str, name: str) -> None:
    of_kind = (case for case in CASES if case.kind == kind)
    case = next(each for each in of_kind if any(name in i.trial.can_use for i in done(each)))
    whole = analysed(case)
    less = analyse(kind, keeping(done(case), lambda trial, each: each != name))
    loss = LOSSES[kind, name]
    note = f"Without {name}: no {experiments()[kind].can_use[name]}."
    if loss.other_numbers:
        assert [each.quantity for each in less.findings] == [f.quantity for f in whole.findings]
        assert less.notes[-1] == note
        return
    assert plain(less.findings) == plain(whole.findings)
    assert less.notes == (*whole.notes, note)
    _same_tables(whole, less, loss)
    _same_figures(whole, less, loss)
    check_channels(SIM, Lacking(name), [item.trial for item in done(case)])


def _same_tables(whole: Result, less: Result, loss: Loss) -> None:
    assert [table.key for table in less.tables] == [table.key for table in whole.tables]
    for was, now in zip(whole.tables, less.tables, strict=True):
        gone = {column for key, column in loss.columns if key == was.key}
        assert without_columns(now, gone) == without_columns(was, gone)
        for column in gone:
            assert any(row[column] is not None for row in was.rows)
            assert all(row.get(column) is None for row in now.rows)


def _same_figures(whole: Result, less: Result, loss: Loss) -> None:
    left = [figure for figure in whole.figures if figure.key not in loss.figures]
    assert len(left) == len(whole.figures) - len(loss.figures)
    assert [figure.key for figure in less.figures] == [figure.key for figure in left]
    for was, now in zip(left, less.figures, strict=True):
        if was.key not in loss.curves:
            assert plain(now) == plain(was)
            continue
        before, after = curves_of(was), curves_of(now)
        assert 0 < len(after) < len(before)
        assert all(curve in before for curve in after)
    assert {*loss.curves} <= {figure.key for figure in left}


class Lacking:
    """A bench that records everything but one channel."""

    def __init__(self, name: str) -> None:
        self._names = frozenset(VOCABULARY) - {name}

    def channels(self, trial: Trial) -> frozenset[str]:
        return self._names
