"""The guardian: the parent process of a program that moves a bench.

Run by its path, with nothing but the standard library: `guardian.py COMMAND...`. It starts the
command with three pipe ends, which `VARIABLE` names: where signals are read, where they are
written, and where the program writes to us. Until the program is connected to a bench, it is left
alone. From then on the guardian

- hands on the signals that it is sent. The C handler of Python writes the program's own ones to
  us, also inside a call that lets none of its threads run: we count both, and kill a program that
  does not obey the second one;
- kills a program that owes a sign of life for `SILENCE`;
- says, when the program has died, that nobody saw the bench at rest, and ends with exit code 5.

No method of a plug-in can be called from here. A command that stops the controller can.
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
"""First bytes of texts that the program sends: what is said if it dies, and the command that stops
its controller, arguments separated by NUL. The length follows (two bytes)."""
MAKING_SAFE, CONNECTED, LEAVING, BEAT, REST = 0xFD, 0xFB, 0xFA, 0xF9, 0xF8
"""Single bytes: the bench is being made safe as somebody insists; a bench is connected; all is said
and the program only ends; a sign of life, another of which follows; none follows."""
OURS = 64
"""Added to the number of a signal that was sent to the guardian itself."""
STUCK, SAFE = 1.5, 30.0
"""s in which a program begins to leave once somebody insists, and may then make the bench safe."""
SILENCE = 30.0
"""s without a sign of life that is owed."""
TURN = 1.0
"""s between two looks; when it becomes three of them, the guardian itself did not run."""
STOPPING = 8.0
"""s that the command may take that stops the controller."""
NOT_SAFE = 5  # the exit code
ASKING = (signal.SIGINT, signal.SIGTERM)
HANG_UP = getattr(signal, "SIGHUP", None)


class StopRequests:
    """Counts who asked the program to stop: a hang-up only asks, it does not insist."""

    def __init__(self) -> None:
        self.times = 0

    def add(self, number: int) -> None:
        """A signal came."""
        if number in ASKING or (number == HANG_UP and not self.times):
            self.times += 1


class Guardian:
    """What is known of the program; fed with the bytes of its pipe.

    Attributes:
        note, stopper: the last of each that was sent.
        moves: whether a bench is connected.
        deadline: when the program is killed unless something changes; None for never.
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
        """It was killed at its deadline."""
        silent = f"gave no sign of life for {SILENCE:g} s"
        return f"{'did not obey' if self._insisted else silent} and was killed"

    def feed(self, data: bytes, now: float) -> bytes:
        """The signals in `data`, to be handed on."""
        data, signals = self._left + data, b""
        while data:
            kind = data[0]
            if kind in (NOTE, STOPPER):
                end = 3 + int.from_bytes(data[1:3])
                if len(data) < end:
                    break  # the rest is still to come
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
        """A signal came to the program, or with `OURS` added to the guardian."""
        asked = self._asked[byte & OURS]
        asked.add(byte % OURS)
        if asked.times > 1 and self._insisted is None:
            self._insisted = now + STUCK
        return bytes((byte,))

    def slept(self, now: float) -> None:
        """The guardian did not run for some time: what came meanwhile was not read."""
        if self._silent is not None:
            self._silent = now + SILENCE


def main(command: list[str]) -> int:
    """Start `command` and watch until it has ended; the exit code. POSIX only."""
    come, back = os.pipe()
    told, tell = os.pipe()
    heard = _signals()
    for end in (back, told):
        os.set_blocking(end, False)
    ends = (come, back, tell)
    program = subprocess.Popen(  # noqa: S603 - the command that was typed, no shell
        command, pass_fds=ends, env={**os.environ, VARIABLE: ",".join(map(str, ends))}
    )
    os.close(tell)
    guardian, looked, killed = Guardian(), time.monotonic(), ""
    while program.poll() is None:
        select.select([told, heard], [], [], TURN)
        now = time.monotonic()
        if now - looked > 3 * TURN:
            guardian.slept(now)
        looked = now
        # Signals first: what the program told before one of them is then among what is read next.
        sent = [number for number in _read(heard) if number != signal.SIGCHLD]
        moved, signals = guardian.moves, guardian.feed(_read(told), now)
        if moved and not guardian.moves:
            os.close(back)  # the end of what is handed on
        if guardian.moves:
            signals += b"".join(guardian.hear(OURS + number, now) for number in sent)
            with suppress(OSError):
                os.write(back, signals)
            if guardian.deadline is not None and now >= guardian.deadline:
                killed = guardian.why()
                program.kill()
                with suppress(subprocess.TimeoutExpired):  # a disk may hold it
                    program.wait(TURN)
                break
        else:
            for number in sent:  # of a terminal's Ctrl-C it hears twice, and leaves at the first
                program.send_signal(number)
    guardian.feed(_read(told), looked)
    return _ended(program.returncode, guardian, killed)


def _signals() -> int:
    """Where the numbers of signals can be read from now on. POSIX: Windows has no SIGCHLD."""
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
    """All that there is."""
    data = b""
    with suppress(BlockingIOError):
        while piece := os.read(pipe, 65536):
            data += piece
    return data


def _ended(status: int | None, guardian: Guardian, killed: str) -> int:
    """Say what there is to say of a program that has ended; the exit code."""
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
    with suppress(OSError):  # nobody may be there to read it
        os.write(2, line + b"\n")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
