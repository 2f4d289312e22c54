"""Somebody stops the program: the run is closed in order and can be read afterwards."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest

from tests.system.user import SEA, begun, campaign, command, environment, write

LONG = SEA.replace("cycles = 1\n", "cycles = 10\nrepeat = 100\n", 1)


STOPPING = {"SIGINT": "Ctrl-C", "SIGTERM": "SIGTERM", "SIGHUP": "SIGHUP"}


@pytest.mark.slow
@pytest.mark.parametrize(
    "number", [getattr(signal, name) for name in STOPPING if hasattr(signal, name)]
)
def test_a_stopped_run_is_sealed_as_interrupted(tmp_path: Path, number: signal.Signals, request):
    write(tmp_path, LONG)
    # Started under nohup, a program keeps ignoring SIGHUP, as it should; this one is not.
    request.addfinalizer(partial(signal.signal, number, signal.signal(number, signal.SIG_DFL)))
    with begun(tmp_path, "run", "protocol.toml", "--report") as process:
        while not (line := process.stderr.readline()).startswith("sea: "):
            assert line
        process.send_signal(number)
        out, err = process.communicate(timeout=120)
    assert process.returncode == 130, err
    assert "Traceback" not in err
    assert "stopping" in err
    archive = tmp_path / out.splitlines()[-1]
    assert archive.is_file()
    assert {path.name for path in archive.parent.iterdir()} == {archive.name}
    shown = campaign(tmp_path, "show", str(archive)).out
    assert f"status:      interrupted: stopped by {STOPPING[number.name]}" in shown
    assert "safe state:  confirmed" in shown
    campaign(tmp_path, "report", str(archive))


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals")
def test_a_run_whose_terminal_closes_is_sealed_as_interrupted(tmp_path: Path):
    """The real thing: afterwards every write to the terminal fails, and that ends nothing."""
    import pty

    write(tmp_path, LONG)
    terminal, theirs = pty.openpty()
    own_terminal = (
        "import fcntl, os, signal, sys, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0); "
        "signal.signal(signal.SIGHUP, signal.SIG_DFL); "  # these tests may be under nohup
        "os.execv(sys.argv[1], sys.argv[1:])"
    )
    with subprocess.Popen(
        [sys.executable, "-c", own_terminal, *command("run", "protocol.toml")],
        cwd=tmp_path,
        env=environment(),
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
        start_new_session=True,
    ) as process:
        os.close(theirs)
        shown = b""
        while b"sea: " not in shown:
            shown += os.read(terminal, 1024)
        os.close(terminal)
        process.wait(timeout=120)
    (archive,) = (tmp_path / "results").iterdir()
    assert archive.suffix == ".nxs"
    shown = campaign(tmp_path, "show", str(archive)).out
    assert "status:      interrupted: stopped by SIGHUP" in shown
    assert "safe state:  confirmed" in shown


@pytest.mark.slow
def test_a_killed_run_is_readable_and_says_that_it_has_no_end(tmp_path: Path):
    write(tmp_path, LONG)
    with begun(tmp_path, "run", "protocol.toml", "--workers", "1") as process:
        process.stderr.readline()
        journal = next((tmp_path / "results").glob("*.partial")) / "journal.jsonl"
        while "trial-00002" not in journal.read_text(encoding="utf-8"):
            assert process.poll() is None
            time.sleep(0.005)
        process.kill()
        process.stderr.read()
    heading, line = campaign(tmp_path, "list").out.splitlines()
    run = dict(zip(heading.split("\t"), line.split("\t"), strict=True))
    assert run["status"] == "incomplete"
    assert run["trials"].endswith(" of 200")
    assert "safe state:  not confirmed" in campaign(tmp_path, "show", run["run"]).out
