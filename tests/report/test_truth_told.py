"""What is told of the truth: means are not counted beside their parts, and what is off alike."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

import pytest

from campaign.estimate import Estimate, Systematic
from campaign.experiments.interface import Experiment, TestData
from campaign.reason import Reason
from campaign.report.content.document import Document, document_of
from campaign.result import Finding, Result

WIDE = 0.4


def told(made_up: ModuleType, folder: Path, shares: Sequence[float], **more: float) -> Document:
    """Of a test that found these shares of the true stiffness at rest, each with ±40 %."""
    true = _true(made_up, folder)
    part = (Systematic("slips in steps", 0.2 * true), Systematic("dwell", 0.1 * true))

    def one(share: float, conditions: dict) -> Finding:
        value, half = share * true, WIDE * share * true
        ends = value - half, value + half
        told = Estimate("stiffness_at_rest", value, "N m/rad", *ends, 0.95, systematic=part)
        return Finding.of(told, {"direction": "positive", **conditions})

    found = [one(share, {"measurement": n}) for n, share in enumerate(shares, start=1)]
    found += [one(share, {"statistic": name}) for name, share in more.items()]
    return _document(made_up, folder, tuple(found))


def _document(made_up: ModuleType, folder: Path, findings: tuple[Finding, ...]) -> Document:
    def analyse(data: TestData) -> Result:
        return Result(findings=findings)

    run = made_up.made_up_run(folder, tests={"breakaway": ()})
    kind = Experiment("breakaway", "", made_up.ShakeOptions, lambda options, bench: (), analyse)
    return document_of(run, {"breakaway": kind})


def _true(made_up: ModuleType, folder: Path) -> float:
    plain = Finding.of(Estimate("stiffness_at_rest", 1.0, "N m/rad", 0.5, 1.5, 0.95), {})
    (row,) = _document(made_up, folder, (plain,)).truths["breakaway"].rows
    return float(row["true"])


def test_a_mean_is_not_counted_beside_what_it_is_of(made_up: ModuleType, tmp_path: Path) -> None:
    document = told(made_up, tmp_path, (0.9, 1.1, 1.05, 0.2), mean=0.82)
    (answer,) = document.opening.answers
    assert answer.truth == "3 of 4 intervals hold the true values of the simulated bench"
    note = document.truths["breakaway"].note
    assert note == "3 of 4 intervals hold the true values; means of others are not counted."


def test_a_mean_alone_counts(made_up: ModuleType, tmp_path: Path) -> None:
    (answer,) = told(made_up, tmp_path, (), mean=0.82).opening.answers
    assert answer.truth == "1 of 1 intervals hold the true value of the simulated bench"


@pytest.mark.parametrize(
    ("shares", "said"),
    [
        # Means over their standard errors: 13, 29, 5.6; Student's t of 99.5 %: 7.5, 14.1, 4.0.
        (
            (0.90, 0.92, 0.93, 0.91),
            "bias −7 to −10 % (4 of 4; exceeds scatter)",
        ),
        (
            (1.08, 1.09, 1.085),
            "bias +8 to +9 % (3 of 3; exceeds scatter)",
        ),
        (
            (0.90, 0.88, 0.93, 0.91, 0.85, 0.9, 0.89, 1.01),
            "bias −9.1 % (mean of 8, −15 to +1 %; exceeds scatter)",
        ),
        ((0.90, 1.08, 0.93, 1.05), ""),  # they scatter
        ((0.90, 0.98, 0.93, 0.99), ""),  # nobody can tell: four may well lie on one side
        ((0.90, 0.90), ""),  # two say nothing of their scatter
        ((0.998, 0.9981, 0.9979), ""),  # nobody minds
    ],
)
def test_estimates_that_are_all_off_alike_are_told(
    made_up: ModuleType, tmp_path: Path, shares: tuple[float, ...], said: str
) -> None:
    document = told(made_up, tmp_path, shares, mean=sum(shares) / len(shares))
    (answer,) = document.opening.answers
    assert f"{len(shares)} of {len(shares)} intervals hold the true values" in answer.truth
    assert (f"; stiffness at rest: {said}" in answer.truth) == bool(said)
    assert ("exceeds scatter" in answer.truth) == bool(said)
    note = document.truths["breakaway"].note
    assert (f". Stiffness at rest: {said}" in note) == bool(said)
    assert ("; largest systematic part: slips in steps" in note) == bool(said)


def test_what_is_off_alike_is_told_without_any_interval(
    made_up: ModuleType, tmp_path: Path
) -> None:
    true = _true(made_up, tmp_path)
    none = (
        Estimate.without_interval(
            "stiffness_at_rest", share * true, "N m/rad", Reason("test", "one value")
        )
        for share in (0.90, 0.92, 0.93, 0.91)
    )
    found = tuple(Finding.of(each, {"measurement": n}) for n, each in enumerate(none))
    (answer,) = _document(made_up, tmp_path, found).opening.answers
    assert answer.truth.startswith("stiffness at rest: bias −7 to −10 % (4 of 4")


def test_bounds_that_all_lie_on_their_side_are_not_told_as_a_bias(
    made_up: ModuleType, tmp_path: Path
) -> None:
    true = _true(made_up, tmp_path)
    found = tuple(
        Finding.of(
            Estimate.without_interval(
                "stiffness_at_rest",
                share * true,
                "N m/rad",
                Reason("test", "hidden"),
                kind="at least",
            ),
            {"measurement": n},
        )
        for n, share in enumerate((0.90, 0.92, 0.93, 0.91))
    )
    document = _document(made_up, tmp_path, found)
    assert "what is true" not in document.truths["breakaway"].note


def _fits(true: float, exponents: Sequence[str]) -> tuple[Finding, ...]:
    """Of two directions, fitted with each of these exponents; 20 % off, and sure of it."""
    return tuple(
        Finding.of(
            Estimate("coulomb_torque", share * true, "N m", 0.7 * true, 0.9 * true, 0.95),
            {"direction": direction, "exponent": exponent},
        )
        for exponent in exponents
        for direction, share in (("positive", 0.80), ("negative", 0.81))
    )


@pytest.mark.parametrize(
    ("exponents", "said"),
    [
        (
            ("free", "2"),
            "0 of 2 intervals hold the true values; fits of the same points with the exponent held",
        ),
        (("2",), "0 of 2 intervals hold the true values"),
    ],
)
def test_two_fits_of_the_same_points_count_once(
    made_up: ModuleType, tmp_path: Path, exponents: tuple[str, ...], said: str
) -> None:
    """Four numbers of two fits each would be told as off alike; they are two."""
    document = _document(made_up, tmp_path, _fits(30.0, exponents))
    left_out = " are not counted." if len(exponents) == 2 else "."
    assert document.truths["breakaway"].note == f"{said}{left_out}"
    (answer,) = document.opening.answers
    assert answer.truth == "0 of 2 intervals hold the true values of the simulated bench"


def test_of_several_interfaces_it_is_told_what_is_true_of_which(
    made_up: ModuleType, tmp_path: Path
) -> None:
    found = Estimate("damping_at_rest", 900.0, "N m s/rad", 800.0, 1000.0, 0.95)
    (table,) = _document(made_up, tmp_path, (Finding.of(found, {}),)).truths.values()
    assert table.rows[0]["of"] == "the sum of 2 interfaces, before any slips"
    assert "Applies to" in [column.label for column in table.columns]
