"""The parent of a program that moves a bench: death, silence, signals, and peace otherwise."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from campaign.execution import guardian
from campaign.execution.guardian import (
    BEAT,
    CONNECTED,
    LEAVING,
    MAKING_SAFE,
    NOTE,
    OURS,
    REST,
    SAFE,
    SILENCE,
    STOPPER,
    STUCK,
    Guardian,
    StopRequests,
)

INT, TERM = bytes((signal.SIGINT,)), bytes((signal.SIGTERM,))
hangs_up = pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="no SIGHUP here")
on_posix = pytest.mark.skipif(sys.platform == "win32", reason="there is a guardian on POSIX only")


def asked(*numbers: int) -> int:
    count = StopRequests()
    for number in numbers:
        count.add(number)
    return count.times


def test_each_ctrl_c_and_each_sigterm_counts_and_nothing_else() -> None:
    assert asked() == 0
    assert asked(signal.SIGINT, signal.SIGTERM, signal.SIGINT) == 3
    assert asked(signal.SIGSEGV, 0) == 0


@hangs_up
def test_a_hang_up_counts_only_before_anything_else_does() -> None:
    assert asked(signal.SIGHUP, signal.SIGHUP) == 1
    assert asked(signal.SIGINT, signal.SIGHUP) == 1
    assert asked(signal.SIGHUP, signal.SIGINT) == 2


def said(kind: int, text: bytes) -> bytes:
    return bytes((kind,)) + len(text).to_bytes(2) + text


def note(text: bytes) -> bytes:
    return said(NOTE, text)


def connected() -> Guardian:
    one = Guardian()
    one.feed(bytes((CONNECTED,)), 0.0)
    return one


def test_one_signal_is_handed_on_and_sets_no_deadline() -> None:
    one = connected()
    assert one.deadline is None
    assert one.feed(INT, 100.0) == INT
    assert one.deadline is None


def test_the_second_one_sets_a_deadline_that_more_of_them_do_not_put_off() -> None:
    one = connected()
    assert one.feed(INT + TERM, 100.0) == INT + TERM
    assert one.deadline == 100.0 + STUCK
    one.feed(INT, 101.0)
    assert one.deadline == 100.0 + STUCK


def test_a_signal_that_both_have_heard_is_one() -> None:
    """A terminal's Ctrl-C reaches the guardian and the program."""
    one = connected()
    one.feed(INT, 100.0)
    assert one.hear(OURS + signal.SIGINT, 100.0) == bytes((OURS + signal.SIGINT,))
    assert one.deadline is None
    one.hear(OURS + signal.SIGTERM, 101.0)
    assert one.deadline == 101.0 + STUCK


def test_other_signals_are_handed_on_and_count_for_nothing() -> None:
    other = bytes((signal.SIGSEGV,))
    one = connected()
    assert one.feed(INT + other + other, 100.0) == INT + other + other
    assert one.deadline is None
    one.feed(INT, 101.0)
    assert one.deadline == 101.0 + STUCK


def test_a_program_that_makes_safe_has_longer() -> None:
    one = connected()
    one.feed(INT + INT, 100.0)
    assert one.feed(bytes((MAKING_SAFE,)), 101.0) == b""
    assert one.deadline == 101.0 + SAFE
    one.feed(INT, 102.0)
    assert one.deadline == 101.0 + SAFE


def test_silence_counts_from_the_last_sign_of_life_until_none_is_owed() -> None:
    one = connected()
    one.feed(bytes((BEAT,)), 100.0)
    assert one.deadline == 100.0 + SILENCE
    one.feed(bytes((BEAT,)), 105.0)
    assert one.deadline == 105.0 + SILENCE
    one.slept(200.0)
    assert one.deadline == 200.0 + SILENCE
    one.feed(bytes((REST,)), 201.0)
    assert one.deadline is None
    one.slept(300.0)
    assert one.deadline is None


def test_a_bench_is_connected_until_the_program_only_ends() -> None:
    one = Guardian()
    assert not one.moves
    one.feed(bytes((CONNECTED, BEAT, REST)), 1.0)
    assert one.moves
    one.feed(bytes((LEAVING,)), 2.0)
    assert not one.moves


@pytest.mark.parametrize("text", [b"", b"kept \x02\x02\xfe\xfd\xfa", b"x" * 1000])
@pytest.mark.parametrize("piece", [1, 2, 3, 4, 5000])
def test_a_note_comes_through_however_it_is_cut_and_is_no_signal(text: bytes, piece: int) -> None:
    one = connected()
    data = INT + note(b"first") + note(text) + said(STOPPER, b"stop\0it") + TERM
    heard = b"".join(one.feed(data[i : i + piece], 1.0) for i in range(0, len(data), piece))
    assert heard == INT + TERM
    assert (one.note, one.stopper, one.moves) == (text, b"stop\0it", True)


def test_a_note_is_known_as_soon_as_it_is_whole() -> None:
    one = Guardian()
    one.feed(note(b"kept"), 1.0)
    assert one.note == b"kept"
    one.feed(note(b"more")[:-1], 1.0)
    assert one.note == b"kept"


PROGRAM = """
import ctypes, os, signal, sys, time
come, back, tell = map(int, os.environ["{variable}"].split(","))
def say(*data): os.write(tell, bytes(data))
def note(kind, text): os.write(tell, bytes((kind,)) + len(text).to_bytes(2) + text)
def ready(): os.write(1, b"ready\\n")
def heard(count): return [os.read(come, 1)[0] for _ in range(count)]
signal.signal(signal.SIGINT, lambda *_: None)
signal.signal(signal.SIGTERM, lambda *_: None)
CONNECTED, LEAVING, BEAT, REST, NOTE, STOPPER, MAKING_SAFE = {bytes}
note(NOTE, b"the run is kept")
{does}
"""
BYTES = (CONNECTED, LEAVING, BEAT, REST, NOTE, STOPPER, MAKING_SAFE)


class Watched:
    """A program under a guardian, each in a process of its own."""

    def __init__(self, does: str, **constants: float) -> None:
        """`constants` of guardian.py that differ, for instance a shorter patience."""
        path = guardian.__file__
        program = PROGRAM.format(variable=guardian.VARIABLE, bytes=BYTES, does=does)
        code = (
            f"import runpy, sys; g = runpy.run_path({path!r}); "
            f"g['main'].__globals__.update({constants!r}); sys.exit(g['main'](sys.argv[1:]))"
        )
        self.process = subprocess.Popen(
            [sys.executable, "-I", "-S", "-c", code, sys.executable, "-c", program],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,  # one group, as in a terminal
        )

    def until_ready(self) -> None:
        assert self.process.stdout.readline() == "ready\n"

    def end(self) -> tuple[int, str, str]:
        out, err = self.process.communicate(timeout=60)
        return self.process.returncode, out, err


DIED = (
    "\nthe program died: {}\nthe run is kept\n"
    "the backend could not be asked to make the bench safe\n"
)


@on_posix
@pytest.mark.parametrize(
    ("does", "code", "err"),
    [
        ("sys.exit(3)", 3, ""),
        ("os.kill(os.getpid(), signal.SIGKILL)", -signal.SIGKILL, ""),
        ("say(CONNECTED); say(LEAVING); sys.exit(130)", 130, ""),
        ("say(CONNECTED); os._exit(0)", 5, DIED.format("exit code 0")),
        ("say(CONNECTED); os.kill(os.getpid(), signal.SIGKILL)", 5, DIED.format("signal 9")),
        ("say(CONNECTED, LEAVING, CONNECTED); os._exit(0)", 5, DIED.format("exit code 0")),
    ],
)
def test_who_dies_with_a_bench_connected_has_the_exit_code_of_an_unsafe_one(
    does: str, code: int, err: str
) -> None:
    assert Watched(does).end() == (code, "", err)


@on_posix
@pytest.mark.parametrize(
    "hangs",
    [
        "time.sleep(60)",
        "ctypes.PyDLL(None).sleep(60)",  # holds the interpreter's lock
        "os.kill(os.getpid(), signal.SIGSTOP)",
    ],
)
def test_who_owes_a_sign_of_life_is_killed(hangs: str) -> None:
    code, _, err = Watched(f"say(CONNECTED, BEAT); {hangs}", SILENCE=0.3, TURN=0.1).end()
    assert code == 5
    assert err.startswith("\nthe program gave no sign of life for 0.3 s and was killed\nthe run is")


@on_posix
@pytest.mark.parametrize("before", ["", "say(CONNECTED); ", "say(CONNECTED, BEAT, REST); "])
def test_who_owes_none_may_take_its_time(before: str) -> None:
    does = f"{before}time.sleep(1.0); say(LEAVING)"
    assert Watched(does, SILENCE=0.2, TURN=0.1).end() == (0, "", "")


@pytest.mark.slow
@on_posix
def test_the_sleep_of_both_is_no_silence() -> None:
    """A signal stops them together, as a laptop that is closed does."""
    does = "say(CONNECTED, BEAT); ready(); sys.stdin.readline(); say(LEAVING)"
    watched = Watched(does, SILENCE=2.0, TURN=0.1)
    watched.until_ready()
    os.killpg(watched.process.pid, signal.SIGSTOP)
    time.sleep(2.3)
    os.killpg(watched.process.pid, signal.SIGCONT)
    time.sleep(0.3)
    watched.process.stdin.write("\n")
    assert watched.end() == (0, "", "")


@on_posix
def test_the_controller_of_a_program_that_died_is_stopped_by_its_own_command() -> None:
    stopper = [sys.executable, "-c", "import sys; print('stopped', sys.argv[1:])", "a b", "c"]
    does = f"note(STOPPER, b'\\0'.join({[each.encode() for each in stopper]!r}))"
    code, out, err = Watched(f"{does}; say(CONNECTED); os._exit(0)").end()
    assert (code, out) == (5, "")
    assert err.endswith("\nstopped ['a b', 'c']\n")
    assert "could not be asked" not in err


@on_posix
def test_nothing_at_the_terminal_keeps_the_controller_from_being_stopped(tmp_path: Path) -> None:
    """Standard error is gone; Ctrl-C does not reach the command."""
    told = tmp_path / "told"
    code = f"import os; open({str(told)!r}, 'w').write(str(os.getsid(0) == os.getpid()))"
    does = f"note(STOPPER, b'\\0'.join([sys.executable.encode(), b'-c', {code.encode()!r}]))"
    watched = Watched(f"{does}; say(CONNECTED); ready(); sys.stdin.readline(); os._exit(0)")
    watched.until_ready()
    watched.process.stderr.close()
    watched.process.stdin.write("\n")
    watched.process.stdin.close()
    assert watched.process.wait(60) == 5
    watched.process.stdout.close()
    assert told.read_text(encoding="utf-8") == "True"


@on_posix
def test_a_program_that_quits_leaves_its_guardian_to_say_so() -> None:
    watched = Watched("say(CONNECTED); ready(); time.sleep(60)")
    watched.until_ready()
    os.killpg(watched.process.pid, signal.SIGQUIT)
    assert watched.end() == (5, "", DIED.format("signal 3"))


@on_posix
def test_a_command_that_hangs_as_well_is_not_waited_for() -> None:
    stopper = f"[{sys.executable!r}.encode(), b'-c', b'import time; time.sleep(60)']"
    does = f"note(STOPPER, b'\\0'.join({stopper})); say(CONNECTED); os._exit(0)"
    assert Watched(does, STOPPING=0.2).end()[0] == 5


@on_posix
def test_signals_to_the_guardian_reach_the_program() -> None:
    """By the pipe where it listens, else as signals; those of the whole group by both ways."""
    watched = Watched("say(CONNECTED); ready(); print(heard(2)); say(LEAVING)")
    watched.until_ready()
    watched.process.send_signal(signal.SIGINT)
    watched.process.send_signal(signal.SIGTERM)
    code, out, _ = watched.end()
    assert code == 0
    assert set(eval(out)) == {OURS + signal.SIGINT, OURS + signal.SIGTERM}
    before = Watched("signal.signal(signal.SIGTERM, signal.SIG_DFL); ready(); time.sleep(60)")
    before.until_ready()
    before.process.send_signal(signal.SIGTERM)
    assert before.end()[0] == -signal.SIGTERM


@on_posix
def test_who_does_not_obey_is_ended_and_the_last_note_is_said() -> None:
    watched = Watched("say(CONNECTED); ready(); time.sleep(60)", STUCK=0.05, TURN=0.1)
    watched.until_ready()
    os.killpg(watched.process.pid, signal.SIGINT)  # once, for both
    time.sleep(0.3)
    assert watched.process.poll() is None
    watched.process.send_signal(signal.SIGINT)
    code, _, err = watched.end()
    assert code == 5
    assert err.startswith("\nthe program did not obey and was killed\nthe run is kept\n")


@on_posix
def test_who_makes_the_bench_safe_is_given_the_time_for_it() -> None:
    """As long as SAFE, and not as long as STUCK."""
    does = "say(CONNECTED); ready(); heard(2); say(MAKING_SAFE); time.sleep(0.5); say(LEAVING)"
    watched = Watched(does, STUCK=0.2, TURN=0.05)
    watched.until_ready()
    watched.process.send_signal(signal.SIGINT)
    time.sleep(0.1)
    watched.process.send_signal(signal.SIGTERM)
    assert watched.end() == (0, "", "")
