"""Symbols lead to what files really have."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from campaign.channels import VOCABULARY
from campaign.physics.bench import Bench
from campaign.protocol.shapes import shape_at
from campaign.report.content.symbols import SYMBOLS, Symbol

ROOT = Path(__file__).resolve().parents[2]
BENCH = Bench.model_validate(
    tomllib.loads((ROOT / "protocols/benches/simulink.toml").read_text(encoding="utf-8"))
).model_dump(mode="json")


def paths(field: str) -> Iterator[tuple[str, ...]]:
    """The paths of a real bench that a symbol's field stands for."""
    table, *rest = field.split(".")
    names = list(BENCH[table]) if rest[0] == "*" else [rest[0]]
    for name in names:
        keys = (table, name, *rest[1:])
        if shape_at(Bench, BENCH, keys) is not None:
            yield keys


@pytest.mark.parametrize("symbol", [s for s in SYMBOLS if s.field], ids=lambda s: s.symbol)
def test_a_field_exists_and_has_that_unit(symbol: Symbol) -> None:
    found = list(paths(symbol.field))
    assert found
    for keys in found:
        shape = shape_at(Bench, BENCH, keys)
        assert shape is not None
        unit = shape.quantity.si if shape.quantity else ""
        assert unit == symbol.unit, keys


@pytest.mark.parametrize("symbol", [s for s in SYMBOLS if s.channel], ids=lambda s: s.symbol)
def test_a_channel_exists(symbol: Symbol) -> None:
    assert symbol.channel in VOCABULARY


def test_no_symbol_stands_there_twice() -> None:
    assert len({each.symbol for each in SYMBOLS}) == len(SYMBOLS)
