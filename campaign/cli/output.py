"""Printing: rich on a terminal, plain lines elsewhere; no markup from files.

Text from a file, a serial line or the command line must not control the terminal. Two filters
remove control characters. `plain_streams` filters all writes to standard output and standard error.
The consoles of this module bypass these streams; they filter their input and then add their own
control characters.
"""

from __future__ import annotations

import io
import os
import shlex
import shutil
import signal
import subprocess
import sys
import textwrap
import time
import webbrowser
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO, cast

from rich import box
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderableType
from rich.measure import Measurement
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from campaign.plain_text import json_text, printable

TYPED = "  campaign "
"""Start of a line with a command to type, which is never wrapped."""
INTERVAL = 10.0
"""Seconds between two lines of one phase without redrawing."""
ONE_LINE = 20
"""Longest cell of a table, in characters, that is never wrapped."""


_ours: TextIO | None = None
"""Standard output while `sys.stdout` is something else."""


class PlainConsole(Console):
    """A console that removes control characters from its input; cursor and colors are its own."""

    def __init__(self, stream: TextIO) -> None:
        super().__init__(file=_beneath(stream), markup=False, highlight=False, emoji=False)

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterator[Segment]:
        """Segments of the output without control characters except tabs and line ends."""
        for text, style, control in super().render(renderable, options):
            yield Segment(text if control else _plain(text), style, control)


class PlainStream:
    """A text stream without control characters except tabs and line ends."""

    def __init__(self, stream: TextIO) -> None:
        self.beneath = stream

    def write(self, text: str) -> int:
        self.beneath.write(_plain(text))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        if name == "buffer":  # it would bypass the filter
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


@contextmanager
def redirect_prints() -> Iterator[None]:
    """Inside the block `print` goes to standard error, and standard output is for this module."""
    global _ours
    before, _ours = _ours, sys.stdout
    sys.stdout = sys.stderr
    try:
        yield
    finally:
        sys.stdout, _ours = _ours, before


class _Kept(io.StringIO):
    """Buffer for output to a terminal."""

    def isatty(self) -> bool:
        return True


@contextmanager
def paged() -> Iterator[None]:
    """Inside the block, buffer output to a terminal.

    Output longer than the screen goes to the program `PAGER` (`less`; "" or `cat` for none).
    """
    before = sys.stdout
    if before is None or not before.isatty():
        yield
        return
    kept = _Kept()
    sys.stdout = cast(TextIO, PlainStream(kept))
    try:
        yield
    finally:
        sys.stdout = before
        text = kept.getvalue()
        pager = shlex.split(os.environ.get("PAGER", "less"))
        long = text.count("\n") >= shutil.get_terminal_size().lines
        if not (long and pager and shutil.which(pager[0]) and _paged(pager, text)):
            _beneath(before).write(text)


def _paged(command: Sequence[str], text: str) -> bool:
    """Whether a pager has shown the text; `less` keeps colors, as with `git`."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the pager
    try:
        environment = {"LESS": "FRX", **os.environ}
        done = subprocess.run(command, input=text, text=True, encoding="utf-8", env=environment)  # noqa: S603 (the user's)
    except OSError:
        return False
    finally:
        signal.signal(signal.SIGINT, before)
    return done.returncode not in (126, 127)


def _beneath(stream: TextIO) -> TextIO:
    """Stream below a plain stream, also during a live display."""
    stream = getattr(stream, "rich_proxied_file", stream)
    return stream.beneath if isinstance(stream, PlainStream) else stream


def console() -> Console:
    """Console for standard output: the requested output of a command."""
    return PlainConsole(_ours or sys.stdout)


def error_console() -> Console:
    """Console for standard error: progress, warnings, everything else."""
    return PlainConsole(sys.stderr)


def on_a_terminal() -> bool:
    """Whether the output is a terminal."""
    return console().is_terminal


def print_line(text: str = "", hang: int = 0) -> None:
    """Print one line; on a terminal it is wrapped between words.

    hang: further indent, in columns, of wrapped lines.
    """
    _print_words(console(), Text(_plain(text)), hang)


def print_text(text: str) -> None:
    """Print text without wrapping, also on a terminal."""
    (_ours or sys.stdout).write(text)


def print_note(text: str, style: str = "") -> None:
    """Print one line on standard error, like `print_line`."""
    _print_words(error_console(), Text(_plain(text), style=style))


def print_warning(text: str) -> None:
    """Print a note on a problem that does not end the command."""
    print_note(text, "yellow")


def _print_words(out: Console, text: Text, hang: int = 0) -> None:
    """Print text; on a terminal, wrap lines that are too long."""
    if out.is_terminal:
        text = Text(_broken(text.plain, out.width, hang), style=text.style)
    out.print(text, soft_wrap=True)


def _wrapped(line: str, width: int, hang: int) -> str:
    if line.startswith(TYPED):
        return line
    text = line.lstrip()
    indent = line[: len(line) - len(text)]
    return textwrap.fill(
        _joined(text),
        width,
        initial_indent=indent,
        subsequent_indent=indent + " " * hang,
        break_long_words=False,
        break_on_hyphens=False,
    )


@contextmanager
def waiting(first: str) -> Iterator[Callable[[str, str], None]]:
    """Show progress on standard error; yields a function of the phase and the full text.

    On a terminal, one line redrawn in place, first with `first`. Elsewhere, a line for each phase,
    at most every `INTERVAL` seconds.
    """
    out = error_console()
    if out.is_terminal and not out.is_dumb_terminal:
        with out.status(first) as status:
            yield lambda phase, text: status.update(Text(text))
        return
    printed: dict[str, float] = {}

    def show(phase: str, text: str) -> None:
        now = time.monotonic()
        if now - printed.get(phase, -INTERVAL) >= INTERVAL:
            printed[phase] = now
            print_note(text)

    yield show


def _joined(text: str) -> str:
    """Text with no-break spaces around ±, so that a number and its uncertainty stay together."""
    return text.replace(" ± ", "\xa0±\xa0")


def open_page(page: Path) -> None:
    """Open a page in a browser; print a note without a browser."""
    if not webbrowser.open(page.resolve().as_uri()):
        print_warning("no browser available; open the file manually")


def print_json(tree: Any) -> None:
    """Print JSON; unprintable characters are escaped, none is removed."""
    print_text(f"{json_text(tree)}\n")  # wrapped lines would be no JSON


def print_table(
    headings: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    spare: Sequence[str] = (),
    beside: bool = False,
) -> None:
    """Print a table on a terminal, tab-separated lines elsewhere.

    On a terminal no word is broken. `spare` columns are left out in their order until the others
    fit; a line below names them. If no table fits, each row is printed with one cell per line.

    beside: print on standard error.
    """
    out = error_console() if beside else console()
    if not out.is_terminal:
        for row in (headings, *rows):
            line = "\t".join(_plain(" ".join(cell.split())) for cell in row)
            (sys.stderr if beside else _ours or sys.stdout).write(f"{line}\n")
        return
    shown = [[_joined(_plain(cell)) for cell in row] for row in (headings, *rows)]
    fitting = _fitting(out, list(zip(*shown, strict=True)), list(spare))
    if fitting is None:
        for row in shown[1:]:
            _print_record(out, headings, row)
        return
    out.print(fitting)
    headers = {str(column.header) for column in fitting.columns}
    if missing := [heading for heading in headings if heading not in headers]:
        note = f"left out: {', '.join(missing)}; with `| cat` all is shown"
        _print_words(out, Text(note, style="dim"))


def print_section(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print an empty line and a table; nothing without rows."""
    if rows:
        print_line()
        print_table(headings, rows)


def _fitting(out: Console, columns: list[tuple[str, ...]], spare: list[str]) -> Table | None:
    """Table that fits the terminal; None if that is not possible."""
    unlimited = out.options.update(width=1_000_000)
    while True:
        widths = [_least(column) for column in columns]
        left = out.width - Measurement.get(out, unlimited, _table(columns, widths)).minimum
        if left >= 0:
            return _table(columns, _shared(columns, widths, left))
        if not spare:
            return None
        without = spare.pop(0)
        columns = [column for column in columns if column[0] != without]


def _least(column: Sequence[str]) -> int:
    """Least width without broken words; short cells and names stay in one line."""
    whole = all(cell_len(cell) <= ONE_LINE or " " not in cell for cell in column)
    parts = (part for cell in column for part in ([cell] if whole else cell.split(" ")))
    return max(cell_len(line) for part in parts for line in part.split("\n"))


def _shared(columns: Sequence[Sequence[str]], widths: list[int], left: int) -> list[int]:
    """Widths with the free width of a line shared between the columns, least need first."""
    needs = [max(map(cell_len, column)) - at for column, at in zip(columns, widths, strict=True)]
    wider = list(widths)
    for place, each in enumerate(order := sorted(range(len(needs)), key=needs.__getitem__)):
        more = min(needs[each], left // (len(order) - place))
        wider[each] += more
        left -= more
    return wider


def _table(columns: Sequence[Sequence[str]], widths: Sequence[int]) -> Table:
    """Table from columns of these widths, each with its heading first."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for column, width in zip(columns, widths, strict=True):
        table.add_column(column[0], width=width)
    for row in list(zip(*columns, strict=True))[1:]:
        cells = zip(row, widths, strict=True)
        table.add_row(*(Text(_broken(cell, width)) for cell, width in cells))
    return table


def _broken(text: str, width: int, hang: int = 0) -> str:
    """Text with each line wrapped to that width."""
    return "\n".join(_wrapped(line, width, hang) for line in text.split("\n"))


def _print_record(out: Console, headings: Sequence[str], row: Sequence[str]) -> None:
    """Print a row that fits in no table: the first cell, then one line per other cell."""
    _print_words(out, Text(row[0], style="bold"))
    wide = max(map(len, headings[1:]), default=0)
    for heading, cell in zip(headings[1:], row[1:], strict=True):
        if cell:
            _print_words(out, Text(f"  {heading:<{wide}}  {cell}"), wide + 2)


def _plain(text: str) -> str:
    return printable(text, keep="\n\t")


def bytes_text(count: int) -> str:
    """Text of a byte count, decimal: `14.2 MB`."""
    size, unit = float(count), "B"
    for unit in ("B", "kB", "MB", "GB", "TB"):
        if size < 1000 or unit == "TB":
            break
        size /= 1000
    return f"{size:.0f} {unit}" if unit == "B" else f"{size:.1f} {unit}"
