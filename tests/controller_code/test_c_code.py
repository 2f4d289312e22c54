"""Compensations in C: the bits of the engine, for every model and for inputs that hurt."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from campaign.controller_code.compensation import SampledCompensation, trial_inputs
from campaign.controller_code.targets.c import c_code, vectors_code
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

UNUSED = ("-Wno-unused", "-Wno-unused-parameter")
FLAGS = ("-std=c99", "-Wall", "-Wextra", *UNUSED, "-O2", "-ffp-contract=off")
SANITIZED = {
    "gcc": ("-fsanitize=address,undefined", "-fno-sanitize-recover=all"),
    "clang": ("-fsanitize=undefined", "-fsanitize-trap=undefined"),  # needs no library of its own
}
COMPILERS = [name for name in ("gcc", "clang") if shutil.which(name)]
pytestmark = pytest.mark.skipif(not COMPILERS, reason="no C compiler on the PATH")


def ended(
    folder: Path, made: SampledCompensation, inputs: np.ndarray, *flags: str, compiler: str
) -> str:
    """What the compiled test says; it must end with 0."""
    name = f"compensation_{made.name}"
    (folder / f"{name}.c").write_text(c_code(made, ["a test"]), encoding="utf-8")
    (folder / f"{name}_test.c").write_text(vectors_code(made, inputs), encoding="utf-8")
    command = [compiler, *FLAGS, *flags, f"{name}_test.c", "-o", "test", "-lm"]
    compiled = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert compiled.returncode == 0, compiled.stderr
    assert "warning" not in compiled.stderr, compiled.stderr
    done = subprocess.run(["./test"], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize(("bench", "name"), SHIPPED)
def test_shipped_compensations_have_the_bits_of_the_engine(
    tmp_path: Path, bench: str, name: str, compiler: str
) -> None:
    made = SampledCompensation.of(simulable(bench), name)
    said = ended(tmp_path, made, trial_inputs(made), *SANITIZED[compiler], compiler=compiler)
    assert said == "0 of 2000 samples differ\n"


@pytest.mark.slow
@pytest.mark.parametrize("name", simulable("platform").compensation)
def test_in_single_precision_it_is_near_and_nothing_is_a_double(tmp_path: Path, name: str) -> None:
    campaign(tmp_path, "export-compensation", "platform", name, "--to", "c-single")
    code = (tmp_path / f"compensation_{name}.c").read_text(encoding="utf-8")
    assert "In single precision: to 0.001 of the largest torque" in code
    flags = (*FLAGS, "-Wdouble-promotion", "-Werror=double-promotion")
    command = [COMPILERS[0], *flags, "-c", f"compensation_{name}.c", "-o", "code.o"]
    subprocess.run(command, cwd=tmp_path, check=True)
    command = [COMPILERS[0], *FLAGS, f"compensation_{name}_test.c", "-o", "test", "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)
    said = subprocess.run(["./test"], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert said.stdout == "0 of 2000 samples differ\n"


@pytest.mark.slow
def test_a_step_function_of_a_plug_in_has_the_bits_of_the_engine(tmp_path: Path) -> None:
    made = of_a_plug_in()
    for inputs in (trial_inputs(made), hurting(made)):
        ended(tmp_path, made, inputs, compiler=COMPILERS[0])


@pytest.mark.parametrize("name", TRIES)
def test_every_model_has_the_bits_of_the_engine(tmp_path: Path, name: str) -> None:
    made = of_model(name)
    for inputs in (trial_inputs(made), hurting(made)):
        ended(tmp_path, made, inputs, compiler=COMPILERS[0])


def test_a_reading_that_is_none_leaves_the_torque_and_the_limit_is_one(tmp_path: Path) -> None:
    made = SampledCompensation.of(simulable("platform"), "observer")
    name, limit = "compensation_observer", made.bench.limits.torque
    (tmp_path / f"{name}.c").write_text(c_code(made, ["a test"]), encoding="utf-8")
    (tmp_path / "main.c").write_text(f'''
#include <stdio.h>
#include "{name}.c"
int main(void)
{{
    {name}_state state;
    double first, held, most, anew;
    {name}_reset(&state);
    first = {name}_step(&state, 0.1, 0.0, 0.0, 1.0);
    held = {name}_step(&state, NAN, 0.0, 0.0, 1.0);
    held = held == {name}_step(&state, 0.1, INFINITY, 0.0, 1.0) ? held : 1e9;
    most = {name}_step(&state, -1e6, 0.0, 0.0, 1.0);
    {name}_reset(&state);
    anew = {name}_step(&state, 0.1, 0.0, 0.0, 1.0);
    printf("%a %a %a %a\\n", first, held, most, anew);
    return 0;
}}
''')
    command = [COMPILERS[0], *FLAGS, "main.c", "-o", "test", "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)
    said = subprocess.run(["./test"], cwd=tmp_path, capture_output=True, text=True, check=True)
    first, held, most, anew = map(float.fromhex, said.stdout.split())
    assert first == held == anew != 0.0
    assert abs(most) == limit


@pytest.mark.slow
def test_the_program_of_the_command_ends_with_0_and_notices_a_wrong_number(tmp_path: Path) -> None:
    done = campaign(tmp_path, "export-compensation", "platform", "lugre", "--output", "code")
    assert "Loop, sliding, rate command: 5.85 Hz crossover, 69 deg, 30.9 dB" in done.out
    folder = tmp_path / "code"
    compile_ = [COMPILERS[0], *FLAGS, "compensation_lugre_test.c", "-o", "test", "-lm"]
    subprocess.run(compile_, cwd=folder, check=True)
    assert subprocess.run(["./test"], cwd=folder, check=False).returncode == 0
    code = folder / "compensation_lugre.c"
    text = code.read_text(encoding="utf-8")
    wrong = re.sub(r"(friction_(\d+) = \(friction_\2) \+ ", r"\1 - ", text, count=1)
    assert wrong != text
    code.write_text(wrong, encoding="utf-8")
    subprocess.run(compile_, cwd=folder, check=True)
    assert subprocess.run(["./test"], cwd=folder, check=False).returncode == 1


def test_names_of_a_bench_stay_words_in_comments_and_identifiers(tmp_path: Path) -> None:
    """Whoever wrote the bench file writes no code for the controller."""
    made = of_an_evil_name()
    assert made.identifier.isidentifier()
    code = c_code(made, [f"The bench {EVIL}", f"run {EVIL}"])
    path = tmp_path / f"{made.identifier}.c"
    path.write_text(code, encoding="utf-8")
    subprocess.run([COMPILERS[0], *FLAGS, "-c", path.name], cwd=tmp_path, check=True)


def test_contracted_arithmetic_is_noticed(tmp_path: Path) -> None:
    made = SampledCompensation.of(simulable("platform"), "observer")
    name = "compensation_observer"
    (tmp_path / f"{name}.c").write_text(c_code(made, ["a test"]), encoding="utf-8")
    (tmp_path / f"{name}_test.c").write_text(
        vectors_code(made, trial_inputs(made)), encoding="utf-8"
    )
    flags = ("-std=c99", "-O2", "-ffp-contract=fast", "-mfma")
    command = [COMPILERS[0], *flags, f"{name}_test.c", "-o", "test", "-lm"]
    if subprocess.run(command, cwd=tmp_path, check=False, capture_output=True).returncode:
        pytest.skip("this processor has no fma to contract to")
    cpu = Path("/proc/cpuinfo")
    if not cpu.is_file() or " fma " not in cpu.read_text(encoding="utf-8"):
        pytest.skip("this processor has no fma to contract to")
    assert subprocess.run(["./test"], cwd=tmp_path, check=False).returncode == 2


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("simulink", "lugre"), "does not say controller.sample_rate"),
        (("platform", "nobody"), "has no compensation 'nobody'; there are static, lugre, observer"),
        (("platform", "lugre", "--to", "fortran"), "there are c, c-single, matlab, json, st"),
    ],
)
def test_mistakes_are_said_in_a_line(tmp_path: Path, arguments: tuple[str, ...], why: str) -> None:
    told = campaign(tmp_path, "export-compensation", *arguments, code=2).err
    assert why in " ".join(told.split())
    assert list(tmp_path.iterdir()) == []
