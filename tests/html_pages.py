"""A page as tests read it."""

from __future__ import annotations

from html.parser import HTMLParser

VOID = {"meta", "link", "br", "img", "input", "hr"}


class Page(HTMLParser):
    """Every element with its attributes and text, and whether the tags are balanced.

    `code` are scripts and styles. `stops` are the elements that the Tab key stops at: the figure
    around it, or "", and its tag.
    """

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.open: list[str] = []
        self.mistakes: list[str] = []
        self.words: list[str] = []
        self.code: list[str] = []
        self.stops: list[tuple[str, str]] = []
        self.figure = ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {k: v or "" for k, v in attrs}))
        if tag == "figure":
            self.figure = dict(attrs).get("id") or ""
        stops = tag in ("a", "button", "summary", "input") or ("tabindex", "0") in attrs
        if stops and ("tabindex", "-1") not in attrs:
            self.stops.append((self.figure, tag))
        if len(dict(attrs)) != len(attrs):
            self.mistakes.append(f"an attribute twice in <{tag}>")
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {k: v or "" for k, v in attrs}))

    def handle_endtag(self, tag: str) -> None:
        if tag == "figure":
            self.figure = ""
        if not self.open or self.open.pop() != tag:
            self.mistakes.append(f"</{tag}> closes something else")

    def handle_data(self, data: str) -> None:
        unseen = self.open and self.open[-1] in ("script", "style")
        (self.code if unseen else self.words).append(data)

    def all(self, tag: str) -> list[dict[str, str]]:
        return [attrs for name, attrs in self.elements if name == tag]

    @property
    def text(self) -> str:
        """All words that are seen, in one line."""
        return " ".join(" ".join(self.words).split())
