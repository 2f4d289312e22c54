"""Table 3.1: its rules against their controls, and its measures against closed forms."""

from __future__ import annotations

import math
import tomllib
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from campaign.channels import DRIVE_TORQUE, FRICTION_TORQUE, LOAD_RATE, RELATIVE_ANGLE
from campaign.experiments.model_properties import virtual_experiments
from campaign.experiments.model_properties.experiment import ModelPropertiesOptions
from campaign.experiments.model_properties.parameter_set import Scale, options_of, with_friction
from campaign.experiments.model_properties.rules import (
    BLANK,
    DEPENDS,
    MARKS,
    MET,
    PARTLY,
    RULES,
    ModelVerdict,
)
from campaign.experiments.model_properties.virtual_experiments import PULL
from campaign.physics.bench import Bench
from campaign.physics.friction import friction_models
from campaign.published.values import thesis
from campaign.recording import Recording
from campaign.result import Result
from campaign.signals import Polyline
from tests.experiments.laboratory import Done, analyse, execute, finding, table, trials

PROTOCOLS = Path(__file__).parents[2] / "protocols"
(TEST,) = tomllib.loads((PROTOCOLS / "friction_models.toml").read_text(encoding="utf-8"))["test"]
SET = "LuGre 1995"
GIVEN = TEST["sets"][SET]
CONTROLS = sorted({rule.positive for rule in RULES} | {rule.negative for rule in RULES[1:]})


def specimen() -> Bench:
    text = (PROTOCOLS / TEST["bench"]).read_text(encoding="utf-8")
    return Bench.model_validate(tomllib.loads(text))


def planned(models: list[str], sets: Any = None) -> list[Any]:
    return trials("model_properties", specimen(), {"models": models, "sets": sets or {SET: GIVEN}})


@cache
def controls() -> Result:
    return analyse("model_properties", execute(planned(CONTROLS)))


def mark(model: str, name: str) -> float:
    return finding(controls(), "model_property", model=model, property=name).value


@pytest.mark.slow
@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.name)
def test_a_rule_meets_its_controls(rule: Any) -> None:
    assert mark(rule.positive, rule.name) == MET
    if rule is not RULES[0]:  # no model of the table lacks Coulomb friction: see below
        assert mark(rule.negative, rule.name) == BLANK


@pytest.mark.slow
def test_the_page_shows_the_marks() -> None:
    """Of the controls, and where it says that a mark depends on no parameter."""
    page = (PROTOCOLS.parent / "docs" / "friction-models.md").read_text(encoding="utf-8")
    lines = [line.strip("| ").split(" | ") for line in page.splitlines()]
    (head,) = [cells for cells in lines if cells[0] == "property"]
    shown = {cells[0]: cells[1:] for cells in lines if len(cells) == len(head)}
    for rule in RULES:
        for names, sign in zip(head[1:], shown[rule.name], strict=True):
            for name in names.replace("`", "").split(", "):
                if name in CONTROLS and sign != "?":
                    assert MARKS[mark(name, rule.name)] == sign, (rule.name, name)


def test_the_page_shows_states_and_switches() -> None:
    page = (PROTOCOLS.parent / "docs" / "friction-models.md").read_text(encoding="utf-8")
    for name in set(TEST["models"]) - {"armstrong"}:  # whose state depends on the step
        made, model = options_of(name, GIVEN, own=True), friction_models()[name]
        assert model.switches is not None
        sizes = f"| {model.state_size(made, 1e-4)}, {model.switches(made)} |"
        (row,) = [line for line in page.splitlines() if line.startswith(f"| [`{name}`]")]
        assert sizes in row


def test_viscous_friction_alone_has_no_coulomb_friction() -> None:
    alone = options_of("coulomb", {**GIVEN, "coulomb_torque": "0 N m"}, own=True)
    tree = with_friction(specimen(), alone)
    steady = [t for t in planned(["coulomb"]) if t.point["part"] == "steady sliding"]
    done = execute(t.model_copy(update={"bench": tree}) for t in steady)
    scale = Scale.of(GIVEN, 1.0, "coulomb")
    part = virtual_experiments.PARTS["steady sliding"]
    ends = [
        part.measure(item, scale) for item in done if float(str(item.trial.point["speed"])) > 0
    ][-2:]
    slope = np.diff([e["friction_torque"] for e in ends]) / np.diff([e["rate"] for e in ends])
    zero = ends[0]["friction_torque"] - slope * ends[0]["rate"]
    assert RULES[0].mark({"coulomb_share": float(zero[0]) / scale.coulomb}) == BLANK


def test_marks_begin_at_their_thresholds() -> None:
    for rule in RULES:
        signs = {rule.sign: 1.0} if rule.sign else {}
        assert rule.mark({rule.shows: rule.threshold, **signs}) == MET
        assert rule.mark({rule.shows: 0.999 * rule.threshold, **signs}) == PARTLY
        assert rule.mark({rule.shows: 0.5 * rule.threshold, **signs}) == PARTLY
        assert rule.mark({rule.shows: 0.499 * rule.threshold, **signs}) == BLANK
        if rule.sign:
            assert rule.mark({rule.shows: 2.0 * rule.threshold, rule.sign: 0.0}) == PARTLY


def test_a_mark_that_differs_between_sets_depends_on_the_parameters() -> None:
    judged = ModelVerdict("m", {"a": {"coulomb_share": 1.0}, "b": {"coulomb_share": 0.1}}, {})
    assert judged.sign(RULES[0]) == DEPENDS
    assert judged.marks(RULES[0]) == [BLANK, MET]


@pytest.mark.parametrize("exponent", [1.0, 2.0])
def test_the_scale_of_a_set_is_that_of_its_model(exponent: float) -> None:
    scale = Scale.of({**GIVEN, "stribeck_exponent": exponent}, 2.0, "dahl")
    assert (scale.static, scale.coulomb, scale.viscous) == pytest.approx((1.5, 1.0, 0.4))
    assert scale.velocity == pytest.approx(1e-3, rel=1e-8)
    assert scale.natural_rate == pytest.approx(math.sqrt(1e5 / 2.0))
    assert scale.own == pytest.approx(1.0)  # Dahl's friction never exceeds Tc
    assert scale.amplitude == pytest.approx(0.5e-5)


def test_a_model_goes_without_what_its_source_does_not_have() -> None:
    tree: Any = with_friction(specimen(), options_of("dahl", GIVEN, own=True))
    assert tree["friction"]["load"]["viscous_friction"] == 0.0
    tree = with_friction(specimen(), options_of("lugre", GIVEN, own=True))
    assert tree["friction"]["load"]["viscous_friction"] == 0.4


def rests(rate: Any, period: float) -> float:
    """A made-up pull of ten periods; rate over phase, in units of the pull's rate."""
    scale = Scale.of(GIVEN, 1.0, "lugre")
    time = np.linspace(0.0, 10.0 * period, 20_001)
    v = PULL * scale.velocity * rate((time / period) % 1.0)
    x = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(time))])
    trial = next(t for t in planned(["lugre"]) if t.point["part"] == "soft spring")
    done = execute([trial])[0]
    made = {LOAD_RATE: v, RELATIVE_ANGLE: x, DRIVE_TORQUE: np.zeros_like(x)}
    own = done.samples.channels
    channels = {name: replace(own[name], samples=values) for name, values in made.items()}
    item = replace(done, samples=Recording(time=time, channels=channels))
    return virtual_experiments.PARTS["soft spring"].measure(item, scale)["rests"]


def test_a_swing_that_just_comes_to_a_halt_does_not_rest() -> None:
    assert rests(lambda phase: 1.0 - np.cos(2.0 * np.pi * phase), 2.0) == 0.0


def test_rests_between_slips_are_counted() -> None:
    slips = lambda phase: np.where(phase > 0.6, 6.0 * np.sin((phase - 0.6) * 7.854), 0.0)  # noqa: E731
    assert rests(slips, 2.0) == 9.0


def presliding(torque: Any) -> dict[str, float]:
    """Measures of a made-up friction, a function of the way so far and of the displacement."""
    (trial,) = [t for t in planned(["gms"]) if t.point["part"] == "presliding"]
    done = execute([trial])[0]
    samples = done.samples
    made = replace(samples.channels[FRICTION_TORQUE], samples=torque(samples[RELATIVE_ANGLE]))
    channels = {**samples.channels, FRICTION_TORQUE: made}
    item = replace(done, samples=Recording(time=samples.time, channels=channels))
    return dict(virtual_experiments.presliding_numbers(item, Scale.of(GIVEN, 1.0, "gms")))


def test_a_spring_comes_back_and_loses_nothing() -> None:
    found = presliding(lambda x: 1e5 * x)
    assert found["reversible_share"] == pytest.approx(1.0, abs=1e-6)
    assert found["loss_factor"] == pytest.approx(0.0, abs=1e-6)


def play(x: Any, width: float) -> Any:
    """Maxwell slip of one element: a spring of stiffness 1e5 that slips at `width` (rad)."""
    z, found = 0.0, []
    for step in np.diff(x, prepend=0.0):
        z = float(np.clip(z + step, -width, width))
        found.append(1e5 * z)
    return np.array(found)


def test_one_slipping_spring_has_its_closed_forms() -> None:
    amplitude = Scale.of(GIVEN, 1.0, "gms").amplitude
    width = 0.4 * amplitude
    found = presliding(lambda x: play(x, width))
    # Unloaded from 1e5 width, it comes back by the width; the loop is a parallelogram.
    assert found["reversible_share"] == pytest.approx(0.4, abs=0.05)
    lost = 4.0 * width * (amplitude - width) / (math.pi * width * amplitude)
    assert found["loss_factor"] == pytest.approx(lost, rel=0.02)
    assert found["closure"] > 1e3


@pytest.mark.slow
def test_the_printed_table_is_met_where_the_models_are_those_of_the_print() -> None:
    """Of the controls, with one set: the cells that differ are those that the file explains."""
    printed = thesis()["3.1"]
    differ = {
        (cell.row, cell.column)
        for cell in printed.cells
        if cell.quantity == "model_property"
        and cell.column in CONTROLS
        and mark(cell.column, cell.row) != cell.value
    }
    assert differ == {
        ("static friction", "dahl"),
        ("friction lag", "armstrong"),
        ("stick-slip", "stribeck"),
        ("stick-slip", "armstrong"),
        ("presliding", "armstrong"),
    }
    assert all(cell.notes for cell in printed.cells if (cell.row, cell.column) in differ)


@pytest.mark.slow
def test_without_a_rest_armstrongs_breakaway_falls_with_the_ramp_rate() -> None:
    """By its dwell time, which is a row of its own: the note at its cell says so."""
    scale, torques = Scale.of(GIVEN, 1.0, "armstrong"), []
    for trial in planned(["armstrong"]):
        if trial.point["part"] == "ramp":
            task = trial.task
            peak, lasts = task.disturbance.values[-1], task.duration
            times = (0.0, 0.001, 0.01, 0.011, 0.025, 0.025 + lasts)
            push = Polyline(times=times, values=(0.0, 2.0, 2.0, 0.0, 0.0, peak))
            changed = {"disturbance": push, "duration": times[-1], "window": (0.0, times[-1])}
            moved = trial.model_copy(update={"task": task.model_copy(update=changed)})
            recording = execute([moved])[0].recording()
            late = recording.window(0.025, times[-1])
            slides = int(np.argmax(late[LOAD_RATE] > PULL * scale.velocity))
            assert np.max(recording[LOAD_RATE][recording.time < 0.025]) > 3.0 * scale.velocity
            torques.append(float(np.max(late[FRICTION_TORQUE][:slides])))
    assert torques[0] - torques[-1] > 0.8 * scale.excess


@pytest.mark.slow
def test_tables_show_marks_numbers_rules_and_sizes() -> None:
    marks = {row["property"]: row for row in table(controls(), "model-properties").rows}
    assert marks["presliding"]["gms"] == "+"
    assert marks["presliding"]["lugre"] == "o"
    assert marks["nonlocal memory"]["armstrong"] == "–"  # a spring has no loop to close
    assert marks["dwell time"]["lugre"] == "–"
    sizes = {row["model"]: row for row in table(controls(), "model-sizes").rows}
    assert sizes["lugre"] == {"model": "lugre", "parameters": 6, "state": 1, "switches": 1}
    assert (sizes["stribeck"]["switches"], sizes["gms"]["switches"]) == (2, 11)
    assert [figure.key for figure in controls().figures] == [
        "model-marks", "model-properties", "model-presliding", "model-lag",
    ]  # fmt: skip


@pytest.mark.slow
def test_a_model_whose_trials_are_not_all_there_is_left_out() -> None:
    result = analyse("model_properties", dahl()[1:])
    assert not result.findings
    assert result.notes == ("dahl, LuGre 1995: trials are missing; the model is left out.",)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("part", "channel"),
    [
        ("ramp", FRICTION_TORQUE),
        ("swing", FRICTION_TORQUE),
        ("soft spring", RELATIVE_ANGLE),
        ("presliding", FRICTION_TORQUE),
        ("vibration", RELATIVE_ANGLE),
        ("rest", FRICTION_TORQUE),
    ],
)
def test_lost_samples_are_no_mark(part: str, channel: str) -> None:
    done = list(dahl())
    at = next(k for k, item in enumerate(done) if item.trial.point["part"] == part)
    samples = done[at].samples
    own = samples.channels[channel]
    values = np.where(np.arange(len(own.samples)) % 7 == 3, np.nan, own.samples)
    channels = {**samples.channels, channel: replace(own, samples=values)}
    done[at] = replace(done[at], samples=replace(samples, channels=channels))
    result = analyse("model_properties", done)
    assert not result.findings
    assert any("dahl, LuGre 1995: " in note and "left out" in note for note in result.notes)


@cache
def dahl() -> tuple[Done, ...]:
    return execute(planned(["dahl"]))


@pytest.mark.slow
def test_one_table_is_not_made_of_two_benches() -> None:
    twice = [
        replace(
            item, trial=item.trial.model_copy(update={"point": {**item.trial.point, "day": day}})
        )
        for day in (1, 2)
        for item in dahl()
    ]
    with pytest.raises(ValueError, match="one bench"):
        analyse("model_properties", twice)


@pytest.mark.parametrize(
    ("models", "change", "words"),
    [
        (["lugre"], {"zero_bend": "1 mrad/s"}, "no friction model has the parameter 'zero_bend'"),
        (["lugr"], {}, "there is no friction model 'lugr'"),
        (["gms"], {"attraction": "1 N m"}, "attraction"),
        (["lugre"], {"model": "coulomb"}, "name one that has them, as lugre"),
        (["lugre"], {"static_torque": "0.9 N m"}, "name one that has them, as lugre"),
        (["lugre"], {"viscous_friction": "0 N m s/rad"}, "name one that has them, as lugre"),
    ],
)
def test_what_cannot_be_tried_is_refused(models: list[str], change: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words.replace("(", r"\(")):
        planned(models, {SET: {**GIVEN, **change}})


def test_a_bench_without_inertia_is_refused() -> None:
    bench = specimen()
    without = bench.model_copy(update={"axis": bench.axis.model_copy(update={"inertia": None})})
    options = ModelPropertiesOptions(models=("lugre",), sets={SET: GIVEN})
    from campaign.experiments.model_properties.experiment import EXPERIMENT

    with pytest.raises(ValueError, match=r"axis\.inertia"):
        list(EXPERIMENT.trials(options, without))
