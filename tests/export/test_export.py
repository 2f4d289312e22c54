"""Exports, each read back by another program than the one that wrote it."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest

import campaign
from campaign.cli.main import main
from campaign.errors import UsageError
from campaign.export import exports
from campaign.export.mat import LARGEST, check_size, matlab_names
from campaign.export.run_export import export_run
from campaign.recording import Channel, Ending, Outcome, Recording
from tests.archives import archived, plan_of

SPECIAL = [0.1, 1 / 3, np.nan, np.inf, -np.inf, -0.0, 5e-324, np.finfo(float).max, 1 + 2**-52]
LONG = "a_rather_long_name_that_two_channels_share_up_to_its_very_end_"  # 62 characters


def channel(name: str, unit: str, samples: np.ndarray) -> Channel:
    return Channel(name, unit, f"Label of {name[:9]} (°)", unit, samples)


@pytest.fixture
def run(tmp_path: Path) -> campaign.api.RunView:
    """One trial that failed before its first sample, and one with values that get lost easily."""
    first, second = plan_of(tmp_path).trials
    point = {"bench.gear.preload.torque": 33.0, "compensation": "static", "list": [1, 2]}
    second = second.model_copy(update={"point": point, "seed": 2**63 - 25})
    channels = [
        channel("gyro_rate", "rad/s", np.array(SPECIAL)),
        channel("end", "", np.arange(9.0)),
        channel("units", "N m", -np.arange(9.0)),
        channel("_hidden", "A", np.arange(9.0) / 7),
        channel(LONG + "1", "A", np.full(9, 1.0)),
        channel("trial", "A", np.full(9, 2.0)),
    ]
    ending = Ending(Outcome.LIMIT, "rate reached 5 °/s")
    recording = Recording(np.arange(9) / 3, {c.name: c for c in channels}, (), ending)
    return campaign.open(archived(tmp_path / "results", [(first, None), (second, recording)]))


def exported(run: campaign.api.RunView, to: str, folder: Path) -> Path:
    done = export_run(run, exports()[to], folder)
    assert (done.files, done.damaged) == (1, ())
    names = sorted(path.name for path in folder.iterdir())
    assert names == [f"trial-00002.{to}", "trials.csv"]
    return folder / names[0]


def samples(run: campaign.api.RunView) -> dict[str, np.ndarray]:
    recording = run.trial(2).recording()
    return {"time": recording.time} | {n: c.samples for n, c in recording.channels.items()}


def same(values: object, expected: np.ndarray) -> None:
    """Equal to the last bit, the sign of zero included."""
    found = np.asarray(values, dtype=float)
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(np.signbit(found), np.signbit(expected))


def test_csv_is_read_to_the_last_bit_by_pandas_and_numpy(run, tmp_path):
    path = exported(run, "csv", tmp_path / "out")
    heading = path.read_text(encoding="utf-8").splitlines()[0].split(",")
    assert heading[:4] == ["time (s)", "gyro_rate (rad/s)", "end", "units (N m)"]
    frame = pd.read_csv(path, engine="python")
    matrix = np.loadtxt(path, delimiter=",", skiprows=1)
    for column, expected in enumerate(samples(run).values()):
        same(frame.iloc[:, column], expected)
        same(matrix[:, column], expected)


def test_a_heading_of_csv_holds_nothing_that_a_terminal_obeys(run, tmp_path):
    strange = channel("rate\x1b[2J\u202e", "°/s\x07", np.arange(3.0))
    recording = Recording(np.arange(3) / 3, {strange.name: strange}, (), Ending(Outcome.COMPLETED))
    path = tmp_path / "trial.csv"
    exports()["csv"].write(run.trial(2), recording, path)
    heading = path.read_text(encoding="utf-8").splitlines()[0]
    assert heading == "time (s),rate?[2J? (°/s?)"


def test_parquet_is_read_by_pandas_with_its_units(run, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    path = exported(run, "parquet", tmp_path / "out")
    frame = pd.read_parquet(path, engine="pyarrow")
    for name, expected in samples(run).items():
        same(frame[name], expected)
    schema = parquet.read_schema(path)
    assert schema.field("gyro_rate").metadata[b"units"] == b"rad/s"
    assert schema.field("time").metadata == {b"units": b"s", b"label": b"Time"}
    assert json.loads(schema.metadata[b"trial"]) == run.trial(2).trial.model_dump(mode="json")


NAMES = ["time", "gyro_rate", "end_2", "units_2", "x_hidden", LONG + "1", "trial_2"]


def test_mat_is_read_by_scipy(run, tmp_path):
    from scipy.io import loadmat

    path = exported(run, "mat", tmp_path / "out")
    found = loadmat(path, squeeze_me=True)
    for name, expected in zip(NAMES, samples(run).values(), strict=True):
        same(found[name], expected)
    assert str(found["units"]["gyro_rate"]) == "rad/s"
    about = found["trial"]
    assert int(about["seed"]) == 2**63 - 25
    assert float(about["point"].item()["bench_gear_preload_torque"]) == 33.0
    assert json.loads(str(about["json"])) == run.trial(2).trial.model_dump(mode="json")


OCTAVE = """
s = load(argv(){1});
f = fopen(argv(){2}, "w");
for name = argv()(3:end)'
  fprintf(f, "%.17g ", s.(name{1}));
  fprintf(f, "\\n");
end
fprintf(f, "%s|%s|%s|", s.units.gyro_rate, s.labels.gyro_rate, s.trial.reason);
fprintf(f, "%s|%d|%d", class(s.trial.seed), s.trial.seed, columns(s.time));
"""


@pytest.mark.skipif(shutil.which("octave") is None, reason="Octave is not installed")
def test_mat_is_read_by_octave(run, tmp_path):
    path = exported(run, "mat", tmp_path / "out")
    script, told = tmp_path / "read.m", tmp_path / "told.txt"
    script.write_text(OCTAVE, encoding="utf-8")
    command = ["octave", "--no-gui", "--quiet", "--norc", script, path, told, *NAMES]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    *series, rest = told.read_text(encoding="utf-8").splitlines()
    for line, expected in zip(series, samples(run).values(), strict=True):
        same([float(word) for word in line.split()], expected)
    words = ["rad/s", r"Label of gyro_rate (\xb0)", r"rate reached 5 \xb0/s"]
    assert rest.split("|") == [*words, "uint64", f"{2**63 - 25}", "1"]


def test_names_that_matlab_would_refuse_are_changed_and_stay_apart():
    names = matlab_names(["a.b", "a_b", "while", "1st", "x" * 70, "x" * 80, "é"], taken=["a_b"])
    assert names == ["a_b_2", "a_b_3", "while_2", "x1st", "x" * 63, "x" * 61 + "_2", "x_"]


def test_what_version_5_cannot_hold_is_refused():
    check_size("trial-00001", LARGEST // 8)
    with pytest.raises(UsageError, match=r"trial-00001: 268435456 samples .*2 GB"):
        check_size("trial-00001", LARGEST // 8 + 1)


def test_the_table_of_trials_says_whose_file_is_whose(run, tmp_path):
    exported(run, "csv", tmp_path / "out")
    table = pd.read_csv(tmp_path / "out" / "trials.csv", keep_default_na=False)
    assert list(table["number"]) == [1, 2]
    assert list(table["file"]) == ["", "trial-00002.csv"]
    assert list(table["reason"]) == ["no power at 5 °C", "rate reached 5 °/s"]
    assert table["bench.gear.preload.torque"][1] == "33.0"
    assert table["seed"][1] == 2**63 - 25


def test_a_folder_with_something_in_it_is_refused(run, tmp_path):
    taken = tmp_path / "taken"
    taken.mkdir()
    exported(run, "csv", taken)
    before = sorted(taken.iterdir())
    with pytest.raises(UsageError, match="is there already; nothing was written"):
        export_run(run, exports()["csv"], taken)
    assert sorted(taken.iterdir()) == before


def test_after_a_failure_there_is_no_folder(run, tmp_path, monkeypatch):
    def full(*arguments: object, **options: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(pd.DataFrame, "to_csv", full)
    with pytest.raises(UsageError, match="No space left on device"):
        export_run(run, exports()["csv"], tmp_path / "deep" / "out")
    assert list((tmp_path / "deep").iterdir()) == []


def test_trials_are_chosen_by_number_and_test(run, tmp_path):
    done = export_run(run, exports()["csv"], tmp_path / "one", numbers=[2])
    assert done.files == 1
    assert len(pd.read_csv(tmp_path / "one" / "trials.csv")) == 1
    export_run(run, exports()["csv"], tmp_path / "two", tests=["stabilization"])
    assert len(pd.read_csv(tmp_path / "two" / "trials.csv")) == 2
    with pytest.raises(UsageError, match="trial 7"):
        export_run(run, exports()["csv"], tmp_path / "three", numbers=[7])


def command(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    """Exit code of `campaign` with these arguments."""
    monkeypatch.setattr("sys.argv", ["campaign", *map(str, arguments)])
    with pytest.raises(SystemExit) as left:
        main()
    return int(left.value.code or 0)


def test_the_command_exports_what_can_be_read_and_names_the_rest(run, capsys, monkeypatch):
    with h5py.File(run.path, "r+") as file:
        file["trial_00002/data/gyro_rate"][3] = 17.0
    code = command(monkeypatch, "export", run.path, "--to", "csv")
    told = capsys.readouterr()
    folder = run.path.with_name(f"{run.path.stem}-csv")
    assert code == 4
    assert told.out.strip() == str(folder)
    assert "gyro_rate" in told.err
    names = sorted(path.name for path in folder.iterdir())
    assert names == ["damaged.csv", "trial-00002.csv", "trials.csv"]
    heading = (folder / "trial-00002.csv").read_text(encoding="utf-8").splitlines()[0]
    assert heading.startswith("time (s),end,units (N m),")  # and not the damaged channel


def test_a_format_that_is_not_there(run, capsys, monkeypatch):
    assert command(monkeypatch, "export", run.path, "--to", "xls") == 2
    assert "there are csv, mat, parquet" in capsys.readouterr().err
