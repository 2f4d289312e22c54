"""Options that experiments chose by themselves, for the plan."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from campaign.experiments import experiments
from campaign.options import describe
from campaign.protocol import PlannedTest
from campaign.units import Quantity, convert


def chosen_lines(test: PlannedTest) -> Iterator[str]:
    """One line for each: `settle_angle = "1 deg"`, and why."""
    texts = {name: as_toml(test.kind, name, test.options[name]) for name in test.chosen}
    width = max((len(f"{name} = {text}") for name, text in texts.items()), default=0)
    for name, reason in test.chosen.items():
        line = f"{name} = {texts[name]}"
        yield f"{line:<{min(width, 40)}}  {reason}"


def as_toml(kind: str, name: str, value: Any) -> str:
    """An option's value (SI) as a protocol writes it; of a long list the ends."""
    known = {info.name: info.quantity for info in describe(experiments()[kind].options)}
    quantity = known.get(name)
    quantity = quantity and quantity.here
    if isinstance(value, Sequence) and not isinstance(value, str):
        return _listed([_one(item, quantity) for item in value])
    return _one(value, quantity)


def _one(value: Any, quantity: Quantity | None) -> str:
    if isinstance(value, str) or quantity is None:
        return f'"{value}"' if isinstance(value, str) else f"{value:g}"
    return f'"{convert(value, quantity.si, quantity.display):.6g} {quantity.display}"'


def _listed(texts: Sequence[str]) -> str:
    if len(texts) <= 3:
        return f"[{', '.join(texts)}]"
    return f"[{texts[0]}, {texts[1]}, ... {texts[-1]}] ({len(texts)})"
