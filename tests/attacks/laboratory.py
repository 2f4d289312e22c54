"""Hostile plug-ins as a user meets them: `campaign run`, here or in a process of its own."""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module, invalidate_caches
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from typer.main import get_command

from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_reader import RunReader
from campaign.archive.verification.verify_run import verify_run
from campaign.backends import backends
from campaign.cli import app, main
from campaign.entry_points import installed
from campaign.errors import ExitCode
from campaign.execution.safety import NOT_SAFE
from campaign.plain_text import printable
from tests.packages import Packages

PACKAGE = "sabotage"
BACKENDS = {
    "hostile": "LIVE",
    "hostile_calm": "CALM",
    "hostile_stop": "STOPPABLE",
    "hostile_together": "TOGETHER",
}
BENCH = """\
name = "few"

[axis]
name = "axis"

[limits]
angle = "60 deg"
rate = "60 deg/s"
acceleration = "10 rad/s^2"
torque = "100 N m"
current = "10 A"
duration = "60 s"
"""
MOVES = """\
[[test]]
name = "home"
kind = "move"
bench = "few.toml"
seed = 1
speed = "20 deg/s"
rest = "0.2 s"
sample_rate = "100 Hz"

[test.matrix]
angle = ["1 deg", "2 deg", {more}]
"""
"""Trials of less than a second, that ask next to nothing of a backend and of this machine."""
RAMPS = """\
[[test]]
name = "ramps"
kind = "breakaway"
bench = "few.toml"
seed = 1
positions = ["0 deg"]
directions = ["positive"]
torque_rate = "20 N m/s"
"""
"""A trial that cannot do without some channels."""
NEVER = ("This is a bug", "Traceback", "internal error", "INTERNAL_ERROR")
COMMAND = get_command(app)  # which takes half as long as the rest of a command


@dataclass(frozen=True)
class Done:
    """What became of a `campaign run`."""

    folder: Path
    backend: str
    code: int
    out: str
    err: str

    @cached_property
    def archive(self) -> Path | None:
        """The sealed run; None without one."""
        return next((self.folder / "results").glob("*.nxs"), None)

    @cached_property
    def run(self) -> RunReader:
        assert self.archive is not None, self.err
        return open_run(self.archive)

    @property
    def partial(self) -> list[Path]:
        return list((self.folder / "results").glob("*.partial"))

    @property
    def refused(self) -> bool:
        """Whether nothing was executed, and nothing is left of it."""
        return not (self.archive or self.partial or self.out)

    def ended(self, *codes: int) -> Done:
        """With one of these codes, and as every command has to end, whatever it was given."""
        assert self.code in codes, f"{self.code}: {self.out}{self.err}"
        assert not [text for text in NEVER if text in self.err + self.out], self.err
        assert printable(self.err, keep="\n\t") == self.err, "a terminal would obey"
        assert (NOT_SAFE in self.err) == (self.code == ExitCode.NOT_SAFE), self.err
        return self

    def sealed(self) -> Done:
        """Sealed where it was begun, sound, legible, and told alone on standard output."""
        assert self.archive is not None, self.err
        assert not self.partial, self.err
        path = str(self.archive.relative_to(self.folder))
        assert self.out.splitlines() == [path], self.out
        found = verify_run(self.archive)
        assert found.sound, found.problems
        for trial in self.run.trials:
            for channel in trial.recording().channels.values():
                assert channel.samples.dtype == np.float64, channel
        return self

    def names_the_plug_in(self, *words: str) -> Done:
        """The reason says which package, and what it did."""
        told = self.run.reason if self.archive is not None else self.err
        for word in (PACKAGE, *words):
            assert word in told, told
            assert word in self.err, self.err
        return self


def write_protocols(folder: Path) -> None:
    moves = MOVES.format(more="")
    for name, text in (("few.toml", BENCH), ("moves.toml", moves), ("ramps.toml", RAMPS)):
        (folder / name).write_text(text, encoding="utf-8")


def packed(folder: Path) -> Packages:
    """The package, as good as installed below `folder`."""
    made = Packages(folder / "packages")
    source = Path(__file__).with_name("hostile.py").read_text(encoding="utf-8")
    points = {f"campaign.backends/{name}": f"{PACKAGE}:{kind}" for name, kind in BACKENDS.items()}
    made.install(PACKAGE, {f"{PACKAGE}.py": source}, points, "1.3")
    return made


@contextmanager
def installed_here(packages: Packages) -> Iterator[None]:
    """This process, too, has what is in a folder of packages."""
    sys.path.insert(0, str(packages.folder))
    _forget()
    import_module(PACKAGE)
    try:
        yield
    finally:
        sys.path.remove(str(packages.folder))
        sys.modules.pop(PACKAGE, None)
        _forget()


def _forget() -> None:
    invalidate_caches()
    installed.cache_clear()
    backends.cache_clear()


def arguments(at: str, do: str, backend: str, protocol: str) -> tuple[str, ...]:
    """Of a run in which the plug-in does `do` at the calls `at`."""
    settings = {"backend.at": at, "backend.do": do}
    sets = (("--set", f"{name}={json.dumps(value)}") for name, value in settings.items())
    return (
        "run",
        protocol,
        "--backend",
        backend,
        "--yes",
        *(word for pair in sets for word in pair),
    )


class Here:
    """Runs commands in this process, which a hostile plug-in cannot harm for long."""

    def __init__(
        self,
        folder: Path,
        monkeypatch: pytest.MonkeyPatch,
        capfd: pytest.CaptureFixture[str],
    ) -> None:
        self.folder = folder
        self._monkeypatch = monkeypatch
        self._captured = capfd
        monkeypatch.setattr(sys.modules["campaign.cli.main"], "app", COMMAND)
        monkeypatch.chdir(folder)
        write_protocols(folder)

    @property
    def plug_in(self) -> ModuleType:
        return sys.modules[PACKAGE]

    def limit(self, name: str, seconds: float = 0.2) -> None:
        """How long a call of foreign code may take."""
        self._monkeypatch.setattr(f"campaign.backends.calls.{name}", seconds)

    def attacked(
        self, at: str, do: str, backend: str = "hostile", protocol: str = "moves.toml"
    ) -> Done:
        """The hostile one does `do` at the calls `at`."""
        return self.campaign(*arguments(at, do, backend, protocol), backend=backend)

    def attacked_in_turn(self, at: str, rows: Sequence[str]) -> Done:
        """It does something else in each trial, and nothing bad in the one after the last."""
        more = ", ".join(f'"{3 + 0.1 * n:g} deg"' for n in range(len(rows) - 1))
        (self.folder / "turns.toml").write_text(MOVES.format(more=more), encoding="utf-8")
        return self.attacked(at, "\n".join(rows), protocol="turns.toml")

    def campaign(self, *words: str, backend: str = "hostile") -> Done:
        self._captured.readouterr()
        self.plug_in.renew()
        self._monkeypatch.setattr(sys, "argv", ["campaign", *words])
        with as_before():
            with pytest.raises(SystemExit) as left:
                main()
            out, err = self._captured.readouterr()
        waited = self.plug_in.WAITED_OUT
        self.plug_in.RELEASED.set()
        assert not waited, f"a hang was waited for, in {waited}"
        return Done(self.folder, backend, int(left.value.code or 0), out, err)


@contextmanager
def as_before() -> Iterator[None]:
    """Afterwards this process is as it was, as far as plug-ins here are known to change it."""
    folder, variables, mask = Path.cwd(), dict(os.environ), os.umask(0o022)
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    handlers = {number: signal.getsignal(number) for number in numbers}
    interval, hooks = sys.getswitchinterval(), (threading.excepthook, sys.excepthook)
    streams = sys.stdin, sys.stdout, sys.stderr
    try:
        with warnings.catch_warnings(), np.errstate():
            yield
    finally:
        os.chdir(folder)
        os.environ.clear()
        os.environ.update(variables)
        os.umask(mask)
        for number, handler in handlers.items():
            signal.signal(number, handler)
        sys.setswitchinterval(interval)
        threading.excepthook, sys.excepthook = hooks
        sys.stdin, sys.stdout, sys.stderr = streams


def process(packages: Packages, words: Sequence[str]) -> Done:
    """A command in a process of its own, beside the folder of packages."""
    told = packages.campaign(*words)
    return Done(packages.folder.parent, "hostile", told.returncode, told.stdout, told.stderr)
