"""Runs of one rig a month apart, simulated: what changes of it between them is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from campaign.archive.layout.header import RunHeader
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.writing.writer import RunWriter
from campaign.experiments import experiments
from campaign.protocol import as_tree, load_protocol, make_plan
from campaign.resources import protocols_folder
from campaign.trial import ChannelInfo, Trial
from tests.comparison.laboratory import executed

RAMPS = """
title = "The platform's breakaway"

[[test]]
name = "ramps"
kind = "breakaway"
bench = "platform"
positions = ["-20 deg", "20 deg"]
directions = ["positive"]
torque_rate = "8 N m/s"
rest = "0.1 s"
"""
STATIC = "ramps.bench.friction.load.static_torque"
START = datetime(2026, 1, 5, 8, 30, tzinfo=UTC)
MONTH = timedelta(days=30.4375)


@dataclass(frozen=True)
class Wanted:
    """One run: what is set of its bench, when it began, what somebody noted.

    `warm`: value and unit of a channel `temperature`, of which one sample is lost.
    """

    changes: tuple[str, ...] = ()
    at: datetime = START
    tags: tuple[str, ...] = ()
    seed: int | None = None
    warm: tuple[float, str] | None = None


def monthly(changes: Sequence[Sequence[str]], first_seed: int) -> list[Wanted]:
    """A run a month, with these changes of its bench."""
    return [
        Wanted(tuple(each), START + n * MONTH, seed=first_seed + n)
        for n, each in enumerate(changes)
    ]


def archived(folder: Path, wanted: Mapping[str, Wanted], text: str = RAMPS) -> dict[str, Path]:
    """A sealed run for each, by name, in `folder`/results; alike trials are simulated together."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "protocol.toml"
    path.write_text(text, encoding="utf-8")
    plans = {}
    for name, run in wanted.items():
        protocol = load_protocol(
            path, experiments(), overrides=run.changes, shipped=protocols_folder()
        )
        plans[name] = make_plan(protocol, seed=run.seed)
    numbered: list[Trial] = []
    for plan in plans.values():
        numbered += [
            trial.model_copy(update={"number": len(numbered) + n})
            for n, trial in enumerate(plan.trials, start=1)
        ]
    done = {each.trial.number: each for each in executed(numbered)}
    made, first = {}, 0
    for name, plan in plans.items():
        run = wanted[name]
        tree = as_tree(plan)
        header = RunHeader.model_validate(
            {
                "name": name,
                "created": run.at.isoformat(),
                "title": plan.protocol.title,
                "protocol_name": plan.protocol.path.name,
                "sources": dict(plan.protocol.sources),
                "normalised": tree,
                "tests": tree["tests"],
                "trials": len(plan.trials),
                "tags": run.tags,
                "backend": "sim",
                "source": "simulation",
            }
        )
        writer = RunWriter.create(folder / "results", header, plan.trials)
        for place, trial in enumerate(plan.trials):
            simulated = done[first + place + 1]
            recording = simulated.recording()
            writing = writer.begin(trial)
            infos = [channel.info for channel in recording.channels.values()]
            block = [channel.samples for channel in recording.channels.values()]
            if run.warm is not None:
                infos.append(ChannelInfo("temperature", run.warm[1], "Temperature", run.warm[1]))
                block.append(np.full(len(recording.time), run.warm[0]))
                block[-1][3] = np.nan
            writing.start(tuple(infos))
            writing.append(recording.time, np.stack(block))
            for event in recording.events:
                writing.event(event)
            writing.finish(simulated.ending, run.at.isoformat(), run.at.isoformat())
        first += len(plan.trials)
        made[name] = writer.seal(RunStatus.COMPLETE, "", ended=run.at.isoformat())
    return made
