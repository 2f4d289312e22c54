"""`campaign rerun`: one archived trial simulated again, compared bit by bit."""

from __future__ import annotations

from datetime import UTC, datetime
from functools import partial
from pathlib import Path

from campaign.archive.layout.header import RunHeader
from campaign.archive.layout.names import PARTIAL
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.damage_words import heading, in_words, lost_trials
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_list import find_run
from campaign.archive.reading.run_reader import RunReader
from campaign.archive.reading.sound_samples import whole_recording
from campaign.archive.writing.run_names import reserved_name
from campaign.archive.writing.writer import RunWriter
from campaign.channels import COMPENSATION_TORQUE, FRICTION_TORQUE
from campaign.cli.output import print_line, print_note
from campaign.cli.prepare import find_backend, open_backend
from campaign.cli.session import Session, execute
from campaign.errors import ArchiveError, ExitCode, UsageError, worst_exit_code
from campaign.execution import provenance
from campaign.execution.recording_difference import changes, differences
from campaign.execution.written_order import in_written_order
from campaign.physics import truth
from campaign.physics.bench import Bench
from campaign.physics.complete import control_rate
from campaign.physics.engine_version import (
    DRY_ERRORS,
    DRY_TORQUE_ERRORS,
    ENGINE,
    ERRORS,
    FIRST,
    TORQUE_ERRORS,
)
from campaign.physics.friction import is_dry
from campaign.policy import Policy
from campaign.recording import Recording
from campaign.trial import trial_number

SIM = "sim"
TIMES = 10
"""Largest deviation of equal samples, in multiples of the error of an older engine."""


def rerun_trial(name: str, wanted: str, results: Path) -> ExitCode:
    """Execute an archived trial again; the new archive's path is the last line of output."""
    run = open_run(find_run(results, name))
    archived = find_trial(run, wanted)
    before = None if archived.not_kept else whole_recording(archived)
    kind = find_backend(SIM)
    simulated = run.header.backend == SIM
    tree = run.header.backend_options if simulated else {}
    options = kind.options.model_validate(tree, context={"si": True})
    bench = in_written_order(archived.trial.bench, run.header.sources.values())
    # The new run has one trial.
    trial = archived.trial.model_copy(update={"number": 1, "bench": bench})
    texts = run.header.truth.sources.values()
    plants = run.header.truth.plants
    truths = {name: in_written_order(plant, texts) for name, plant in plants.items()}
    backend = open_backend(kind, options, [trial], truths)
    now = datetime.now(UTC)
    stem = f"rerun-{archived.trial.name}-{run.header.protocol_name or 'run'}"
    with reserved_name(results, stem, now) as lock:
        header = _header(run, archived, lock.name, now, options.model_dump(mode="json"))
        folder = results / f"{header.name}{PARTIAL}"
        session = Session(kind, backend, [trial], Policy(), workers=1, folder=folder, repeats=run)
        outcome, code = execute(session, lambda: RunWriter.create(results, header, [trial], lock))
    if outcome.status is RunStatus.INTERRUPTED:
        print_note("interrupted: nothing was compared")
        print_line(str(outcome.archive))
        return code
    if not simulated:
        print_note(
            f"{run.name} was executed on {run.header.backend!r}: this compares measured samples "
            "with simulated ones"
        )
    (again,) = open_run(outcome.archive).trials
    engine = int(run.header.versions.get("engine", FIRST)) if simulated else ENGINE
    acted = Bench.model_validate(trial.bench, context={"si": True})
    if trial.truth:
        acted = truth.simulated(truths[trial.truth], acted)
    what = f"{archived.trial.name} of {run.name}"
    if before is None:
        same = _say_digests(what, archived, again)
    else:
        say = _say if engine == ENGINE else partial(_say_change, engine, acted)
        same = say(what, before, again.recording())
    print_line(str(outcome.archive))
    return worst_exit_code([same, ExitCode.ARCHIVE if run.damaged else ExitCode.DONE])


def find_trial(run: RunReader, wanted: str) -> ArchivedTrial:
    """The executed trial of that number or name.

    Raises UsageError when there is none, ArchiveError when it cannot be read.
    """
    number = trial_number(wanted)
    if archived := run.executed(number):
        return archived
    if lost := lost_trials(run).get(number):
        raise ArchiveError(f"{run.path}: trial {number} cannot be read: {in_words(lost)}")
    planned = any(each.number == number for each in run.plan)
    what = "was planned but not executed" if planned else f"is not among its {len(run.plan)} trials"
    raise UsageError(f"{run.name}: trial {number} {what}")


def _say(what: str, before: Recording, again: Recording) -> ExitCode:
    lines = differences(before, again)
    if not lines:
        size = f"{len(before.channels)} channels of {len(before.time)} samples"
        print_line(f"{what}: equal to the bit, {size}")
        return ExitCode.DONE
    print_line(f"{what}: different")
    for line in lines:
        print_line(f"  {line}")
    return ExitCode.TRIALS_FAILED


def _say_digests(what: str, archived: ArchivedTrial, again: ArchivedTrial) -> ExitCode:
    """Compare the new samples with the digests of a trial without samples."""
    was, now = archived.digests(), again.digests()
    different = [name for name in {**was, **now} if was.get(name) != now.get(name)]
    if not different and archived.ending.outcome is again.ending.outcome:
        print_line(f"{what}: equal to the bit, {len(was)} series, by their digests")
        return ExitCode.DONE
    print_line(f"{what}: different, by the digests of: {', '.join(different) or 'none'}")
    return ExitCode.TRIALS_FAILED


def _say_change(
    engine: int, bench: Bench, what: str, before: Recording, again: Recording
) -> ExitCode:
    """Compare samples of two engines: changes of the channels against the older engine's error."""
    older, changed = min(engine, ENGINE), changes(before, again)
    dry = any(is_dry(each) for each in bench.friction.values())
    bounds = {name: TIMES * _error(older, name, dry=dry) for name in changed}
    beyond = [name for name, change in changed.items() if not change <= bounds[name]]
    if before.ending.outcome is not again.ending.outcome:
        verdict = f"different: {before.ending.outcome} → {again.ending.outcome}"
    elif _is_noisy(bench):
        verdict = "no verdict: the engines draw sensor noise differently"
    elif beyond:
        verdict = f"different in {', '.join(beyond)}"
    else:
        verdict = f"the same within {TIMES} times the error of engine {older}"
    print_line(f"{what}: simulated by engine {engine}, repeated by engine {ENGINE}: {verdict}")
    for name, change in changed.items():
        print_line(f"  {name}: changed by {change:.2g} of its rms; {bounds[name]:.2g} is allowed")
    return ExitCode.DONE if verdict.startswith("the same") else ExitCode.TRIALS_FAILED


def _error(engine: int, channel: str, *, dry: bool) -> float:
    torque = channel in (FRICTION_TORQUE, COMPENSATION_TORQUE)
    error = (TORQUE_ERRORS if torque else ERRORS).get(engine, 0.0)
    of_dry = (DRY_TORQUE_ERRORS if torque else DRY_ERRORS).get(engine, 0.0)
    return max(error, of_dry) if dry else error


def _is_noisy(bench: Bench) -> bool:
    sensors = bench.sensors
    each = (sensors.gyro, sensors.encoder, sensors.resolver, sensors.current)
    return control_rate(bench) is not None and any(sensor.noise > 0 for sensor in each)


def _header(
    run: RunReader, archived: ArchivedTrial, name: str, now: datetime, options: dict[str, object]
) -> RunHeader:
    trial, was = archived.trial, run.header
    notes = [f"repeats {trial.name} of {run.name}"]
    if run.damaged:
        notes.append(heading(Path(run.path.name), run.damaged))
    return was.model_copy(
        update={
            "name": name,
            "created": now.isoformat(timespec="milliseconds"),
            "title": f"{trial.label}, repeated",
            "notes": "; ".join(notes),
            "tags": ("rerun",),
            "tests": tuple(test for test in was.tests if test.get("name") == trial.test),
            "only": (trial.test,),
            "backend": SIM,
            "source": "simulation",
            "backend_options": options,
            "versions": provenance.versions(),
            "plugins": provenance.plug_ins([trial], SIM, was.truth.plants.values()),
            "host": provenance.host(),
            "command": provenance.command(),
            "protocol_path": "",
        }
    )
