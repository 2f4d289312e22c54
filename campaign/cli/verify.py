"""`campaign verify`: integrity of archives, byte by byte, and their signatures."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from campaign import signing
from campaign.archive.layout.signature_file import has_signature, read_signature, signature_path
from campaign.archive.reading.damage import Damage
from campaign.archive.reading.damage_words import in_words
from campaign.archive.reading.results_file import OtherLayoutError, holds_results, read_any_results
from campaign.archive.reading.run_list import find_runs
from campaign.archive.verification.result import Verification
from campaign.archive.verification.statement import run_statement
from campaign.archive.verification.verify_run import verify_run
from campaign.cli.output import error_console, print_json, print_line, print_note, print_warning
from campaign.cli.sign import WHAT_IT_PROVES
from campaign.errors import ArchiveError, ExitCode, UsageError


def verify_archives(
    names: Sequence[str], results: Path, *, as_json: bool, wanted: ExpectedSigner | None = None
) -> ExitCode:
    """Verify the runs that `names` match; return ARCHIVE if any is damaged.

    A run without the `wanted` signature fails, too. Results files, which a shell's `*.nxs` also
    matches, have no signature and are verified against their own hash.
    """
    paths = list(dict.fromkeys(path for name in names for path in find_runs(results, name)))
    checks = []
    for path in paths:
        if holds_results(path):
            kept = _of_results(path)
            checks.append((kept, check_signature(path, None)))
            if kept.sound and not as_json:
                print_line(f"{path}: sound (results of a run, not a run)")
            elif not as_json:
                _print_problems(kept)
            continue
        with _progress(path) as progress:
            checks.append((verify_run(path, progress), check_signature(path, wanted)))
        if not as_json:
            _print(*checks[-1])
    if as_json:
        print_json([_tree(*one) for one in checks])
    good = all(run.sound and signature.valid is not False for run, signature in checks)
    return ExitCode.DONE if good else ExitCode.ARCHIVE


def _of_results(path: Path) -> Verification:
    """Verification of a results file, which has no trials and no seal."""
    problems: tuple[Damage, ...] = ()
    try:
        read_any_results(path)
    except OtherLayoutError:
        pass  # its hash matches
    except ArchiveError as error:
        problems = (Damage.of(path, error),)
    return Verification(path, problems, remarks=(), trials=0, datasets=0)


def _print_problems(found: Verification) -> None:
    for damage in found.problems:
        print_line(f"{found.path}: {in_words(damage)}")


def _print(found: Verification, signature: SignatureCheck) -> None:
    """Print one line per problem, or one line without problems, and a line on the signature."""
    _print_problems(found)
    if found.sound:
        root = f", seal {found.root}" if found.root else ""
        print_line(f"{found.path}: sound ({found.trials} trials, {found.datasets} datasets{root})")
    for damage in found.remarks:
        print_warning(f"{found.path}: note: {damage}")
    if signature.valid and not found.sound:
        print_line(f"{signature.text}; but the run differs from the signed one")
    elif signature.valid is not None:
        print_line(signature.text)
    elif signature.text:
        print_note(signature.text)


def _tree(found: Verification, signature: SignatureCheck) -> dict[str, object]:
    return {
        "path": str(found.path),
        "sound": found.sound,
        "trials": found.trials,
        "datasets": found.datasets,
        "seal": found.root,
        "problems": [vars(damage) for damage in found.problems],
        "remarks": [vars(damage) for damage in found.remarks],
        "signature": vars(signature),
    }


@contextlib.contextmanager
def _progress(path: Path) -> Iterator[Callable[[int], object]]:
    """Progress bar on a terminal; verification reads about twice the bytes of the run."""
    console = error_console()
    if not console.is_terminal:
        yield lambda count: None
        return
    from rich.progress import BarColumn, DownloadColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}", markup=False), BarColumn(), DownloadColumn())
    with Progress(*columns, TimeRemainingColumn(), console=console, transient=True) as bar:
        task = bar.add_task(path.name, total=2 * _bytes(path))
        yield lambda count: bar.advance(task, count)


def _bytes(path: Path) -> int:
    files = path.iterdir() if path.is_dir() else [path]
    with contextlib.suppress(OSError):
        return sum(file.stat().st_size for file in files)
    return 0


RECOMPUTED = "a changed run can have new checksums; only a signature shows the change"


@dataclass(frozen=True)
class ExpectedSigner:
    """Required signer of a run, and the allowed keys."""

    signer: str
    allowed: signing.AllowedSigners


@dataclass(frozen=True)
class SignatureCheck:
    """Result of the check of one run's signature.

    Attributes:
        file: name of the signature file; empty without one.
        valid: None if not checked.
        text: message of one line; empty for an unsealed run, which cannot have a signature.
        key: kind and fingerprint of a valid key.
    """

    file: str
    valid: bool | None
    text: str
    key: str = ""


def wanted_signature(signer: str | None, allowed: Path | None) -> ExpectedSigner | None:
    """Signer from the two options of `verify`. Raises UsageError if they are unusable."""
    if signer is None and allowed is None:
        return None
    if not signer or allowed is None:
        raise UsageError(
            "--signer NAME and --allowed-signers FILE belong together: the expected "
            "signer, and the file with the keys of signers"
        )
    signing.check_tool()
    return ExpectedSigner(signer, signing.AllowedSigners.read(allowed))


def check_signature(run: Path, wanted: ExpectedSigner | None) -> SignatureCheck:
    """Check the run for the wanted signature. Raises UsageError if the check is not possible."""
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
        hint = "use --signer NAME --allowed-signers FILE"
        return SignatureCheck(
            file, None, f"{run}: note: {file} was not checked ({hint}); {RECOMPUTED}"
        )
    return SignatureCheck("", None, f"{run}: note: not signed; {RECOMPUTED}")
