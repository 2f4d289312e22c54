"""What compensations hold, beside what is published, stated, and true of the simulated bench."""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

import pytest

from campaign.estimate import Estimate
from campaign.experiments.interface import Experiment
from campaign.physics.bench import Bench
from campaign.physics.truth import digest, plant_of
from campaign.report.content.document import Document, document_of
from campaign.report.content.held_values import HeldValue, held_by
from campaign.result import Result

pytestmark = pytest.mark.usefixtures("drawings_kept")

BENCHES = Path(__file__).parents[2] / "protocols" / "benches"
TWINS = ("static-identified", "lugre-identified", "observer-identified")


def bench(name: str = "platform-identified", **changes: object) -> Bench:
    tree = tomllib.loads((BENCHES / f"{name}.toml").read_text(encoding="utf-8"))
    return Bench.model_validate(tree | changes)


def document(
    made_up: ModuleType,
    folder: Path,
    rig: Bench,
    tried: Sequence[str] = TWINS,
    truth: Bench | None = None,
    **header: object,
) -> Document:
    kinds = {
        kind: Experiment(
            kind, "", made_up.ShakeOptions, lambda options, bench: (), lambda data: Result()
        )
        for kind in ("stabilization", "breakaway")
    }
    plant = None if truth is None else plant_of(truth)
    key = "" if plant is None else digest(plant)
    facts = {**({"truth": {"plants": {key: plant}}} if plant else {}), **header}
    run = made_up.made_up_run(folder, tests=dict.fromkeys(kinds, ()), bench=rig, **facts)
    trials = []
    for place, archived in enumerate(run.trials):
        trial = archived.trial
        task = trial.task.model_copy(update={"compensation": tried[place % len(tried)]})
        trial = trial.model_copy(update={"task": task, "truth": key})
        trials.append(dataclasses.replace(archived, trial=trial))
    return document_of(dataclasses.replace(run, trials=tuple(trials)), kinds)


def one(numbers: Sequence[HeldValue], quantity: str, direction: str = "") -> HeldValue:
    (found,) = (
        each
        for each in numbers
        if each.quantity == quantity and each.conditions.get("direction", "") == direction
    )
    return found


def test_a_compensation_holds_a_sum_and_a_number_of_one() -> None:
    """15 273.5 and 423 068 N m/rad; half-widths 289.45 and 1634."""
    numbers = held_by(bench(), TWINS)
    rest, alone = one(numbers, "stiffness_at_rest"), one(numbers, "bristle_stiffness")
    assert rest.found.value == pytest.approx(15273.5 + 423068.0)
    assert rest.found.half_width == pytest.approx((289.45**2 + 1634.0**2) ** 0.5)
    assert (alone.found.value, alone.found.half_width) == pytest.approx((15273.5, 289.45))
    assert rest.stated == alone.stated == 15284.0
    assert one(numbers, "bristle_damping").found.value == pytest.approx(1180.07)
    assert one(numbers, "inertia").compensation == "observer"


def test_what_two_hold_alike_is_told_once_and_as_it_was_identified() -> None:
    """Of the LuGre twin it is a sum of shares, and its interval wider."""
    coulomb = one(held_by(bench(), TWINS), "coulomb_torque", "negative")
    assert sorted(coulomb.compensation.split(", ")) == ["lugre", "static"]
    assert (coulomb.found.value, coulomb.found.half_width) == pytest.approx((26.6221, 0.08835))
    alone = one(held_by(bench(), ["lugre-identified"]), "coulomb_torque", "negative")
    assert alone.found.half_width > 0.1


def test_nothing_is_told_of_what_was_not_tried_or_is_not_as_identified() -> None:
    assert held_by(bench(), ["lugre", "static", "none"]) == ()
    text = (BENCHES / "platform-identified.toml").read_text(encoding="utf-8")
    changed = text.replace('bristle_damping = "1180.07', 'bristle_damping = "1280.07')
    assert changed != text
    told = held_by(Bench.model_validate(tomllib.loads(changed)), TWINS)
    assert {each.compensation for each in told} == {"static", "observer"}


def test_a_number_of_which_a_part_was_not_identified_is_left_out() -> None:
    tree = tomllib.loads((BENCHES / "platform-identified.toml").read_text(encoding="utf-8"))
    path = "compensation.lugre-identified.friction.weaker.bristle_stiffness"
    del tree["known"]["values"][path]
    quantities = {each.quantity for each in held_by(Bench.model_validate(tree), TWINS)}
    assert "bristle_stiffness" in quantities
    assert "stiffness_at_rest" not in quantities


def test_the_table_says_which_truth_and_how_the_document_came_to_its_number(
    made_up: ModuleType, tmp_path: Path
) -> None:
    found = document(made_up, tmp_path, bench(), truth=bench("platform"))
    table = found.truths["stabilization"]
    rows = {row["quantity"]: row for row in table.rows if not row["direction"]}
    told = {
        name: (row["published"], row["printed_in"], row["held"], round(float(str(row["true"])), 2))
        for name, row in rows.items()
    }
    assert told == {
        "stiffness at rest": (15284.0, "Table 4.5", 15284.0, 438812.0),
        "bristle stiffness σ0": (15284.0, "Table 4.5", 15284.0, 15284.0),
        "bristle damping σ1": (1165.0, "Table 4.5", 1165.0, 1185.19),
        "inertia": (35.0, "Text 4.3.3a", 69.1773, 69.18),
    }
    assert [row["of"] for row in rows.values()] == [
        "the sum of 4 interfaces, before any slips",
        "friction.load alone",
        "the sum of 4 interfaces, before any slips",
        "the axis",
    ]
    assert "not measured: by Equation 4.12" in table.note
    assert "slow torque ramp, by Equation 4.13" in table.note
    inside = [row["inside"] for row in rows.values()]
    assert inside == ["yes"] * 4
    # Two compensations state another exponent each, and hold the same: it counts once.
    assert len(table.rows) == 16
    answer = next(each for each in found.opening.answers if each.test == "stabilization")
    assert " of 14 intervals hold the true values of the simulated bench" in answer.truth


def test_a_wrong_number_is_called_wrong(made_up: ModuleType, tmp_path: Path) -> None:
    """The axis is 90 kg m^2, and 69.24 ± 0.20 kg m^2 were identified."""
    truth = bench("platform", axis={"name": "azimuth", "inertia": "90 kg m^2"})
    table = document(made_up, tmp_path, bench(), truth=truth).truths["stabilization"]
    (row,) = (row for row in table.rows if row["quantity"] == "inertia")
    assert (row["true"], row["inside"]) == (90.0, "no")


def test_what_two_tests_share_stands_with_the_first(made_up: ModuleType, tmp_path: Path) -> None:
    found = document(made_up, tmp_path, bench(), truth=bench("platform"))
    assert list(found.truths) == ["stabilization"]


def test_without_a_simulated_bench_or_a_document_less_is_known(
    made_up: ModuleType, tmp_path: Path
) -> None:
    assert document(made_up, tmp_path, bench(), backend="serial").truths == {}
    rig = bench()
    known = rig.known.model_copy(update={"document": ""})
    rig = rig.model_copy(update={"known": known})
    table = document(made_up, tmp_path, rig, truth=bench("platform")).truths["stabilization"]
    assert not {"published", "printed_in"} & {column.name for column in table.columns}
    assert all(isinstance(row["found"], Estimate) for row in table.rows)
