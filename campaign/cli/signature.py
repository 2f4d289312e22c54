"""The signature of a run in the output of `verify`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from campaign import signing
from campaign.archive.layout.signature_file import has_signature, read_signature, signature_path
from campaign.archive.verification.statement import run_statement
from campaign.cli.sign import WHAT_IT_PROVES
from campaign.errors import ArchiveError, UsageError

RECOMPUTED = "anyone who changes a run can compute its checksums anew; only a signature shows that"


@dataclass(frozen=True)
class ExpectedSigner:
    """Whose signature a run must have."""

    signer: str
    allowed: signing.AllowedSigners


@dataclass(frozen=True)
class SignatureCheck:
    """What was found out about the signature of one run.

    Attributes:
        file: its name; empty when there is none.
        valid: None when nobody asked.
        text: one line for people; empty for a run that is not sealed and cannot have one.
        key: of a valid one, kind and fingerprint.
    """

    file: str
    valid: bool | None
    text: str
    key: str = ""


def wanted_signature(signer: str | None, allowed: Path | None) -> ExpectedSigner | None:
    """What the two options of `verify` mean. Raises UsageError when they cannot be used."""
    if signer is None and allowed is None:
        return None
    if not signer or allowed is None:
        raise UsageError(
            "--signer NAME and --allowed-signers FILE go together: who must have signed, and the "
            "file that says which keys are theirs"
        )
    signing.check_tool()
    return ExpectedSigner(signer, signing.AllowedSigners.read(allowed))


def check_signature(run: Path, wanted: ExpectedSigner | None) -> SignatureCheck:
    """Whether the run has the signature that is wanted. Raises UsageError when nobody can tell."""
    file = signature_path(run).name if run.is_file() and has_signature(run) else ""
    if wanted is None:
        return _unchecked(run, file)
    if not run.is_file():
        return SignatureCheck("", False, f"{run}: is not signed: only a sealed run can be")
    try:
        signature = read_signature(run)
        key = signing.verify(run_statement(run), signature, wanted.signer, wanted.allowed)
    except signing.SignatureError as error:
        return SignatureCheck(file, False, f"{run.with_name(file)}: {error}")
    except ArchiveError as error:
        return SignatureCheck(file, False, str(error))
    text = f"{run}: signed by {wanted.signer} with the key {key}; that {WHAT_IT_PROVES}"
    return SignatureCheck(file, True, text, key)


def _unchecked(run: Path, file: str) -> SignatureCheck:
    if not run.is_file():
        return SignatureCheck("", None, "")
    if file:
        hint = "--signer NAME --allowed-signers FILE say by whom"
        return SignatureCheck(
            file, None, f"{run}: note: {file} was not checked ({hint}); {RECOMPUTED}"
        )
    return SignatureCheck("", None, f"{run}: note: not signed; {RECOMPUTED}")
