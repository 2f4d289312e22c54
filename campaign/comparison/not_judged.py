"""Reasons why a difference of two findings with intervals is not judged.

Some numbers follow from others of the same test: one change of an error is a change of each of its
ratios, too, and would be declared as often as there are ratios.

Besides, the interval of a single trial does not hold what a comparison of benches asks of it: there
is no scatter between trials in it.
"""

from __future__ import annotations

from campaign.api.analysis import AnalysedTest
from campaign.reason import NONE, Cause, Reason
from campaign.recording import Outcome
from campaign.result import Finding, same_value
from campaign.trial import Role

DERIVED = frozenset({"error_reduction", "error_decrease", "error_growth", "load_share"})
"""Quantities that are functions of other numbers of the same test."""
FOLLOWS = Cause(
    "follows from others",
    "it follows from other numbers of the same test, which are compared themselves",
)
REPEAT = "the interval does not include the scatter between trials; `repeat = 3` measures it"
ONE_TRIAL_EACH = Cause("one trial each", f"one trial each: {REPEAT}")
ONE_OF_ONE_TRIAL = Cause("one of one trial", f"{{side}} is of one trial: {REPEAT}")


def doubt(sides: tuple[AnalysedTest, AnalysedTest], findings: tuple[Finding, Finding]) -> Reason:
    """Why two findings are not judged although both have intervals; `NONE` when they are.

    sides, findings: of the reference and of the other run.
    """
    if findings[0].quantity in DERIVED:
        return FOLLOWS()
    names = ("the reference", "the other")
    own = list(zip(names, sides, findings, strict=True))
    alone = [name for name, test, finding in own if trials_behind(test, finding) == 1]
    if alone:
        return ONE_TRIAL_EACH() if len(alone) == 2 else ONE_OF_ONE_TRIAL(side=alone[0])
    return NONE


def trials_behind(test: AnalysedTest, finding: Finding) -> int:
    """How many trials the finding may rest on: those that its conditions do not contradict."""
    return sum(
        archived.ending.outcome is Outcome.COMPLETED
        and archived.trial.role is Role.MEASUREMENT
        and all(
            same_value(finding.conditions[path], value)  # type: ignore[arg-type]
            for path, value in archived.trial.point.items()
            if path in finding.conditions
        )
        for archived in test.trials
    )
