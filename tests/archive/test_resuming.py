"""A run that was interrupted is gone on with: nothing is lost on the way, and nothing differs."""

import json
import os
import random
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from campaign.archive.layout.journal_summary import read_journal
from campaign.archive.layout.names import JOURNAL
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_list import find_run, list_runs
from campaign.archive.writing.writer import RunWriter
from campaign.errors import ArchiveError, UsageError
from campaign.recording import Ending, Fault, Outcome, SafeState
from tests.archive.conftest import RESUMED

DOCUMENT = Path(__file__).parents[2] / "docs" / "developers" / "archive-format.md"


def content(path):
    """Every attribute and dataset of a file, as HDF5 has it: path to bytes."""
    found, names = {}, {}

    def place(item):
        return h5py.h5o.get_info(item.id).addr

    def named(name, item):
        names[place(item)] = f"/{name}"

    def attributes(name, item):
        for key in item.attrs:
            value = item.attrs[key]
            # HDF5 itself would search the whole file for the name of each of them.
            if key == "DIMENSION_LIST":
                value = [names[place(item.file[reference])] for (reference,) in value]
            elif key == "REFERENCE_LIST":
                value = sorted((names[place(item.file[ref])], int(n)) for ref, n in value)
            found[f"{name}@{key}"] = np.asarray(value).tolist()

    def visit(name, item):
        attributes(f"/{name}", item)
        found[f"/{name}"] = item[()].tobytes() if isinstance(item, h5py.Dataset) else "group"

    with h5py.File(path, locking=False) as file:
        file.visititems(named)
        attributes("/", file)
        file.visititems(visit)
    return found


def documented_differences():
    """The paths that the format's description says may differ, as one pattern."""
    section = DOCUMENT.read_text(encoding="utf-8").split("## What a resume changes")[1]
    listed = re.findall(r"`(/[^`]*)`", section.split("\n## ")[0])
    assert len(listed) > 10
    patterns = (re.escape(p).replace("NNNNN", r"\d+").replace("/\\*", "(/.*)?") for p in listed)
    return re.compile(f"({'|'.join(patterns)})(@sha256)?")


def begin(results, kit, count=5, **fields):
    """A run and its trials; the first one is finished, the second was interrupted."""
    writer, trials = kit.begin(results, count, [300], **fields)
    stopped = Ending(Outcome.INTERRUPTED, "Ctrl-C")
    kit.recorded(writer, trials[1], kit.samples(40, 2), ending=stopped)
    return writer, trials


def interrupted(results, kit, **fields):
    writer, trials = begin(results, kit, **fields)
    return writer.seal(RunStatus.INTERRUPTED, "stopped by Ctrl-C", ended=kit.ENDED), trials


def finish(writer, trials, kit, status=RunStatus.COMPLETE):
    done = {n for n, outcome in writer.finished.items() if outcome is Outcome.COMPLETED}
    for trial in trials:
        if trial.number not in done:
            kit.record(writer, trial, 300 * trial.number)
    return writer.seal(status, ended="2026-11-22T09:00:00Z")


def uninterrupted(results, kit, count=5, **fields):
    return finish(*kit.begin(results, count, **fields), kit)


@pytest.mark.parametrize("how", ["sealed", "killed", "twice"])
def test_a_resumed_run_equals_an_uninterrupted_one(tmp_path, kit, how):
    other = {"created": "2026-11-23T07:00:00Z", "host": {"name": "third"}, "command": ["again"]}
    expected = content(uninterrupted(tmp_path / "b", kit, name="whole", **other))
    writer, trials = begin(tmp_path / "a", kit)
    if how == "killed":
        writer.close()
        path = writer.folder
    else:
        path = writer.seal(RunStatus.INTERRUPTED, ended=kit.ENDED)
    writer = RunWriter.resume(path, RESUMED)
    assert writer.finished == {1: Outcome.COMPLETED, 2: Outcome.INTERRUPTED}
    if how == "twice":
        kit.record(writer, trials[1], 600)
        path = writer.seal(RunStatus.FAULT, "no power", ended=kit.ENDED)
        writer = RunWriter.resume(path, RESUMED)
    resumed = content(finish(writer, trials, kit))
    differing = {
        path for path in expected.keys() | resumed.keys() if expected.get(path) != resumed.get(path)
    }
    allowed = documented_differences()
    assert {path for path in differing if not allowed.fullmatch(path)} == set()
    assert "/trial_00002_attempt_1/data/gyro_rate" in differing
    assert "/run/journal/data" in differing
    assert any(path.endswith("@DIMENSION_LIST") for path in expected)


def test_earlier_attempts_are_kept_and_only_the_last_is_analysed(tmp_path, kit):
    path, trials = interrupted(tmp_path, kit)
    writer = RunWriter.resume(path, RESUMED)
    recorder = writer.begin(trials[1])
    assert recorder.attempt == 2
    told = Ending(
        Outcome.FAULT,
        "no word for 1 s",
        SafeState.NOT_CONFIRMED,
        Fault.LOST_CONNECTION,
        {"latency_ms": {"most": 4.5, "mean": float("nan")}, "resends": np.int64(3)},
    )
    recorder.finish(told, kit.STARTED, kit.ENDED)
    kit.record(writer, trials[1], 77)
    for look in (lambda: writer.folder, lambda: finish(writer, trials, kit)):
        run = open_run(look())
        assert len(run.trials[1].recording().time) == 77
        assert list(run.earlier_attempts) == [2]
        first, second = run.earlier_attempts[2]
        assert first.ending == Ending(Outcome.INTERRUPTED, "Ctrl-C")
        assert len(first.recording().time) == 40
        assert second.ending.fault is Fault.LOST_CONNECTION
        latency = {"most": 4.5, "mean": "nan"}
        assert second.ending.telemetry == {"latency_ms": latency, "resends": 3}
        assert run.problems() == []
    assert [archived.trial.number for archived in run.trials] == [1, 2, 3, 4, 5]
    with h5py.File(run.path) as file:
        assert "trial_00002_attempt_2" in file
        assert file["run/outcome/trials_finished"][()] == 5


def test_every_planned_trial_can_be_executed_from_the_archive(tmp_path, kit):
    bench = {"name": "other", "list": [1, 1.0, None, True], "deep": {"x": 5e-324}}
    trials = [kit.trial(1), kit.trial(2), kit.trial(3).model_copy(update={"bench": bench})]
    trials[1] = trials[1].model_copy(update={"options": {"speed": 0.1}, "setup": ("Preload",)})
    writer, _ = kit.begin(tmp_path, trials, [10], seed=7, protocol_path="/lab/x.toml")
    trees = (writer.folder / "plan-trees.jsonl").read_text().splitlines()
    assert len(trees) == 4  # two benches, and options with and without something in them

    def sealed():
        return writer.seal(RunStatus.INTERRUPTED, ended=kit.ENDED)

    for look in (lambda: writer.folder, sealed):
        run = open_run(look())
        assert [run.planned(n) for n in (1, 2, 3)] == trials
        assert [run.planned(n).fingerprint for n in (1, 2, 3)] == [t.fingerprint for t in trials]
        assert len(run.full_plan) == len(trials)
        assert (run.header.seed, run.header.protocol_path) == (7, "/lab/x.toml")
        with pytest.raises(ArchiveError, match="no trial 4"):
            run.planned(4)


def test_a_bench_of_the_plan_that_was_changed_is_refused(tmp_path, kit):
    writer, _ = begin(tmp_path, kit)
    path = writer.folder / "plan-trees.jsonl"
    path.write_text(path.read_text().replace("35.0", "36.0"))
    with pytest.raises(ArchiveError, match=r"plan-trees\.jsonl: line 1 does not match its digest"):
        open_run(writer.folder).planned(1)


def test_the_journal_tells_of_decisions_steps_and_the_resume(tmp_path, kit):
    writer, trials = begin(tmp_path, kit)
    writer.decision("skip", "the limit switch", 2)
    writer.operator_step(3, "Preload the spring to 5 N m", "done")
    path = writer.seal(RunStatus.FAULT, "no power", ended=kit.ENDED)
    changed = RESUMED.model_copy(update={"changes": ("versions.numpy: 2.0 → 2.1",)})
    writer = RunWriter.resume(path, changed)
    kinds = [type(entry).__name__ for entry in read_journal(writer.folder / JOURNAL).entries]
    assert kinds[-4:] == ["Decision", "OperatorStep", "RunEnded", "RunResumed"]
    run = open_run(writer.folder)
    reason = "the run is in progress or was killed"
    assert (run.status, run.reason) == (RunStatus.INCOMPLETE, reason)
    entries = read_journal(writer.folder / JOURNAL).entries
    assert entries[-1] == changed
    decision, step = (entry.model_dump(exclude={"event", "at"}) for entry in entries[-4:-2])
    assert decision == {"trial": 2, "decision": "skip", "reason": "the limit switch"}
    assert step == {"trial": 3, "step": "Preload the spring to 5 N m", "answer": "done"}
    finish(writer, trials, kit)


def test_a_torn_last_line_is_cut_before_more_is_written(tmp_path, kit):
    writer, trials = begin(tmp_path, kit)
    writer.close()
    with (writer.folder / JOURNAL).open("ab") as journal:
        journal.write(b'{"at":"2026-11-21T09:3')
    (writer.folder / "trial-00003.trial.part").write_bytes(b"half of it")
    (writer.folder / "trial-00003.trial").write_bytes(b"whole, and never reported")
    writer = RunWriter.resume(writer.folder, RESUMED)
    assert {path.name for path in writer.folder.glob("*.part")} <= {"sealed.nxs.part"}
    assert b'09:3{"' not in (writer.folder / JOURNAL).read_bytes()
    run = open_run(finish(writer, trials, kit))
    assert [archived.trial.number for archived in run.trials] == [1, 2, 3, 4, 5]
    assert run.problems() == []


def test_a_changed_trial_file_is_named_and_nothing_is_touched(tmp_path, kit):
    writer, _ = begin(tmp_path, kit)
    writer.close()
    path = writer.folder / "trial-00002.trial"
    path.write_bytes(path.read_bytes()[:-1] + b"!")
    before = (writer.folder / JOURNAL).read_bytes()
    with pytest.raises(ArchiveError, match=r"trial-00002\.trial: is not what the journal says"):
        RunWriter.resume(writer.folder, RESUMED)
    path.unlink()
    with pytest.raises(ArchiveError, match=r"trial-00002\.trial"):
        RunWriter.resume(writer.folder, RESUMED)
    assert (writer.folder / JOURNAL).read_bytes() == before


def test_a_damaged_sealed_run_is_not_taken_apart(tmp_path, kit):
    path, _ = interrupted(tmp_path, kit)
    whole = path.read_bytes()
    with h5py.File(path) as file:
        samples = file["trial_00001/data"]
        # A sample, and the beginning of what HDF5 finds the format of the archive by.
        sample = next(
            each.id.get_chunk_info(0).byte_offset
            for each in samples.values()
            if isinstance(each, h5py.Dataset) and each.chunks
        )
        number = h5py.h5o.get_info(file["run/provenance"].id).addr
    for place, told in ((sample, "own hash; it was damaged or changed"), (number + 8, "cannot be")):
        damaged = bytearray(whole)
        damaged[place] ^= 1
        path.write_bytes(damaged)
        with pytest.raises(ArchiveError, match=f"{told}.*; it is as it was$"):
            RunWriter.resume(path, RESUMED)
        assert path.read_bytes() == damaged
        assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_what_has_ended_or_is_no_run_is_refused(tmp_path, kit):
    with pytest.raises(UsageError, match=r"has ended \(complete\)"):
        RunWriter.resume(kit.run(tmp_path), RESUMED)
    with pytest.raises(UsageError, match="is no run"):
        RunWriter.resume(tmp_path / "nothing.partial", RESUMED)


@pytest.mark.slow
def test_one_process_at_a_time_writes_a_run(tmp_path, kit):
    writer, trials = begin(tmp_path, kit)
    program = "import sys; from pathlib import Path\n"
    program += "from campaign.archive.writing.writer import RunWriter\n"
    program += "from campaign.archive.layout.journal import RunResumed\n"
    program += f"RunWriter.resume(Path(sys.argv[1]), RunResumed(at={RESUMED.at!r}))"
    command = [sys.executable, "-c", program, str(writer.folder)]
    other = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "UsageError" in other.stderr
    assert "another process is writing the run" in other.stderr
    path = finish(writer, trials, kit, RunStatus.FAULT)
    again = RunWriter.resume(path, RESUMED)
    with pytest.raises(UsageError, match="another process"):
        RunWriter.resume(path.with_suffix(".partial"), RESUMED)
    again.close()
    RunWriter.resume(again.folder, RESUMED).close()


# Resumes and seals a run again and again, a few trials at a time, until it is killed.
WEAR = """
import sys
from pathlib import Path
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.run_list import find_run
from campaign.archive.writing.writer import RunWriter
results = Path(sys.argv[1])
trials = [kit.make_trial(number) for number in range(1, 1001)]
print("ready", flush=True)
while True:
    writer = RunWriter.resume(find_run(results), kit.RESUMED)
    for number in range(len(writer.finished) + 1, len(writer.finished) + 4):
        kit.write_trial(writer, trials[number - 1], 37 * number)
        print("finished", number, flush=True)
    writer.seal(RunStatus.INTERRUPTED, ended=kit.ENDED)
"""


def kill_again_and_again(results, kit, kills, seed):
    """Kill a program that resumes and seals, `kills` times; nothing reported is ever missing."""
    kit.begin(results, 1000)[0].close()
    reported, moments = set(), random.Random(seed)
    for _ in range(kills):
        child = kit.python(WEAR, results)
        assert child.stdout.readline() == "ready\n"
        time.sleep(moments.uniform(0, 0.4))
        child.kill()
        said = child.communicate()[0].split("\n")[:-1]
        reported |= {int(line.split()[1]) for line in said}
        assert len(list_runs(results)) == 1
        run = open_run(find_run(results))
        assert run.problems() == []
        assert {archived.trial.number for archived in run.trials} >= reported
        for archived in run.trials[-6:]:
            number = archived.trial.number
            expected = kit.samples(37 * number, number)[1][2]
            assert archived.recording()["friction_torque"].tobytes() == expected.tobytes()
    return reported


@pytest.mark.slow
def test_a_kill_while_resuming_or_sealing_loses_nothing(tmp_path, kit):
    kill_again_and_again(tmp_path, kit, kills=4, seed=5)


@pytest.mark.soak
def test_two_hundred_kills_while_resuming_or_sealing_lose_nothing(tmp_path, kit):
    for seed in range(10):
        assert kill_again_and_again(tmp_path / str(seed), kit, kills=20, seed=seed)


# Ends itself, as a kill does, before its n-th operation on a file, for every n there is.
STEPS = """
import json, os, shutil, sys
from pathlib import Path
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.run_list import find_run, list_runs
from campaign.archive.reading.open_run import open_run
from campaign.archive.writing.writer import RunWriter
from campaign.archive.writing import seal_run
from campaign.archive.writing import unseal_run
template, results = Path(sys.argv[1]), Path(sys.argv[2])
seen, limit = 0, 0

def hook(event, arguments):
    global seen
    if event in {"open", "os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.truncate"}:
        if str(results) in str(arguments[0]) or event == "os.remove":
            seen += 1
            if seen == limit:
                os._exit(9)

def go_on(path):
    writer = RunWriter.resume(path, kit.RESUMED)
    if 2 not in writer.finished:
        kit.write_trial(writer, kit.make_trial(2), 90)
        os.write(1, b"")
    return writer.seal(RunStatus.INTERRUPTED, ended=kit.ENDED)

for limit in range(1, 1000):
    shutil.rmtree(results, ignore_errors=True)
    shutil.copytree(template, results)
    child = os.fork()
    if not child:
        sys.addaudithook(hook)
        go_on(find_run(results))
        os._exit(0)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    runs = list_runs(results)
    assert [run.problem for run in runs] == [""], (limit, runs)
    run = open_run(find_run(results))
    kept = [trial.trial.number for trial in run.trials]
    assert kept in ([1], [1, 2]), (limit, kept)
    assert run.problems() == [], limit
    if code == 0:
        break
    assert code == 9, (limit, code)
    sealed = go_on(find_run(results))
    assert len(open_run(sealed).trials) == 2, limit
    assert [path.name for path in results.glob("[!.]*")] == [sealed.name], limit
print(limit)
"""


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_kill_before_any_single_step_loses_nothing(tmp_path, kit):
    writer, _ = kit.begin(tmp_path / "template", 2, [50])
    writer.seal(RunStatus.INTERRUPTED, ended=kit.ENDED)
    places = tmp_path / "template", tmp_path / "results"
    child = kit.python(STEPS, *places)
    out, errors = child.communicate()
    assert child.returncode == 0, errors
    assert int(out) > 40


def fill_up(path, trials, kit):
    """Go on with a run until the disk is full, and seal it; what was told on the way."""
    told = []
    try:
        writer = RunWriter.resume(path, RESUMED)
    except ArchiveError as error:
        return [str(error)]
    try:
        for trial in trials[2:]:
            kit.record(writer, trial, 9000)
    except ArchiveError as error:
        told.append(str(error))
    try:
        writer.seal(RunStatus.FAULT, "the disk is full", ended=kit.ENDED)
    except ArchiveError as error:
        told.append(str(error))
    return told


@pytest.mark.parametrize("left", [0, 60_000, 300_000, 500_000])
def test_a_full_disk_leaves_the_run_as_it_was(small_disk, kit, left):
    path, trials = interrupted(small_disk / "results", kit)
    writer = RunWriter.resume(path, RESUMED)
    kit.record(writer, trials[1], 9000)  # incompressible: 250 kB
    path = writer.seal(RunStatus.INTERRUPTED, ended=kit.ENDED)
    before = path.read_bytes()
    free = shutil.disk_usage(small_disk).free
    (small_disk / "filler").write_bytes(bytes(free - left))
    problems = fill_up(path, trials, kit)
    assert problems
    assert all("No space left on device" in problem for problem in problems)
    if len(problems) == 1:  # it could not even be opened for going on
        assert path.read_bytes() == before
        assert [p.suffix for p in path.parent.iterdir() if p.name[0] != "."] == [".nxs"]
    run = open_run(find_run(small_disk / "results"))
    assert run.problems() == []
    (small_disk / "filler").unlink()
    resumed = RunWriter.resume(find_run(small_disk / "results"), RESUMED)
    assert {1, 2} <= set(resumed.finished)
    assert open_run(finish(resumed, trials, kit)).problems() == []


def test_a_results_folder_taken_away_is_said(tmp_path, kit):
    path, trials = interrupted(tmp_path / "results", kit)
    writer = RunWriter.resume(path, RESUMED)
    shutil.move(tmp_path / "results", tmp_path / "elsewhere")
    with pytest.raises(ArchiveError):
        kit.record(writer, trials[1], 10)
    with pytest.raises(ArchiveError, match="could not be sealed"):
        writer.seal(RunStatus.FAULT, "gone", ended=kit.ENDED)
    resumed = RunWriter.resume(find_run(tmp_path / "elsewhere"), RESUMED)
    assert open_run(finish(resumed, trials, kit)).problems() == []


@pytest.mark.soak
def test_ten_hours_are_archived_in_flat_memory(tmp_path):
    program = Path(__file__).parents[2] / "benchmarks" / "long_recording.py"
    command = [sys.executable, str(program), "--json", "--folder", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    figures = json.loads(done.stdout)
    assert figures.pop("archive") > 100  # MB
    assert max(figures.values()) < 500  # MB


@pytest.mark.slow
def test_twenty_minutes_take_no_more_memory_than_two(tmp_path):
    program = Path(__file__).parents[2] / "benchmarks" / "long_recording.py"
    command = [sys.executable, str(program), "--json", "--folder", str(tmp_path), "--hours"]
    short, long = (
        json.loads(subprocess.run([*command, h], capture_output=True, check=True).stdout)
        for h in ("0.03", "0.33")
    )
    assert long["archive"] > 8 * short["archive"]
    assert long["sealed again"] < short["sealed again"] + 30  # MB; the samples are 124 MB


def test_a_folder_beside_a_damaged_sealed_file_is_left_alone(tmp_path, kit):
    """Killed between the two, the program leaves both; should the file be damaged since, the folder
    has the run."""
    writer, _ = kit.begin(tmp_path, 2, [50])
    folder = writer.folder
    shutil.copytree(folder, tmp_path / "copy")
    sealed = writer.seal(RunStatus.INTERRUPTED, ended=kit.ENDED)
    (tmp_path / "copy").rename(folder)
    before = sorted(path.name for path in folder.iterdir())
    content = bytearray(sealed.read_bytes())
    content[len(content) // 2] ^= 1
    sealed.write_bytes(content)
    with pytest.raises(ArchiveError):
        RunWriter.resume(sealed, RESUMED)
    assert sorted(path.name for path in folder.iterdir()) == before
