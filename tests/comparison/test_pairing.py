"""Which findings of two runs are the same quantity under the same conditions."""

from __future__ import annotations

import pytest

from campaign.api.analysis import AnalysedTest
from campaign.comparison.same_quantity import pair_findings, pair_tests, same_finding
from campaign.experiments.interface import TestData
from campaign.result import Finding, Result
from tests.comparison.laboratory import analysed


def finding(quantity: str = "torque", unit: str = "N m", **conditions: object) -> Finding:
    return Finding(quantity, 1.0, unit, conditions)  # type: ignore[arg-type]


def test(name: str, kind: str, *findings: Finding) -> AnalysedTest:
    return analysed(TestData(name, kind, {}, ()), Result(findings=findings))


test.__test__ = False  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ({"frequency": 0.24}, {"frequency": 0.24}, True),
        ({"frequency": 0.24}, {"frequency": 0.2401}, True),
        ({"frequency": 0.24}, {"frequency": 0.2410}, False),
        ({"position": 0.0}, {"position": 1e-17}, True),
        ({"position": 0.0}, {"position": 0.001}, False),
        ({"direction": "positive"}, {"direction": "negative"}, False),
        ({"exponent": "2"}, {"exponent": "free"}, False),
        ({"frequency": 0.24}, {}, False),
        ({"frequency": None}, {}, True),
        ({"on": True}, {"on": 1}, False),
        ({"a": 1, "b": "x"}, {"b": "x", "a": 1.0}, True),
    ],
)
def test_conditions_are_the_same_within_a_thousandth(one, other, same):
    assert same_finding(finding(**one), finding(**other)) is same
    assert same_finding(finding(**other), finding(**one)) is same


def test_units_must_go_together():
    assert same_finding(finding(unit="rad"), finding(unit="mrad"))
    assert not same_finding(finding(unit="rad"), finding(unit="N m"))
    assert not same_finding(finding("torque"), finding("stiffness"))


def test_each_finding_takes_part_once_and_none_is_dropped():
    one = [finding(n=1), finding(n=1), finding(n=2)]
    other = [finding(n=3), finding(n=1), finding(n=2), finding(n=2)]
    pairs, alone, left = pair_findings(one, other)
    assert [
        (a is one[i], b is other[j]) for (a, b), i, j in zip(pairs, (0, 2), (1, 2), strict=True)
    ]
    assert [each is one[1] for each in alone] == [True]
    assert [(each is other[0]) or (each is other[3]) for each in left] == [True, True]


def test_tests_go_together_by_name_then_by_what_they_have_in_common():
    a, b, c = (finding(n=n) for n in (1, 2, 3))
    reference = [test("map", "k", a), test("old", "k", b, c), test("rest", "other", a)]
    other = [test("new", "k", a, b, c), test("map", "k", a), test("small", "k", b)]
    pairing = pair_tests(reference, other)
    names = [(pair.reference.name, pair.other.name) for pair in pairing.tests]
    assert names == [("map", "map"), ("old", "new")]
    assert [each.name for each in pairing.only_reference] == ["rest"]
    assert [each.name for each in pairing.only_other] == ["small"]
    assert pairing.tests[1].only_other == (a,)


def test_a_test_has_one_partner():
    reference = [test("a", "k", finding()), test("b", "k", finding())]
    pairing = pair_tests(reference, [test("c", "k", finding())])
    assert [(p.reference.name, p.other.name) for p in pairing.tests] == [("a", "c")]
    assert [each.name for each in pairing.only_reference] == ["b"]


def test_tests_of_one_name_and_another_kind_do_not_go_together():
    pairing = pair_tests([test("t", "k", finding())], [test("t", "other", finding())])
    assert not pairing.tests
    assert len(pairing.only_reference) == len(pairing.only_other) == 1


def test_tests_of_one_name_stay_together_when_nothing_was_found():
    pairing = pair_tests([test("t", "k", finding(n=1))], [test("t", "k")])
    assert [pair.only_reference for pair in pairing.tests] == [(finding(n=1),)]


def test_what_follows_from_published_values_is_no_finding_of_a_run():
    derived = Finding("torque", 1.0, "N m", {}, recomputed=True)
    (pair,) = pair_tests([test("t", "k", derived)], [test("t", "k", derived)]).tests
    assert not pair.findings
