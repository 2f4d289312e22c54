"""Where the Tab key goes on a page, and how few strokes lead to a figure."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

TOUCH = """() => {
  const e = document.activeElement;
  if (!e || e === document.body || e === document.documentElement) return null;
  if (e.dataset.stop) return { again: Number(e.dataset.stop) };
  window.stops = (window.stops ?? 0) + 1;
  e.dataset.stop = window.stops;
  const href = e.getAttribute("href") ?? "";
  const target = href.startsWith("#") ? document.getElementById(href.slice(1)) : null;
  const order = [...document.querySelectorAll("*")];
  const style = getComputedStyle(e);
  const figure = e.closest("figure");
  const ring = style.outlineStyle !== "none" && parseFloat(style.outlineWidth) >= 2;
  return {
    place: order.indexOf(e),
    target: target ? order.indexOf(target) : -1,
    figure: figure ? [...document.querySelectorAll("figure")].indexOf(figure) : -1,
    shown: ring || style.boxShadow !== "none",
    what: e.outerHTML.slice(0, 120),
  };
}"""
MOST = 3000


@dataclass(frozen=True)
class Stop:
    """A stop of the Tab key.

    Attributes:
        place: in the document's order, of all elements.
        target: the place that a link within the page leads to; -1 for anything else.
        figure: number of the figure that it is in, from 0; -1 for none.
        shown: whether one sees that the focus is there.
    """

    place: int
    target: int
    figure: int
    shown: bool
    what: str


def stops(page) -> list[Stop]:
    """Every stop of the page, by pressing Tab until the first one comes again."""
    found = []
    for _ in range(MOST):
        page.keyboard.press("Tab")
        told = page.evaluate(TOUCH)
        if told is None or "again" in told:
            return found
        found.append(Stop(**told))
    raise AssertionError(f"more than {MOST} stops")


def strokes(found: list[Stop], place: int) -> int:
    """How many stops lead from the top to the element at `place` or, within it, to the first stop.

    A link within the page costs the stops up to it; from its target on the next stop follows.
    """
    goal = next((n for n, stop in enumerate(found) if stop.place >= place), len(found))
    least = {-1: 0}  # number of the stop where one is; -1 is the top
    reached = deque([-1])
    best = len(found) + 1
    while reached:
        here = reached.popleft()
        spent = least[here]
        if here < goal:
            best = min(best, spent + goal - here)
        for number in range(here + 1, len(found)):
            target = found[number].target
            if target < 0:
                continue
            cost = spent + number - here
            if target == place:
                best = min(best, cost)
            after = sum(stop.place < target for stop in found) - 1
            if cost < least.get(after, best):
                least[after] = cost
                reached.append(after)
    return best
