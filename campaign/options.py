"""The base of everything a user writes in TOML, and of everything `campaign kinds` lists.

A friction model, a compensation method, an experiment, a backend and a bench each declare what
they accept as one `Options` class: fields with a physical quantity from `campaign.units`, a
default and a meaning. Validation, error messages and documentation all come from there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, ConfigDict
from pydantic_core import PydanticUndefined

from campaign.units import Quantity


class Options(BaseModel):
    """A frozen set of options: unknown names, NaN and infinity are errors."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, use_attribute_docstrings=True
    )


@dataclass(frozen=True)
class OptionInfo:
    """One line of `campaign kinds NAME`."""

    name: str
    unit: str
    default: Any
    required: bool
    meaning: str


def describe(options: type[BaseModel]) -> Iterator[OptionInfo]:
    """The options of a class in the order they were declared; units as a reader writes them."""
    for name, field in options.model_fields.items():
        quantity = next((m for m in field.metadata if isinstance(m, Quantity)), None)
        default = field.default_factory() if field.default_factory else field.default  # type: ignore[call-arg]
        yield OptionInfo(
            name=name,
            unit=quantity.display if quantity else "",
            default=None if default is PydanticUndefined else default,
            required=field.is_required(),
            meaning=" ".join((field.description or "").split()),
        )
