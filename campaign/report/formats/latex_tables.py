"""LaTeX tables with booktabs and siunitx: natural width, or wrapped to the line."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from campaign.report.latex_text import LONGEST, breakable, cell_numbers, column_head
from campaign.report.page.pieces import Grid

LONG = 30
"""Rows from which on a table may go over pages."""
ROOM = 84
"""Characters of a line of an article in footnotesize; a wider table has its cells wrapped."""
WIDEST = 40
"""Characters from which on a column's words ask for no more room."""
GAP = 3
"""Characters between two columns."""
MANY = 8
"""Columns from which on the letters are smaller."""


def grid_lines(grid: Grid, label: str) -> Iterator[str]:
    """A table with its caption and, below it, its notes. `label`: for references to it."""
    caption = rf"\caption{{{breakable(grid.title)}}}\label{{{label}}}"
    letters = r"\scriptsize" if len(grid.headers) > MANY else r"\footnotesize"
    letters += r"\setlength{\tabcolsep}{4pt}\sisetup{separate-uncertainty,retain-explicit-plus}"
    notes = " ".join(map(breakable, filter(None, (*grid.notes, grid.file))))
    if len(grid.rows) > LONG:
        yield rf"\begingroup{letters}\setlength{{\LTcapwidth}}{{\linewidth}}"
        yield from _long(grid, caption)
        yield rf"\noindent {notes}\par\endgroup" if notes else r"\endgroup"
    else:
        yield r"\begin{table}[htbp]\centering"
        yield rf"{caption if grid.number is not None else _title(grid)}{letters}"
        yield from _short(grid)
        yield rf"\par\smallskip\raggedright {notes}" if notes else ""
        yield r"\end{table}"


def _short(grid: Grid) -> Iterator[str]:
    yield rf"\begin{{tabular}}{{{_columns(grid)}}}"
    yield rf"\toprule {_head(grid)} \midrule"
    yield from _rows(grid)
    yield r"\bottomrule"
    yield r"\end{tabular}"


def _long(grid: Grid, caption: str) -> Iterator[str]:
    """Over as many pages as it takes; the heads are repeated."""
    top = rf"\toprule {_head(grid)} \midrule"
    if grid.number is None:
        yield rf"\noindent {_title(grid)}"
    yield rf"\begin{{longtable}}{{{_columns(grid)}}}"
    yield rf"{caption} \\ {top} \endfirsthead" if grid.number is not None else ""
    yield rf"{top} \endhead"
    yield r"\bottomrule \endfoot"
    yield from _rows(grid)
    yield r"\end{longtable}"
    if grid.number is None:
        yield r"\addtocounter{table}{-1}"  # which every long table counts up


def _title(grid: Grid) -> str:
    return rf"\textbf{{{breakable(grid.title)}}}\par "


def _head(grid: Grid) -> str:
    return rf"{' & '.join(map(column_head, grid.headers))} \\"


def _rows(grid: Grid) -> Iterator[str]:
    right = _right(grid)
    for row in grid.rows:
        cells = (
            cell_numbers(c) if each else breakable(c) for c, each in zip(row, right, strict=True)
        )
        yield rf"{' & '.join(cells)} \\"


def _right(grid: Grid) -> tuple[bool, ...]:
    return grid.right or (False,) * len(grid.headers)


def _columns(grid: Grid) -> str:
    """The column specification; cells wrap where they are wider than a line together."""
    right = _right(grid)
    lines = [grid.headers, *grid.rows]
    widths = [max(len(line[column]) for line in lines) for column in range(len(grid.headers))]
    if sum(widths) + GAP * len(widths) <= ROOM:
        return "".join("r" if each else "l" for each in right)
    words = [max(map(_longest, (line[column] for line in lines))) for column in range(len(widths))]
    asked = _asked([word + GAP for word in words], [min(w, WIDEST) + GAP for w in widths])
    shares = [each / sum(asked) for each in asked]
    return "".join(
        rf">{{\{'raggedleft' if each else 'raggedright'}\arraybackslash}}"
        rf"p{{\dimexpr{share:.4f}\linewidth-2\tabcolsep\relax}}"
        for each, share in zip(right, shares, strict=True)
    )


def _longest(text: str) -> int:
    """Characters of a text's longest word that is not broken."""
    return min(max(map(len, text.split()), default=0), LONGEST)


def _asked(least: Sequence[int], wanted: Sequence[int]) -> list[float]:
    """What each column gets of the room: its longest word, and of the rest as it has more."""
    more = [max(want - word, 0) for want, word in zip(wanted, least, strict=True)]
    spare = max(ROOM - sum(least), 0) / max(sum(more), 1)
    return [word + spare * each for word, each in zip(least, more, strict=True)]
