"""Lines that are parsed together are what each of them says, or none of them is."""

from __future__ import annotations

import pytest
from pydantic import TypeAdapter

from campaign.archive.layout import json_lines

NUMBERS = TypeAdapter(list[dict[str, int]])


@pytest.fixture(autouse=True)
def pairs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(json_lines, "TOGETHER", 2)


@pytest.mark.parametrize("count", [0, 1, 2, 5])
def test_every_part_is_there_in_order(count: int) -> None:
    lines = [b'{"a":%d}' % number for number in range(count)]
    wanted = [{"a": number} for number in range(count)]
    assert json_lines.parse_at_once(NUMBERS, lines) == wanted


@pytest.mark.parametrize("wrong", [b"", b"{", b'{"a":"b"}', b'{"a":1},{"a":2}'])
@pytest.mark.parametrize("place", [0, 3])
def test_a_line_that_is_not_one_entry_makes_none(wrong: bytes, place: int) -> None:
    lines = [b'{"a":1}'] * 4
    lines[place] = wrong
    assert json_lines.parse_at_once(NUMBERS, lines) is None
