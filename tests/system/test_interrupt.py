"""Somebody stops the program: the run is closed in order and can be read afterwards."""

from __future__ import annotations

import signal
import subprocess
from pathlib import Path

import pytest

from tests.system.user import SEA, campaign, command, environment, write

LONG = SEA.replace("cycles = 1\n", "cycles = 10\nrepeat = 3000\n", 1)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_stopped_run_is_sealed_as_interrupted(tmp_path: Path, number: signal.Signals):
    write(tmp_path, LONG)
    with subprocess.Popen(
        command("run", "protocol.toml", "--report"),
        cwd=tmp_path,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        stdin=subprocess.DEVNULL,
        text=True,
    ) as process:
        first = process.stderr.readline()
        assert first.startswith("sea: "), first + process.stderr.read()
        process.send_signal(number)
        out, err = process.communicate(timeout=120)
    assert process.returncode == 130, err
    assert "Traceback" not in err
    assert "stopping" in err
    archive = tmp_path / out.splitlines()[-1]
    assert archive.is_file()
    assert {path.name for path in archive.parent.iterdir()} == {archive.name}
    shown = campaign(tmp_path, "show", str(archive)).out
    who = "Ctrl-C" if number is signal.SIGINT else "SIGTERM"
    assert f"status:      interrupted: stopped by {who}" in shown
    assert "safe state:  confirmed" in shown
    campaign(tmp_path, "report", str(archive))


def test_a_killed_run_is_readable_and_says_that_it_has_no_end(tmp_path: Path):
    write(tmp_path, LONG)
    with subprocess.Popen(
        command("run", "protocol.toml", "--workers", "1"),
        cwd=tmp_path,
        env=environment(),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        stdin=subprocess.DEVNULL,
        text=True,
    ) as process:
        process.stderr.readline()
        journal = next((tmp_path / "results").glob("*.partial")) / "journal.jsonl"
        while "trial-00002" not in journal.read_text(encoding="utf-8"):
            assert process.poll() is None
        process.kill()
        process.stderr.read()
    heading, line = campaign(tmp_path, "list").out.splitlines()
    run = dict(zip(heading.split("\t"), line.split("\t"), strict=True))
    assert run["status"] == "incomplete"
    assert run["trials"].endswith(" of 6000")
    assert "safe state:  not confirmed" in campaign(tmp_path, "show", run["run"]).out
