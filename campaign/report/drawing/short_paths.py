"""Short notation of SVG paths and numbers."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

CURVES = 10
"""Rounding of coordinates in parts of a point: a fifth of a pixel on the widest page ..."""
SIGNS = 100
"""... and of a sign, which is round only with finer coordinates."""


def short_path(text: str, parts: int = CURVES) -> str:
    """Shorten a path: relative steps in integer parts of a point, so that errors do not add up.

    Successive steps in the same direction are merged, which paints the same.
    """
    if re.search(r"[^MLCQz0-9.\s-]", text):
        return text  # no path of matplotlib
    if re.fullmatch(r"[^CQz]*z?\s*", text):
        body, closed, _ = text.partition("z")
        return _straight(body, parts) + closed
    commands = re.findall(r"([A-Za-z])([^A-Za-z]*)", text)
    written: list[str] = []
    here = start = (0, 0)
    last = ""
    for command, numbers in commands:
        values = [whole(number, parts) for number in numbers.split()]
        points = list(zip(values[::2], values[1::2], strict=True))
        if command == "z":
            written.append("z")
            here, last = start, "z"
            continue
        alone = last == "m"  # a dot, perhaps
        if command == "L" and points == [here] and not alone:
            continue
        letter, steps = _step(command, here, points)
        _write(written, last, letter, steps, parts)
        here = points[-1]
        start = here if command == "M" else start
        last = letter
    return "".join(written)


def _straight(text: str, parts: int) -> str:
    """Shorten a path of moves and lines only, as all long paths are."""
    moves = np.array(re.findall("[ML]", text)) == "M"
    if not len(moves):
        return ""
    numbers = np.array(re.sub("[ML]", " ", text).split(), dtype=float)
    places = np.rint(numbers * parts).astype(np.int64).reshape(-1, 2)
    steps = np.diff(places, axis=0, prepend=0)
    after_move = np.concatenate([[False], moves[:-1]])  # a dot, perhaps
    visible = moves | after_move | (steps != 0).any(axis=1)
    steps, moves, after_move = steps[visible], moves[visible], after_move[visible]
    (x, y), (x_before, y_before) = steps.T, np.concatenate([[[0, 0]], steps[:-1]]).T
    onward = (x * y_before == y * x_before) & (x * x_before + y * y_before > 0)
    first = np.flatnonzero(~onward | moves | after_move)
    written: list[str] = []
    last = ""
    for move, (east, north) in zip(
        moves[first].tolist(), np.add.reduceat(steps, first).tolist(), strict=True
    ):
        if move:
            letter, step = "m", [east, north]
        elif not north:
            letter, step = "h", [east]
        else:
            letter, step = ("l", [east, north]) if east else ("v", [north])
        _write(written, last, letter, step, parts)
        last = letter
    return "".join(written)


def _write(written: list[str], last: str, letter: str, steps: Sequence[int], parts: int) -> None:
    # After a move, a step without a letter is a line.
    same = (letter == last and letter != "m") or (letter, last) == ("l", "m")
    numbers = _joined(steps, parts)
    if not same:
        written.append(letter)
    elif not numbers.startswith("-"):
        written.append(" ")
    written.append(numbers)


def _step(
    command: str, here: tuple[int, int], points: Sequence[tuple[int, int]]
) -> tuple[str, list[int]]:
    """Relative command with its numbers; horizontal and vertical lines need one number."""
    steps = [value - origin for point in points for value, origin in zip(point, here, strict=True)]
    if command == "L" and not steps[1]:
        return "h", steps[:1]
    if command == "L" and not steps[0]:
        return "v", steps[1:]
    return command.lower(), steps


def _joined(values: Sequence[int], parts: int) -> str:
    text = ""
    for value in values:
        shown = short_number(value, parts)
        text += shown if not text or shown.startswith("-") else f" {shown}"
    return text


def whole(number: str, parts: int = CURVES) -> int:
    """A number in integer parts of a point, in which steps add up without error."""
    return round(parts * float(number))


@lru_cache(maxsize=8192)
def short_number(value: int, parts: int = CURVES) -> str:
    """Shortest SVG notation of a number of parts: `12.5`, `-.05`."""
    before, behind = divmod(abs(value), parts)
    digits = len(str(parts)) - 1
    text = f"{before or ''}{f'.{behind:0{digits}}'.rstrip('0') if behind else ''}" or "0"
    return f"-{text}" if value < 0 else text
