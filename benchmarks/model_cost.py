"""What a step of each friction model costs, along a prescribed sine: ratios to `coulomb`.

    python -m benchmarks.model_cost [--rounds 9]

Each round measures all models in turn; the table has medians. The numbers are those of
`benchmarks.model_choice`: presliding and reversals are in the motion.
"""

from __future__ import annotations

import argparse
import statistics
import time

import numpy as np

from benchmarks.model_choice import TRUTHS
from campaign.physics.friction import friction_models
from campaign.physics.friction_response import Along

RATE, SECONDS = 1000.0, 500.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=9)
    rounds = parser.parse_args().rounds
    along = Along.rates(np.sin(2.0 * np.pi * np.arange(RATE * SECONDS) / RATE), RATE)
    options = {name: {"model": name, **tree} for name, tree in TRUTHS.items()}
    for tree in options.values():
        along.friction(tree)  # compiled
    taken: dict[str, list[float]] = {name: [] for name in options}
    for _ in range(rounds):
        for name, tree in options.items():
            began = time.perf_counter()
            along.friction(tree)
            taken[name].append(time.perf_counter() - began)
    base = statistics.median(taken["coulomb"])
    print("| model | parameters | states | cost of a step |\n| --- | --- | --- | --- |")
    for name, times in taken.items():
        model = friction_models()[name]
        made = model.options.model_validate(options[name], context={"si": True})
        states = model.state_size(made, 1.0 / RATE)
        ratios = [each / base for each in times]
        shown = f"{statistics.median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f})"
        print(f"| `{name}` | {len(model.parameters(made))} | {states} | {shown} |")


if __name__ == "__main__":
    main()
