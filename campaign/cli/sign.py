"""`campaign sign`, and the signature of `run --sign` and `resume --sign`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from campaign import signing
from campaign.archive.layout.files import why
from campaign.archive.layout.signature_file import (
    has_signature,
    set_aside_signature,
    signature_path,
    write_signature,
)
from campaign.archive.reading.run_list import find_run
from campaign.archive.writing.run_lock import RunLock
from campaign.cli.ask import has_terminal
from campaign.cli.output import print_line, print_note, print_warning
from campaign.errors import ArchiveError, CampaignError, ExitCode, UsageError
from campaign.execution.run_reference import reference
from campaign.interrupts import unwinding

WHAT_IT_PROVES = "proves who, not when"


@unwinding()
def sign_archive(name: str, results: Path, key: Path, *, replace: bool) -> ExitCode:
    """Sign a sealed, sound run; the signature's path is the last line of the output.

    Raises:
        UsageError: it is not sealed, has a signature (without `replace`), or the key is unusable.
        ArchiveError: it is damaged, or the signature cannot be written.
    """
    sealed = find_run(results, name)
    if not sealed.is_file():
        raise UsageError(
            f"{sealed}: is not sealed, and only a sealed run can be signed; "
            f"`campaign resume {reference(sealed)}` completes it"
        )
    from campaign.archive.verification.verify_run import verify_run

    _check_free(sealed, replace=replace)
    signing.check_key(key)  # before all of a large run is read
    with _locked(sealed):
        problems = verify_run(sealed).problems
        if problems:
            raise ArchiveError(
                f"{sealed}: is not sound ({problems[0]}), and was not signed; "
                f"`campaign verify {reference(sealed)}` lists all problems"
            )
        _sign(sealed, key, replace=replace)
    print_line(str(signature_path(sealed)))
    return ExitCode.DONE


def rehearse_signing(key: Path) -> None:
    """Sign a test text, to detect an unusable key before the run. Raises UsageError."""
    made = signing.sign_test_text(key, ask=has_terminal())
    if made.asked:
        print_warning(
            "the passphrase is needed again when the run is sealed; with an agent "
            f"(`ssh-add {key}`) there is no prompt"
        )


def sign_new_run(sealed: Path, key: Path) -> ExitCode:
    """Sign a new run; a failure is printed, keeps the run, and returns ARCHIVE or INTERRUPTED."""
    try:
        with unwinding():
            if not sealed.is_file():
                raise ArchiveError(f"{sealed}: is not sealed")
            with _locked(sealed):
                _sign(sealed, key, replace=True)
    except CampaignError as error:
        _say_unsigned(sealed, str(error))
        return ExitCode.ARCHIVE
    except KeyboardInterrupt:
        _say_unsigned(sealed, "interrupted")
        return ExitCode.INTERRUPTED
    return ExitCode.DONE


def _say_unsigned(sealed: Path, reason: str) -> None:
    print_warning(
        f"NOT SIGNED: {reason}\n"
        f"the run is kept; `campaign sign {reference(sealed)} --key FILE` signs it"
    )


@contextmanager
def _locked(sealed: Path) -> Iterator[None]:
    """Lock the run against a resume while it is signed."""
    try:
        lock = RunLock.acquire(sealed.parent, sealed.stem)
    except OSError as error:
        raise ArchiveError(f"{sealed.parent}: cannot be written: {why(error)}") from None
    try:
        yield
    finally:
        lock.release()


def _check_free(sealed: Path, *, replace: bool) -> None:
    if has_signature(sealed) and not replace:
        raise UsageError(
            f"{signature_path(sealed)}: the run is signed already; --replace renames that "
            "signature, and removes nothing"
        )


def _sign(sealed: Path, key: Path, *, replace: bool) -> None:
    """Sign the run, then set an old signature aside and write the new one."""
    from campaign.archive.verification.statement import run_statement

    made = signing.sign(run_statement(sealed), key, ask=has_terminal())
    _check_free(sealed, replace=replace)
    try:
        old = set_aside_signature(sealed, "replaced")
    except OSError as error:
        raise ArchiveError(f"{signature_path(sealed)}: cannot be renamed: {why(error)}") from None
    write_signature(sealed, made.text)
    if old:
        print_note(f"the earlier signature is now {old}")
    print_note(f"signed with the key {made.key}; that {WHAT_IT_PROVES}")
