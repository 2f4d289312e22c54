"""The program runs where Python 3.11 to 3.13 do: no newer syntax, and nothing that Windows lacks.

What needs POSIX stands in a few functions that say so, each behind a test of the platform or of
the name itself; they are listed here.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FILES = sorted(
    path.relative_to(ROOT).as_posix()
    for folder in ("campaign", "firmware", "tests", "benchmarks")
    for path in (ROOT / folder).rglob("*.py")
)
OURS = [file for file in FILES if file.startswith("campaign/")]

MODULES = frozenset({
    "crypt", "curses", "fcntl", "grp", "nis", "ossaudiodev", "posix", "pty", "pwd", "readline",
    "resource", "spwd", "syslog", "termios", "tty",
})  # fmt: skip
"""Modules that Windows does not have."""
NAMES = frozenset({
    "os.O_CLOEXEC", "os.O_DIRECTORY", "os.O_DSYNC", "os.O_NOCTTY", "os.O_NOFOLLOW", "os.O_NONBLOCK",
    "os.O_SYNC", "os.O_TMPFILE", "os.chown", "os.chroot", "os.ctermid", "os.fchdir", "os.fchmod",
    "os.fchown", "os.fdatasync", "os.fork", "os.forkpty", "os.getegid", "os.geteuid", "os.getgid",
    "os.getgroups", "os.getloadavg", "os.getpgid", "os.getpgrp", "os.getsid", "os.getuid",
    "os.initgroups", "os.killpg", "os.lchown", "os.mkfifo", "os.mknod", "os.nice", "os.openpty",
    "os.pidfd_open", "os.pipe2", "os.posix_fadvise", "os.posix_fallocate", "os.posix_spawn",
    "os.pread", "os.preadv", "os.pwrite", "os.pwritev", "os.readv", "os.sched_getaffinity",
    "os.sched_setaffinity", "os.sendfile", "os.set_blocking", "os.setgid",
    "os.setpgid", "os.setpriority", "os.setsid",
    "os.setuid", "os.statvfs", "os.sync", "os.sync_file_range", "os.tcgetpgrp", "os.tcsetpgrp",
    "os.ttyname", "os.uname", "os.wait", "os.wait3", "os.wait4", "os.writev",
    "select.epoll", "select.kqueue", "select.poll",
    "signal.ITIMER_REAL", "signal.SIGALRM", "signal.SIGCHLD", "signal.SIGCONT", "signal.SIGHUP",
    "signal.SIGKILL", "signal.SIGPIPE", "signal.SIGQUIT", "signal.SIGSTOP", "signal.SIGTSTP",
    "signal.SIGTTIN", "signal.SIGTTOU", "signal.SIGUSR1", "signal.SIGUSR2", "signal.SIGWINCH",
    "signal.alarm", "signal.pause", "signal.pthread_kill", "signal.pthread_sigmask",
    "signal.setitimer", "signal.siginterrupt", "signal.sigtimedwait", "signal.sigwait",
    "socket.AF_UNIX", "socket.SO_REUSEPORT", "time.clock_settime",
    "time.tzset",
})  # fmt: skip
"""Names that Windows does not have in modules that it has."""

ALLOWED: dict[tuple[str, str], str] = {
    ("campaign/archive/writing/run_lock.py", "_lock"): 'if os.name == "nt":',
    ("campaign/archive/writing/remnants.py", "_in_use"): 'if os.name == "nt"',
    ("campaign/signing/tool.py", "_kill"): 'os.name == "posix"',
    ("campaign/physics/compilation.py", "distrust"): 'os.name != "posix"',
    ("campaign/report/formats/pdf.py", "_is_root"): 'os.name == "posix"',
    ("campaign/report/formats/pdf.py", "_end_all"): 'os.name == "posix"',
    ("campaign/device/line.py", "PtyStream.__init__"): "this system has no pseudo-terminals",
    ("campaign/execution/stop.py", "StopSwitch.on_signals"): 'if os.name == "posix":',
    ("campaign/execution/stop.py", "under_guardian"): "POSIX",
    ("campaign/execution/guardian.py", "main"): "POSIX",
    ("campaign/execution/guardian.py", "_signals"): "POSIX",
}
"""Where they are used all the same, and by which words one sees that it is known."""


def uses(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Function, or empty, and name, of each thing in `tree` that Windows lacks."""
    for function, node in _walk(tree, ""):
        if isinstance(node, ast.Import):
            found = [alias.name.split(".")[0] for alias in node.names]
            yield from ((function, name) for name in found if name in MODULES)
        elif isinstance(node, ast.ImportFrom) and node.module:
            if node.module.split(".")[0] in MODULES:
                yield function, node.module
            joined = (f"{node.module}.{alias.name}" for alias in node.names)
            yield from ((function, name) for name in joined if name in NAMES)
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            name = f"{node.value.id}.{node.attr}"
            if name in NAMES:
                yield function, name


def _walk(node: ast.AST, function: str) -> Iterator[tuple[str, ast.AST]]:
    for child in ast.iter_child_nodes(node):
        inner = function
        if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            inner = f"{function}.{child.name}".lstrip(".")
        yield inner, child
        yield from _walk(child, inner)


@cache
def text_of(file: str) -> str:
    return (ROOT / file).read_text(encoding="utf-8")


def parsed(file: str) -> ast.Module:
    """Not kept: a million objects slow every collection down."""
    return ast.parse(text_of(file), file, feature_version=(3, 11))


MENTIONED = re.compile(
    rf"\b({'|'.join(map(re.escape, MODULES | NAMES))})\b"
    rf"|^\s*from ({'|'.join({name.split('.')[0] for name in NAMES})}) import",
    re.MULTILINE,
)
"""Only a file with such a text can use what Windows lacks."""


@cache
def found(file: str) -> frozenset[tuple[str, str]]:
    return frozenset(uses(parsed(file)) if MENTIONED.search(text_of(file)) else ())


def test_nothing_that_windows_lacks_is_used_without_saying_so() -> None:
    loose = {(file, *one) for file in OURS for one in found(file) if (file, one[0]) not in ALLOWED}
    assert not loose


@pytest.mark.parametrize(("file", "function"), ALLOWED)
def test_what_is_allowed_is_there_and_says_so(file: str, function: str) -> None:
    assert function in {where for where, _ in found(file)}
    text = text_of(file)
    node = _definition(parsed(file), function)
    source = text if node is None else ast.get_source_segment(text, node)
    assert ALLOWED[file, function] in str(source)


def _definition(tree: ast.Module, function: str) -> ast.AST | None:
    node: ast.AST | None = None
    for name in filter(None, function.split(".")):
        inside = ast.iter_child_nodes(node or tree)
        node = next(child for child in inside if getattr(child, "name", None) == name)
    return node


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("import fcntl", {("", "fcntl")}),
        ("def f():\n    from pty import openpty", {("f", "pty")}),
        ("class A:\n    def f(self):\n        os.fork()", {("A.f", "os.fork")}),
        ("from signal import SIGKILL", {("", "signal.SIGKILL")}),
        ("import os, json\nos.open('x', os.O_RDONLY)", set()),
    ],
)
def test_uses_are_found(text: str, expected: set[tuple[str, str]]) -> None:
    assert set(uses(ast.parse(text))) == expected


def test_text_files_are_opened_with_their_encoding() -> None:
    """Without one it is the machine's: not UTF-8 on Windows."""
    loose = [
        f"{file}:{node.lineno}"
        for file in OURS
        if re.search(r"\b(open|read_text|write_text)\b", text_of(file))
        for node in ast.walk(parsed(file))
        if isinstance(node, ast.Call) and _opens_text(node)
    ]
    assert not loose


def _opens_text(call: ast.Call) -> bool:
    """Whether it opens a file as text, by a mode that is written there, and names no encoding."""
    if any(word.arg in ("encoding", None) for word in call.keywords):
        return False
    name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    if name in ("read_text", "write_text"):
        return len(call.args) <= (name == "write_text")
    words = [word.value for word in call.keywords if word.arg == "mode"]
    modes = [arg.value for arg in (*call.args, *words) if isinstance(arg, ast.Constant)]
    text = (isinstance(mode, str) and mode != "" and set(mode) <= set("rwaxt+") for mode in modes)
    return name == "open" and any(text)


@pytest.mark.slow
def test_the_syntax_is_that_of_python_3_11() -> None:
    for file in FILES:
        parsed(file)
