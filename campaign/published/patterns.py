"""Names of published cells with `*`: `5.11`, `5.11/0.4`, `5.11/*/lugre`, `*/mean`."""

from __future__ import annotations

ANY = "*"


def covers(pattern: str, path: str) -> bool:
    """Whether `pattern` matches the cell at `path`: the same names in order, or the first of them.

    `*` stands for any one name. A pattern that is longer than the path covers nothing.
    """
    wanted, names = pattern.split("/"), path.split("/")
    return len(wanted) <= len(names) and all(
        want in (ANY, name) for want, name in zip(wanted, names, strict=False)
    )


def overlap(one: str, other: str) -> bool:
    """Whether both patterns can cover the same cell."""
    pairs = zip(one.split("/"), other.split("/"), strict=False)
    return all(ANY in pair or pair[0] == pair[1] for pair in pairs)
