r"""`NAME.tex` for use in a paper, and `main.tex`, which typesets it alone."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator

from campaign.report.formats.interface import Format, WrittenPage
from campaign.report.formats.latex_tables import grid_lines
from campaign.report.latex_text import breakable, latex
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

MAIN = "main.tex"
FLOATS = (r"\begin{figure}", r"\begin{table}")
SECTIONS = {1: "section", 2: "subsection", 3: "subsubsection"}

HEAD = r"""% Made by campaign from the archive of a run; to be used by \input from another document.
% It needs in the preamble:
%   \usepackage[T1]{fontenc}
%   \usepackage{array,booktabs,longtable,graphicx,siunitx,textcomp}
% and, where the document lies in another folder than this one, before the \input:
%   \newcommand{\reportfolder}{path/to/this/folder}
% Labels are fig:RUN:N and tab:RUN:N, with the numbers of the page. No figure or table leaves its
% section: what waits for a place gets it before the next section, which begins on a new page. With
% the package placeins they stay before their notes as well, and with
% \newcommand{\reportbreak}{\FloatBarrier} there are no new pages. \newcommand{\reportbreak}{} lets
% them go where they like.
\providecommand{\reportfolder}{.}
\providecommand{\reportbreak}{\clearpage}
\providecommand{\reportbarrier}{\ifdefined\FloatBarrier\FloatBarrier\fi}
"""

WRAPPER = r"""% Typesets report.tex alone: pdflatex main, twice. Write your own in its place.
\documentclass[a4paper,10pt]{article}
\usepackage[T1]{fontenc}
\IfFileExists{lmodern.sty}{\usepackage{lmodern}}{}
\usepackage[margin=20mm]{geometry}
\usepackage{array,booktabs,longtable,graphicx,siunitx,textcomp}
\IfFileExists{placeins.sty}{\usepackage{placeins}}{}
\begin{document}
\input{NAME.tex}
\end{document}
"""


def write(written: WrittenPage) -> None:
    """Add `report.tex`, `main.tex`, `report.bib` and the figures as PDF."""
    pdfs, name = written.pdfs, written.name
    body = "\n\n".join(map("\n".join, _in_their_sections(written)))
    texts = {f"{name}.tex": f"{HEAD}\n{body}\n", MAIN: WRAPPER.replace("NAME", name)}
    if written.bibtex:
        texts[f"{name}.bib"] = written.bibtex
    write_files(written.folder, texts.items())
    for name, page in pdfs.items():
        (written.folder / name).write_bytes(page)


def _in_their_sections(written: WrittenPage) -> Iterator[list[str]]:
    """Lines of each piece; before a heading, all floats are placed."""
    floating = False
    for piece in all_plain(written.pieces):
        lines = list(_lines(piece, written))
        if isinstance(piece, Heading):
            if piece.level > 2 and floating:
                lines.insert(0, r"\reportbarrier")
            elif piece.level <= 2 and (floating or piece.anchor.startswith("test-")):
                lines.insert(0, r"\reportbreak")
                floating = False
        floating = floating or any(line.startswith(FLOATS) for line in lines)
        yield lines


def _lines(piece: Piece, written: WrittenPage) -> Iterator[str]:
    match piece:
        case Heading():
            yield rf"\{SECTIONS[piece.level]}{{{latex(piece.text)}}}"
        case Paragraph():
            yield (r"\textbf{Mind:} " if piece.role == "warning" else "") + breakable(piece.text)
        case Items():
            yield from _items(map(breakable, piece.texts))
        case Facts():
            yield from _items(
                rf"\textbf{{{breakable(name)}:}} {breakable(text)}" for name, text in piece.pairs
            )
        case ShownFigure():
            yield from _figure(piece, written.label, written.pdfs)
        case Grid():
            yield from grid_lines(piece, f"tab:{written.label}:{piece.number}")
        case Source():
            yield rf"{latex(piece.title)}: \texttt{{{latex(f'{written.name}.bib')}}}."


def _items(texts: Iterable[str]) -> Iterator[str]:
    yield r"\begin{itemize}\setlength{\itemsep}{0pt}"
    yield from (rf"\item {text}" for text in texts)
    yield r"\end{itemize}"


def _figure(shown: ShownFigure, run: str, pdfs: Collection[str]) -> Iterator[str]:
    file = f"{shown.file.removesuffix('.svg')}.pdf"
    size = r"width=\linewidth,height=0.8\textheight,keepaspectratio"
    title = latex(f"{shown.title}.")
    yield r"\begin{figure}[htbp]\centering"
    if file in pdfs:
        yield rf"\includegraphics[{size}]{{\reportfolder/{file}}}"
    else:
        yield rf"\fbox{{\texttt{{{latex(shown.file)}}}}}"
    yield rf"\caption[{title}]{{\textbf{{{title}}} {breakable(caption(shown))}}}"
    yield rf"\label{{fig:{run}:{shown.number}}}"
    yield r"\end{figure}"


FORMAT = Format(
    "latex", "report.tex for \\input, main.tex, figures as PDF.", write, pdf_figures=True
)
