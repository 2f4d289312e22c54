"""What a whole simulated trial costs, from the plan's trial to samples in memory.

    python -m benchmarks.whole_trials

Trials of the thesis' stabilization loop, each with a plant of its own, go through the simulated
backend and the supervising recorder, limits included, into memory: one after the other, and
together. Minima of a few rounds, in turn: what counts are the ratios.
"""

from __future__ import annotations

import math
import os
import time
import tomllib
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line has it

from campaign.backends.sim import BACKEND
from campaign.execution.recorder import SupervisingRecorder
from campaign.execution.supervision import Supervision, TrialStop
from campaign.physics.bench import Bench
from campaign.signals import Sine
from campaign.trial import MemoryRecorder, Task, Trial

SIMULINK = Path(__file__).parents[1] / "protocols" / "benches" / "simulink.toml"
TOGETHER, DURATION, ROUNDS = 16, 25.0, 5
SWING = Sine(amplitude=math.radians(18.0), frequency=0.24)


def trial(number: int, compensation: str) -> Trial:
    """The stabilization loop with an inertia of its own."""
    tree = tomllib.loads(SIMULINK.read_text(encoding="utf-8"))
    tree["axis"]["inertia"] = f"{35 + number} kg m^2"
    task = Task(
        mode="rate",
        base_acceleration=SWING,
        compensation=compensation,
        duration=DURATION,
        window=(0.0, DURATION),
        sample_rate=1000.0,
    )
    bench = Bench.model_validate(tree).model_dump(mode="json")
    return Trial(number=number + 1, test="t", kind="stabilization", seed=1, bench=bench, task=task)


def recorder(of: Trial) -> SupervisingRecorder:
    """Into memory."""
    return SupervisingRecorder(of, MemoryRecorder(), TrialStop(lambda: False), Supervision())  # type: ignore[arg-type]


def main() -> None:
    """Print milliseconds of one core per trial."""
    print(f"{'ms per trial of 25 s':<24}{'alone':>8}{f'{TOGETHER} together':>14}")
    for compensation in ("none", "lugre"):
        trials = [trial(number, compensation) for number in range(TOGETHER)]
        best = [math.inf, math.inf]
        for _ in range(ROUNDS):
            backend = BACKEND.open(BACKEND.options())
            began = time.process_time()
            for each in trials:
                backend.execute(each, recorder(each), lambda: False)
            best[0] = min(best[0], time.process_time() - began)
            if not hasattr(backend, "execute_together"):
                continue
            began = time.process_time()
            stops = [lambda: False] * TOGETHER
            for _ in backend.execute_together(trials, [recorder(each) for each in trials], stops):
                pass
            best[1] = min(best[1], time.process_time() - began)
        alone, together = (seconds / TOGETHER * 1e3 for seconds in best)
        print(f"{compensation:<24}{alone:>8.2f}{together:>14.2f}")


if __name__ == "__main__":
    main()
