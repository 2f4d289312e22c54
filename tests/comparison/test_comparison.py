"""Archived runs against each other: what is told of them, and what is refused."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from campaign.archive.reading.open_run import open_run
from campaign.comparison.run_comparison import Comparison, compare_runs
from campaign.comparison.tables import alone_table, change_of, headline, sentences
from campaign.errors import UsageError
from campaign.experiments import experiments
from campaign.references.verdict import Verdict

Compare = Callable[..., Comparison]


@pytest.fixture(scope="module")
def compare(results: Path) -> Compare:
    known: dict[tuple[str, ...], Comparison] = {}

    def made(*names: str, exchanged: tuple[str, ...] = ()) -> Comparison:
        if (*names, *exchanged) not in known:
            runs = [open_run(results / f"{name}.nxs") for name in names]
            known[(*names, *exchanged)] = compare_runs(runs, experiments(), exchanged)
        return known[(*names, *exchanged)]

    return made


@pytest.mark.slow
def test_the_change_that_was_made_is_found_and_no_other(compare: Compare):
    (against,) = compare("before", "after").against
    found = {
        (pair.quantity, pair.conditions["direction"])
        for pair in against.of(Verdict.DIFFERENT)
        if pair.conditions["exponent"] == "free"
    }
    assert ("coulomb_torque", "positive") in found
    assert found <= {("coulomb_torque", "positive"), ("coulomb_torque", "nominal")}
    (pair,) = (
        pair
        for pair in against.pairs
        if pair.quantity == "coulomb_torque"
        and pair.conditions == {"direction": "positive", "exponent": "free"}
    )
    low, high = pair.found.difference.combined
    assert low < 17.732 - 16.12 < high
    assert headline(pair).startswith("Coulomb friction Tc, direction positive, exponent free: +")


def test_two_runs_of_one_bench_are_not_told_apart(compare: Compare):
    (against,) = compare("before", "again").against
    assert not against.of(Verdict.DIFFERENT)
    assert against.tested >= 15
    words = " ".join(sentences(against, against.tested))
    assert "No difference is shown. That does not say that there is none" in words


def test_errors_of_single_trials_are_told_and_not_judged(compare: Compare):
    (against,) = compare("before", "again").against
    errors = [pair for pair in against.pairs if pair.quantity == "stabilization_error"]
    assert len(errors) == 2
    for pair in errors:
        assert pair.verdict is Verdict.NOT_JUDGED
        assert "one trial each" in str(pair.reason)
        assert "%" in change_of(pair)
        assert pair.display == "mrad"


def test_a_comparison_says_in_its_title_what_is_compared_with_what(compare: Compare):
    # Their titles are the same, so that the names tell them apart, if not of one second.
    several = compare("before", "again", "after")
    before, again, after = (side.run.header.name for side in several.sides)
    assert several.title == f"{again} and {after} compared with {before}"
    assert compare("before", "after").title == f"{after} compared with {before}"


def test_what_differs_is_told_field_by_field_in_readable_units(compare: Compare):
    (against,) = compare("before", "after").against
    told = {(c.where, c.path): (c.reference, c.other) for c in against.changes}
    assert told["map: bench", "friction.load.coulomb_torque"] == ("16.12 N·m", "17.732 N·m")
    assert told["map", "seed"] == ("1", "3")
    assert not [c for c in against.changes if c.path.startswith("versions")]
    (same,) = compare("before", "again").against
    assert {c.path for c in same.changes} == {"seed"}


def test_constants_of_the_one_bench_cancel_unless_the_part_was_exchanged(compare: Compare):
    (against,) = compare("before", "again").against
    assert against.shared["map"] == {"torque constant", "inertia"}
    (other,) = compare("before", "again", exchanged=("inertia",)).against
    assert other.shared["map"] == {"torque constant"}

    def shift(of: object) -> list[float | None]:
        return [
            p.standard_uncertainty
            for pair in of.pairs  # type: ignore[attr-defined]
            for p in pair.found.difference.systematic
            if p.source == "inertia"
        ]

    assert max(x or 0.0 for x in shift(other)) > 3 * max(x or 0.0 for x in shift(against))


def test_an_error_that_nobody_knows_cannot_be_exchanged(compare: Compare):
    with pytest.raises(UsageError, match="'motor': is none of torque constant, inertia"):
        compare("before", "again", exchanged=("motor",))


def test_what_only_one_run_found_is_listed(compare: Compare):
    (against,) = compare("before", "waves").against
    table = alone_table(against)
    assert table is not None
    quantities = {row["quantity"] for row in table.rows}
    assert "Coulomb friction Tc" in quantities
    assert {row["run"] for row in table.rows} == {"A"}
    (same,) = compare("before", "again").against
    assert alone_table(same) is None


def test_each_of_several_runs_is_compared_with_the_first_in_one_family(compare: Compare):
    comparison = compare("before", "again", "after")
    assert [(a.reference.letter, a.other.letter) for a in comparison.against] == [
        ("A", "B"),
        ("A", "C"),
    ]
    assert comparison.tested == sum(each.tested for each in comparison.against)
    (alone,) = compare("before", "after").against
    both = comparison.against[1]
    raw = [pair.found.p for pair in both.pairs if pair.testable]
    assert raw == [pair.found.p for pair in alone.pairs if pair.testable]
    adjusted = [pair.adjusted for pair in both.pairs if pair.testable]
    assert adjusted != [pair.adjusted for pair in alone.pairs if pair.testable]


def test_one_run_and_the_same_run_are_refused(results: Path, tmp_path: Path):
    run = open_run(results / "before.nxs")
    with pytest.raises(UsageError, match="two runs or more"):
        compare_runs([run], experiments())
    with pytest.raises(UsageError, match="are the same run"):
        compare_runs([run, run], experiments())
    shutil.copy(results / "before.nxs", tmp_path / "copy.nxs")
    with pytest.raises(UsageError, match="are the same run"):
        compare_runs([run, open_run(tmp_path / "copy.nxs")], experiments())


def test_runs_with_nothing_in_common_are_refused_with_what_each_has(results: Path):
    kept = Path(__file__).parents[1] / "archive" / "kept" / "format-3.nxs"
    with pytest.raises(UsageError) as refused:
        compare_runs([open_run(results / "before.nxs"), open_run(kept)], experiments())
    message = str(refused.value)
    assert "no finding in common" in message
    assert "velocity_map" in message
    assert message.count("\n") >= 2


def test_a_title_that_speaks_of_hardware_says_that_it_was_simulated(compare: Compare):
    side = compare("before", "after").sides[0]
    header = side.run.header.model_copy(update={"title": "Hardware acceptance"})
    assert replace(side, run=replace(side.run, header=header)).title == (
        "Hardware acceptance (simulated)"
    )
