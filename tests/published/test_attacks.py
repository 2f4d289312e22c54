"""What somebody may do to a bench between its description and a run, and the status that follows.

The trials are those that `campaign run` would execute and archive; nothing is executed here.
"""

from __future__ import annotations

import math
import re
import shutil
import tomllib
from pathlib import Path

import pytest

from campaign.experiments import experiments
from campaign.physics.bench import Bench
from campaign.protocol import load_protocol, make_plan
from campaign.protocol.bench_file import load_bench
from campaign.published.evidence import Evidence, evidence_of
from campaign.published.headline import headline
from campaign.published.provenance import Provenance, provenance_of
from campaign.published.scoreboard import Line, Scoreboard, score
from campaign.published.status import Status
from campaign.published.values import read_published, thesis
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


def copied(folder: Path, bench: str, old: str, new: str) -> Path:
    """The shipped protocols in a folder, with one text of a bench changed by hand."""
    copy = Path(shutil.copytree(SHIPPED, folder / "protocols"))
    file = copy / "benches" / f"{bench}.toml"
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new, 1), encoding="utf-8")
    return copy


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


def test_set_alters_the_bench() -> None:
    found = shipped("preload", "preload", 'preload.bench.axis.inertia="60 kg m^2"')
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


NOTHING_KNOWN = re.compile(r"^\[known\]$.*?^\[axis\]$", re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("known", ["", "known = {}\n", '[known]\ndocument = "thesis"\n'])
def test_who_empties_what_is_known_does_not_get_a_better_status(tmp_path: Path, known: str) -> None:
    """Of a calibrated bench with another gear: nobody can tell that nothing was fitted."""
    copy = copied(tmp_path, "platform", "ratio = 141.176", "ratio = 100.0")
    file = copy / "benches" / "platform.toml"
    emptied = NOTHING_KNOWN.sub("[axis]", file.read_text(encoding="utf-8"))
    head, rest = emptied.split("[axis]", 1)
    file.write_text(f"{head}{known}[axis]{rest}", encoding="utf-8")
    found = provenance(copy / "preload.toml", "preload")
    finding = finding_of("none", Finding("stabilization_error", 0.59e-3, "rad", ERROR))
    told = line("5.10/none/stabilization_error", finding, provenance=found)
    assert (told.status, told.verdict) == ("undescribed", "agrees")
    assert told.why == "the bench does not say what it was made from"
    headline_of = headline(Scoreboard((told,)))
    (count,) = headline_of.counts
    assert (count.status, count.compared, count.good) == (Status.UNDESCRIBED, 1, 1)


def test_a_swept_table_of_friction_is_another_bench(tmp_path: Path) -> None:
    """It goes by a name in the conditions, as of one that was always there."""
    file = copied(tmp_path, "simulink", "[axis]", "[axis]") / "stabilization.toml"
    bench = tomllib.loads((SHIPPED / "benches" / "simulink.toml").read_text(encoding="utf-8"))
    table = {**bench["friction"]["load"], "bristle_stiffness": "9000 N m/rad"}
    inline = ", ".join(f"{k} = {_toml(v)}" for k, v in table.items())
    text = file.read_text(encoding="utf-8")
    assert "[test.matrix]\n" in text
    sweep = f'[test.matrix]\n"bench.friction.load" = [{{ {inline} }}]\n'
    file.write_text(text.replace("[test.matrix]\n", sweep, 1), encoding="utf-8")
    found = provenance(file, "stabilization")
    assert "not the 'simulink'" in found.why_altered({**ERROR, "bench.friction.load": "lugre"})


def _toml(value: object) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {_toml(v)}" for k, v in value.items()) + " }"
    return str(value).lower() if isinstance(value, bool) else repr(value)


RENAMED = """
source = "a copy"
[[table]]
name = "A.1"
title = "What Table 5.11 prints"
quantity = "stabilization_error"
unit = "{unit}"
{decimals}
conditions = {{ acceleration = "36 deg/s^2", frequency = "0.4 Hz" }}
columns = {{ condition = "compensation", names = ["none", "static"] }}
[table.cells]
all = {cells}
"""


@pytest.mark.parametrize(
    ("unit", "decimals", "cells"),
    [
        ("mrad", "decimals = 2", "[0.70, 0.31]"),
        ("rad", "decimals = 5", "[0.70e-3, 0.31e-3]"),
        ("mrad", "", "[0.70, 0.31]"),
    ],
)
@pytest.mark.parametrize("known", ["fitted", "given", "seen"])
def test_a_fitted_number_is_fitted_under_any_name(
    unit: str, decimals: str, cells: str, known: str
) -> None:
    """A laboratory's own document prints Table 5.11 at 0.4 Hz as its Table A.1.

    0.31 stands for a number that the thesis does not print there: the bench was not fitted to it.
    """
    thesis_cell = next(c for c in thesis()["5.11"].cells if c.path == "5.11/0.4/none")
    cells = cells.replace("0.70", f"{thesis_cell.value}")
    own = read_published(RENAMED.format(unit=unit, decimals=decimals, cells=cells), "own.toml")
    bench = load_bench(str(SHIPPED / "benches" / "platform.toml"))
    patterns = {"fitted": (), "given": (), "seen": (), known: ("5.11/0.4",)}
    bench = bench.model_copy(update={"known": bench.known.model_copy(update=patterns)})
    where: dict[str, Value] = {"acceleration": math.radians(36), "frequency": 0.4}
    findings = [
        Finding("stabilization_error", 0.7e-3, "rad", {**where, "compensation": name})
        for name in ("none", "static")
    ]
    board = score(own, [evidence_of("t", ("A.1",), findings, bench)])
    told = {"fitted": "calibrated", "given": "recovered", "seen": "selected"}[known]
    free = "predicted" if known == "fitted" else "simulated"
    assert [line.status for line in board.lines] == [told, free]


def test_what_was_fitted_is_no_operating_condition() -> None:
    """Or a sweep could choose, from one run to the next, what the calibration had to find."""
    tree = tomllib.loads((SHIPPED / "benches" / "platform.toml").read_text(encoding="utf-8"))
    tree["known"]["operating"] = ["gear.preload.torque", "axis.inertia"]
    with pytest.raises(ValueError, match="inertia' was fitted"):
        Bench.model_validate(tree)
    tree["known"]["operating"] = ["*"]
    with pytest.raises(ValueError, match="no number at"):
        Bench.model_validate(tree)


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
