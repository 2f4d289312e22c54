"""What docs/developers/adding-an-experiment.md shows is a whole experiment that works."""

from __future__ import annotations

import importlib.util
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from campaign.experiments import experiments
from campaign.experiments.analysis import result_of
from campaign.experiments.interface import Experiment, TestData, bench_of, options_of
from campaign.options import describe
from campaign.protocol import check_limits, load_protocol, make_plan
from campaign.trial import Most
from tests.experiments.asked import asked, suitable
from tests.experiments.laboratory import execute, failed, table

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "developers" / "adding-an-experiment.md").read_text(encoding="utf-8")


def block(kind: str) -> str:
    (found,) = re.findall(rf"^```{kind}\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
    return str(found)


@pytest.fixture(scope="module")
def experiment(tmp_path_factory: pytest.TempPathFactory) -> Experiment:
    path = tmp_path_factory.mktemp("page") / "coast_down.py"
    path.write_text(block("python"), encoding="utf-8")
    spec = importlib.util.spec_from_file_location("coast_down", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # as `import` does
    spec.loader.exec_module(module)
    found = module.EXPERIMENT
    assert isinstance(found, Experiment)
    return found


def test_the_example_runs_and_finds_the_friction(experiment: Experiment, tmp_path: Path) -> None:
    protocol = tmp_path / "my.toml"
    protocol.write_text(block("toml protocol"), encoding="utf-8")
    registry = {**experiments(), experiment.name: experiment}
    plan = make_plan(load_protocol(protocol, registry, shipped=ROOT / "protocols"))
    check_limits(plan)
    done = execute(plan.trials)
    result = experiment.analyse(TestData("coast-down", "coast_down", {}, done))
    rows = table(result, "coast-down").rows
    coulomb = [f.conditions["bench.friction.load.coulomb_torque"] for f in result.findings]
    assert coulomb == [20.0, 20.0, 26.0, 26.0]
    for tc, row in zip(coulomb, rows, strict=True):
        # Far above the Stribeck velocity: Coulomb and viscous friction of load and motor.
        rate = float(str(row["rate"]))
        expected = float(str(tc)) + 141.176 * 0.03 + (4 + 141.176 * 0.001) * rate
        assert row["friction"] == pytest.approx(expected, rel=0.01)
    with experiments().including(experiment):
        assert suitable("coast_down", done) == (list(done), "")
        (parameter,) = asked("coast_down", done).identified.parameters
    means = [float(str(row["friction"])) for row in rows]
    assert parameter.estimate.value == pytest.approx(np.mean(means))
    assert parameter.estimate.has_interval
    nothing = result_of(experiment, TestData("", "", {}, tuple(map(failed, done))))
    assert not nothing.figures
    assert "did not complete" in nothing.notes[0]


def test_the_stage_on_the_page_finds_the_push_for_its_speed(
    experiment: Experiment, tmp_path: Path
) -> None:
    """The rate is a straight line over the torque between two pushes."""
    names = dict(experiment.trials.__globals__)  # type: ignore[attr-defined]
    exec(compile(block("python stage"), "page", "exec"), names)
    stage = names["STAGE"]
    protocol = tmp_path / "my.toml"
    protocol.write_text(block("toml protocol").split("[test.matrix]")[0], encoding="utf-8")
    staged = replace(experiment, stages=(stage,))
    registry = {**experiments(), experiment.name: staged}
    plan = make_plan(load_protocol(protocol, registry, shipped=ROOT / "protocols"))
    assert plan.following == Most(1, 2.8, 2800)
    done = execute(plan.trials)
    rig = bench_of(plan.trials[0])
    options = options_of(staged, plan.trials[0].options)
    (request,) = stage.trials(options, rig, TestData("", "", {}, done))
    result = experiment.analyse(TestData("", "", {}, done))
    slow, fast = (float(str(row["rate"])) for row in table(result, "coast-down").rows)
    share = (np.deg2rad(20.0) - slow) / (fast - slow)
    assert request.point["torque"] == pytest.approx(50.0 + 20.0 * share, abs=1e-3)


def test_the_example_documents_its_options(experiment: Experiment) -> None:
    listed = {info.name: info for info in describe(experiment.options)}
    assert set(listed) == {"torques", "push", "coast", "sample_rate"}
    assert listed["torques"].unit == "N m or N"
    assert all(info.meaning for info in listed.values())


def test_the_page_names_what_exists() -> None:
    for path in set(re.findall(r"`((?:campaign|tests)/[\w/.]+)`", PAGE)):
        if path != "campaign/experiments/coast_down.py":
            assert (ROOT / path).exists(), path
