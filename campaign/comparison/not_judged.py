"""Reasons why a difference of two findings with intervals is not judged.

Some numbers follow from others of the same test: a changed error changes all its ratios, and each
ratio would be declared different.

The interval of a single trial does not include the scatter between trials.
"""

from __future__ import annotations

from campaign.api.analysis import AnalysedTest
from campaign.reason import NONE, Cause, Reason
from campaign.result import Finding, allow

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
    """Reason not to judge two findings with intervals; `NONE` to judge them.

    sides, findings: of the reference and of the other run.
    """
    names = ("the reference", "the other")
    own = list(zip(names, sides, findings, strict=True))
    alone = [name for name, test, finding in own if trials_behind(test, finding) == 1]
    if alone:
        return ONE_TRIAL_EACH() if len(alone) == 2 else ONE_OF_ONE_TRIAL(side=alone[0])
    return NONE


def trials_behind(test: AnalysedTest, finding: Finding) -> int:
    """Count of completed measurements that the conditions of a finding do not exclude."""
    return sum(
        archived.is_completed_measurement and allow(finding.conditions, archived.trial.point)
        for archived in test.trials
    )
