"""What docs/developers/windows.md lists, with an `os` that lacks what Windows lacks."""

from __future__ import annotations

import importlib
import io
import os
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from campaign import processes
from campaign.errors import UsageError
from tests.test_portable import NAMES


class OtherSystem:
    """`os` as it is on Windows, for one module: pathlib goes on as it is."""

    name = "nt"

    def __getattr__(self, name: str) -> Any:
        if f"os.{name}" in NAMES:
            raise AttributeError(f"Windows has no os.{name}")
        return getattr(os, name)


@pytest.fixture
def on_windows(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The module of that name, as it runs there."""

    def module(name: str) -> Any:
        found = importlib.import_module(f"campaign.{name}")
        monkeypatch.setattr(found, "os", OtherSystem())
        return found

    return module


def test_names_of_a_folder_are_not_synced(on_windows: Any, tmp_path: Path) -> None:
    files = on_windows("archive.layout.files")
    files.sync_folder(tmp_path / "nowhere")
    (tmp_path / "part").write_text("whole")
    files.publish(tmp_path / "part", tmp_path / "final")
    assert (tmp_path / "final").read_text() == "whole"


@pytest.mark.parametrize("busy", [False, True])
def test_a_run_is_locked_by_msvcrt(
    on_windows: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, busy: bool
) -> None:
    def locking(descriptor: int, mode: int, count: int) -> None:
        assert (mode, count) == (2, 1)
        if busy:
            raise OSError("another process has it")

    monkeypatch.setitem(sys.modules, "msvcrt", SimpleNamespace(locking=locking, LK_NBLCK=2))
    with (tmp_path / "lock").open("wb") as file:
        assert on_windows("archive.writing.run_lock")._lock(file.fileno()) is not busy
    remnants = on_windows("archive.writing.remnants")
    assert remnants._in_use(tmp_path, "lock.lock") is False


def test_a_stop_is_kept_in_its_file(on_windows: Any, tmp_path: Path) -> None:
    on_windows("archive.layout.files")
    latch = on_windows("device.latch")
    memory = latch.LatchMemory(tmp_path / "latch.json", boot=3)
    assert memory.set(session=1, by="a host")
    assert latch._read(tmp_path / "latch.json") == memory.stop


@pytest.mark.parametrize(
    ("name", "end"), [("signing.tool", "_kill"), ("report.formats.pdf", "_end_all")]
)
def test_a_program_is_ended_by_itself(on_windows: Any, name: str, end: str) -> None:
    process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    with process:
        words = {"group": True} if end == "_kill" else {}
        getattr(on_windows(name), end)(process, **words)
        assert process.wait(10) != 0


def test_a_browser_is_never_root_and_a_cache_is_the_user_s(on_windows: Any, tmp_path: Path) -> None:
    assert on_windows("report.formats.pdf")._is_root() is False
    tmp_path.chmod(0o777)
    assert on_windows("physics.compilation").distrust.__wrapped__(tmp_path) == ""


def test_a_live_bench_is_refused(on_windows: Any) -> None:
    with pytest.raises(UsageError, match="'serial' moves a bench: run it on Linux or macOS"):
        on_windows("execution.stop")._begin_anew(SimpleNamespace(name="serial"))


def test_ctrl_c_stops_a_simulated_run(on_windows: Any) -> None:
    stop = on_windows("execution.stop").StopSwitch()
    with stop.on_signals():
        assert not stop()
        signal.raise_signal(signal.SIGINT)
        assert stop()


def test_workers_are_spawned(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "START_METHOD", "spawn")
    processes.start_preloading(["a_module_that_nobody_has"])
    assert processes.process_context([]).get_start_method() == "spawn"


def test_an_operator_is_asked(on_windows: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    ask = on_windows("cli.ask")
    monkeypatch.setattr(sys, "stdin", io.StringIO("done\nmore\n"))
    assert ask.read_line(lambda: False) == "done\n"
    assert ask.read_line(lambda: True) is None
    assert ask.read_line(lambda: False) is None


def test_an_emulator_listens_alone_at_tcp_and_has_no_pty(
    on_windows: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    line = on_windows("device.line")
    monkeypatch.setitem(sys.modules, "pty", None)
    with pytest.raises(UsageError, match="--pty: this system has no pseudo-terminals; use --tcp"):
        line.PtyStream()
    listening = line.TcpLine("127.0.0.1:0")
    with pytest.raises(UsageError, match="cannot listen there"):
        line.TcpLine(listening.name.removeprefix("socket://"))
    listening.close()
