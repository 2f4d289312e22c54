"""Compilation of the simulation in advance."""

from __future__ import annotations

from campaign.backends.sim import SimBackend, SimOptions
from campaign.physics.complete import CompleteBench
from campaign.recording import MemoryRecorder
from campaign.trial import Task, Trial


def warm_up(bench: CompleteBench) -> None:
    """Simulate 2.5 sample periods, so that everything is compiled and imported afterwards."""
    rate = bench.controller.sample_rate or 1000.0
    task = Task(mode="rate", duration=2.5 / rate, window=(0.0, 0.0), sample_rate=rate)
    tree = bench.model_dump(mode="json")
    trial = Trial(number=1, test="warm-up", kind="warm-up", seed=0, bench=tree, task=task)
    SimBackend(SimOptions()).execute(trial, MemoryRecorder(), lambda: False)
