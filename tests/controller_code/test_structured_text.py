"""Compensations in Structured Text, compiled by matiec: the engine's torques, within a bound."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from campaign.controller_code.compensation import SampledCompensation, trial_inputs
from campaign.controller_code.targets.structured_text import BOUND, st_code
from campaign.protocol.bench_file import simulable
from tests.controller_code.cases import (
    EVIL,
    SHIPPED,
    TRIES,
    hurting,
    of_a_plug_in,
    of_an_evil_name,
    of_model,
)
from tests.system.user import campaign

HOME = Path(os.environ.get("MATIEC", Path(shutil.which("iec2c") or "").parent))
"""The folder of `iec2c` and `lib`."""

pytestmark = pytest.mark.skipif(
    not ((HOME / "iec2c").is_file() and (HOME / "lib" / "C").is_dir() and shutil.which("gcc")),
    reason="no gcc, or no matiec: build github.com/beremiz/matiec and set MATIEC to the folder of "
    "iec2c and lib",
)
MAIN = """
#include <stdio.h>
#include "iec_std_lib.h"
TIME __CURRENT_TIME;
BOOL __DEBUG;
#include "POUS.h"
#include "POUS.c"
int main(void)
{
    static NAME block;
    double reset, in[4];
    NAME_init__(&block, 0);
    while (scanf("%lf %lf %lf %lf %lf", &reset, in, in + 1, in + 2, in + 3) == 5) {
        __SET_VAR(block., RESET,, reset != 0);
        __SET_VAR(block., GYRO_RATE,, in[0]);
        __SET_VAR(block., LOAD_ANGLE,, in[1]);
        __SET_VAR(block., MOTOR_ANGLE,, in[2]);
        __SET_VAR(block., MOTOR_CURRENT,, in[3]);
        NAME_body__(&block);
        printf("%a\\n", __GET_VAR(block.TORQUE,));
    }
    return 0;
}
"""


def built(folder: Path, name: str, code: str) -> None:
    """`./test` in the folder: it reads reset and inputs, and writes torques."""
    (folder / "code.st").write_text(code, encoding="utf-8")
    (folder / "main.c").write_text(MAIN.replace("NAME", name.upper()), encoding="utf-8")
    command = [HOME / "iec2c", "-I", HOME / "lib", "-T", folder, folder / "code.st"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    include = ["-I", str(HOME / "lib" / "C"), "-w", "-O1", "-ffp-contract=off"]
    subprocess.run(["gcc", *include, "main.c", "-o", "test", "-lm"], cwd=folder, check=True)


def torques(folder: Path, inputs: np.ndarray, reset: np.ndarray | None = None) -> np.ndarray:
    """What the block gives (n,) for inputs (n, 4)."""
    started = np.zeros(len(inputs)) if reset is None else reset
    rows = np.column_stack([started, inputs]).tolist()
    told = "\n".join(" ".join(map(repr, row)) for row in rows)
    done = subprocess.run(
        ["./test"], cwd=folder, input=told, capture_output=True, text=True, check=True
    )
    return np.array(list(map(float.fromhex, done.stdout.split())))


def off_by(folder: Path, made: SampledCompensation, inputs: np.ndarray) -> float:
    """The largest difference, as a share of the largest torque."""
    right = made.torques(inputs)
    return float(np.max(np.abs(torques(folder, inputs) - right)) / np.max(np.abs(right)))


@pytest.mark.parametrize(("bench", "name"), SHIPPED)
def test_shipped_compensations_are_within_the_bound(tmp_path: Path, bench: str, name: str) -> None:
    made = SampledCompensation.of(simulable(bench), name)
    built(tmp_path, made.identifier, st_code(made, ["a test"]))
    assert off_by(tmp_path, made, trial_inputs(made)) <= BOUND


@pytest.mark.parametrize("name", TRIES)
def test_every_model_is_within_the_bound(tmp_path: Path, name: str) -> None:
    made = of_model(name)
    built(tmp_path, made.identifier, st_code(made, ["a test"]))
    for inputs in (trial_inputs(made), hurting(made)):
        assert off_by(tmp_path, made, inputs) <= BOUND


def test_a_step_function_of_a_plug_in_is_within_the_bound(tmp_path: Path) -> None:
    made = of_a_plug_in()
    built(tmp_path, made.identifier, st_code(made, ["a test"]))
    for inputs in (trial_inputs(made), hurting(made)):
        assert off_by(tmp_path, made, inputs) <= BOUND


def test_a_reading_that_is_none_leaves_the_torque_and_the_limit_is_one(tmp_path: Path) -> None:
    made = SampledCompensation.of(simulable("platform"), "observer")
    built(tmp_path, made.identifier, st_code(made, ["a test"]))
    inputs = np.tile([0.1, 0.0, 0.0, 1.0], (7, 1))
    inputs[1, 0], inputs[2, 1], inputs[3:5, 0] = np.nan, -np.inf, (-1e6, 1e7)
    said = torques(tmp_path, inputs, np.array([1, 0, 0, 0, 0, 0, 1]))
    first, no_rate, no_angle, one, other, again, anew = said.tolist()
    assert first == no_rate == no_angle == anew != 0.0
    assert sorted([one, other]) == [-made.bench.limits.torque, made.bench.limits.torque]
    assert again != first


WRONG = {
    r"(friction_(\d+) := \(friction_\2) \+ ": r"\1 - ",
    r"parameters_1\[2\]": "parameters_1[1]",
    r"memory_1\[4\] := torque": "memory_1[0] := torque",
    r"\* 0\.781606": "* 0.781607",
}


def test_the_vectors_of_the_command_notice_a_wrong_number(tmp_path: Path) -> None:
    campaign(tmp_path, "export-compensation", "platform", "lugre", "--to", "st")
    rows = np.loadtxt(tmp_path / "compensation_lugre.csv", delimiter=",", skiprows=1)
    text = (tmp_path / "compensation_lugre.st").read_text(encoding="utf-8")
    assert "matiec 6bb2c339" in text
    assert "This file was not run" in text
    most = BOUND * np.max(np.abs(rows[:, 4]))
    built(tmp_path, "compensation_lugre", text)
    assert np.max(np.abs(torques(tmp_path, rows[:, :4]) - rows[:, 4])) <= most
    for right, wrong in WRONG.items():
        changed = re.sub(right, wrong, text, count=1)
        assert changed != text, right
        built(tmp_path, "compensation_lugre", changed)
        assert np.max(np.abs(torques(tmp_path, rows[:, :4]) - rows[:, 4])) > most, right


def test_names_of_a_bench_stay_words_in_comments(tmp_path: Path) -> None:
    """Whoever wrote the bench file writes no code for the controller."""
    made = of_an_evil_name()
    built(tmp_path, made.identifier, st_code(made, [f"The bench {EVIL}", f"run {EVIL}"]))
    assert torques(tmp_path, np.zeros((1, 4))).tolist() == [0.0]
