"""The archive is valid NeXus by the judgement of the NeXus community's own checker."""

import atexit
import hashlib
import os
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path

import h5py
import numpy as np
import pytest

from campaign.archive.layout.run_status import RunStatus
from campaign.archive.layout.storage import CHUNK
from campaign.archive.writing.nexus import VERSION, definition_path
from campaign.archive.writing.preview import PREVIEW_POINTS
from campaign.archive.writing.writer import RunWriter
from campaign.backends.sim import CHANNELS
from tests.forks import Forks


def nxcheck(path: Path) -> tuple[int, int, str]:
    """Errors, warnings and output of `nxcheck`: is each group valid NeXus?"""
    return judged_by("nxcheck", str(path))


def nxvalidate(path: Path, trial: int = 1) -> tuple[int, int, str]:
    """Errors, warnings and output of `nxvalidate`: does a trial follow `NXfriction_trial`?"""
    return judged_by(
        "nxvalidate", "-a", str(definition_path()), "-p", f"/trial_{trial:05d}", str(path)
    )


@cache
def checkers() -> Forks:
    """A process that has imported both."""
    scripts = ", ".join(f"nexusformat.scripts.{name}" for name in ("nxcheck", "nxvalidate"))
    made = Forks(os.environ, f"import {scripts}")
    atexit.register(made.close)
    return made


def judged_by(script: str, *arguments: str) -> tuple[int, int, str]:
    """Errors, warnings and the output of a checker, which exits with 0 whatever it finds."""
    checker = {"BEFORE_THE_COMMAND": "tests.archive.checker", "CHECKER": script}
    python = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
    done = checkers().run(Path.cwd(), *arguments, environment=python | checker)
    assert done.returncode == 0, done.stderr
    output = done.stdout + done.stderr
    errors = re.search(r"Total number of errors: (\d+)", output)
    warnings = re.search(r"Total number of warnings: (\d+)", output)
    assert errors, output
    assert warnings, output
    return int(errors[1]), int(warnings[1]), output


@pytest.mark.parametrize("counts", [[50], [20, None, 0], [2 * CHUNK], []])
def test_a_sealed_run_has_no_errors_and_no_warnings(tmp_path, kit, counts):
    errors, warnings, output = nxcheck(kit.run(tmp_path, counts))
    assert (errors, warnings) == (0, 0), output


def test_the_checker_finds_what_is_wrong(sealed):
    """The test above would pass on anything if this did not fail."""
    with h5py.File(sealed, "r+") as file:
        file["trial_00001/data"].attrs["NX_class"] = "NXnonsense"
    errors, _, _ = nxcheck(sealed)
    assert errors > 0


BENCH = {
    "name": "tiny",
    "controller": {
        "rate": {"form": "ideal", "proportional": 2.0, "integral": 30.0},
        "current": {"form": "parallel", "proportional": 0.5, "integral": 7.0},
    },
}


def write_whole(kit, results: Path, samples: int = 50, bench: object = BENCH) -> Path:
    """A sealed run of a trial with a simulated bench's channels."""
    trial = kit.trial(1).model_copy(update={"bench": bench})
    writer = RunWriter.create(results, kit.header(), [trial])
    block = np.random.default_rng(1).normal(size=(len(CHANNELS), samples))
    kit.recorded(writer, trial, (np.arange(samples) / 1000, block), CHANNELS)
    return writer.seal(RunStatus.COMPLETE, "", ended="2026-11-21T09:40:00Z")


@pytest.mark.parametrize("samples", [50, PREVIEW_POINTS + 1])
def test_sealed_trials_follow_the_definition(tmp_path, kit, samples):
    sealed = write_whole(kit, tmp_path, samples)
    for judge in (nxvalidate, nxcheck):
        errors, warnings, output = judge(sealed)
        assert (errors, warnings) == (0, 0), output
    with h5py.File(sealed) as file:
        assert file["trial_00001/definition"][()] == b"NXfriction_trial"
        assert file["trial_00001/definition"].attrs["version"] == VERSION


def test_a_bench_that_tells_no_gains_has_no_controllers(tmp_path, kit):
    sealed = write_whole(kit, tmp_path, bench={"name": "tiny", "controller": {"rate": "?"}})
    assert nxvalidate(sealed)[:2] == (0, 0)
    with h5py.File(sealed) as file:
        assert list(file["trial_00001/instrument/motor"]) == ["physical_quantity"]


def test_gains_are_those_of_the_parallel_form(tmp_path, kit):
    sealed = write_whole(kit, tmp_path)
    with h5py.File(sealed) as file:
        motor = file["trial_00001/instrument/motor"]
        loops = [loop for loop in motor if loop.endswith("_controller")]
        gains = {loop: (motor[loop]["K_p"][()], motor[loop]["K_i"][()]) for loop in loops}
        assert gains == {"rate_controller": (2.0, 60.0), "current_controller": (0.5, 7.0)}
        gain = motor["rate_controller/K_i"]
        assert gain.attrs["units"] == "A/rad"
        digest = hashlib.sha256(np.float64(60.0).tobytes()).hexdigest()
        assert gain.attrs["sha256"].decode() == digest


def without(name: str) -> Callable[[h5py.Group], None]:
    return lambda entry: entry.__delitem__(name)


def without_units(name: str) -> Callable[[h5py.Group], None]:
    return lambda entry: entry[name].attrs.__delitem__("units")


def shorter(entry: h5py.Group) -> None:
    """One line for the fact, one for each of some sizes."""
    units = entry["data/motor_current"].attrs["units"]
    del entry["data/motor_current"]
    entry["data/motor_current"] = np.zeros(30)
    entry["data/motor_current"].attrs["units"] = units


def renamed(entry: h5py.Group) -> None:
    del entry["definition"]
    entry["definition"] = "NXfiction_trial"


@pytest.mark.parametrize(
    ("damage", "expected"),
    [
        (without("data/motor_current"), (1, 0)), (without("data/time"), (1, 0)),
        (without("start_time"), (1, 0)), (without("instrument/gyro"), (1, 0)),
        (without("record/json"), (1, 0)), (without("record/trees"), (1, 0)), (renamed, (1, 0)),
        (shorter, (0, 3)), (without_units("data/gyro_rate"), (0, 1)),
        (without_units("data/time"), (0, 1)), (without_units("data/friction_torque"), (0, 1)),
    ],
)  # fmt: skip
def test_what_does_not_follow_it_is_found(tmp_path, kit, damage, expected):
    sealed = write_whole(kit, tmp_path)
    with h5py.File(sealed, "r+") as file:
        damage(file["trial_00001"])
    errors, warnings, output = nxvalidate(sealed)
    assert errors == expected[0], output
    assert bool(warnings) == bool(expected[1]), output


def test_the_definition_is_well_formed_by_the_rules_for_definitions():
    """`nxlint` checks it against the schema of the definition language."""
    from nexusformat.nexus.validate import lint_nxdl

    assert lint_nxdl(definition_path()) == []
