"""Requests to stop a run: the first ends it in order, the second aborts it.

Signal handlers raise nothing: an exception from a handler can be lost, for instance in a weak
reference's callback, or break the interrupted code. The handler notes the request; a separate
thread aborts the program at the second one. For a live bench the guardian ensures the abort even
while a call blocks all threads of the program.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import NoReturn

from campaign import interrupts
from campaign.backends.calls import HEARTBEAT
from campaign.backends.interface import BackendKind
from campaign.errors import ExitCode, UsageError
from campaign.execution.guardian import (
    BEAT,
    CONNECTED,
    LEAVING,
    MAKING_SAFE,
    NOTE,
    OURS,
    REST,
    STOPPER,
    VARIABLE,
    StopRequests,
)
from campaign.execution.safety import NOT_SAFE, SAFE
from campaign.plain_text import printable

_NOTICE = "\nstopping: closing the archive; press Ctrl-C again to abort\n"
"""Fits a narrow terminal, which would break words."""
NOTHING_BEGUN = "stopped at once; nothing was begun"
_SHOW_CURSOR = "\x1b[?25h"  # a live display hides it
_LONGEST = 2000
"""bytes; longest note, so that one write to a pipe takes it."""
_PIECE = 4096
"""bytes read at a time."""
_OWN = 128
"""Added to a signal's number by this module's handler; Python's C handler writes plain numbers."""
_ENDING = 1.0
"""s; time limit for the guardian to close its end of the pipe."""


@dataclass(frozen=True)
class GuardianPipes:
    """Pipe ends from the guardian.

    Attributes:
        come, back: read and write end of one pipe: signals to this program, also from itself.
        to_guardian: write end of the pipe to the guardian.
    """

    come: int
    back: int
    to_guardian: int


def under_guardian(kind: BackendKind) -> GuardianPipes | None:
    """Restart the program as the child of a guardian, if `kind` moves a bench and has none yet.

    Call it before any work or output. Returns None if no guardian is needed, and in a program that
    uses campaign as a library. Raises UsageError on a system without guardian (not POSIX).
    """
    if not kind.live:
        return None
    if given := os.environ.pop(VARIABLE, ""):
        pipes = GuardianPipes(*map(int, given.split(",")))
        for end in (pipes.come, pipes.back, pipes.to_guardian):
            os.set_inheritable(end, False)
        os.set_blocking(pipes.to_guardian, False)  # POSIX: no other system has a guardian
        return pipes
    if interrupts.is_program():
        _begin_anew(kind)
    return None


def _begin_anew(kind: BackendKind) -> NoReturn:
    if os.name != "posix":
        raise UsageError(
            f"the backend {kind.name!r} moves a bench: run it on Linux or macOS; on this system no "
            "other process can watch the program"
        )
    sys.stdout.flush()
    sys.stderr.flush()
    guardian = str(Path(__file__).with_name("guardian.py"))
    # -I, -S: a file in the user's folder cannot replace a module of the library.
    command = [sys.executable, "-I", "-S", guardian, sys.executable, *sys.orig_argv[1:]]
    os.execv(sys.executable, command)  # noqa: S606 - our own program, no shell


class StopSwitch:
    """Stop flag of the run: a call returns whether a stop was requested.

    The first SIGINT (Ctrl-C), SIGTERM or SIGHUP (terminal closed) only sets it: running trials
    end, the bench is made safe and the archive is closed. A second SIGINT or SIGTERM makes the
    bench safe and ends the program. A second SIGHUP does not: shell and kernel both send one when
    a terminal closes.

    Attributes:
        make_safe: called in a separate thread at the second request; returns the exit code.
    """

    def __init__(self, guardian: GuardianPipes | None = None) -> None:
        """`guardian`: pipes of a program that moves a bench."""
        self._reason = ""
        self._note: Callable[[], str] = lambda: NOTHING_BEGUN
        self._moves = False
        self._noticed = False
        self._guardian = guardian
        self.make_safe: Callable[[], ExitCode] = lambda: ExitCode.INTERRUPTED

    def __call__(self) -> bool:
        return bool(self._reason)

    @property
    def reason(self) -> str:
        """Source of the request; empty without one."""
        return self._reason

    def request(self, reason: str) -> None:
        """Ask the run to stop; a second request changes nothing."""
        self._reason = self._reason or reason

    def kept(self, note: Callable[[], str], *, moves: bool, stopper: Sequence[str] = ()) -> None:
        """Set the last message of an abort: what of the run is kept, and where.

        `moves`: whether the bench needs a confirmed safe state. The guardian receives the text and
        the command `stopper`, which stops the bench's controller, before this returns.
        """
        self._note, self._moves = note, moves
        text = f"{NOT_SAFE if moves else ''}\n{note()}".strip()
        self._send_text(NOTE, text)
        self._send_text(STOPPER, "\0".join(stopper))

    @contextmanager
    def on_signals(self) -> Iterator[StopSwitch]:
        """Handle SIGINT, SIGTERM and SIGHUP inside the block. Main thread only.

        A SIGHUP that is ignored before stays ignored, as nohup requires.
        """
        guardian = self._guardian
        with ExitStack() as stack:
            come, back = (guardian.come, guardian.back) if guardian else os.pipe()
            watcher = threading.Thread(target=self._watch, args=(come,), daemon=True)
            watcher.start()
            stack.callback(watcher.join, _ENDING if guardian else None)
            stack.callback(os.close, back)  # ends the watcher
            if guardian:
                self._send_text(NOTE, NOT_SAFE)  # until more is known
                self._send(bytes((CONNECTED,)))
                stack.callback(self._send, bytes((LEAVING,)))
                HEARTBEAT.send = lambda more: self._send(bytes((BEAT if more else REST,)))
            if os.name == "posix":
                os.set_blocking(back, False)
                to = guardian.to_guardian if guardian else back
                before_it = signal.set_wakeup_fd(to, warn_on_full_buffer=False)
                stack.callback(signal.set_wakeup_fd, before_it)

            def handle(number: int, frame: FrameType | None) -> None:
                self._ask(number)
                with suppress(OSError):
                    os.write(back, bytes((_OWN + number,)))

            before = {number: signal.signal(number, handle) for number in _stopping_signals()}
            try:
                yield self
            finally:
                for number, handler in before.items():
                    if handler is not None:  # None: not set from Python, not restorable
                        signal.signal(number, handler)

    def _send_text(self, kind: int, text: str) -> None:
        data = text.encode(errors="replace")[:_LONGEST]
        self._send(bytes((kind,)) + len(data).to_bytes(2) + data)

    def _send(self, data: bytes) -> None:
        if self._guardian is not None:
            try:
                os.write(self._guardian.to_guardian, data)
            except BrokenPipeError:
                self.request("the death of its guardian process")
            except OSError:
                pass  # the guardian is suspended, and the pipe is full

    def _ask(self, number: int) -> None:
        self.request("Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name)
        if not self._noticed:
            self._noticed = True
            _say(_NOTICE)

    def _watch(self, come: int) -> None:
        """Count requests per listener (C handler, guardian, own handler); the maximum decides."""
        counted = {0: StopRequests(), OURS: StopRequests(), _OWN: StopRequests()}
        while data := os.read(come, _PIECE):
            for byte in data:
                number = byte % OURS
                if number in _stopping_signals():  # other signals may have handlers, too
                    counted[byte - number].add(number)
                    self._ask(number)
            if max(asked.times for asked in counted.values()) > 1:
                self._leave()
        os.close(come)

    def _leave(self) -> NoReturn:
        """Abort: make the bench safe, print the last message, exit."""
        self._send(bytes((MAKING_SAFE,)))
        code = self.make_safe()
        unsafe = code is ExitCode.NOT_SAFE
        state = f"{NOT_SAFE if unsafe else SAFE}\n" if unsafe or self._moves else ""
        cursor = _SHOW_CURSOR if sys.stderr is not None and sys.stderr.isatty() else ""
        try:
            note = printable(self._note(), keep="\n")
        except OSError as error:  # the disk of the results is gone
            note = f"what was kept cannot be looked at: {error}"
        _say(f"{cursor}\n{state}{note}\n")
        self._send(bytes((LEAVING,)))
        os._exit(code)


def _say(text: str) -> None:
    # Not through sys.stderr: the signal may have interrupted a write to its buffer.
    with suppress(OSError):  # stderr may be closed
        os.write(sys.__stderr__.fileno() if sys.__stderr__ else 2, text.encode())


def _stopping_signals() -> list[signal.Signals]:
    numbers = [signal.SIGINT, signal.SIGTERM]
    hang_up: signal.Signals | None = getattr(signal, "SIGHUP", None)  # Windows has none
    if hang_up is not None and signal.getsignal(hang_up) is not signal.SIG_IGN:
        numbers.append(hang_up)
    return numbers
