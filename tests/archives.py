"""Small archives of real trials, for tests of what reads them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from campaign.archive.layout.header import RunHeader
from campaign.archive.layout.results import RunResults
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.writing.results_file import prepare_results
from campaign.archive.writing.writer import RunWriter
from campaign.backends.interface import Backend
from campaign.backends.sim import SimBackend, SimOptions
from campaign.experiments import experiments
from campaign.protocol import Plan, as_tree, load_protocol, make_plan
from campaign.recording import Ending, Outcome, Recording
from campaign.resources import protocols_folder
from campaign.trial import Trial

PROTOCOL = """
title = "A stabilized axis"

[[test]]
name = "stabilization"
kind = "stabilization"
bench = "simulink"
seed = 5
frequency = "2 Hz"
acceleration = "18 deg/s^2"
settle_cycles = 1
cycles = 3

[test.matrix]
compensation = ["none", "static"]
"""


def plan_of(folder: Path, text: str = PROTOCOL) -> Plan:
    """The plan of a protocol that is written into `folder`."""
    path = folder / "axis.toml"
    path.write_text(text, encoding="utf-8")
    return make_plan(load_protocol(path, experiments(), shipped=protocols_folder()))


def simulated_run(folder: Path, text: str = PROTOCOL) -> Path:
    """Two trials of 2 s, simulated and sealed in `folder`/results."""
    plan = plan_of(folder, text)
    return executed(
        folder / "results", plan.trials, SimBackend(SimOptions()), as_tree(plan)["tests"]
    )


def executed(
    results: Path, trials: Sequence[Trial], backend: Backend, tests: Sequence[object] = ()
) -> Path:
    """A sealed run of `trials`, each executed by `backend`."""
    writer = RunWriter.create(results, _header(tests, results), trials)
    for trial in trials:
        recorder = writer.begin(trial)
        ending = backend.execute(trial, recorder, lambda: False)
        recorder.finish(ending, "2026-11-21T09:37:00Z", "2026-11-21T09:37:02Z")
    return writer.seal(RunStatus.COMPLETE, "", ended="2026-11-21T09:40:00Z")


def archived(results: Path, pairs: Sequence[tuple[Trial, Recording | None]]) -> Path:
    """A sealed run of recordings made elsewhere; None for a trial that failed before any."""
    writer = RunWriter.create(results, _header((), results), [trial for trial, _ in pairs])
    for trial, recording in pairs:
        recorder = writer.begin(trial)
        ending = Ending(Outcome.FAULT, "no power at 5 °C")
        if recording is not None:
            ending = recording.ending
            recorder.start(tuple(channel.info for channel in recording.channels.values()))
            block = [channel.samples for channel in recording.channels.values()]
            recorder.append(recording.time, np.stack(block))
            for event in recording.events:
                recorder.event(event)
        recorder.finish(ending, "2026-11-21T09:37:00Z", "2026-11-21T09:37:02Z")
    return writer.seal(RunStatus.FAILED_TRIALS, "made up", ended="2026-11-21T09:40:00Z")


def _header(tests: Sequence[object], results: Path) -> RunHeader:
    name = f"2026-11-21T09-36-5{len(list(results.glob('*.nxs')))}-axis"
    return RunHeader.model_validate(
        {"name": name, "created": "2026-11-21T09:36:58Z", "title": "A stabilized axis"}
        | {"protocol_name": "axis", "backend": "sim", "tests": tests}
    )


def write_results(run: Path, found: RunResults) -> Path:
    """The file of results beside the run at `run`, as the program writes it."""
    prepared = prepare_results(run, found)
    try:
        return prepared.publish()
    finally:
        prepared.discard()
