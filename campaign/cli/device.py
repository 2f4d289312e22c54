"""`campaign device`: a controller to rehearse against, until Ctrl-C."""

from __future__ import annotations

import math
import signal
from collections.abc import Sequence
from types import FrameType

from campaign.cli.output import print_line, print_note
from campaign.device.controller import HEARTBEAT_TIMEOUT, PATIENCE
from campaign.device.faults import parse_faults
from campaign.device.line import PtyStream, TcpLine
from campaign.device.machine import Setup
from campaign.device.server import Server
from campaign.device.warm_up import warm_up
from campaign.errors import ExitCode, UsageError
from campaign.protocol.bench_file import load_bench

ANY_PORT = "127.0.0.1:0"


def run_device(
    bench: str,
    *,
    tcp: str | None,
    pty: bool,
    speed: str,
    heartbeat_timeout: float | None,
    faults: Sequence[str],
    fault_seed: int,
) -> ExitCode:
    """Serve until somebody ends the program; the first line of output is the port to use."""
    if tcp is not None and pty:
        raise UsageError("a controller has one line: --pty or --tcp, not both")
    pace = _speed(speed)
    wanted = parse_faults(faults)
    setup = Setup(load_bench(bench), pace)
    if heartbeat_timeout is None:
        heartbeat_timeout = PATIENCE if math.isinf(pace) else HEARTBEAT_TIMEOUT
    line = PtyStream() if pty else TcpLine(tcp or ANY_PORT)
    # Compiling takes long, and a controller that is silent for long looks dead.
    warm_up(setup.bench)
    server = Server(line, setup, timeout=heartbeat_timeout, faults=wanted, fault_seed=fault_seed)
    try:
        for name in ("SIGTERM", "SIGHUP"):
            if hasattr(signal, name):  # Windows has no SIGHUP
                signal.signal(getattr(signal, name), _interrupt)
        print_line(line.name)
        print_note(f"rehearsing {setup.bench.name!r}; Ctrl-C ends it")
        server.serve()
    except KeyboardInterrupt:
        pass  # how a rehearsal ends
    return ExitCode.DONE


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


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
