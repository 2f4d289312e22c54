"""LaTeX tables with booktabs and siunitx: natural width, or wrapped to the line width."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from campaign.report.latex_text import LONGEST, breakable, cell_numbers, column_head
from campaign.report.page.pieces import Grid

LONG = 30
"""Maximum number of rows of a table without page breaks."""
ROOM = 84
"""Characters of a line of an article in footnotesize; cells of a wider table are wrapped."""
WIDEST = 40
"""Limit of the requested width of a column (characters)."""
GAP = 3
"""Gap between two columns (characters)."""
MANY = 8
"""Maximum number of columns in the normal size of letters."""


def grid_lines(grid: Grid, label: str) -> Iterator[str]:
    """Table with its caption above and its notes below. `label`: for references to it."""
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
    """Table with page breaks and repeated headings."""
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
        yield r"\addtocounter{table}{-1}"  # every long table increments it


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
    """Column specification; cells are wrapped if the table is wider than a line."""
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
    """Length of the longest word of a text, at most `LONGEST` (longer words are broken)."""
    return min(max(map(len, text.split()), default=0), LONGEST)


def _asked(least: Sequence[int], wanted: Sequence[int]) -> list[float]:
    """Width of each column (characters): its minimum, and a share of the spare width."""
    more = [max(want - word, 0) for want, word in zip(wanted, least, strict=True)]
    spare = max(ROOM - sum(least), 0) / max(sum(more), 1)
    return [word + spare * each for word, each in zip(least, more, strict=True)]
