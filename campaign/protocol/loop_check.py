"""Refusal of a plan with an unstable loop, and warnings for close ones."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from campaign.errors import LimitError
from campaign.physics.bench import Bench
from campaign.physics.complete import complete
from campaign.physics.loop_margins import LoopMargins
from campaign.physics.plan_loops import LoopUse, loops_of
from campaign.protocol.plan import Plan, PlannedTest

TWO_PI = 2.0 * math.pi
PER_RADIAN = 180.0 / math.pi
"""How many times too large a gain in A s/deg is when it was typed as A s/rad."""


def check_loops(plan: Plan) -> None:
    """Raise LimitError when a test that does not seek it has an unstable loop."""
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
    """A sentence for each test that means to go where a loop is unstable."""
    for test in tests:
        if test.seeks_instability:
            loop = f" (worst: {in_words(test.loops[0])})" if test.loops else ""
            yield f"{test.name} goes to where its loop becomes unstable{loop}"


def in_words(use: LoopUse) -> str:
    """E.g. `7.1 Hz crossover, 62 deg, 24 dB (lugre, stuck)`."""
    torque = ", under a torque command" if use.mode == "torque" else ""
    return f"{margins_in_words(use.margins)} ({use.compensation}, {use.regime}{torque})"


def margins_in_words(margins: LoopMargins) -> str:
    """E.g. `7.1 Hz crossover, 62 deg, 24 dB`; `UNSTABLE ...` where there is no margin."""
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
    """Whether the rate controller's gain looks like one in A s/deg."""
    # A loop that is known is that of a bench of which all is known.
    bench = complete(Bench.model_validate(plan.trials[use.trial - 1].bench, context={"si": True}))
    rate = bench.controller.rate
    if bench.is_linear:
        return  # nobody measures travel in radians
    lower = rate.model_copy(update={"proportional": rate.proportional / PER_RADIAN})
    controller = bench.controller.model_copy(update={"rate": lower})
    changed = bench.model_copy(update={"controller": controller})
    loops = dict(loops_of(changed, use.compensation, use.mode))
    found = loops[use.regime]
    if use.mode == "rate" and isinstance(found, LoopMargins) and found.stable:
        yield (
            f"  with controller.rate.proportional 57.3 times smaller it is stable: is "
            f"{rate.proportional:.4g} A s/rad meant, or A s/deg given as A s/rad?"
        )


def _more(uses: Sequence[LoopUse]) -> str:
    return f", and {len(uses) - 1} more of its loops" if len(uses) > 1 else ""


def _time(seconds: float) -> str:
    return f"{seconds:.3g} s" if seconds >= 1.0 else f"{seconds * 1e3:.3g} ms"
