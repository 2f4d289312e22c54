"""No logic reads a sentence: with codes in place of all texts every number is the same."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from campaign.estimate import Estimate
from campaign.reason import Cause, Reason
from campaign.result import Result
from tests.experiments.laboratory import analyse
from tests.experiments.test_channels import CASES, Case, done


def without_text(given: Any) -> Any:
    """An estimate or another cell as its numbers and codes."""
    if isinstance(given, Estimate):
        reason = (given.reason.code, given.reason.values)
        parts = [(part.source, repr(part.standard_uncertainty)) for part in given.systematic]
        numbers = (given.value, given.low, given.high, given.standard_error, given.freedom)
        return given.name, given.unit, repr(numbers), given.origin, given.kind, reason, parts
    return repr(given) if isinstance(given, float | int) else type(given)


def numbers(result: Result) -> dict[str, Any]:
    """Everything of a result, its reasons as codes but in notes."""
    return {
        "findings": [
            (each.quantity, sorted(map(str, each.conditions.items())), without_text(each.known))
            for each in result.findings
        ],
        "tables": [
            (table.key, [[without_text(cell) for cell in row.values()] for row in table.rows])
            for table in result.tables
        ],
        "figures": [
            (figure.key, len(panel.marks), [digest(curve) for curve in panel.curves])
            for figure in result.figures
            for panel in figure.panels
        ],
        "key numbers": [(e.quantity, without_text(e.known)) for e in result.key_numbers],
        "notes": [*result.notes],
        "doubts": [(each.number, each.fatal, each.reason.code) for each in result.doubts],
    }


def digest(curve: Any) -> bytes:
    return np.concatenate(
        [np.ravel(np.asarray(each, float)) for each in (curve.x, curve.y)]
    ).tobytes()


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_codes_in_place_of_texts_change_no_number(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    items = [replace(item, estimates=()) for item in done(case)]  # which are measured anew
    made, codes = Cause.__call__, {}

    def by_text(self: Cause, **values: Any) -> Reason:
        reason = made(self, **values)
        codes[reason.text] = hashlib.sha256(self.code.encode()).hexdigest()
        return reason

    def by_code(self: Cause, **values: Any) -> Reason:
        reason = by_text(self, **values)
        return replace(reason, text=codes[reason.text])

    monkeypatch.setattr(Cause, "__call__", by_text)
    usual = numbers(analyse(case.kind, items))
    for text in sorted(codes, key=len, reverse=True):  # a reason may be within another
        usual["notes"] = [each.replace(text, codes[text]) for each in usual["notes"]]
    monkeypatch.setattr(Cause, "__call__", by_code)
    assert numbers(analyse(case.kind, items)) == usual
