"""`campaign verify`: integrity of archives, byte by byte, and who signed them."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from campaign import signing
from campaign.archive import find_runs
from campaign.archive.layout.signature_file import has_signature, read_signature, signature_path
from campaign.archive.reading.damage import Damage
from campaign.archive.reading.damage_words import in_words
from campaign.archive.reading.results_file import OtherLayoutError, holds_results, read_any_results
from campaign.archive.verification.result import Verification
from campaign.archive.verification.statement import run_statement
from campaign.archive.verification.verify_run import verify_run
from campaign.cli.output import error_console, print_json, print_line, print_note
from campaign.cli.sign import WHAT_IT_PROVES
from campaign.errors import ArchiveError, ExitCode, UsageError


def verify_archives(
    names: Sequence[str], results: Path, *, as_json: bool, wanted: ExpectedSigner | None = None
) -> ExitCode:
    """Verify the runs that `names` mean; ARCHIVE when anything is wrong with any of them.

    A run without the signature that is `wanted` is wrong, too; results have none. Results, which
    `*.nxs` means as well when a shell spells it out, are held against their own hash.
    """
    paths = list(dict.fromkeys(path for name in names for path in find_runs(results, name)))
    found = []
    for path in paths:
        if holds_results(path):
            kept = _of_results(path)
            found.append((kept, check_signature(path, None)))
            if kept.sound and not as_json:
                print_line(f"{path}: sound (holds results of a run, and no run)")
            elif not as_json:
                _print_problems(kept)
            continue
        with _progress(path) as progress:
            found.append((verify_run(path, progress), check_signature(path, wanted)))
        if not as_json:
            _print(*found[-1])
    if as_json:
        print_json([_tree(*one) for one in found])
    good = all(run.sound and signature.valid is not False for run, signature in found)
    return ExitCode.DONE if good else ExitCode.ARCHIVE


def _of_results(path: Path) -> Verification:
    """Whether a file of results is as it was written; it has no trials and no seal."""
    problems: tuple[Damage, ...] = ()
    try:
        read_any_results(path)
    except OtherLayoutError:
        pass  # its hash was right
    except ArchiveError as error:
        problems = (Damage.of(path, error),)
    return Verification(path, problems, remarks=(), trials=0, datasets=0)


def _print_problems(found: Verification) -> None:
    for damage in found.problems:
        print_line(f"{found.path}: {in_words(damage)}")


def _print(found: Verification, signature: SignatureCheck) -> None:
    """One line per problem on standard output; one when there is none; one for a signature."""
    _print_problems(found)
    if found.sound:
        root = f", seal {found.root}" if found.root else ""
        print_line(f"{found.path}: sound ({found.trials} trials, {found.datasets} datasets{root})")
    for damage in found.remarks:
        print_note(f"{found.path}: note: {damage}", style="yellow")
    if signature.valid and not found.sound:
        print_line(f"{signature.text}; but the run is not what was signed")
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
    """A bar on a terminal; what is read is about twice what the run has in bytes."""
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
            "--signer NAME and --allowed-signers FILE belong together: the expected "
            "signer, and the file with the keys of signers"
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
