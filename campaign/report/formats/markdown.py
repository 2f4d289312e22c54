"""`NAME.md`: for GitHub and pandoc, with the figures and tables of the folder beside it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from campaign.report.formats.interface import Format, WrittenPage
from campaign.report.output import write_files
from campaign.report.page.folder import ShownFigure
from campaign.report.page.pieces import (
    Facts,
    Grid,
    Heading,
    Items,
    Paragraph,
    Piece,
    Source,
    all_plain,
    caption,
)

_SIGNS = re.compile(r"([\\`*_{}\[\]<>|~$^#@&])")
"""Start of markup of GitHub or pandoc within a line: code, emphasis, links, HTML, maths, entities,
citations, sub- and superscripts."""
_ADDRESS = re.compile(r"://|\bwww\.|:(?=[a-z_+-][a-z0-9_+-]*:)", re.IGNORECASE)
"""Text that becomes a link or an emoji without markup."""
_FIRST = re.compile(r"^([-+=:%]|\d+(?=[.)]))")
"""Start of a list, a rule, a definition or a title at the beginning of a line."""


def write(written: WrittenPage) -> None:
    """Add `NAME.md`."""
    text = "\n\n".join(map(_written, all_plain(written.pieces))) + "\n"
    write_files(written.folder, [(f"{written.name}.md", text)])


def escaped(text: str) -> str:
    """Escape text within a line or a cell: one line that looks the same and has no markup."""
    line = _SIGNS.sub(r"\\\1", " ".join(text.split()))
    return _ADDRESS.sub(lambda found: found[0].replace(":", "&#58;").replace(".", "&#46;"), line)


def paragraph(text: str) -> str:
    """Escape text at the beginning of a line."""
    line = escaped(text)
    first = _FIRST.match(line)
    if first is None:
        return line
    if first[0].isdigit():
        return f"{first[0]}\\{line[first.end() :]}"
    return f"\\{line}"


def _written(piece: Piece) -> str:
    return "\n\n".join(_lines(piece))


def _lines(piece: Piece) -> Iterator[str]:
    match piece:
        case Heading():
            yield f"{'#' * piece.level} {escaped(piece.text)}"
        case Paragraph():
            yield (
                f"> **Mind:** {escaped(piece.text)}"
                if piece.role == "warning"
                else paragraph(piece.text)
            )
        case Items():
            yield "\n".join(f"- {paragraph(text)}" for text in piece.texts)
        case Facts():
            pairs = (f"- **{escaped(name)}:** {escaped(value)}" for name, value in piece.pairs)
            yield "\n".join(pairs)
        case ShownFigure():
            yield f"![{escaped(piece.title)}]({piece.file})"
            words = escaped(caption(piece))
            yield f"**Figure {piece.number}. {escaped(piece.title)}.** {words}"
        case Grid():
            yield from _grid(piece)
        case Source():
            yield f"{paragraph(piece.title)}:"
            yield _fenced(piece)


def _grid(grid: Grid) -> Iterator[str]:
    number = "" if grid.number is None else f"Table {grid.number}. "
    yield f"**{number}{escaped(grid.title)}**"
    rule = [":---"] * len(grid.headers)
    for column, right in enumerate(grid.right):
        rule[column] = "---:" if right else ":---"
    head = [_row(map(escaped, grid.headers)), _row(rule)]
    yield "\n".join([*head, *(_row(map(escaped, row)) for row in grid.rows)])
    notes = [paragraph(" ".join(grid.notes))] if grid.notes else []
    if grid.file:
        notes.append(f"[{grid.file}]({grid.file})")
    if notes:
        yield " ".join(notes)


def _row(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _fenced(source: Source) -> str:
    """Verbatim text between fences that are longer than any in it."""
    longest = max(map(len, re.findall("`+", source.text)), default=0)
    fence = "`" * max(3, longest + 1)
    return f"{fence}{source.language}\n{source.text.rstrip()}\n{fence}"


FORMAT = Format("markdown", "report.md, for GitHub and pandoc.", write)
