"""The guardian: the parent process of a program that moves a bench.

It is run by its path and uses only the standard library: `guardian.py COMMAND...`. It starts the
command with three pipe ends, numbered in `VARIABLE`: to read signals, to write signals, and to
write to the guardian. It acts only while the program is connected to a bench. Then the guardian

- passes on the signals that it receives. Python's C handler writes the program's own signals to
  the guardian, also during a call that blocks all threads. The guardian counts both, and kills a
  program that does not obey the second signal;
- kills a program whose sign of life is overdue by `SILENCE`;
- reports, after the program dies, that the safe state is not confirmed; exit code 5.

It cannot call a method of a plug-in, but can run a command that stops the controller.
"""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import time
from contextlib import suppress

VARIABLE = "CAMPAIGN_GUARDIAN"
NOTE, STOPPER = 0xFE, 0xFC
"""First bytes of the program's texts: message if it dies; command that stops its controller, with
arguments separated by NUL. The length follows (two bytes)."""
MAKING_SAFE, CONNECTED, LEAVING, BEAT, REST = 0xFD, 0xFB, 0xFA, 0xF9, 0xF8
"""Single bytes: the bench is being made safe after a second stop request; a bench is connected; the
program only exits; a sign of life, with another to follow; a last sign of life."""
OURS = 64
"""Added to the number of a signal that was sent to the guardian itself."""
STUCK, SAFE = 1.5, 30.0
"""s from a second stop request until the program must react; s that making safe may then take."""
SILENCE = 30.0
"""s until an expected sign of life is overdue."""
TURN = 1.0
"""s between two polls; after three times as long the guardian itself did not run."""
STOPPING = 8.0
"""s; time limit of the command that stops the controller."""
NOT_SAFE = 5  # exit code
ASKING = (signal.SIGINT, signal.SIGTERM)
HANG_UP = getattr(signal, "SIGHUP", None)


class StopRequests:
    """Counts stop requests; a hang-up counts only as the first one."""

    def __init__(self) -> None:
        self.times = 0

    def add(self, number: int) -> None:
        """Count signal `number`."""
        if number in ASKING or (number == HANG_UP and not self.times):
            self.times += 1


class Guardian:
    """State of the program, from the bytes of its pipe.

    Attributes:
        note, stopper: the last text of each kind.
        moves: whether a bench is connected.
        deadline: monotonic time (s) at which the program is killed; None for never.
    """

    def __init__(self) -> None:
        self.note = self.stopper = b""
        self.moves = False
        self._insisted: float | None = None
        self._silent: float | None = None
        self._asked = {0: StopRequests(), OURS: StopRequests()}
        self._left = b""

    @property
    def deadline(self) -> float | None:
        return min(filter(None, (self._insisted, self._silent)), default=None)

    def why(self) -> str:
        """Reason for killing the program at its deadline."""
        silent = f"gave no sign of life for {SILENCE:g} s"
        return f"{'did not obey' if self._insisted else silent} and was killed"

    def feed(self, data: bytes, now: float) -> bytes:
        """Update the state from `data`; the signals in it, to be passed on."""
        data, signals = self._left + data, b""
        while data:
            kind = data[0]
            if kind in (NOTE, STOPPER):
                end = 3 + int.from_bytes(data[1:3])
                if len(data) < end:
                    break  # incomplete
                setattr(self, "note" if kind == NOTE else "stopper", data[3:end])
                data = data[end:]
                continue
            if kind < REST:
                signals += self.hear(kind, now)
            elif kind == MAKING_SAFE:
                self._insisted = now + SAFE
            elif kind in (BEAT, REST):
                self._silent = now + SILENCE if kind == BEAT else None
            else:
                self.moves = kind == CONNECTED
            data = data[1:]
        self._left = data
        return signals

    def hear(self, byte: int, now: float) -> bytes:
        """Count a signal to the program, or, with `OURS` added, to the guardian."""
        asked = self._asked[byte & OURS]
        asked.add(byte % OURS)
        if asked.times > 1 and self._insisted is None:
            self._insisted = now + STUCK
        return bytes((byte,))

    def slept(self, now: float) -> None:
        """Restart the silence time: the guardian did not run and did not read the pipe."""
        if self._silent is not None:
            self._silent = now + SILENCE


def main(command: list[str]) -> int:
    """Start `command`, watch it until its end, and return the exit code. POSIX only."""
    come, back = os.pipe()
    inbox, outbox = os.pipe()
    heard = _signals()
    for end in (back, inbox):
        os.set_blocking(end, False)
    ends = (come, back, outbox)
    program = subprocess.Popen(  # noqa: S603 - the command that was typed, no shell
        command, pass_fds=ends, env={**os.environ, VARIABLE: ",".join(map(str, ends))}
    )
    os.close(outbox)
    guardian, looked, killed = Guardian(), time.monotonic(), ""
    while program.poll() is None:
        select.select([inbox, heard], [], [], TURN)
        now = time.monotonic()
        if now - looked > 3 * TURN:
            guardian.slept(now)
        looked = now
        # Signals first: the next read then contains all that the program sent before a signal.
        sent = [number for number in _read(heard) if number != signal.SIGCHLD]
        moved, signals = guardian.moves, guardian.feed(_read(inbox), now)
        if moved and not guardian.moves:
            os.close(back)  # no more signals are passed on
        if guardian.moves:
            signals += b"".join(guardian.hear(OURS + number, now) for number in sent)
            with suppress(OSError):
                os.write(back, signals)
            if guardian.deadline is not None and now >= guardian.deadline:
                killed = guardian.why()
                program.kill()
                with suppress(subprocess.TimeoutExpired):  # a disk access may block it
                    program.wait(TURN)
                break
        else:
            for number in sent:  # a terminal's Ctrl-C arrives twice; the program exits at the first
                program.send_signal(number)
    guardian.feed(_read(inbox), looked)
    return _ended(program.returncode, guardian, killed)


def _signals() -> int:
    """Descriptor from which signal numbers can be read. POSIX: Windows has no SIGCHLD."""
    numbers = [*ASKING, signal.SIGCHLD, signal.SIGQUIT]  # Ctrl-\ ends the program, and not us
    if HANG_UP is not None and signal.getsignal(HANG_UP) is not signal.SIG_IGN:
        numbers.append(HANG_UP)
    heard, woken = os.pipe()
    for end in (heard, woken):
        os.set_blocking(end, False)
    for number in numbers:
        signal.signal(number, lambda *_: None)
    signal.set_wakeup_fd(woken, warn_on_full_buffer=False)
    return heard


def _read(pipe: int) -> bytes:
    """All available bytes of a non-blocking pipe."""
    data = b""
    with suppress(BlockingIOError):
        while piece := os.read(pipe, 65536):
            data += piece
    return data


def _ended(status: int | None, guardian: Guardian, killed: str) -> int:
    """Report the end of the program, run its stopper, and return the exit code."""
    if status is not None and not guardian.moves:
        if status < 0:
            with suppress(OSError):  # SIGKILL has no handler
                signal.signal(-status, signal.SIG_DFL)
            os.kill(os.getpid(), -status)
        return status
    number = status or 0  # None: it was killed
    died = f"exit code {number}" if number >= 0 else f"signal {-number}"
    _say(f"\nthe program {killed or f'died: {died}'}\n".encode() + guardian.note)
    if not guardian.stopper:
        _say(b"the backend could not be asked to make the bench safe")
        return NOT_SAFE
    command = guardian.stopper.split(b"\0")
    _say(b"stopping the controller: " + b" ".join(command))
    try:
        subprocess.run(  # noqa: S603 - the program's own command, no shell
            command, stdin=subprocess.DEVNULL, stdout=2, timeout=STOPPING, start_new_session=True
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        _say(f"the controller was not stopped: {error}".encode())
    return NOT_SAFE


def _say(line: bytes) -> None:
    with suppress(OSError):  # stderr may be closed
        os.write(2, line + b"\n")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
