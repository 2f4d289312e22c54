"""`campaign check`: loops and facts of a bench before anything moves."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from campaign.cli.output import on_a_terminal, print_json, print_line, print_note, print_table
from campaign.errors import ExitCode, UsageError, writing
from campaign.physics.bench import Bench
from campaign.physics.bench_facts import Fact, facts_of
from campaign.physics.complete import PURPOSES, CompleteBench, complete, lacking
from campaign.physics.linear_friction import Regime
from campaign.physics.loop_margins import LoopMargins
from campaign.physics.open_loop import Mode
from campaign.physics.plan_loops import loops_of
from campaign.protocol.bench_file import load_bench
from campaign.protocol.plan_tree import margins_tree
from campaign.text import number, shortened
from campaign.units import convert

TWO_PI = 2.0 * math.pi
FINE = "fine"
HEADINGS = (
    "command",
    "compensation",
    "friction",
    "crossover",
    "phase margin",
    "gain margin",
    "delay margin",
    "slowest decay",
    "least damped",
    "verdict",
)
FACT_KEYS = ("subject", "value", "against", "unit", "share", "verdict", "advice")


@dataclass(frozen=True)
class CheckedLoop:
    """One loop of a bench; without margins, `why` states why there is no linear loop."""

    compensation: str
    mode: Mode
    regime: Regime
    margins: LoopMargins | None
    why: str = ""

    @property
    def verdict(self) -> str:
        if self.margins is None:
            return f"no linear loop: {self.why}"
        if not self.margins.stable:
            return "UNSTABLE"
        return "low margin" if self.margins.low else FINE


def check_bench(written: str, output: Path | None, *, as_json: bool) -> ExitCode:
    """Print loops and facts of a bench and draw its Bode plot, as far as its data permit.

    Raises UsageError if the picture cannot be written, and the errors of `load_bench`.
    """
    bench = load_bench(written)
    picture = output or Path(f"{Path(written).stem}-check.svg")
    unknown = lacking(bench)
    loops, facts = [] if unknown else list(loops_checked(bench)), facts_of(bench)
    if not unknown:
        _write_picture(complete(bench), picture)
    if as_json:
        drawn = {"lacking": list(unknown)} if unknown else {"picture": str(picture)}
        print_json({"bench": bench.name, **_tree(loops, facts), **drawn})
    else:
        _print(bench, loops, facts)
        print_line(_no_loops(unknown) if unknown else f"Bode picture: {picture}")
    unstable = [
        f"{loop.compensation}, {loop.regime}, under a {loop.mode} command"
        for loop in loops
        if loop.verdict == "UNSTABLE"
    ]
    if unstable:
        print_note(f"unstable: {', '.join(shortened(unstable, 1))}", "red")
    return ExitCode.LIMIT_OR_FAULT if unstable else ExitCode.DONE


def _no_loops(unknown: Sequence[str]) -> str:
    """Text on missing loops, with the missing fields of the bench."""
    what = "; ".join(f"{path} ({PURPOSES[path]})" for path in unknown)
    return f"no loops and no Bode picture: the bench does not say {what}"


def loops_checked(bench: Bench) -> Iterator[CheckedLoop]:
    """All loops of a bench: each compensation, stuck and sliding, for both kinds of command."""
    commands: tuple[tuple[Mode, Iterable[str]], ...] = (
        ("rate", ("none", *bench.compensation)),
        ("torque", bench.compensation),
    )
    for mode, names in commands:
        for name in names:
            for regime, margins in loops_of(bench, name, mode):
                if isinstance(margins, LoopMargins):
                    yield CheckedLoop(name, mode, regime, margins)
                else:
                    yield CheckedLoop(name, mode, regime, None, str(margins))


def _write_picture(bench: CompleteBench, path: Path) -> None:
    from campaign.report.drawing.bode import bode_png, bode_svg

    suffix = path.suffix.lower()
    if suffix not in (".svg", ".png"):
        raise UsageError(f"--output {path}: a picture's name ends in .svg or .png")
    names = ("none", *bench.compensation)
    with writing(f"--output {path}"):
        if suffix == ".png":
            path.write_bytes(bode_png(bench, names))
        else:
            path.write_text(bode_svg(bench, names), encoding="utf-8", newline="\n")


def _print(bench: Bench, loops: list[CheckedLoop], facts: tuple[Fact, ...]) -> None:
    print_line(f"{bench.name}{f': {bench.description}' if bench.description else ''}")
    verdicts = Counter(loop.verdict for loop in loops) + Counter(fact.verdict for fact in facts)
    print_line("; ".join(f"{count} {verdict}" for verdict, count in verdicts.items()))
    print_line()
    if loops:
        spare = ("slowest decay", "delay margin", "least damped", "crossover")
        print_table(HEADINGS, [_loop_row(loop) for loop in loops], spare=spare)
        print_line()
    if not facts:
        return
    shown = [fact for fact in facts if fact.verdict != FINE] if on_a_terminal() else facts
    headings = ("value against limit", "is", "of", "share", "verdict", "what to do")
    if shown:
        print_table(headings, [_fact_row(fact) for fact in shown], spare=("of", "is", "share"))
    if fine := len(facts) - len(shown):
        print_line(f"left out: {fine} values that are fine; with `| cat` all is shown")
    print_line()


def _loop_row(loop: CheckedLoop) -> tuple[str, ...]:
    margins = loop.margins
    place = (loop.mode, loop.compensation, loop.regime)
    if margins is None:
        return (*place, *(["–"] * 6), loop.verdict)
    fastest = f"{number(margins.growth, 3)} 1/s" if margins.poles else "–"
    poles = (fastest, _damping(margins.least_damped))
    if not margins.stable:
        return (*place, *(["–"] * 4), *poles, loop.verdict)
    return (
        *place,
        _shown(margins.crossover, 1.0 / TWO_PI, "Hz"),
        _shown(margins.phase_margin, 180.0 / math.pi, "deg"),
        _gain(margins.gain_margin_db),
        _shown(margins.delay_margin, 1e3, "ms"),
        *poles,
        loop.verdict,
    )


def _shown(value: float | None, factor: float, unit: str) -> str:
    return "–" if value is None else f"{number(round(value * factor, 3), 3)} {unit}"


def _gain(margin: float | None) -> str:
    """Text of a gain margin; below 0 dB it limits a gain decrease (conditionally stable loop)."""
    if margin is not None and margin < 0:
        return f"may fall {_shown(-margin, 1.0, 'dB')}"
    return _shown(margin, 1.0, "dB")


def _damping(pole: complex | None) -> str:
    """Text of a pole: `ζ 0.029 at 10.9 Hz`."""
    if pole is None:
        return "–"
    return f"ζ {-pole.real / abs(pole):.2g} at {abs(pole) / TWO_PI:.3g} Hz"


def _fact_row(fact: Fact) -> tuple[str, ...]:
    value, against = (
        f"{number(convert(x, fact.unit, fact.display), 3)} {fact.display}"
        for x in (fact.value, fact.against)
    )
    share = f"{number(100.0 * fact.share, 2)} %"
    return (fact.subject, value, against, share, fact.verdict, fact.advice)


def _tree(loops: list[CheckedLoop], facts: tuple[Fact, ...]) -> dict[str, Any]:
    return {
        "loops": [
            {
                "compensation": loop.compensation,
                "mode": loop.mode,
                "regime": loop.regime,
                "verdict": loop.verdict,
                **({} if loop.margins is None else margins_tree(loop.margins)),
            }
            for loop in loops
        ],
        "facts": [{name: getattr(fact, name) for name in FACT_KEYS} for fact in facts],
    }
