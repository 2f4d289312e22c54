"""Checking a signature, and describing an unexpected one."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

from campaign.errors import ArchiveError, UsageError
from campaign.signing.tool import NAMESPACE, check_novalidate, copy_for_it, key_in, ssh_keygen

_LARGEST = 1 << 22  # bytes of a file of allowed signers
_COMPLAINT = re.compile(r"^.*?:(\d+): (.+)$", re.MULTILINE)


class SignatureError(ArchiveError):
    """A signature that is not of this text, or not by the expected signer."""


@dataclass(frozen=True)
class AllowedSigners:
    """A file that assigns keys to signers (ssh-keygen(1), ALLOWED SIGNERS)."""

    path: Path
    text: str

    @classmethod
    def read(cls, path: Path) -> AllowedSigners:
        """Read the file. Raises UsageError if it is unreadable or too large."""
        try:
            with path.open("rb") as file:
                content = file.read(_LARGEST + 1)
        except OSError as error:
            raise UsageError(f"{path}: cannot be read: {error.strerror}") from None
        if len(content) > _LARGEST:
            raise UsageError(f"{path}: is too large for a file of allowed signers")
        return cls(path, content.decode("utf-8", "surrogateescape"))

    def names(self, signer: str) -> bool:
        """Whether any line names `signer`; for messages only."""
        lines = (line.strip() for line in self.text.splitlines())
        fields = (
            line[1:].split('"')[0] if line.startswith('"') else line.split()[0]
            for line in lines
            if line and not line.startswith("#")
        )
        return any(fnmatchcase(signer, each) for field in fields for each in field.split(","))


def verify(text: str, signature: str, signer: str, allowed: AllowedSigners) -> str:
    """Check that `signer` signed `text`; return kind and fingerprint of the key.

    Raises:
        SignatureError: the check fails; the message states what is known instead.
        UsageError: the check is impossible.
    """
    with tempfile.TemporaryDirectory() as folder:
        sig = copy_for_it(folder, "signature", signature)
        signers = copy_for_it(folder, "allowed_signers", allowed.text)
        done = ssh_keygen(
            ["-Y", "verify", "-n", NAMESPACE, "-I", signer, "-f", signers, "-s", sig], text
        )
        if not done.code:
            return key_in(done.out)
        made = ssh_keygen(check_novalidate(sig), text)
        if made.code:
            raise _made_otherwise(made.err)
        principals = ssh_keygen(["-Y", "find-principals", "-f", signers, "-s", sig], text)
    by = principals.out.replace(",", "\n").split("\n") if not principals.code else []
    by = [principal.strip() for principal in by if principal.strip()]
    raise _not_by(signer, allowed, key_in(made.out), by, done.err)


def _made_otherwise(told: str) -> SignatureError:
    """Error for a signature that is not of this text."""
    if "namespace" in told:
        return SignatureError(f"was made for another purpose, not in the namespace {NAMESPACE}")
    if "incorrect signature" in told:
        return SignatureError(
            "is not of this run as it is now: the run was changed since, or it is another's"
        )
    return SignatureError("is damaged, or no signature of OpenSSH")


def _not_by(
    signer: str, allowed: AllowedSigners, key: str, by: Sequence[str], told: str
) -> SignatureError | UsageError:
    """Error for a signature of this text by another signer: `by` are the owners of the key."""
    if by and not any(fnmatchcase(signer, each) for each in by):
        return SignatureError(f"was made by {', '.join(by)} ({key}), not by {signer}")
    complaint = _COMPLAINT.search(told)
    if complaint and re.search("missing key|invalid key|bad options", complaint[2]):
        return UsageError(f"{allowed.path}:{complaint[1]}: {complaint[2]}")
    if complaint:
        return SignatureError(
            f"was made with the key {key}, which {allowed.path}:{complaint[1]} does not let count: "
            f"{complaint[2]}"
        )
    if not allowed.names(signer):
        return SignatureError(f"cannot be {signer}'s: {allowed.path} does not name {signer}")
    return SignatureError(
        f"was made with the key {key}, and {allowed.path} does not say that it is {signer}'s"
    )
