"""Printing: rich on a terminal, plain lines elsewhere. No text from a file is read as markup."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from campaign.plain_text import printable


def console() -> Console:
    """Standard output: what a command was asked for."""
    return Console(file=sys.stdout, markup=False, highlight=False, emoji=False)


def error_console() -> Console:
    """Standard error: progress, warnings, everything else."""
    return Console(file=sys.stderr, markup=False, highlight=False, emoji=False)


def print_line(text: str = "") -> None:
    """One line of output as it is, never wrapped by us."""
    console().print(Text(_plain(text)), soft_wrap=True)


def print_note(text: str, style: str = "") -> None:
    """One line on standard error."""
    error_console().print(Text(_plain(text), style=style), soft_wrap=True)


def print_table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """A table for people on a terminal, tab-separated lines for other programs."""
    out = console()
    if not out.is_terminal:
        for row in (headings, *rows):
            print("\t".join(_plain(" ".join(cell.split())) for cell in row))  # noqa: T201
        return
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for heading in headings:
        table.add_column(heading, overflow="fold")
    for row in rows:
        table.add_row(*(Text(_plain(cell)) for cell in row))
    out.print(table)


def _plain(text: str) -> str:
    """What a file or a line has brought must not command the terminal."""
    return printable(text, keep="\n\t")


def bytes_text(count: int) -> str:
    """Bytes for people, decimal: `14.2 MB`."""
    size, unit = float(count), "B"
    for unit in ("B", "kB", "MB", "GB", "TB"):
        if size < 1000 or unit == "TB":
            break
        size /= 1000
    return f"{size:.0f} {unit}" if unit == "B" else f"{size:.1f} {unit}"
