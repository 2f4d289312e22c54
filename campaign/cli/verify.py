"""`campaign verify`: integrity of archives, byte by byte."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from campaign.archive import find_runs
from campaign.archive.reading.damage import Damage
from campaign.archive.reading.damage_words import in_words
from campaign.archive.reading.results_file import OtherLayoutError, holds_results, read_any_results
from campaign.archive.verification.result import Verification
from campaign.archive.verification.verify_run import verify_run
from campaign.cli.output import error_console, print_json, print_line, print_note
from campaign.cli.signature import ExpectedSigner, SignatureCheck, check_signature
from campaign.errors import ArchiveError, ExitCode


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
