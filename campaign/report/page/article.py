"""A page of pieces: comparisons, trends, identifications."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, TypeVar

from campaign.api.analysis import one_line
from campaign.report.page.drawings import Drawing
from campaign.report.page.folder import Folder, ShownFigure
from campaign.report.page.pieces import Facts, Heading, Items, Paragraph, Piece
from campaign.report.palette import Look
from campaign.result import Figure
from campaign.text import count

T = TypeVar("T")


@dataclass(frozen=True)
class Part:
    """A section.

    Attributes:
        contents: its entry in the table of contents; default: its heading.
    """

    anchor: str
    heading: str
    pieces: tuple[Piece, ...]
    contents: str = ""
    role: Literal["", "test", "problems"] = ""


@dataclass(frozen=True)
class Article:
    """A page: title, facts and sections in order.

    Attributes:
        kind: kind of page, in a word.
        command: command that writes it.
        facts: groups of facts, with a letter if there are several.
        folder: figures and tables beside it.
        content: data for its JSON file only.
    """

    kind: str
    command: str
    title: str
    lede: str
    facts: tuple[tuple[str, tuple[tuple[str, str], ...]], ...]
    parts: tuple[Part, ...]
    folder: Folder
    content: Mapping[str, Any] = field(default_factory=dict)

    def pieces(self) -> Iterator[Piece]:
        """All pieces of the page, in order."""
        yield Heading(1, self.title)
        yield Paragraph(self.lede)
        for letter, pairs in self.facts:
            yield Facts(tuple((f"{letter}: {name}" if letter else name, t) for name, t in pairs))
        for part in self.parts:
            yield Heading(2, part.heading, part.anchor)
            yield from part.pieces


@dataclass
class PageParts:
    """Files and problems that the layout of a page collects."""

    folder: Folder = field(default_factory=Folder)
    problems: list[str] = field(default_factory=list)

    def attempt(self, what: str, make: Callable[[], T]) -> T | None:
        """Result of `make`, or None and a problem: one bad figure must not prevent the page."""
        try:
            return make()
        except Exception as error:  # noqa: BLE001 (a plug-in may raise anything)
            self.problems.append(f"{what} cannot be shown: {one_line(error)}")
            return None

    def drawn(
        self, figure: Figure, prefix: str = "", looks: Mapping[str, Look] | None = None
    ) -> ShownFigure | None:
        """A figure of the page; None, and a problem, if it cannot be drawn.

        prefix: prefix of its file name. looks: looks of the page's series; default: its own.
        """

        def shown() -> ShownFigure:
            made, name = Drawing(figure, looks=looks).made(), f"{prefix}{figure.key}"
            return self.folder.figure(figure, made, (), name, trials=figure.trials, looks=looks)

        return self.attempt(f"{prefix}{figure.key}", shown)


def damage_text(what: str, damaged: Sequence[object]) -> str:
    """Sentence on the damage of an archive and its effect."""
    places = count(len(damaged), "place")
    return f"{what}: the archive is damaged in {places}; what cannot be read takes no part."


def problems_part(what: str, told: Sequence[str]) -> tuple[Part, ...]:
    """Section of problems; none without problems."""
    if not told:
        return ()
    return (Part("problems", f"Problems with {what}", (Items(tuple(told)),), role="problems"),)
