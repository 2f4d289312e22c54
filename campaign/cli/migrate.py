"""`campaign migrate`: protocols and benches of an older schema, brought forward."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from pathlib import Path

from campaign.cli.output import print_line, print_note
from campaign.errors import ExitCode, ProtocolError, UsageError
from campaign.protocol.files import UnreadableError, read_source, read_text
from campaign.protocol.migrations import Change, Kind, kind_of, migrate, newest


def migrate_files(files: Sequence[Path], output: Path | None, *, check: bool) -> ExitCode:
    """Rewrite each file in the present schema, or only say what that would change.

    DONE when nothing is left to do; TRIALS_FAILED (1) when a person has to decide something, or
    when `check` finds anything. Nothing is written of a file that a person has to look at, and
    nothing at all when one of them cannot be read (UsageError, ProtocolError).
    """
    if output is not None and (len(files) != 1 or output.exists()):
        why = "is there already" if output.exists() else "is one file; migrate one at a time"
        raise UsageError(f"--output {output}: {why}")
    left = False
    for file, (kind, text, changes) in [(file, migrated(file)) for file in files]:
        by_hand = any(change.by_hand for change in changes)
        left |= by_hand or (check and bool(changes))
        for change in changes:
            _say(file, change, planned=check or by_hand)
        if not changes:
            print_line(f"{file}: {kind} schema {newest(kind)}, nothing to change")
        if by_hand:
            print_note(f"{file}: not written: decide that first, then migrate again", "yellow")
        elif not check and (changes or output is not None):
            _write(output or file, text)
            print_line(f"{output or file}: {kind} schema {newest(kind)} now")
    return ExitCode.TRIALS_FAILED if left else ExitCode.DONE


def migrated(file: Path) -> tuple[Kind, str, list[Change]]:
    """What kind of file it is, its text in the present schema, and what had to change."""
    import tomlkit
    from tomlkit.exceptions import TOMLKitError

    try:
        source = read_source(file, file.name)
        written = read_text(file)
    except UnreadableError as error:
        raise UsageError(f"{file}: {error}") from None
    if not isinstance(source, list):
        kind = kind_of(source.tree)
        source = read_source(file, file.name, newest(kind))  # which knows other schemas
    if isinstance(source, list):
        raise ProtocolError(source)
    text = written.replace("\r\n", "\n")
    try:
        document = tomlkit.parse(text)
    except TOMLKitError as error:  # what tomllib accepts, and this does not
        raise UsageError(f"{file}: cannot be edited: {error}") from None
    changes = migrate(document, kind)
    if not changes:
        return kind, written, changes
    if "schema" in document:
        document["schema"] = newest(kind)
        text = document.as_string()
    else:
        text = f"schema = {newest(kind)}\n{document.as_string()}"
    return kind, text.replace("\n", "\r\n") if "\r\n" in written else text, changes


def _say(file: Path, change: Change, *, planned: bool) -> None:
    if change.by_hand:
        print_line(f"{file}: {change.place}: BY HAND: {change.what}")
    else:
        print_line(f"{file}: {change.place}: {'to do: ' if planned else ''}{change.what}")


def _write(file: Path, text: str) -> None:
    """In place of what is there, whole or not at all, with its permissions."""
    try:
        target = file.resolve()  # a link stays a link
        handle, name = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
        try:
            with os.fdopen(handle, "wb") as out:
                out.write(text.encode())
                out.flush()
                os.fsync(out.fileno())
            mode = target.stat().st_mode & 0o777 if target.exists() else 0o666 & ~_umask()
            Path(name).chmod(mode)
            Path(name).replace(target)
        except BaseException:
            Path(name).unlink(missing_ok=True)
            raise
    except OSError as error:
        raise UsageError(f"{file}: cannot be written: {error.strerror}") from None


def _umask() -> int:
    mask = os.umask(0o077)
    os.umask(mask)
    return mask
