"""Compensations in MATLAB, run by Octave: the engine's torques, within a bound.

Octave takes long to start, so that one process runs all cases.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from campaign.controller_code.compensation import SampledCompensation, trial_inputs
from campaign.controller_code.targets.matlab import m_code, script
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

OCTAVE = shutil.which("octave-cli")
FEW = {"gms": {"elements": 3}, "leuven": {"elements": 3}}
"""Octave takes some ms for a sample of four interfaces with ten elements each."""
FEW_SAMPLES = np.r_[180:220, 250:260, 300:320, 350:370]
"""Reversals, zeros of both signs, denormals."""
Case = tuple[str, str, str, str]
"""Its name, that of the compensation, the code, and the script that tests it."""

pytestmark = pytest.mark.skipif(
    OCTAVE is None, reason="no octave-cli on the PATH: apt-get install octave"
)


def octave(folder: Path, text: str) -> list[str]:
    """Lines that a script prints."""
    (folder / "main_script.m").write_text(f"1;\n{text}\n", encoding="utf-8")
    command = [str(OCTAVE), "--norc", "--quiet", "--no-history", "main_script.m"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    return (done.stdout + done.stderr).splitlines()


def not_within_the_bound(folder: Path, cases: Iterable[Case]) -> list[str]:
    """Of each case where that is so, what its test script says."""
    runs = []
    for case, name, code, test in cases:
        (folder / case).mkdir()
        (folder / case / f"{name}.m").write_text(code, encoding="utf-8")
        (folder / case / f"{name}_test.m").write_text(test, encoding="utf-8")
        # Functions of a name are kept when the folder changes.
        runs.append(
            f"clear all; cd('{case}'); printf('{case}: '); "
            f"try {name}_test; catch problem, disp(problem.message); end; cd('..');"
        )
    told = [line for line in octave(folder, "\n".join(runs)) if line]
    right = [line for line in told if re.search(r": 0 of [1-9]\d+ samples differ", line)]
    assert len(told) >= len(runs), told
    return [line for line in told if line not in right]


def case_of(name: str, made: SampledCompensation, inputs: np.ndarray) -> Case:
    return name, made.identifier, m_code(made, ["a test"]), script(made, inputs)


@pytest.mark.slow
def test_shipped_compensations_are_within_the_bound(tmp_path: Path) -> None:
    shipped = [
        (f"{bench}-{name}", SampledCompensation.of(simulable(bench), name))
        for bench, name in SHIPPED
    ]
    cases = [case_of(case, made, trial_inputs(made)[:500]) for case, made in shipped]
    assert not_within_the_bound(tmp_path, cases) == []


@pytest.mark.slow  # 5 s
def test_a_step_function_of_a_plug_in_is_within_the_bound(tmp_path: Path) -> None:
    made, cases = of_a_plug_in(), []
    for name, inputs in {"trial": trial_inputs(made), "hurting": hurting(made)[150:]}.items():
        cases.append(case_of(f"plug-in-{name}", made, inputs[:100]))
    assert not_within_the_bound(tmp_path, cases) == []


@pytest.mark.slow  # 10 s
def test_every_model_is_within_the_bound(tmp_path: Path) -> None:
    made = {name: of_model(name, **FEW.get(name, {})) for name in TRIES}
    cases = [
        case_of(f"{name}-trial", each, trial_inputs(each)[:100]) for name, each in made.items()
    ]
    cases += [
        case_of(f"{name}-hurting", each, hurting(each)[FEW_SAMPLES]) for name, each in made.items()
    ]
    assert not_within_the_bound(tmp_path, cases) == []


def test_a_reading_that_is_none_leaves_the_torque_and_the_limit_is_one(tmp_path: Path) -> None:
    made = SampledCompensation.of(simulable("platform"), "observer")
    name, limit = made.identifier, made.bench.limits.torque
    (tmp_path / f"{name}.m").write_text(m_code(made, ["a test"]), encoding="utf-8")
    calls = HURTS.format(name)
    said = octave(tmp_path, f"disp(num2str([{calls}], '%.17g '))")
    first, no_rate, no_angle, one, other, again, anew = map(float, said[0].split())
    assert first == no_rate == no_angle == anew != 0.0
    assert sorted([one, other]) == [-limit, limit]
    assert again != first


HURTS = (
    "{0}(true, 0.1, 0, 0, 1), {0}(false, NaN, 0, 0, 1), {0}(false, 0.1, -Inf, 0, 1), "
    "{0}(false, -1e6, 0, 0, 1), {0}(false, 1e7, 0, 0, 1), "
    "{0}(false, 0.1, 0, 0, 1), {0}(true, 0.1, 0, 0, 1)"
)


@pytest.mark.slow
def test_the_script_of_the_command_notices_a_wrong_number(tmp_path: Path) -> None:
    campaign(tmp_path, "export-compensation", "platform", "lugre", "--to", "matlab")
    text, test = (
        (tmp_path / f"compensation_lugre{end}.m").read_text(encoding="utf-8")
        for end in ("", "_test")
    )
    assert "is tested with Octave 7.3" in text
    assert "This file was not run" in text
    assert "more than 1.49e-06 N m" in test
    cases = [("right", "compensation_lugre", text, test)]
    for n, (right, wrong) in enumerate(WRONG.items()):
        changed = re.sub(right, wrong, text, count=1)
        assert changed != text, right
        cases.append((f"wrong-{n}", "compensation_lugre", changed, test))
    told = "\n".join(not_within_the_bound(tmp_path, cases))
    assert "right" not in told
    assert told.count("does not give the torques") == len(WRONG), told


WRONG = {
    r"(friction_(\d+) = \(friction_\2) \+ ": r"\1 - ",
    r"parameters_1\(3\)": "parameters_1(2)",
    r"memory_1\(5\) = torque": "memory_1(1) = torque",
    r"\* 0\.781606": "* 0.781607",
}


def test_names_of_a_bench_stay_words_in_comments(tmp_path: Path) -> None:
    """Whoever wrote the bench file writes no code for the controller."""
    made = of_an_evil_name()
    (tmp_path / f"{made.identifier}.m").write_text(
        m_code(made, [f"The bench {EVIL}", f"run {EVIL}"]), encoding="utf-8"
    )
    said = octave(tmp_path, f"disp({made.identifier}(true, 0, 0, 0, 0))")
    assert said == ["0"]
