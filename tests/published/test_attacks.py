"""What somebody may do to a bench between its description and a run, and the status that follows.

The trials are those that `campaign run` would execute and archive; nothing is executed here.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from campaign.experiments import experiments
from campaign.protocol import load_protocol, make_plan
from campaign.published.provenance import Provenance, provenance_of
from campaign.published.scoreboard import Evidence, Line, score
from campaign.published.values import thesis
from campaign.resources import protocols_folder
from campaign.result import Finding, Value

SHIPPED = protocols_folder()
PRELOAD = "bench.gear.preload.torque"


def provenance(path: Path, test: str, *overrides: str) -> Provenance:
    """Of one test of a protocol, as a report finds it in the archive."""
    protocol = load_protocol(path, experiments(), overrides=overrides, shipped=SHIPPED)
    plan = make_plan(protocol, only=[test], allow_large=False)
    trials = [trial for trial in plan.trials if trial.test == test]
    (tree,) = (t for t in plan.normalised["tests"] if t["name"] == test)
    perturbs = experiments()[trials[0].kind].perturbs_bench
    return provenance_of(trials, perturbs_bench=perturbs, described=tree["bench"])


def shipped(name: str, test: str, *overrides: str) -> Provenance:
    return provenance(SHIPPED / f"{name}.toml", test, *overrides)


def line(path: str, finding: Finding, **more: object) -> Line:
    table = path.split("/")[0]
    evidence = Evidence("t", (table,), [finding], known={"domain": "hardware"}, **more)
    found = score({table: thesis()[table]}, [evidence])
    return next(line for line in found.lines if line.cell.path == path)


@pytest.mark.parametrize(
    "protocol",
    [
        ("preload", "preload"),
        ("repeatability", "velocity-map-days"),
        ("sensitivity", "sensitivity-lugre", "sensitivity-lugre.changes=[-0.2, 0.2]"),
        ("observer_gain", "observer-gain"),
        ("stabilization", "stabilization"),
        ("component_friction", "component-friction"),
    ],
)
def test_the_shipped_protocols_alter_nothing(protocol: tuple[str, ...]) -> None:
    """Among them a matrix over the operating paths, and every declared study of perturbations."""
    assert shipped(*protocol).why_altered({}) == ""


ERROR = {"acceleration": 0.3141592653589793, "frequency": 0.24, "compensation": "none"}


@pytest.mark.parametrize(
    "override",
    [
        'preload.bench.axis.inertia="60 kg m^2"',
        "preload.bench.gear.preload.shares={ static_torque = 0.2, coulomb_torque = 0.8 }",
        'preload.bench.sensors.gyro.noise="0.01 deg/s"',
    ],
)
def test_set_alters_the_bench(override: str) -> None:
    found = shipped("preload", "preload", override)
    conditions: dict[str, Value] = {**ERROR, "average_friction": 50.0, PRELOAD: 50.0}
    finding = Finding("stabilization_error", 0.6e-3, "rad", conditions)
    fitted = {"fitted": ("5.3",), "seen": ("5.12",)}
    before = line("5.12/50/observer", finding_of("observer", finding), **fitted)
    assert before.status == "selected"
    after = line("5.12/50/observer", finding_of("observer", finding), provenance=found, **fitted)
    assert after.status == "altered"
    assert "not the 'platform' that was described" in after.why


def finding_of(compensation: str, finding: Finding) -> Finding:
    conditions = {**finding.conditions, "compensation": compensation}
    return Finding(finding.quantity, finding.value, finding.unit, conditions)


def test_limits_may_be_set() -> None:
    assert (
        shipped("preload", "preload", 'preload.bench.limits.torque="2600 N m"').why_altered({})
        == ""
    )


def test_half_the_stiffness_is_not_the_bench_of_the_appendix(tmp_path: Path) -> None:
    """By hand in the file, not by --set."""
    copy = Path(shutil.copytree(SHIPPED, tmp_path / "protocols"))
    bench = copy / "benches" / "simulink.toml"
    text = bench.read_text(encoding="utf-8")
    bench.write_text(text.replace("18000 N m/rad", "9000 N m/rad", 1), encoding="utf-8")
    why = provenance(copy / "stabilization.toml", "stabilization").why_altered(ERROR)
    assert "not the 'simulink' that was described" in why


def test_a_renamed_and_remarked_bench_is_the_same_bench(tmp_path: Path) -> None:
    copy = Path(shutil.copytree(SHIPPED, tmp_path / "protocols"))
    bench = copy / "benches" / "simulink.toml"
    text = bench.read_text(encoding="utf-8").replace('name = "simulink"', 'name = "ours"')
    bench.write_text(text.replace('angle = "90 deg"', 'angle = "80 deg"  # ours'), "utf-8")
    assert provenance(copy / "stabilization.toml", "stabilization").why_altered({}) == ""


def test_a_threshold_that_is_never_reached_meets_no_claim() -> None:
    """Figure 5.14: sigma2 is said to matter from 65 % on; here no change up to 80 % does."""
    where: dict[str, Value] = {"compensation": "lugre", "parameter": "viscous_friction"}
    beyond = Finding("sensitivity_threshold", 0.8, "", where, lower_bound=True)
    found = line("figure 5.14/viscous_friction/threshold", beyond)
    assert (found.verdict, found.reproduced, found.deviation) == ("not reached", None, None)
    where = {"compensation": "lugre", "parameter": "static_torque"}
    beyond = Finding("sensitivity_threshold", 0.8, "", where, lower_bound=True)
    found = line("figure 5.14/static_torque/threshold", beyond)
    assert found.verdict == "not reached"
    rank = Finding("sensitivity_rank", 5.0, "", where)
    found = line("figure 5.14/static_torque/rank", rank)
    assert (found.verdict, found.reproduced, found.deviation) == ("differs", 5.0, None)


def test_what_follows_from_the_tables_that_were_seen_is_selected() -> None:
    seen = {"fitted": ("5.3",), "seen": ("5.7", "5.12", "5.13")}
    conditions: dict[str, Value] = {**ERROR, "average_friction": 50.0}
    again = line(
        "5.6/50/lugre",
        Finding("stabilization_error", 2e-4, "rad", {**conditions, "compensation": "lugre"}),
        **seen,
    )
    assert again.status == "selected"
    growth = {**conditions, "compensation": "observer"}
    found = line(
        "text 5.3.4.3/error_growth/value", Finding("error_growth", 1.5, "", growth), **seen
    )
    assert (found.status, found.verdict) == ("selected", "missed")
