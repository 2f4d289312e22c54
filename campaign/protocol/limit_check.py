"""Refusal of a plan that would exceed a limit."""

from __future__ import annotations

import math
from collections.abc import Sequence

from campaign.errors import LimitError
from campaign.physics.limits import Margin
from campaign.protocol.plan import LimitUse, Plan
from campaign.units import DISPLAY, convert

NAMED_TRIALS = 3
"""of each test and limit; the rest is counted."""


REMEDIES = {
    "rate": (
        "a longer limits.rate_time (it is cut to 1 % of limits.angle over limits.rate), a longer "
        "controller.relative_rate_filter, a sample_rate as high as the controller's, or a finer "
        "sensors.encoder makes it smaller"
    ),
    "angle": "the limit is narrower than the sensor can tell",
    "torque": "the limit is narrower than the sensor can tell",
    "current": "the limit is narrower than the sensor can tell",
}
"""What to do about a limit that the resolution of a sensor alone would break."""


def check_limits(plan: Plan) -> None:
    """Raise LimitError when a trial would break a limit: each test, limit, value and bound."""
    groups: dict[tuple[str, str, str], list[LimitUse]] = {}
    for use in plan.breaches:
        test = plan.trials[use.trial - 1].test
        groups.setdefault((test, use.margin.limit, use.margin.sensor), []).append(use)
    if not groups:
        return
    trials = len({use.trial for use in plan.breaches})
    lines = [f"nothing was moved: {trials} of {len(plan.trials)} trials would break a limit"]
    lines += [_line(plan, test, uses) for (test, _, _), uses in groups.items()]
    raise LimitError("\n".join(lines))


def in_display_units(margin: Margin) -> tuple[str, str]:
    """Value and bound as a reader sees them, e.g. ("41 N·m", "40 N·m")."""
    unit = DISPLAY.get(margin.unit, margin.unit)
    value, bound = (convert(x, margin.unit, unit) for x in (margin.value, margin.bound))
    shown = "infinite (the rate command jumps)" if math.isinf(value) else f"{value:.4g} {unit}"
    return shown.replace("N m", "N·m"), f"{bound:.4g} {unit}".replace("N m", "N·m")


def one_count(margin: Margin) -> str:
    """What a single count of a sensor reads as, in words."""
    value, _ = in_display_units(margin)
    a = "an" if margin.called == "angle" else "a"
    return f"one count of the {margin.sensor} reads as {a} {margin.called} of {value}"


def _line(plan: Plan, test: str, uses: Sequence[LimitUse]) -> str:
    worst = max(uses, key=lambda use: use.margin.fraction)
    value, bound = in_display_units(worst.margin)
    named = [worst, *(use for use in uses if use is not worst)][:NAMED_TRIALS]
    names = [f"{plan.trials[use.trial - 1].name} ({_label(plan, use, test)})" for use in named]
    more = f" and {len(uses) - len(named)} more" if len(uses) > len(named) else ""
    limit = worst.margin.limit
    if worst.margin.sensor:
        what = f"{one_count(worst.margin)}, limit {bound}; {REMEDIES[limit]}"
        names = [plan.trials[use.trial - 1].name for use in named]
        return f"  {test}: {what}: {', '.join(names)}{more}"
    return f"  {test}: {worst.margin.called} up to {value}, limit {bound}: {', '.join(names)}{more}"


def _label(plan: Plan, use: LimitUse, test: str) -> str:
    label = plan.trials[use.trial - 1].label.removeprefix(test).strip()
    return f"{label} {in_display_units(use.margin)[0]}".strip()
