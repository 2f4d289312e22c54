"""A run, written as another laboratory would have recorded it, comes back with its numbers.

Its columns have other names, units, signs and a decimal comma, its times are shifted and jitter.
Once each recording says which planned trial it is; once nobody planned anything, and what was done
in each is found.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import campaign
from campaign.cli.import_command import import_recordings
from campaign.cli.prepare import Request
from campaign.cli.run import run_protocol
from campaign.cli.run_options import RunOptions
from campaign.errors import ExitCode
from tests.importing.elsewhere import DEGREES, Foreign, columns_toml, written

TESTS = {
    "map": """\
kind = "velocity_map"
bench = "platform"
seed = 217
speeds = ["0.4 deg/s", "1 deg/s", "2 deg/s", "4 deg/s", "9 deg/s", "25 deg/s", "60 deg/s"]
max_travel = "60 deg"
sample_rate = "200 Hz"
""",
    "ramps": """\
kind = "breakaway"
bench = "platform"
seed = 218
positions = ["-30 deg", "0 deg", "30 deg"]
torque_rate = "2 N m/s"
rest = "5 s"
""",
    "sea": """\
kind = "stabilization"
bench = "platform"
seed = 219
frequency = "0.5 Hz"
settle_cycles = 2
cycles = 3
""",
    "sweep": """\
kind = "frequency_response"
bench = "platform"
seed = 220
frequencies = ["1 Hz", "3 Hz", "10 Hz", "20 Hz", "40 Hz"]
""",
    "step": """\
kind = "step_response"
bench = "platform"
linear = false
seed = 221
""",
}
WHAT = ("kind =", "bench =", "linear =")
COLUMNS = DEGREES | {"base_rate": Foreign("hull gyro", "deg/s", 180 / np.pi)}


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("run")
    text = "\n".join(f'[[test]]\nname = "{name}"\n{test}' for name, test in TESTS.items())
    (folder / "plan.toml").write_text(text)
    request = Request(str(folder / "plan.toml"))
    assert run_protocol(request, folder / "results", RunOptions(workers=2)) is ExitCode.DONE
    return campaign.open(next((folder / "results").glob("*.nxs")))


def imported(folder: Path, mapping: str) -> Any:
    (folder / "mapping.toml").write_text('published = "none"\n' + mapping, encoding="utf-8")
    code = import_recordings(
        [str(folder / "mapping.toml")], folder / "results", RunOptions(workers=2)
    )
    assert code is ExitCode.DONE
    return campaign.open(next((folder / "results").glob("*.nxs")))


def recordings(folder: Path, run: Any, name: str, jitter: float, line: str) -> str:
    """The files of a test, and the entries that name them; `{k}` in `line` is the trial's place."""
    entries = []
    own = [trial for trial in run.archive.trials if trial.trial.test == name]
    for k, trial in enumerate(own, start=1):
        written(folder / f"{name} {k}.csv", trial.recording(), COLUMNS, jitter=jitter, seed=k)
        entries.append(f'[[test.recording]]\nfile = "{name} {k}.csv"\n{line.format(k=k)}')
    return "\n".join(entries)


def compared(was: pd.DataFrame, now: pd.DataFrame, names: list[str], share: float) -> None:
    """Every number with an interval comes back within a share of its half-width."""
    held = 0
    for name in names:
        one, other = (
            table[(table.test == name) & (table.get("exponent") != "2")].reset_index(drop=True)
            for table in (was, now)
        )
        assert list(one.quantity) == list(other.quantity), name
        for (_, a), (_, b) in zip(one.iterrows(), other.iterrows(), strict=True):
            if not math.isfinite(a.high - a.low):
                continue
            held += 1
            off = abs(a.value - b.value) / (0.5 * (a.high - a.low))
            assert off <= share, (name, a.quantity, a.value, b.value, off)
    assert held >= 10


@pytest.mark.slow
@pytest.mark.parametrize(("jitter", "repair"), [(0.1, ""), (0.4, "resample")])
def test_recordings_of_planned_trials(tmp_path: Path, run: Any, jitter: float, repair: str):
    parts = [columns_toml(COLUMNS, repair=repair)]
    for name in ("map", "ramps", "sea"):
        parts.append(f'[[test]]\nname = "{name}"\n{TESTS[name]}')
        parts.append(recordings(tmp_path, run, name, jitter, "trial = {k}"))
    again = imported(tmp_path, "\n".join(parts))
    compared(run.results.findings, again.results.findings, ["map", "ramps", "sea"], 0.3)
    told = [event.text for trial in again.archive.trials for event in trial.recording().events]
    assert any("resampled" in text for text in told) is bool(repair)


@pytest.mark.slow
def test_recordings_that_nobody_planned(tmp_path: Path, run: Any):
    parts = [columns_toml(COLUMNS)]
    for name, test in TESTS.items():
        kept = "\n".join(line for line in test.splitlines() if line.startswith(WHAT))
        parts.append(f'[[test]]\nname = "{name}"\n{kept}')
        parts.append(recordings(tmp_path, run, name, 0.1, ""))
    again = imported(tmp_path, "\n".join(parts))
    compared(run.results.findings, again.results.findings, list(TESTS), 1.0)
    step = next(t for t in again.archive.trials if t.trial.test == "step")
    assert step.trial.options["step"] == pytest.approx(math.radians(1.0), rel=1e-6)
    swung = next(t for t in again.archive.trials if t.trial.test == "sea")
    assert swung.trial.options["frequency"] == pytest.approx(0.5, rel=1e-4)
    ramp = next(t for t in again.archive.trials if t.trial.test == "ramps")
    assert ramp.trial.options["torque_rate"] == pytest.approx(2.0)


def test_a_wrong_sign_of_a_column_is_not_mended(tmp_path: Path, run: Any):
    """Nothing is guessed: without its sign the torque is what the file says."""
    parts = [columns_toml(COLUMNS).replace("sign = -1", "sign = 1"), '[[test]]\nname = "sea"']
    parts.append(TESTS["sea"])
    parts.append(recordings(tmp_path, run, "sea", 0.0, "trial = {k}"))
    again = imported(tmp_path, "\n".join(parts))
    was, now = (
        next(t for t in each.archive.trials if t.trial.test == "sea").recording()["drive_torque"]
        for each in (run, again)
    )
    np.testing.assert_allclose(now, -was, rtol=1e-6, atol=1e-6)
