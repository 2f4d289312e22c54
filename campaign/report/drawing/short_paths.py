"""Paths and numbers of a drawing as short as SVG reads them, to a hundredth of a point."""

from __future__ import annotations

import re
from collections.abc import Sequence


def short_path(text: str) -> str:
    """The same path with steps in place of places, in hundredths that do not add up to an error."""
    if re.search(r"[^MLCQz0-9.\s-]", text):
        return text  # not as matplotlib writes paths
    parts = re.findall(r"([A-Za-z])([^A-Za-z]*)", text)
    written: list[str] = []
    here = start = (0, 0)
    last = ""
    for command, numbers in parts:
        values = [hundredths(number) for number in numbers.split()]
        points = list(zip(values[::2], values[1::2], strict=True))
        if command == "z":
            written.append("z")
            here, last = start, "z"
            continue
        alone = last == "m"  # a dot, perhaps
        if command == "L" and points == [here] and not alone:
            continue
        letter, steps = _step(command, here, points)
        # What follows a move without a letter is a line.
        same = (letter == last and letter != "m") or (letter, last) == ("l", "m")
        written.append(_joined(steps) if same else letter + _joined(steps))
        if same and not written[-1].startswith("-"):
            written[-1] = " " + written[-1]
        here = points[-1]
        start = here if command == "M" else start
        last = letter
    return "".join(written)


def _step(
    command: str, here: tuple[int, int], points: Sequence[tuple[int, int]]
) -> tuple[str, list[int]]:
    """The relative command and its numbers; straight ones need one number."""
    steps = [value - origin for point in points for value, origin in zip(point, here, strict=True)]
    if command == "L" and not steps[1]:
        return "h", steps[:1]
    if command == "L" and not steps[0]:
        return "v", steps[1:]
    return command.lower(), steps


def _joined(values: Sequence[int]) -> str:
    text = ""
    for value in values:
        shown = short_number(value)
        text += shown if not text or shown.startswith("-") else f" {shown}"
    return text


def hundredths(number: str) -> int:
    """A number in whole hundredths, in which steps add up without an error."""
    return round(100 * float(number))


def short_number(hundredths: int) -> str:
    """`12.5`, `-.05`: a number as short as SVG reads it."""
    whole, rest = divmod(abs(hundredths), 100)
    text = f"{whole or ''}{f'.{rest:02}'.rstrip('0') if rest else ''}" or "0"
    return f"-{text}" if hundredths < 0 else text
