"""The C reference, compiled once: strictly, and for the soak test with sanitizers."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from .console import Console

FIRMWARE = Path(__file__).parents[2] / "firmware"
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror")
CONSOLE = (
    "console.c",
    "campaign_state.c",
    "campaign_commands.c",
    "campaign_session.c",
    "campaign_latch.c",
    "campaign_records.c",
    "campaign_sending.c",
    "campaign_parameters.c",
    "campaign_wire.c",
    "campaign_limits.c",
)
SANITIZE = ("-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")


def compile_c(target: Path, *sources: str, flags: tuple[str, ...] = ("-O1",)) -> Path:
    compiler = os.environ.get("CC") or shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler")
    files = [str(FIRMWARE / source) for source in sources]
    done = subprocess.run(
        [compiler, *STRICT, *flags, *files, "-o", str(target)], capture_output=True, text=True
    )
    if done.returncode and SANITIZE[1] in flags and "asan" in done.stderr:
        pytest.skip("no sanitizers")
    assert done.returncode == 0, done.stderr
    return target


@pytest.fixture(scope="session")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("firmware") / "console"
    return compile_c(target, *CONSOLE)


@pytest.fixture
def console(program: Path) -> Iterator[Console]:
    with Console(program) as started:
        yield started


@pytest.fixture
def sanitized(tmp_path: Path) -> Iterator[Console]:
    target = compile_c(tmp_path / "console", *CONSOLE, flags=SANITIZE)
    with Console(target) as started:
        yield started
