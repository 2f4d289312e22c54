"""For the same trials, a report and an identification give the same numbers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from campaign.experiments import experiments
from campaign.experiments.interface import TestData, measured, result_of
from campaign.protocol import load_protocol, make_plan
from campaign.published.draws import SEED
from campaign.resources import protocols_folder
from campaign.trial import Trial
from tests.experiments.asked import asked
from tests.experiments.laboratory import Done, execute

PROTOCOLS = sorted(protocols_folder().glob("*.toml"))
MODELS = {"breakaway": "ramps", "presliding_multisine": "presliding"}
QUANTITIES = {
    "ramps": {"breakaway_torque": "breakaway_torque", "strongest_stiffness": "bristle_stiffness"},
    "presliding": {name: name for name in ("stiffness_at_rest", "damping_at_rest", "inertia")},
}
"""By model: what a report calls a parameter."""


def planned(path: Path) -> dict[str, list[Trial]]:
    """Trials of each test of these kinds: of one draw of its bench, of one multisine."""
    plan = make_plan(load_protocol(path, experiments(), shipped=path.parent))
    found: dict[str, list[Trial]] = {}
    for each in plan.trials:
        if each.kind in MODELS:
            own = found.setdefault(each.test, [])
            ramps = each.kind == "breakaway"
            if not own or (ramps and each.point.get(SEED) == own[0].point.get(SEED)):
                own.append(each)
    return found


def executed(trials: list[Trial]) -> list[Done]:
    """As a run does, which measures each trial when it ends."""
    kind = experiments()[trials[0].kind]
    return [replace(done, estimates=tuple(measured(kind, done))) for done in execute(trials)]


@pytest.mark.slow
@pytest.mark.parametrize("path", PROTOCOLS, ids=lambda path: path.stem)
def test_report_and_identification_agree(path: Path) -> None:
    for test, trials in planned(path).items():
        done, kind = executed(trials), trials[0].kind
        report = result_of(experiments()[kind], TestData(test, kind, {}, tuple(done)))
        identified = asked(MODELS[kind], done)
        # Of both directions, which stand first, or of the only one.
        means = [f for f in report.findings if kind != "breakaway" or "statistic" in f.conditions]
        found = {each.quantity: each.known for each in reversed(means)}
        told = {each.estimate.name: each.estimate for each in identified.identified.parameters}
        names = QUANTITIES[MODELS[kind]]
        assert names.keys() <= told.keys(), test
        for name, quantity in names.items():
            assert replace(told[name], name=quantity) == found[quantity], (test, name)
