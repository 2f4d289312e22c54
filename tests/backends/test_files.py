"""The backend `files`: what is handed out, taken and refused, and whose a folder is."""

from __future__ import annotations

import csv
import itertools
import json
import re
import threading
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat, savemat

from campaign.backends.files import BACKEND, DEFECTS, FilesBackend
from campaign.backends.handover.columns import first_mapping
from campaign.errors import ProtocolError, UsageError
from campaign.recording import Ending, Fault, Outcome, Recording, SafeState
from campaign.signals import Polyline, Sine
from campaign.testing import BackendUnderTest, StrictRecorder, backend_checks
from campaign.trial import Task, Trial
from tests.archives import plan_of
from tests.physics.benches import bench

ROOT = Path(__file__).parents[2]
MOVES = Polyline(times=(0.0, 0.2, 0.4, 1.2, 1.4, 1.6, 1.8), values=(0, 0, 0.2, 0.2, 0, 0, -0.1))
TASK = Task(mode="rate", command=MOVES, duration=2.0, window=(0.0, 2.0), sample_rate=250.0)
TREE = bench().model_dump(mode="json")
TRIAL = Trial(
    number=3,
    test="map",
    kind="move",
    seed=1,
    bench=TREE,
    task=TASK,
    setup=("Fit the <long> arm.",),
    requires=("relative_angle", "relative_rate", "drive_torque"),
    can_use=("temperature", "friction_torque"),
)
LATER = TRIAL.model_copy(
    update={
        "number": 4,
        "task": TASK.model_copy(update={"command": Sine(amplitude=0.2, frequency=1)}),
    }
)
TIME = np.arange(500) / 250.0
Columns = dict[str, np.ndarray]


def columns_of(trial: Trial = TRIAL, count: int = 500, rate: float = 250.0) -> Columns:
    """What a good rig records: it follows its command, and friction is what the drive works for."""
    time = np.arange(count) / rate
    command = trial.task.command.sample(time)
    noise = np.random.default_rng(trial.number).standard_normal((2, count))
    torque = 40 * np.tanh(command / 0.002) + 9 * command + 0.3 * noise[0]
    return {
        "time": time,
        "command": command,
        "relative_angle": np.cumsum(command) / rate,
        "relative_rate": command + 1e-4 * noise[1],
        "drive_torque": torque,
    }


def write_csv(path: Path, columns: Mapping[str, np.ndarray]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))


def hand_in(folder: Path, columns: Columns | None = None, *, mark: bool = True) -> Path:
    path = folder / "returned" / "recording.csv"
    write_csv(path, columns if columns is not None else columns_of())
    if mark:
        (folder / "returned" / "done").touch()
    return path


@dataclass
class Done:
    ending: Ending
    recording: Recording

    @property
    def refused(self) -> str:
        """The name by which it was refused."""
        assert self.ending.outcome is Outcome.FAULT, self.ending
        assert self.ending.fault is Fault.RECORDING
        return self.ending.reason.partition(":")[0]


def opened(folder: Path, trials: Sequence[Trial] = (TRIAL,), **options: object) -> FilesBackend:
    chosen = BACKEND.options.model_validate(
        {"folder": str(folder), "wait": "0 s", "settle": "10 ms", **options}
    )
    backend = BACKEND.open(chosen)
    assert isinstance(backend, FilesBackend)
    backend.introduce("a-run")
    for trial in trials:
        assert backend.refuses(trial) is None
    return backend


def execute(
    backend: FilesBackend, trial: Trial = TRIAL, stop: Callable[[], bool] = lambda: False
) -> Done:
    recorder = StrictRecorder()
    with backend:
        ending = backend.execute(trial, recorder, stop)
    return Done(ending, recorder.recording(ending))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Of a hand-over whose first trial is out."""
    done = execute(opened(tmp_path / "out", (TRIAL, LATER)))
    assert done.ending.outcome is Outcome.INTERRUPTED
    assert "trial-00003/returned" in done.ending.reason
    return tmp_path / "out"


def test_the_documentation_has_every_option_and_every_refusal() -> None:
    told = (ROOT / "docs" / "handover.md").read_text(encoding="utf-8")
    sources = [
        *(ROOT / "campaign/backends/handover").glob("*.py"),
        ROOT / "campaign/backends/files.py",
    ]
    text = "".join(path.read_text(encoding="utf-8") for path in sources)
    names = {*re.findall(r'RecordingProblem\(\s*"([a-z ]+)"', text), *DEFECTS.values()}
    assert {"wrong sign", "too short", "clipped", "another rate", "the same file"} <= names
    for name in (*names, *BACKEND.options.model_fields):
        assert f"`{name}`" in told, name


# The kit


@pytest.fixture
def at_the_rig(tmp_path: Path) -> Iterator[Callable[[], FilesBackend]]:
    """Makes backends, each with a folder of its own, while a person plays what is handed out."""
    over, made = threading.Event(), itertools.count()

    def play() -> None:
        while not over.wait(0.01):
            for manifest in tmp_path.glob("kit-*/trial-*/manifest.json"):
                if not (manifest.parent / "returned" / "done").exists():
                    hand_in(manifest.parent, columns_of(KIT, 1500, 250.0))

    person = threading.Thread(target=play)
    person.start()
    yield lambda: opened(tmp_path / f"kit-{next(made)}", (), wait="1 h", settle="1 h")
    over.set()
    person.join()


KIT = TRIAL.model_copy(
    update={"task": TASK.model_copy(update={"duration": 6.0, "window": (0.0, 6.0)})}
)
"""Long enough for a stop that finds it under way."""


@pytest.mark.parametrize("name", backend_checks())
def test_it_passes_the_kit(name: str, at_the_rig: Callable[[], FilesBackend]) -> None:
    spring = KIT.model_copy(update={"task": KIT.task.model_copy(update={"mode": "spring"})})
    backend_checks()[name](BackendUnderTest(at_the_rig, KIT, spring, names="task.mode"))


# Handing out


def test_a_trial_is_handed_out_with_all_that_a_rig_needs(folder: Path) -> None:
    trial = folder / "trial-00003"
    with (trial / "excitation.csv").open(encoding="utf-8") as file:
        head, *rows = csv.reader(file)
    assert head == ["time (s)", "command (rad/s)"]
    assert np.array_equal(np.array(rows, float).T, [TIME, MOVES.sample(TIME)])
    mat = loadmat(trial / "excitation.mat")
    assert np.array_equal(mat["command"].ravel(), MOVES.sample(TIME))
    assert mat["sample_rate"].item() == 250.0
    told = json.loads((trial / "manifest.json").read_text(encoding="utf-8"))
    assert told["fingerprint"] == TRIAL.fingerprint
    assert told["attempt"] == 1
    assert told["task"]["duration"] == 2.0
    assert told["limits"] == TREE["limits"]
    assert {"name": "drive_torque", "unit": "N m"} in told["requires"]
    page = (trial / "index.html").read_text(encoding="utf-8")
    assert "Fit the &lt;long&gt; arm." in page
    assert "excitation.csv" in page
    assert "friction_torque" not in page  # nobody can record the truth
    assert [path.name for path in (trial / "returned").iterdir()] == []


def test_later_trials_are_handed_out_ahead(folder: Path, tmp_path: Path) -> None:
    assert (folder / "trial-00004" / "manifest.json").exists()
    execute(opened(tmp_path / "other", (TRIAL, LATER), ahead=0))
    assert not (tmp_path / "other" / "trial-00004").exists()
    first = (folder / "index.html").read_text(encoding="utf-8")
    assert "trial-00004/index.html" in first
    assert "Fit the &lt;long&gt; arm." in first


def test_motion_of_the_hull_is_handed_out_where_there_is_a_table(tmp_path: Path) -> None:
    rolling = TASK.model_copy(update={"base_acceleration": Sine(amplitude=0.3, frequency=0.5)})
    trial = TRIAL.model_copy(update={"task": rolling})
    refused = opened(tmp_path, ()).refuses(trial)
    assert refused is not None
    assert "backend.motion=table" in refused
    execute(opened(tmp_path, (trial,), motion="table"), trial)
    head = (tmp_path / "trial-00003" / "excitation.csv").read_text(encoding="utf-8").splitlines()[0]
    assert head.split(",")[2:] == ["base_acceleration (rad/s^2)", "base_rate (rad/s)"]


def test_a_linear_axis_is_asked_in_its_own_units(tmp_path: Path) -> None:
    limits = {"angle": 0.5, "rate": 1.0, "acceleration": 5.0, "torque": 900.0, "current": 9.0}
    tree = {
        "name": "carriage",
        "axis": {"name": "x", "kind": "linear"},
        "limits": {**limits, "duration": 60.0},
    }
    trial = TRIAL.model_copy(update={"bench": tree})
    execute(opened(tmp_path, (trial,)), trial)
    out = tmp_path / "trial-00003"
    head = (out / "excitation.csv").read_text(encoding="utf-8").splitlines()[0]
    assert head == "time (s),command (m/s)"
    page = (out / "index.html").read_text(encoding="utf-8")
    assert "position 500 mm, rate 1000 mm/s, force 900 N, current 9 A" in page
    mapping = (tmp_path / "columns.toml").read_text(encoding="utf-8")
    for text in (page, mapping, (out / "manifest.json").read_text(encoding="utf-8")):
        assert not re.search(r"\b(rad|deg|N m)\b", text)
    hand_in(out)
    assert execute(opened(tmp_path, (trial,)), trial).ending.outcome is Outcome.COMPLETED


@pytest.mark.parametrize(
    ("kind", "place", "command", "limit"),
    [
        (
            "rotary",
            "begins at 28.6479 deg instead of 0 deg",
            "deg/s",
            "limit is 5.72958 deg/s",
        ),
        ("linear", "begins at 500 mm instead of 0 mm", "mm/s", "limit is 100 mm/s"),
    ],
)
def test_reasons_are_in_the_units_that_a_person_reads(
    tmp_path: Path, kind: str, place: str, command: str, limit: str
) -> None:
    limits = {"angle": 1.0, "rate": 1.0, "acceleration": 5.0, "torque": 900.0, "current": 9.0}
    tree = {
        "name": "carriage",
        "axis": {"name": "x", "kind": kind},
        "limits": {**limits, "duration": 60.0},
    }
    trial = TRIAL.model_copy(update={"bench": tree})

    def told(folder: Path, one: Trial, columns: Columns) -> str:
        execute(opened(folder, (one,)), one)
        hand_in(folder / "trial-00003", columns)
        execute(opened(folder, (one,)), one)
        return json.loads((folder / "trial-00003" / "verdict.json").read_text(encoding="utf-8"))[
            "refused"
        ]

    assert place in told(
        tmp_path / "a", trial, changed(relative_angle=GOOD["relative_angle"] + 0.5)
    )
    off = np.where(TIME > 1.0, -1.0, 1.0) * GOOD["command"] - 0.05 * np.sin(40 * TIME)
    said = told(tmp_path / "b", trial, changed(command=off))
    assert re.search(rf"the command is [-\d.e]+ {command} instead of [-\d.e]+ {command} at", said)
    slow = {**tree, "limits": {**limits, "rate": 0.1, "duration": 60.0}}
    assert limit in told(tmp_path / "c", trial.model_copy(update={"bench": slow}), GOOD)


def test_the_page_says_how_long_to_go_on_behind_the_rate_that_ends_a_trial(tmp_path: Path) -> None:
    task = TASK.model_copy(update={"stop_rate": 0.02})
    trial = TRIAL.model_copy(update={"task": task})
    execute(opened(tmp_path, (trial,)), trial)
    page = (tmp_path / "trial-00003" / "index.html").read_text(encoding="utf-8")
    assert "0.16 s (40 samples) after the rate has passed 1.14592 deg/s" in page
    told = json.loads((tmp_path / "trial-00003" / "manifest.json").read_text(encoding="utf-8"))
    assert told["record_after_stop_rate"] == 0.16


def test_what_no_rig_can_do_is_refused(tmp_path: Path) -> None:
    spring = TRIAL.model_copy(update={"task": TASK.model_copy(update={"mode": "spring"})})
    assert "task.mode" in (opened(tmp_path, ()).refuses(spring) or "")


# Taking in


def test_a_recording_that_was_asked_is_recorded(folder: Path) -> None:
    hand_in(folder / "trial-00003")
    done = execute(opened(folder))
    assert done.ending.outcome is Outcome.COMPLETED, done.ending
    assert done.ending.telemetry["safe_state_by"] == "whoever handed it in"
    assert np.array_equal(done.recording.time, TIME)
    assert np.array_equal(done.recording["drive_torque"], columns_of()["drive_torque"])
    assert done.recording.channels["command"].label == "Commanded rate"
    assert "taken" in (folder / "index.html").read_text(encoding="utf-8")


def test_what_was_taken_is_read_again_when_the_run_was_killed(folder: Path) -> None:
    hand_in(folder / "trial-00003")
    assert execute(opened(folder)).ending.outcome is Outcome.COMPLETED
    assert execute(opened(folder)).ending.outcome is Outcome.COMPLETED
    assert not (folder / "trial-00003" / "attempt-2").exists()


@pytest.mark.slow
def test_a_matlab_file_does_as_well(folder: Path) -> None:
    savemat(folder / "trial-00003" / "returned" / "rec.mat", columns_of())
    (folder / "trial-00003" / "returned" / "done.txt").touch()
    done = execute(opened(folder))
    assert done.ending.outcome is Outcome.COMPLETED, done.ending
    assert np.array_equal(done.recording["relative_rate"], columns_of()["relative_rate"])


def changed(**changes: np.ndarray) -> Columns:
    return {**columns_of(), **changes}


GOOD = columns_of()


@pytest.mark.parametrize(
    ("name", "columns"),
    [
        ("wrong sign", changed(command=-GOOD["command"], relative_rate=-GOOD["relative_rate"])),
        ("wrong sign", changed(relative_rate=-GOOD["relative_rate"])),
        ("wrong sign", changed(drive_torque=-GOOD["drive_torque"])),
        ("wrong scale", changed(command=GOOD["command"] * 180 / np.pi)),
        ("another place", changed(relative_angle=0.3 + np.cumsum(GOOD["command"]) / 250)),
        ("too short", columns_of(count=250)),
        ("clipped", changed(drive_torque=np.clip(GOOD["drive_torque"], -38, 38))),
        ("another rate", {name: column[::2] for name, column in GOOD.items()}),
        ("another trial", columns_of(LATER)),
        ("undefined", changed(drive_torque=np.where(TIME == 1.0, np.nan, GOOD["drive_torque"]))),
        ("no even clock", changed(time=np.where(TIME < 1.0, TIME, TIME + 0.05))),
    ],
)
def test_what_was_not_asked_is_refused_by_name(folder: Path, name: str, columns: Columns) -> None:
    path = hand_in(folder / "trial-00003", columns)
    before = path.read_bytes()
    done = execute(opened(folder, (TRIAL, LATER)))
    assert done.refused == name, done.ending
    assert path.read_bytes() == before
    # It is asked for once more, beside it, and the page says why.
    again = execute(opened(folder, (TRIAL, LATER)))
    assert again.ending.outcome is Outcome.INTERRUPTED
    second = folder / "trial-00003" / "attempt-2"
    assert done.ending.reason.partition(":")[2].strip()[:20] in (second / "index.html").read_text(
        encoding="utf-8"
    )
    assert json.loads((second / "manifest.json").read_text(encoding="utf-8"))["attempt"] == 2
    assert path.read_bytes() == before
    hand_in(second)
    assert execute(opened(folder, (TRIAL, LATER))).ending.outcome is Outcome.COMPLETED


def test_what_was_refused_is_kept_as_evidence(folder: Path) -> None:
    hand_in(folder / "trial-00003", columns_of(count=250))
    assert len(execute(opened(folder)).recording.time) == 250


def test_a_file_cannot_come_back_twice(folder: Path) -> None:
    trials = (TRIAL, LATER)
    path = hand_in(folder / "trial-00003")
    assert execute(opened(folder, trials)).ending.outcome is Outcome.COMPLETED
    other = folder / "trial-00004" / "returned"
    (other / "again.csv").write_bytes(path.read_bytes())
    (other / "done").touch()
    done = execute(opened(folder, trials), LATER)
    assert done.refused == "the same file"
    assert "trial-00003, attempt 1" in done.ending.reason


def test_a_file_may_come_once_more_when_its_columns_were_wrong(folder: Path) -> None:
    """The rig has nothing to do again for a sign that the mapping had wrong."""
    columns = changed(drive_torque=-GOOD["drive_torque"])
    path = hand_in(folder / "trial-00003", columns)
    assert execute(opened(folder)).refused == "wrong sign"
    execute(opened(folder))
    second = folder / "trial-00003" / "attempt-2" / "returned"
    (second / "again.csv").write_bytes(path.read_bytes())
    (second / "done").touch()
    mapping = folder / "columns.toml"
    text = mapping.read_text(encoding="utf-8")
    mapping.write_text(
        text.replace('column = "drive_torque"', 'column = "drive_torque"\nsign = -1'),
        encoding="utf-8",
    )
    assert execute(opened(folder)).ending.outcome is Outcome.COMPLETED


@pytest.mark.parametrize("accepted", [False, True])
def test_a_drive_at_its_limit_is_taken_where_the_mapping_accepts_it(
    folder: Path, accepted: bool
) -> None:
    hand_in(folder / "trial-00003", changed(drive_torque=np.clip(GOOD["drive_torque"], -38, 38)))
    mapping = folder / "columns.toml"
    text = mapping.read_text(encoding="utf-8")
    if accepted:
        column = 'column = "drive_torque"'
        text = text.replace(column, f'{column}\naccept = ["clipping"]')
    mapping.write_text(text, encoding="utf-8")
    done = execute(opened(folder))
    if accepted:
        assert done.ending.outcome is Outcome.COMPLETED
    else:
        assert done.refused == "clipped"


def test_the_manifest_beside_a_recording_says_whose_it_is(folder: Path) -> None:
    hand_in(folder / "trial-00003")
    manifest = (folder / "trial-00004" / "manifest.json").read_bytes()
    (folder / "trial-00003" / "returned" / "manifest.json").write_bytes(manifest)
    done = execute(opened(folder))
    assert done.refused == "another trial"
    assert "trial-00004" in done.ending.reason


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["csv", "mat"])
def test_a_truncated_file_is_refused_and_named(folder: Path, ending: str) -> None:
    returned = folder / "trial-00003" / "returned"
    path = returned / f"cut.{ending}"
    if ending == "csv":
        write_csv(path, columns_of())
    else:
        savemat(path, columns_of())
    path.write_bytes(path.read_bytes()[:-7000])
    (returned / "done").touch()
    done = execute(opened(folder))
    assert done.refused in ("too short", "unreadable")
    if done.refused == "unreadable":
        assert path.name in done.ending.reason


def test_a_broken_limit_is_left_to_the_recorder_and_asked_for_again(folder: Path) -> None:
    torque = GOOD["drive_torque"] + np.where(np.abs(TIME - 1.0) < 0.01, 1e5, 0.0)
    hand_in(folder / "trial-00003", changed(drive_torque=torque))
    done = execute(opened(folder))
    assert float(done.recording["drive_torque"].max()) > 9e4
    execute(opened(folder))
    page = (folder / "trial-00003" / "attempt-2" / "index.html").read_text(encoding="utf-8")
    assert "limit: drive_torque reached" in page


# Clocks


def test_a_clock_that_drifts_is_put_on_the_trials(folder: Path) -> None:
    recorded = columns_of(count=520, rate=250.0 * (1 + 900e-6))
    hand_in(folder / "trial-00003", recorded)
    done = execute(opened(folder))
    assert done.ending.outcome is Outcome.COMPLETED, done.ending
    assert np.array_equal(done.recording.time, TIME)
    assert np.allclose(done.recording["command"], MOVES.sample(TIME), atol=1e-3)
    assert any("ppm" in event.text for event in done.recording.events)
    assert any("left out" in event.text for event in done.recording.events)


def test_a_drift_of_less_than_a_sample_moves_nothing(folder: Path) -> None:
    recorded = {**GOOD, "time": GOOD["time"] / (1 + 100e-6)}
    hand_in(folder / "trial-00003", recorded)
    done = execute(opened(folder))
    assert np.array_equal(done.recording["drive_torque"], GOOD["drive_torque"])


def test_a_recording_may_begin_at_any_time_of_its_own(folder: Path) -> None:
    hand_in(folder / "trial-00003", changed(time=GOOD["time"] + 1234.5))
    assert execute(opened(folder)).ending.outcome is Outcome.COMPLETED


# Waiting


def test_nothing_is_taken_while_it_is_being_written(folder: Path) -> None:
    returned = folder / "trial-00003" / "returned"
    write_csv(returned / "recording.csv.part", columns_of())
    write_csv(returned / ".recording.csv", columns_of())
    assert execute(opened(folder)).ending.outcome is Outcome.INTERRUPTED


def test_without_a_mark_a_file_is_taken_once_it_rests(folder: Path) -> None:
    """It grows at each look; the last part comes with the look after which nobody writes."""
    path = hand_in(folder / "trial-00003", mark=False)
    text = path.read_text(encoding="utf-8").splitlines(keepends=True)
    parts = [text[:rows] for rows in range(50, 500, 50)] + [text]
    path.write_text("".join(parts.pop(0)), encoding="utf-8")

    def looks() -> bool:
        if parts:
            path.write_text("".join(parts.pop(0)), encoding="utf-8")
        return False

    done = execute(opened(folder, settle="50 ms"), stop=looks)
    assert done.ending.outcome is Outcome.COMPLETED, done.ending


def test_a_stop_ends_the_wait(folder: Path) -> None:
    asked = threading.Event()

    def stop() -> bool:
        was = asked.is_set()
        asked.set()
        return was

    done = execute(opened(folder, wait="1 h"), stop=stop)
    assert done.ending.outcome is Outcome.INTERRUPTED
    assert "operator" in done.ending.reason
    assert "not in progress" in (folder / "index.html").read_text(encoding="utf-8")


def test_nothing_here_moves(tmp_path: Path) -> None:
    assert opened(tmp_path).make_safe() is SafeState.CONFIRMED


# The folder, and its columns


def test_a_folder_belongs_to_one_run(folder: Path) -> None:
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    other = opened(folder)
    other.introduce("another-run")
    with pytest.raises(UsageError, match="hand-over of a-run"):
        execute(other)
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before


def test_a_trial_that_is_another_today_is_handed_out_anew(folder: Path) -> None:
    hand_in(folder / "trial-00003")
    another = TRIAL.model_copy(update={"seed": 2})
    done = execute(opened(folder, (another,)), another)
    assert done.ending.outcome is Outcome.INTERRUPTED
    told = json.loads(
        (folder / "trial-00003" / "attempt-2" / "manifest.json").read_text(encoding="utf-8")
    )
    assert told["fingerprint"] == another.fingerprint


def test_the_first_mapping_can_be_made_that_of_the_rig(folder: Path) -> None:
    path = folder / "columns.toml"
    text = path.read_text(encoding="utf-8")
    assert "# [columns.rig.temperature]" in text
    path.write_text(text.replace('column = "command"', 'column = "Sollwert"'), encoding="utf-8")
    hand_in(folder / "trial-00003")
    done = execute(opened(folder))
    # The rig need not record anew for what the mapping says: nothing is refused.
    assert done.ending.outcome is Outcome.INTERRUPTED
    assert "'Sollwert'" in done.ending.reason
    path.write_text(text, encoding="utf-8")
    assert execute(opened(folder)).ending.outcome is Outcome.COMPLETED


def test_a_channel_of_the_motor_has_the_unit_of_its_own_motion(tmp_path: Path) -> None:
    """A screw's motor turns, and its carriage moves straight."""
    move = '[[test]]\nname = "m"\nkind = "step_response"\nbench = "linear"\n'
    (trial, *_) = plan_of(tmp_path, move).trials
    trial = trial.model_copy(update={"requires": ("motor_rate", "relative_rate")})
    (drafted,) = tomllib.loads(first_mapping([trial]))["columns"].values()
    assert drafted["motor_rate"]["unit"] == "rad/s"
    assert drafted["relative_rate"]["unit"] == "m/s"


def test_a_mapping_with_mistakes_is_no_hand_over(folder: Path) -> None:
    (folder / "columns.toml").write_text("[columns.rig.command]\nunti = 3\n", encoding="utf-8")
    with pytest.raises(ProtocolError, match=r"columns.toml:2"):
        execute(opened(folder))


def test_rates_and_torques_are_read_by_layouts_of_their_own(tmp_path: Path) -> None:
    ramp = Polyline(times=(0.0, 2.0), values=(0.0, 8.0))
    torque = TRIAL.model_copy(
        update={"number": 5, "task": TASK.model_copy(update={"mode": "torque", "command": ramp})}
    )
    trials = (TRIAL, torque)
    execute(opened(tmp_path, trials))
    hand_in(tmp_path / "trial-00003")
    assert execute(opened(tmp_path, trials)).ending.outcome is Outcome.COMPLETED
    columns = changed(command=ramp.sample(TIME), drive_torque=ramp.sample(TIME))
    hand_in(tmp_path / "trial-00005", columns)
    done = execute(opened(tmp_path, trials), torque)
    assert done.ending.outcome is Outcome.COMPLETED, done.ending
    assert done.recording.channels["command"].unit == "N m"


def test_it_says_before_anything_is_handed_out_which_channels_there_will_be(folder: Path) -> None:
    known = opened(folder).channels(TRIAL)
    assert known is not None
    assert {"command", "relative_rate", "drive_torque", "gyro_rate"} <= known
    assert "temperature" not in known
