"""Numbers that decide what is told of a measurement say what they are."""

from __future__ import annotations

import pytest

from benchmarks.constants import ROOT, constants


@pytest.mark.parametrize("room", ["estimation", "experiments"])
def test_constants_say_what_they_are(room: str) -> None:
    paths = sorted((ROOT / "campaign" / room).rglob("*.py"))
    found = [
        (path.name, name, told)
        for path in paths
        for name, told in constants(path.read_text(encoding="utf-8"))
    ]
    assert len(found) > 100
    assert [f"{path}: {name}" for path, name, told in found if not told] == []


def test_what_says_nothing_is_found() -> None:
    source = 'A = 1.0\nB = 2 * A\n"""s"""\nC = -3  # of them\nD = "x"\nE: float = 4.0\n'
    assert list(constants(source)) == [("A", False), ("B", True), ("C", True), ("E", False)]
