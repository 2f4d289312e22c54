"""For the same trials, a report and an identification give the same numbers."""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path

import pytest

from campaign.estimate import Estimate
from campaign.estimation.presliding_dynamics.presliding_fit import (
    PreslidingDynamics,
    identify_presliding_dynamics,
)
from campaign.experiments import experiments
from campaign.experiments.analysis import measured, result_of
from campaign.experiments.interface import TestData
from campaign.experiments.presliding_multisine import experiment as presliding_multisine
from campaign.protocol import load_protocol, make_plan
from campaign.published.draws import SEED
from campaign.resources import protocols_folder
from campaign.result import Result
from campaign.trial import Trial
from tests.experiments.asked import asked
from tests.experiments.laboratory import Done, execute, table_of_estimates

PROTOCOLS = sorted(protocols_folder().glob("*.toml"))
MODELS = {
    "breakaway": "ramps",
    "excitation": "frequency_response",
    "frequency_response": "frequency_response",
    "presliding_multisine": "presliding",
    "velocity_map": "friction_map",
}
SWEPT = {"frequency", "speed", "start_angle", "realisation", "amplitude"}
"""What trials of one sine sweep, of one map, or of one test of multisines differ in."""
CURVE = ("viscous_friction", "coulomb_torque", "static_torque", "stribeck_velocity")
QUANTITIES = {
    "ramps": {"breakaway_torque": "breakaway_torque", "strongest_stiffness": "bristle_stiffness"},
    "presliding": {name: name for name in ("stiffness_at_rest", "damping_at_rest", "inertia")},
    "rate": {name: name for name in ("bandwidth", "gain_margin", "phase_margin")},
    "torque": {"resonance": "elastic_mode_frequency"},
}
"""By model, or by the mode of its trials: what a report calls a number."""
MOST = 100
"""of the trials of a sweep or map."""


def planned(path: Path) -> dict[str, list[Trial]]:
    """Trials of each test of these kinds: of one draw of its bench, multisine or compensation."""
    plan = make_plan(load_protocol(path, experiments(), shipped=path.parent))
    found: dict[str, list[Trial]] = {}
    for each in plan.trials:
        if each.kind in MODELS:
            own = found.setdefault(each.test, [])
            if not own or is_of_one_draw(each, own[0]):
                own.append(each)
    return {test: own[:: -(-len(own) // MOST)] for test, own in found.items()}


def is_of_one_draw(one: Trial, other: Trial) -> bool:
    if one.kind == "breakaway":
        return one.point.get(SEED) == other.point.get(SEED)
    return one.kind != "presliding_multisine" and all(
        value == other.point.get(path) for path, value in one.point.items() if path not in SWEPT
    )


def executed(trials: list[Trial]) -> list[Done]:
    """As a run does, which measures each trial when it ends."""
    kind = experiments()[trials[0].kind]
    return [replace(done, estimates=tuple(measured(kind, done))) for done in execute(trials)]


AGREED: set[tuple[str, ...]] = set()
"""Trials of tests that agree: shipped protocols include each other's."""


@pytest.fixture
def presliding_fitted_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of equal records and assumptions: a trial, its test and its identification ask in turn."""
    known: dict[bytes, PreslidingDynamics] = {}

    def fitted(*asked: object) -> PreslidingDynamics:
        key = pickle.dumps(asked)
        if key not in known:
            known[key] = identify_presliding_dynamics(*asked)  # type: ignore[arg-type]
        return known[key]

    monkeypatch.setattr(presliding_multisine, "identify_presliding_dynamics", fitted)


LONG = ("compensator_data", "excitation")
"""Protocols whose tests take half a minute and more."""


@pytest.mark.slow
@pytest.mark.usefixtures("presliding_fitted_once")
@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, marks=[pytest.mark.soak] if path.stem in LONG else [])
        for path in PROTOCOLS
    ],
    ids=lambda path: path.stem,
)
def test_report_and_identification_agree(path: Path) -> None:
    for test, trials in planned(path).items():
        fingerprints = tuple(each.fingerprint for each in trials)
        if fingerprints in AGREED:
            continue
        agree(test, trials)
        AGREED.add(fingerprints)


def agree(test: str, trials: list[Trial]) -> None:
    done, kind = executed(trials), trials[0].kind
    report = result_of(experiments()[kind], TestData(test, kind, {}, tuple(done)))
    if kind == "excitation":
        agree_on_an_excitation(report, done)
        return
    identified = asked(MODELS[kind], done)
    # Of both directions, which stand first, or of the only one.
    means = [f for f in report.findings if kind != "breakaway" or "statistic" in f.conditions]
    found = {each.quantity: each.known for each in reversed(means)}
    told = {each.quantity: each.known for each in identified.findings}
    told |= {each.estimate.name: each.estimate for each in identified.identified.parameters}
    if kind == "velocity_map":
        agree_on_a_map(report, told)
        return
    names = QUANTITIES.get(MODELS[kind]) or QUANTITIES[trials[0].task.mode]
    assert names.keys() <= told.keys(), test
    for name, quantity in names.items():
        assert replace(told[name], name=quantity) == found[quantity], (test, name)


def agree_on_an_excitation(report: Result, done: list[Done]) -> None:
    """Distortion of multisines, in its tables; inverse dynamics of a series, with its terms."""
    options = done[0].trial.options
    if options["signal"] == "fourier":
        identified = asked("inverse_dynamics", done, terms=options["terms"])
        assert [each.known for each in report.findings] == [
            each.known for each in identified.findings
        ]
        assert {each.quantity for each in report.findings} == {*options["terms"], "delay"}
        return
    identified = asked("frequency_response", done)
    for key in ("responses", "distortion", "distortion-lines"):
        one, other = (table_of_estimates(each, key).rows for each in (report, identified))
        assert sorted(map(str, one)) == sorted(map(str, other)), key
    levels = [
        row[parity]
        for row in table_of_estimates(report, "distortion").rows
        for parity in ("even", "odd")
    ]
    assert [each.known for each in report.findings] == levels


def agree_on_a_map(report: Result, told: dict[str, Estimate]) -> None:
    """A report has each direction with the exponent free and held, a bench file one of them."""
    for way in ("positive", "negative"):
        curves = [
            {
                each.quantity: each.known
                for each in report.findings
                if each.conditions["direction"] == way and each.conditions["exponent"] == exponent
            }
            for exponent in ("free", "2")
        ]
        # Which also says how much of a difference of the directions may be a constant force.
        own = {name: replace(told[f"{name}_{way}"], name=name) for name in CURVE}
        assert any(
            all(replace(own[name], reason=curve[name].reason) == curve[name] for name in CURVE)
            for curve in curves
        )
