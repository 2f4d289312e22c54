"""Refusal of a plan that exceeds a limit or has an unstable loop; warnings for close ones."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from campaign.errors import LimitError
from campaign.physics.bench import Bench
from campaign.physics.complete import complete
from campaign.physics.limits import Margin
from campaign.physics.loop_margins import LoopMargins
from campaign.physics.plan_loops import LoopUse, loops_of
from campaign.protocol.plan import LimitUse, Plan, PlannedTest
from campaign.units import DISPLAY, convert

NAMED_TRIALS = 3
"""Trials that a message names for each test and limit; the rest is counted."""


REMEDIES = {
    "rate": (
        "lengthen limits.rate_time (at most 1 % of limits.angle / limits.rate) or "
        "controller.relative_rate_filter, raise sample_rate to the controller's, or refine "
        "sensors.encoder"
    ),
    "angle": "the limit is narrower than the sensor's resolution",
    "torque": "the limit is narrower than the sensor's resolution",
    "current": "the limit is narrower than the sensor's resolution",
}
"""Remedy for a limit that the resolution of a sensor alone would break."""


def check_limits(plan: Plan) -> None:
    """Raise LimitError if trials would break limits, with test, limit, value and bound of each."""
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
    """Value and bound in display units, e.g. ("41 N·m", "40 N·m")."""
    unit = DISPLAY.get(margin.unit, margin.unit)
    value, bound = (convert(x, margin.unit, unit) for x in (margin.value, margin.bound))
    shown = "infinite (the rate command jumps)" if math.isinf(value) else f"{value:.4g} {unit}"
    return shown.replace("N m", "N·m"), f"{bound:.4g} {unit}".replace("N m", "N·m")


def one_count(margin: Margin) -> str:
    """The value of a single count of a sensor, in words."""
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


TWO_PI = 2.0 * math.pi
PER_RADIAN = 180.0 / math.pi
"""Factor by which a gain in A s/deg is too large if it is entered as A s/rad."""


def check_loops(plan: Plan) -> None:
    """Raise LimitError if a test has an unstable loop and does not seek instability."""
    lines = []
    hints: dict[str, None] = {}
    for test in plan.tests:
        unstable = [use for use in test.loops if not use.margins.stable]
        if unstable and not test.seeks_instability:
            lines.append(f"  {test.name}: {_use(plan, test, unstable[0])}{_more(unstable)}")
            hints |= dict.fromkeys(_hints(plan, unstable[0]))
    if not lines:
        return
    tests = f"{len(lines)} test{'' if len(lines) == 1 else 's'}"
    lines = [f"nothing was moved: the loop is unstable in {tests}", *lines, *hints]
    lines.append(
        "  `campaign check BENCH` shows every loop of a bench; lower the gains or the delays, or "
        "correct the compensation's model"
    )
    raise LimitError("\n".join(lines))


def low_margins(plan: Plan) -> Iterator[str]:
    """A sentence for each test with a loop of less than 20 deg or 3 dB."""
    for test in plan.tests:
        low = [use for use in test.loops if use.margins.low]
        if low:
            yield (
                f"low margin: {test.name}: {_use(plan, test, low[0])}{_more(low)}; below 20 deg or "
                "3 dB a small change of the bench makes it unstable"
            )


def sought_instability(tests: Sequence[PlannedTest]) -> Iterator[str]:
    """A sentence for each test that seeks the instability of a loop."""
    for test in tests:
        if test.seeks_instability:
            loop = f" (worst: {in_words(test.loops[0])})" if test.loops else ""
            yield f"{test.name} goes to where its loop becomes unstable{loop}"


def in_words(use: LoopUse) -> str:
    """E.g. `7.1 Hz crossover, 62 deg, 24 dB (lugre, stuck)`."""
    torque = ", under a torque command" if use.mode == "torque" else ""
    return f"{margins_in_words(use.margins)} ({use.compensation}, {use.regime}{torque})"


def margins_in_words(margins: LoopMargins) -> str:
    """E.g. `7.1 Hz crossover, 62 deg, 24 dB`; `UNSTABLE ...` for an unstable loop."""
    if not margins.stable:
        pole = margins.poles[0]
        turning = f" at {abs(pole.imag) / TWO_PI:.3g} Hz" if abs(pole.imag) > 0 else ""
        return f"UNSTABLE, it grows e-fold in {_time(1.0 / margins.growth)}{turning}"
    parts = ["no crossover"]
    if margins.crossover is not None and margins.phase_margin is not None:
        parts = [
            f"{margins.crossover / TWO_PI:.3g} Hz crossover",
            f"{math.degrees(margins.phase_margin):.3g} deg",
        ]
    gain = margins.gain_margin_db
    return ", ".join(parts if gain is None else [*parts, f"{gain:.3g} dB"])


def _use(plan: Plan, test: PlannedTest, use: LoopUse) -> str:
    trial = plan.trials[use.trial - 1]
    label = trial.label.removeprefix(test.name).strip()
    return f"{in_words(use)} in {trial.name}{f' {label}' if label else ''} on {test.bench}"


def _hints(plan: Plan, use: LoopUse) -> Iterator[str]:
    """A hint if the loop would be stable with a rate gain in A s/deg instead of A s/rad."""
    # Only a complete bench has loops.
    bench = complete(Bench.model_validate(plan.trials[use.trial - 1].bench, context={"si": True}))
    rate = bench.controller.rate
    if bench.is_linear:
        return  # a linear axis has no radians
    lower = rate.model_copy(update={"proportional": rate.proportional / PER_RADIAN})
    controller = bench.controller.model_copy(update={"rate": lower})
    changed = bench.model_copy(update={"controller": controller})
    loops = dict(loops_of(changed, use.compensation, use.mode))
    lowered = loops[use.regime]
    if use.mode == "rate" and isinstance(lowered, LoopMargins) and lowered.stable:
        yield (
            f"  with controller.rate.proportional 57.3 times smaller it is stable: is "
            f"{rate.proportional:.4g} A s/rad intended, or A s/deg given as A s/rad?"
        )


def _more(uses: Sequence[LoopUse]) -> str:
    return f", and {len(uses) - 1} more of its loops" if len(uses) > 1 else ""


def _time(seconds: float) -> str:
    return f"{seconds:.3g} s" if seconds >= 1.0 else f"{seconds * 1e3:.3g} ms"
