"""Printing: rich on a terminal, plain lines elsewhere. No text from a file is read as markup.

What a file, a line or a command line has brought must not command the terminal. Two doors see to
it, whoever prints: inside of `plain_streams`, whatever is written to standard output or standard
error loses its control characters; the consoles of this module write past that, and take them out
of what they are given before they add their own.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TextIO, cast

from rich import box
from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from campaign.plain_text import json_text, printable


class PlainConsole(Console):
    """A console that obeys nothing in what it prints; cursor and colours are its own."""

    def __init__(self, stream: TextIO) -> None:
        super().__init__(file=_beneath(stream), markup=False, highlight=False, emoji=False)

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterator[Segment]:
        """The pieces of what is printed, each without control characters but line ends."""
        for text, style, control in super().render(renderable, options):
            yield Segment(text if control else _plain(text), style, control)


class PlainStream:
    """A text stream without control characters but tabs and line ends."""

    def __init__(self, stream: TextIO) -> None:
        self.beneath = stream

    def write(self, text: str) -> int:
        self.beneath.write(_plain(text))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        if name == "buffer":  # there is no way past
            raise AttributeError(name)
        return getattr(self.beneath, name)


@contextmanager
def plain_streams() -> Iterator[None]:
    """Inside the block, `sys.stdout` and `sys.stderr` are plain: for warnings and usage errors."""
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (stream and cast(TextIO, PlainStream(stream)) for stream in before)
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before


def _beneath(stream: TextIO) -> TextIO:
    """What a plain stream writes to, also while a live display has put itself in front."""
    stream = getattr(stream, "rich_proxied_file", stream)
    return stream.beneath if isinstance(stream, PlainStream) else stream


def console() -> Console:
    """Standard output: what a command was asked for."""
    return PlainConsole(sys.stdout)


def error_console() -> Console:
    """Standard error: progress, warnings, everything else."""
    return PlainConsole(sys.stderr)


def print_line(text: str = "") -> None:
    """One line of output as it is, never wrapped by us."""
    console().print(Text(_plain(text)), soft_wrap=True)


def print_note(text: str, style: str = "") -> None:
    """One line on standard error."""
    error_console().print(Text(_plain(text), style=style), soft_wrap=True)


def print_json(tree: Any) -> None:
    """For machines: every letter of every text, escaped where it is not printable."""
    print_line(json_text(tree))


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
    return printable(text, keep="\n\t")


def bytes_text(count: int) -> str:
    """Bytes for people, decimal: `14.2 MB`."""
    size, unit = float(count), "B"
    for unit in ("B", "kB", "MB", "GB", "TB"):
        if size < 1000 or unit == "TB":
            break
        size /= 1000
    return f"{size:.0f} {unit}" if unit == "B" else f"{size:.1f} {unit}"
