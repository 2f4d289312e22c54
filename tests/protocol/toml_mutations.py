"""Seeded damage to a TOML text that was right: lines, numbers, units, types, depth, letters."""

from __future__ import annotations

import random
import re
from collections.abc import Callable

NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w.])")
VALUE = re.compile(r"(?m)^(\s*[\w.\"-]+\s*=\s*)(.+)$")
QUOTED = re.compile(r'"([^"\n]*)"')

VALUES = (
    "true", "0", "-1", "1", "1.5", "nan", "inf", "-inf", "1e308", "1e-308", "9" * 25, "0x7fffffff",
    '""', '"1"', '"1 Hz"', '"1 kg m^2"', '"-1 deg"', '"1e400 Hz"', '"1 Hz Hz"', '"nan Hz"',
    '"Hz"', "[]", "[[]]", "[1, 2]", '["none", "none"]', '[1, "a", true]', "{}", '{ a = 1 }',
    '{ start = 1, stop = 1e9, num = 3 }', '{ start = 0, stop = 1, step = 1e-9 }',
    '{ start = 1, stop = 3, num = 1000000000 }', '{ start = "1 Hz", stop = "2 Hz", num = 4 }',
    "2020-01-01", "12:30:00", '"/"', '"../../.."', '"benches"', '"\\u0000"', '"\\u202e\\u200b"',
    '"\\u001b[2J"', '"simulink"', '"platform"', '"/dev/zero"', '"."',
)  # fmt: skip
UNITS = (
    "Hz", "kHz", "deg", "rad", "deg/s", "rad/s^2", "N m", "kg m^2", "ms", "min", "A", "%", "K",
    "furlong", "m m", "1/s", "", "Hz**99", "degC", "µs", "N·m", "e9", "kilo",
)  # fmt: skip
LETTERS = (
    "\0", "\x07", "\x1b[31m", "\x7f", "\x85", "é", "ß", "\u00a0", "\u200b", "\u202e", "\u2028",
    "\ufeff", "\U0001f4a9", "\ud7ff", "e\u0301" * 20, "\t", "\r", "'", '"', '"""', "\\", "#", "=",
    "[", "]", "{", "}", ",", ".",
)  # fmt: skip
KEYS = ("test", "matrix", "title", "bench", "repeat", "order", "include", "check", "rest", "x y")


def delete_lines(text: str, chance: random.Random) -> str:
    lines = text.splitlines(keepends=True)
    at = chance.randrange(len(lines))
    return "".join(lines[:at] + lines[at + chance.randint(1, 3) :])


def repeat_lines(text: str, chance: random.Random) -> str:
    lines = text.splitlines(keepends=True)
    at, count = chance.randrange(len(lines)), chance.randint(1, 8)
    return "".join([*lines[: at + count], *lines[at : at + count], *lines[at + count :]])


def move_line(text: str, chance: random.Random) -> str:
    lines = text.splitlines(keepends=True)
    moved = lines.pop(chance.randrange(len(lines)))
    lines.insert(chance.randint(0, len(lines)), moved)
    return "".join(lines)


def cut(text: str, chance: random.Random) -> str:
    at = chance.randrange(len(text))
    return text[:at] if chance.random() < 0.5 else text[:at] + text[at + chance.randint(1, 40) :]


def scale_number(text: str, chance: random.Random) -> str:
    def scaled(found: re.Match[str]) -> str:
        factor = chance.choice(
            [0, -1, 10, 0.1, 1e3, 1e-3, 1e6, 1e-6, 1e9, 1e-9, 1e15, 1e300, 1.001]
        )
        value = float(found[0]) * factor
        whole = "." not in found[0] and "e" not in found[0].lower() and abs(factor) >= 1
        return str(int(value)) if whole and abs(value) < 1e20 else repr(value)

    return _one(NUMBER, text, chance, scaled)


def change_value(text: str, chance: random.Random) -> str:
    return _one(VALUE, text, chance, lambda found: found[1] + chance.choice(VALUES))


def change_unit(text: str, chance: random.Random) -> str:
    def changed(found: re.Match[str]) -> str:
        number = found[1].split(" ")[0] or "1"
        return f'"{number} {chance.choice(UNITS)}"'

    return _one(QUOTED, text, chance, changed)


def swap_values(text: str, chance: random.Random) -> str:
    values = [found[2] for found in VALUE.finditer(text)]
    return _one(VALUE, text, chance, lambda found: found[1] + chance.choice(values))


def put_letter(text: str, chance: random.Random) -> str:
    at = chance.randint(0, len(text))
    return text[:at] + chance.choice(LETTERS) * chance.choice([1, 1, 1, 3]) + text[at:]


def lengthen(text: str, chance: random.Random) -> str:
    """A string, a key, a list or a comment of up to 100 000 letters."""
    size = chance.choice([300, 5_000, 100_000])
    kind = chance.randrange(5)
    if kind == 0:
        return _one(QUOTED, text, chance, lambda found: f'"{found[1]}{"x" * size}"')
    if kind == 1:
        return _one(VALUE, text, chance, lambda found: f"{found[1]}[{'1, ' * (size // 3)}]")
    if kind == 2:
        return _insert(text, chance, f"{'k' * size} = 1\n")
    if kind == 3:
        return _one(VALUE, text, chance, lambda found: found[1] + "7" * size)
    return _insert(text, chance, f"# {'é' * size}\n")


def deepen(text: str, chance: random.Random) -> str:
    depth = chance.choice([5, 31, 33, 500, 5_000])
    kind = chance.randrange(4)
    if kind == 0:
        return _insert(text, chance, f"[{'.'.join(['a'] * depth)}]\nb = 1\n")
    if kind == 1:
        return _one(VALUE, text, chance, lambda found: f"{found[1]}{'[' * depth}{']' * depth}")
    if kind == 2:
        nested = "{ a = " * depth + "1" + " }" * depth
        return _one(VALUE, text, chance, lambda found: f"{found[1]}{nested}")
    return _insert(text, chance, f"{'.'.join(['a'] * depth)} = 1\n")


def put_key(text: str, chance: random.Random) -> str:
    table = chance.choice(["", "[test]\n", "[[test]]\n", "[test.matrix]\n", "[x]\n", "[[x.y]]\n"])
    key = chance.choice(KEYS)
    quoted = f'"{key}"' if " " in key or chance.random() < 0.1 else key
    return _insert(text, chance, f"{table}{quoted} = {chance.choice(VALUES)}\n")


def other_ending(text: str, chance: random.Random) -> str:
    return text.replace("\n", chance.choice(["\r\n", "\r", "\n\n", "\u2028"]))


MUTATIONS: tuple[Callable[[str, random.Random], str], ...] = (
    delete_lines, repeat_lines, move_line, cut, scale_number, scale_number, change_value,
    change_value, change_unit, swap_values, put_letter, lengthen, deepen, put_key, other_ending,
)  # fmt: skip
"""What can be done to a text; some twice as often as the rest."""


def mutated(text: str, chance: random.Random) -> bytes:
    """`text` after one to three mutations, as a file would have it; now and then not UTF-8."""
    for _ in range(chance.choice([1, 1, 1, 2, 3])):
        if text:
            text = chance.choice(MUTATIONS)(text, chance)
    content = text.encode("utf-8", "surrogatepass")
    if chance.random() < 0.03:
        at = chance.randint(0, len(content))
        content = content[:at] + chance.randbytes(chance.randint(1, 4)) + content[at:]
    return content


def _one(
    pattern: re.Pattern[str], text: str, chance: random.Random, new: Callable[[re.Match[str]], str]
) -> str:
    """One of the places where `pattern` is found, replaced."""
    found = list(pattern.finditer(text))
    if not found:
        return text
    place = chance.choice(found)
    return text[: place.start()] + new(place) + text[place.end() :]


def _insert(text: str, chance: random.Random, lines: str) -> str:
    """`lines` before one of the lines of `text`."""
    starts = [0, *(found.end() for found in re.finditer("\n", text))]
    at = chance.choice(starts)
    return text[:at] + lines + text[at:]
