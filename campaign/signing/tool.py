"""Running ssh-keygen: no shell, bounded time, prompts only at a terminal."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from campaign.errors import UsageError

NAMESPACE = "campaign-run@1"
PATIENCE = 60.0
"""Time limit (s) for ssh-keygen without a prompt at the terminal; allows for touching a token."""

_TOO_OLD = ("unknown option", "illegal option", "Unsupported operation for -Y")
_KEY = re.compile(r"with (\S+) key (\S+)\s*$")


@dataclass(frozen=True)
class ToolResult:
    """Output of ssh-keygen, and its exit status."""

    code: int
    out: str
    err: str


def check_tool() -> str:
    """Path of ssh-keygen. Raises UsageError if it is missing."""
    path = shutil.which("ssh-keygen")
    if path is None:
        raise UsageError(
            "signatures need ssh-keygen, which is not on the PATH; it comes with OpenSSH "
            "(Debian and Ubuntu: the package openssh-client, Fedora: openssh-clients, Windows: the "
            "optional feature OpenSSH Client)"
        )
    return path


def ssh_keygen(arguments: Sequence[str], text: str, *, ask: bool = False) -> ToolResult:
    """Run ssh-keygen with `text` as its input; with `ask` it may wait for the user at the terminal.

    Without `ask` it has no terminal, and must not read a passphrase from its input either. Raises
    UsageError if it is missing, not executable, too old, or exceeds the time limit.
    """
    tool = check_tool()
    try:
        with subprocess.Popen(  # noqa: S603 - a list, never a shell
            [tool, *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=_environment(ask=ask),
            start_new_session=not ask,
        ) as process:
            try:
                out, err = process.communicate(text.encode(), None if ask else PATIENCE)
            except BaseException:
                _kill(process, group=not ask)
                raise
    except subprocess.TimeoutExpired:
        raise UsageError(f"{tool} did not answer within {PATIENCE:g} s") from None
    except OSError as error:
        raise UsageError(f"{tool} cannot be executed: {error.strerror}") from None
    messages = err.decode("utf-8", "replace")
    if process.returncode and any(sign in messages for sign in _TOO_OLD):
        raise UsageError(
            f"{tool} is too old: it knows no such signatures (`-Y`); OpenSSH 8.2 or newer does"
        )
    return ToolResult(process.returncode, out.decode("utf-8", "replace"), messages)


def _environment(*, ask: bool) -> dict[str, str]:
    """Environment: with `ask` prompts only at the terminal, otherwise only by an askpass dialog."""
    environment = {**os.environ, "LC_ALL": "C"}  # the program recognizes the English messages
    environment["SSH_ASKPASS_REQUIRE"] = "never" if ask else "force"
    if ask:
        environment.pop("DISPLAY", None)  # OpenSSH before 8.4 decides by DISPLAY
    return environment


def _kill(process: subprocess.Popen[bytes], *, group: bool) -> None:
    """End the process; with `group`, also a dialog that it opened."""
    with suppress(OSError):
        if group and os.name == "posix":
            os.killpg(process.pid, signal.SIGKILL)
        else:
            process.kill()


def check_novalidate(signature: str) -> list[str]:
    """Arguments that check whether the signature is of the text, by any signer."""
    return ["-Y", "check-novalidate", "-n", NAMESPACE, "-s", signature]


def copy_for_it(folder: str, name: str, text: str) -> str:
    """A copy for ssh-keygen: a regular file that stays unchanged between two calls."""
    path = Path(folder, name)
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    return str(path)


def key_in(told: str) -> str:
    """Kind and fingerprint of the key that ssh-keygen reports, such as `ED25519 SHA256:...`."""
    match = _KEY.search(told)
    return f"{match[1]} {match[2]}" if match else "of an unknown kind"
