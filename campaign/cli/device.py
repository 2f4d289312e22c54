"""`campaign device`: a controller emulator, until Ctrl-C."""

from __future__ import annotations

import math
import os
import signal
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path

from campaign.cli.output import print_line, print_note
from campaign.device.controller import HEARTBEAT_TIMEOUT, PATIENCE
from campaign.device.faults import parse_faults
from campaign.device.latch import new_memory
from campaign.device.line import PtyStream, TcpLine
from campaign.device.machine import DeviceLog, Setup
from campaign.device.server import Server
from campaign.device.warm_up import warm_up
from campaign.errors import ExitCode, UsageError, writing
from campaign.interrupts import unwinding
from campaign.protocol.bench_file import simulable

ANY_PORT = "127.0.0.1:0"


@unwinding()
def run_device(
    bench: str,
    *,
    tcp: str | None,
    pty: bool,
    speed: str,
    heartbeat_timeout: float | None,
    faults: Sequence[str],
    fault_seed: int,
    latch: str | None = None,
    new_latch: bool = False,
    log: Path | None = None,
) -> ExitCode:
    """Serve until the user ends the program; the first line of output is the port."""
    if tcp is not None and pty:
        raise UsageError("a controller has one line: --pty or --tcp, not both")
    pace = _speed(speed)
    wanted = parse_faults(faults)
    if heartbeat_timeout is None:
        heartbeat_timeout = PATIENCE if math.isinf(pace) else HEARTBEAT_TIMEOUT
    with _latch_file(latch, new=new_latch) as file, closing(_log(log)) as noting:
        setup = Setup(simulable(bench), pace, log=noting, latch_file=file)
        line = PtyStream() if pty else TcpLine(tcp or ANY_PORT)
        # Compile first: a controller must not be silent for long.
        warm_up(setup.bench)
        server = Server(
            line, setup, timeout=heartbeat_timeout, faults=wanted, fault_seed=fault_seed
        )
        try:
            for name in ("SIGTERM", "SIGHUP"):
                if hasattr(signal, name):  # Windows has no SIGHUP
                    signal.signal(getattr(signal, name), signal.default_int_handler)
            print_line(line.name)
            print_note(f"emulating the controller of {setup.bench.name!r}; Ctrl-C ends it")
            print_note(f"panic stops are stored in {file or 'no file'}")
            server.serve()
        except KeyboardInterrupt:
            pass  # the normal end
    return ExitCode.DONE


@contextmanager
def _latch_file(named: str | None, *, new: bool) -> Iterator[Path | None]:
    """File of the latch: the named one, None for `none`, or a temporary one.

    new: whether this is the first start of a controller with a named file.
    """
    if named in (None, "none") and new:
        raise UsageError("--new-latch needs --latch FILE: the file to create")
    if named == "none":
        yield None
    elif named is not None:
        file = Path(named)
        if not file.parent.is_dir():
            raise UsageError(f"--latch {named}: there is no such folder")
        if new:
            _make(file)
        elif not os.path.lexists(file):
            print_note(
                f"--latch {named}: no such file, so latched; use --new-latch at the first start"
            )
        yield file
    else:
        with tempfile.TemporaryDirectory(prefix="campaign-device-") as folder:
            file = Path(folder) / "latch.json"
            new_memory(file)
            yield file


def _make(file: Path) -> None:
    with writing(f"--latch {file}"):
        try:
            new_memory(file)
        except FileExistsError:
            raise UsageError(
                f"--new-latch: {file} exists and may hold a stop; start without --new-latch"
            ) from None


def _log(file: Path | None) -> DeviceLog:
    with writing(f"--log {file}"):
        return DeviceLog(file)


def _speed(text: str) -> float:
    if text == "max":
        return math.inf
    try:
        speed = float(text)
    except ValueError:
        speed = math.nan
    if not 0 < speed <= 1000:
        raise UsageError(f"--speed {text}: a number from 0 to 1000, e.g. 1 or 20, or max")
    return speed
