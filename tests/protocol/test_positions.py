"""Positions of keys and values, in every way TOML can write them."""

from __future__ import annotations

import pytest

from campaign.protocol.positions import Aim, Keys, Positions

TEXT = """\
# comment
a.b."c d" = { x.y = 1, z = [1, "ä", { q = 2 }] }
[plain]
n = 1  # one
[[test]]
n = 1
[test.matrix]
"bench.axis" = [
    "1",  # first
    "2",
]
[[test]]
[test.sub.'q']
v = 2020-01-01
[[test.inner]]
w = true
"""


@pytest.mark.parametrize(
    ("keys", "aim", "position"),
    [
        (("a",), "key", (2, 1)), (("a", "b"), "key", (2, 3)), (("a", "b", "c d"), "key", (2, 5)),
        (("a", "b", "c d"), "value", (2, 13)), (("a", "b", "c d", "x", "y"), "key", (2, 17)),
        (("a", "b", "c d", "x", "y"), "value", (2, 21)),
        (("a", "b", "c d", "z", 1), "value", (2, 32)),
        (("a", "b", "c d", "z", 2), "value", (2, 37)),
        (("a", "b", "c d", "z", 2, "q"), "value", (2, 43)), (("plain",), "value", (3, 1)),
        (("plain",), "key", (3, 2)), (("plain", "n"), "value", (4, 5)),
        (("test", 0), "value", (5, 1)), (("test", 0, "n"), "value", (6, 5)),
        (("test", 0, "matrix"), "value", (7, 1)), (("test", 0, "matrix"), "key", (7, 7)),
        (("test", 0, "matrix", "bench.axis"), "key", (8, 1)),
        (("test", 0, "matrix", "bench.axis", 1), "value", (10, 5)),
        (("test", 1), "value", (12, 1)), (("test", 1, "sub", "q"), "value", (13, 1)),
        (("test", 1, "sub", "q", "v"), "value", (14, 5)),
        (("test", 1, "inner", 0, "w"), "value", (16, 5)),
        (("test", 0, "missing"), "value", (5, 1)), (("nothing",), "key", (1, 1)),
        ((), "value", (1, 1)),
    ],
)  # fmt: skip
def test_position(keys: Keys, aim: Aim, position: tuple[int, int]) -> None:
    """The last three are not there: what is around them is pointed at."""
    assert Positions(TEXT).find(keys, aim) == position
