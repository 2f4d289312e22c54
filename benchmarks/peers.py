"""Time against error: the engine beside general solvers on the thesis' stabilization trial.

    python -m benchmarks.peers [--write] [--repeats 5]

25 s of the loop of the thesis' appendix, everything recorded at 1 kHz: continuous, and with a
sampled controller whose gyro has noise (5 s of it), each without compensation and with LuGre's.
Everybody integrates the same equations, and with noise the same numbers of it; scipy and numbalsoda
get a compiled right-hand side. The error is that of the stabilization error, the standard deviation
of the pointing angle after the transient, and the largest error of that angle beside its largest
value. Runs alternate; minima and medians are told. `--write` puts table and picture into
docs/developers/performance.md. Numbalsoda takes part where it is installed.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line has it

import numpy as np

from benchmarks.document import IMAGES, machine, table, write_section
from benchmarks.peer_solvers import (
    ACCELERATION,
    FREQUENCY,
    PERIOD,
    Array,
    Solver,
    by_dop853,
    by_odeint,
    solvers,
)
from campaign.physics.bench import Bench
from campaign.physics.lanes import Lane
from campaign.physics.rows import OUT_POINTING
from campaign.physics.simulate import simulate_together
from campaign.physics.vector import LANES
from campaign.signals import Sine
from campaign.trial import Task

SIMULINK = Path(__file__).parents[1] / "protocols" / "benches" / "simulink.toml"
SEED, SIGMA = 1, 1e-4
"""The gyro's noise, rad/s."""
STEPS: tuple[float | None, ...] = (1e-3, 0.5e-3, 0.25e-3, None)
"""s; None is the step that the program itself chooses."""
TIGHT = 1e-12
SLOW = 3.0
"""s of one run; what takes longer is run twice."""


@dataclass(frozen=True)
class Case:
    """A trial: its length (s), and after how much of it (s) it has settled."""

    name: str
    compensated: bool
    noisy: bool
    duration: float
    settled: float

    @property
    def samples(self) -> int:
        return round(self.duration / PERIOD)

    def deviation(self, angle: Array) -> float:
        """The stabilization error (rad)."""
        return float(np.std(angle[round(self.settled / PERIOD) :]))


CASES = [
    Case(
        f"{'LuGre compensated' if compensated else 'uncompensated'}{', noise' if noisy else ''}",
        compensated,
        noisy,
        5.0 if noisy else 25.0,
        1.0 / FREQUENCY if noisy else 2.0 / FREQUENCY,
    )
    for noisy in (False, True)
    for compensated in (False, True)
]


@dataclass
class Entry:
    """One way to simulate a case: what makes `trials` pointing angles at once, and what came of it.

    errors: of the deviation and of the angle; seconds: of each run, per trial.
    """

    who: str
    how: str
    run: Callable[[], Array]
    trials: int = 1
    errors: tuple[float, float] = (np.nan, np.nan)
    seconds: list[float] = field(default_factory=list)

    def measure(self) -> Array:
        began = time.perf_counter()
        angle = self.run()
        self.seconds.append((time.perf_counter() - began) / self.trials)
        return angle


def lanes(case: Case, count: int, step: float | None) -> list[Lane]:
    """Trials made ready, each with an inertia of its own; the first is the one of the thesis."""
    task = Task(
        mode="rate",
        base_acceleration=Sine(amplitude=ACCELERATION, frequency=FREQUENCY),
        compensation="lugre" if case.compensated else "none",
        duration=case.duration,
        window=(case.settled, case.duration),
        sample_rate=1.0 / PERIOD,
    )
    return [Lane.of(bench(case.noisy, 35.0 + 0.01 * k), task, SEED, step) for k in range(count)]


@cache
def bench(noisy: bool, inertia: float) -> Bench:
    tree = tomllib.loads(SIMULINK.read_text(encoding="utf-8"))
    tree["axis"]["inertia"] = f"{inertia} kg m^2"
    if noisy:
        tree["controller"]["sample_rate"] = f"{1.0 / PERIOD} Hz"
        tree.setdefault("sensors", {})["gyro"] = {"noise": f"{SIGMA} rad/s"}
    return Bench.model_validate(tree)


def by_engine(case: Case, count: int, step: float | None) -> Array:
    """As the program does it: trials made ready, noise drawn, all channels computed."""
    parts = [out[0][OUT_POINTING] for _, out in simulate_together(lanes(case, count, step))]
    return np.concatenate(parts)


def by_solver(case: Case, solver: Solver, rtol: float) -> Array:
    if case.noisy:
        noise = np.random.Generator(np.random.PCG64(SEED)).standard_normal(case.samples) * SIGMA
        return solver.sampled(noise, case.compensated, rtol)
    return solver.whole(np.arange(case.samples) * PERIOD, case.compensated, rtol)


def entries(case: Case) -> Iterator[Entry]:
    for count in (1, LANES):
        for step in STEPS:
            used = lanes(case, 1, step)[0].grid.step * 1e3
            how = f"{used:g} ms" if step else f"{used:g} ms, its own step"
            who = "engine" if count == 1 else f"engine, {count} lanes"
            yield Entry(who, how, partial(by_engine, case, count, step), count)
    for solver in solvers():
        for rtol in solver.noisy if case.noisy else solver.tolerances:
            yield Entry(solver.name, f"{rtol:.0e}", partial(by_solver, case, solver, rtol))


def measured(case: Case, repeats: int) -> tuple[list[Entry], float]:
    """Every entry, measured; and how far two references of other kinds are apart."""
    np.seterr(over="ignore")  # Radau's numerical Jacobian tries steps of every size
    truth = by_solver(case, by_dop853(), TIGHT)
    other = by_solver(case, by_odeint(), TIGHT)
    deviation, largest = case.deviation(truth), np.abs(truth).max()
    apart = abs(case.deviation(other) / deviation - 1.0)
    found = list(entries(case))
    for entry in found:
        angle = entry.run()  # compiles
        entry.errors = (
            abs(case.deviation(angle) / deviation - 1.0),
            float(np.abs(angle - truth).max() / largest),
        )
    for turn in range(repeats):
        for entry in found:
            if turn < 2 or min(entry.seconds) < SLOW:
                entry.measure()
    return found, apart


def rows(case: Case, found: list[Entry]) -> list[list[str]]:
    """Milliseconds of one core per simulated second and trial, fastest and median, and errors."""
    scale = 1e3 / case.duration
    return [
        [
            entry.who,
            entry.how,
            f"{min(entry.seconds) * scale:.3g}",
            f"{statistics.median(entry.seconds) * scale:.3g}",
            *(f"{error:.1e}" for error in entry.errors),
        ]
        for entry in found
    ]


HEADINGS = ["", "step, tolerance", "ms per s", "median", "error", "largest error"]


def draw(results: list[tuple[Case, list[Entry]]], path: Path) -> None:
    """Time against error of each case; towards the lower left is better."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    mpl.rcParams.update({"font.size": 8})
    figure, axes = plt.subplots(2, 2, figsize=(8.0, 6.4), sharex=True, layout="constrained")
    names = list(dict.fromkeys(entry.who for _, found in results for entry in found))
    looks = {name: (f"C{n}", "os^vDPX*"[n % 8]) for n, name in enumerate(names)}
    for (case, found), ax in zip(results, axes.flat, strict=True):
        for name in names:
            own = sorted((e for e in found if e.who == name), key=lambda entry: -entry.errors[0])
            colour, marker = looks[name]
            ax.loglog(
                [min(entry.seconds) * 1e3 / case.duration for entry in own],
                [max(entry.errors[0], 1e-12) for entry in own],
                marker=marker,
                color=colour,
                label=name,
                linewidth=1,
                markersize=4,
            )
        ax.set_title(case.name)
        ax.grid(alpha=0.3)
    for ax in axes[1]:
        ax.set_xlabel("ms of one core per simulated second")
    figure.supylabel("relative error of the stabilization error")
    handles, labels = axes.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=4, frameon=False)
    figure.savefig(path, dpi=120, pil_kwargs={"optimize": True})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--write", action="store_true", help="into docs/developers/performance.md")
    arguments = parser.parse_args()
    text, results = [f"{machine()}. Fastest and median of {arguments.repeats} runs in turn."], []
    if not any(solver.name == "numbalsoda" for solver in solvers()):
        text[0] += " Numbalsoda was not installed."
    for case in CASES:
        found, apart = measured(case, arguments.repeats)
        results.append((case, found))
        about = f"{case.duration:g} s; dop853 and odeint at {TIGHT:.0e} are {apart:.0e} apart"
        text.append(f"**{case.name[0].upper()}{case.name[1:]}** ({about})")
        text.append(table(HEADINGS, rows(case, found)))
        print(text[-2], text[-1], sep="\n", flush=True)
    if arguments.write:
        draw(results, IMAGES / "peers.png")
        write_section("peers", "\n\n".join(text))


if __name__ == "__main__":
    main()
