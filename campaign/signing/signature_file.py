"""Signing with a person's existing key."""

from __future__ import annotations

import os
import stat
import tempfile
from dataclasses import dataclass
from pathlib import Path

from campaign.errors import UsageError
from campaign.signing.tool import (
    NAMESPACE,
    check_novalidate,
    check_tool,
    copy_for_it,
    key_in,
    ssh_keygen,
)

_TEST = "campaign-test\n"
_BEGINNING = "-----BEGIN SSH SIGNATURE-----"


@dataclass(frozen=True)
class Signature:
    """A new signature.

    Attributes:
        text: the armored text, for a file.
        key: kind and fingerprint, such as `ED25519 SHA256:...`.
        asked: whether the user had to type a passphrase at the terminal.
    """

    text: str
    key: str
    asked: bool


def check_key(key: Path) -> None:
    """Raise UsageError if ssh-keygen or a readable key file is missing."""
    check_tool()
    try:
        if not stat.S_ISREG(key.stat().st_mode):
            raise UsageError(f"the key {key} is not a file")
        with key.open("rb"):
            pass
    except OSError as error:
        raise UsageError(f"the key {key} cannot be read: {error.strerror}") from None


def sign_test_text(key: Path, *, ask: bool) -> Signature:
    """Sign a test text, to check that `key` is usable. Raises UsageError."""
    return sign(_TEST, key, ask=ask)


def sign(text: str, key: Path, *, ask: bool) -> Signature:
    """Sign `text` with a private key, or with a public one whose private half the agent has.

    Args:
        ask: whether the user can type a passphrase at a terminal.

    Raises UsageError with the problem of the key.
    """
    check_key(key)
    command = ["-Y", "sign", "-n", NAMESPACE, "-f", str(key)]
    asked = False
    done = ssh_keygen(command, text)
    if done.code and ask and "incorrect passphrase" in done.err:
        asked = True
        done = ssh_keygen(command, text, ask=True)
    if done.code:
        raise _sign_error(key, done.err, asked)
    if not done.out.startswith(_BEGINNING):
        raise UsageError(f"ssh-keygen made no signature with {key}")
    with tempfile.TemporaryDirectory() as folder:
        made = ssh_keygen(check_novalidate(copy_for_it(folder, "signature", done.out)), text)
    if made.code:
        raise UsageError(f"ssh-keygen made a signature with {key} that it does not accept itself")
    return Signature(done.out, key_in(made.out), asked)


def _sign_error(key: Path, told: str, asked: bool) -> UsageError:
    if "too open" in told:
        return UsageError(f"the key {key} can be read by others; OpenSSH wants `chmod 600 {key}`")
    if "incorrect passphrase" in told:
        if asked:
            return UsageError(f"the key {key} has another passphrase")
        return UsageError(
            f"the key {key} needs a passphrase, and there is no terminal to ask for it; let an "
            f"agent have it: `ssh-add {key}`"
        )
    if "No private key found" in told:
        agent = "the agent does not have it" if os.environ.get("SSH_AUTH_SOCK") else "no agent runs"
        return UsageError(
            f"the key {key} is a public one: its private half is not beside it, and {agent}; "
            "`ssh-add` hands a key to the agent"
        )
    if "Couldn't load public key" in told:
        return UsageError(f"{key}: is not a key of OpenSSH")
    return UsageError(f"ssh-keygen could not sign with {key}: {_last_line(told)}")


def _last_line(told: str) -> str:
    return next(reversed(told.strip().splitlines()), "it does not say why")
