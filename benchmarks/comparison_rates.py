"""How often a comparison declares what is not there, and finds what is.

Run with `python -m benchmarks.comparison_rates [--equal 200] [--changed 50] [--workers 2]`. A pair
is two runs of a map, errors of two compensations and ramps, simulated on `platform` with seeds of
their own; in changed pairs Coulomb friction of the axis is 5 % higher in the other run.
"""

from __future__ import annotations

import argparse
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from scipy.stats import binomtest

from benchmarks.document import table
from campaign.references.verdict import Verdict
from tests.comparison.laboratory import PLATFORM, compared, simulated

TOGETHER = 5
"""Pairs of a job, which are simulated side by side."""
FIRST = 300_000
"""Seed of the first run."""
LOAD = 16.12
"""N m, Coulomb friction of the load on `platform`; that of the axis is 25.3 (26.7 negative)."""
NEGATIVE = 17.01
MORE = 0.05
CHANGES = tuple(
    f'{test}.bench.friction.load.{path}="{value!r} N m"'
    for test in ("map", "errors", "ramps")
    for path, value in (
        ("coulomb_torque", LOAD + MORE * 25.3),
        ("negative.coulomb_torque", NEGATIVE + MORE * 26.7),
    )
)


def declared(first: int, changes: tuple[str, ...]) -> list[set[str]]:
    """Of each pair of a job, the quantities that are declared different."""
    with tempfile.TemporaryDirectory() as folder:
        before = simulated(Path(folder), PLATFORM, range(first, first + TOGETHER))
        after = simulated(
            Path(folder), PLATFORM, range(first + TOGETHER, first + 2 * TOGETHER), changes
        )
    return [
        {pair.quantity for pair in compared(*pairs) if pair.verdict is Verdict.DIFFERENT}
        for pairs in zip(before, after, strict=True)
    ]


def main() -> None:
    """Print both rates with their 95 % intervals."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--equal", type=int, default=200)
    parser.add_argument("--changed", type=int, default=50)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    with ProcessPoolExecutor(options.workers) as pool:
        rows = []
        for what, count, changes, first in (
            ("equal: anything is declared", options.equal, (), FIRST),
            ("5 % more friction: it is found", options.changed, CHANGES, 2 * FIRST),
        ):
            jobs = range(first, first + 2 * count, 2 * TOGETHER)
            found = [one for job in pool.map(declared, jobs, [changes] * len(jobs)) for one in job]
            hits = sum("coulomb_torque" in one if changes else bool(one) for one in found)
            ends = binomtest(hits, len(found)).proportion_ci(0.95)
            share = f"{100 * ends.low:.0f} to {100 * ends.high:.0f} %"
            rows.append([what, f"{hits} of {len(found)}", share])
            print(rows[-1], flush=True)
    print(table(["pairs", "number", "95 % interval of the share"], rows))


if __name__ == "__main__":
    main()
