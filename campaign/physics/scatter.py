"""Scatter of a bench's friction: the `[variation]` table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import (
    BeforeValidator,
    Discriminator,
    Field,
    SerializerFunctionWrapHandler,
    Tag,
    field_validator,
    model_serializer,
    model_validator,
)

from campaign.options import Options
from campaign.physics.friction_paths import (
    INTERFACE,
    Keys,
    Wrong,
    changeable,
    choices,
    nested,
    plain,
    why_not,
    without,
)

TORQUES = "torques"
"""Name of a common draw of Coulomb and static torque in a bench."""


class Scatter(Options):
    """Factor of a friction parameter: a distribution around 1.

    `0.02` is short for `{ relative = 0.02 }`.
    """

    paths: tuple[str, ...] = ()
    """Parameters that one common draw multiplies; the key is then any name. Absent: that of the
    key."""
    relative: float = Field(ge=0, le=0.3)
    """Relative standard deviation of a normal distribution."""

    @model_validator(mode="before")
    @classmethod
    def _short(cls, value: Any) -> Any:
        if isinstance(value, int | float) and not isinstance(value, bool):
            return {"relative": value}
        if not isinstance(value, Mapping | Scatter):
            raise ValueError("not a relative standard deviation such as 0.02, nor a table")
        return value

    @field_validator("paths")
    @classmethod
    def _plain(cls, paths: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(dict.fromkeys(plain(path) for path in paths))

    @model_serializer(mode="wrap")
    def _shortest(self, whole: SerializerFunctionWrapHandler) -> Any:
        return whole(self) if self.paths else self.relative


@dataclass(frozen=True)
class Line:
    """A draw.

    Attributes:
        keys: its keys in the table.
        paths: parameters that it multiplies.
    """

    keys: tuple[str, ...]
    paths: tuple[str, ...]
    relative: float

    @property
    def name(self) -> str:
        """Its path, or the name of a common draw; it seeds the draws."""
        return ".".join(self.keys)


def _kind(value: Any) -> str:
    """Tag of a value: a distribution, or the table of one interface."""
    if isinstance(value, Mapping) and not value.keys() & Scatter.model_fields.keys():
        return INTERFACE
    return "Scatter"


Scatters = Annotated[
    dict[
        str,
        Annotated[
            Annotated[Scatter, Tag("Scatter")] | Annotated[dict[str, Scatter], Tag(INTERFACE)],
            Discriminator(_kind),
        ],
    ],
    BeforeValidator(nested),
]


class VariationOptions(Options):
    """Scatter of the friction of a simulated bench: relative standard deviations by path."""

    seed: int = Field(default=0, ge=0, lt=2**63)
    """Seed of all draws."""
    day: int = Field(default=0, ge=0, lt=2**31)
    """Number of the day: each has its own friction; on day 0 it is exactly as described."""
    day_to_day: Scatters = {}
    """Scatter from day to day, by path, `coulomb_torque` of every interface or
    `load.coulomb_torque`: a relative standard deviation, or a table."""
    trial_to_trial: Scatters = {}
    """Scatter from trial to trial, in the same form."""

    @property
    def days(self) -> tuple[Line, ...]:
        """Draws of a day."""
        return tuple(_lines(self.day_to_day))

    @property
    def trials(self) -> tuple[Line, ...]:
        """Draws of a trial."""
        return tuple(_lines(self.trial_to_trial))


def _lines(table: Scatters) -> Iterator[Line]:
    for key, value in table.items():
        if isinstance(value, Scatter):
            yield Line((key,), value.paths or (key,), value.relative)
        else:
            for name, one in value.items():
                yield Line((key, name), one.paths or (f"{key}.{name}",), one.relative)


def wrong_scatter(variation: VariationOptions, friction: Mapping[str, Any]) -> Iterator[Wrong]:
    """Paths without a parameter that can scatter."""
    declared = {name: changeable(options) for name, options in friction.items()}
    for table, lines in (("day_to_day", variation.days), ("trial_to_trial", variation.trials)):
        for line in lines:
            common = line.paths != (line.name,)
            for index, path in enumerate(line.paths):
                message = _no_distribution(line, declared)
                message = message or why_not(path, declared, "that can change")
                if message:
                    place: Keys = ("paths", index) if common else ()
                    yield Wrong((table, *line.keys, *place), message)
        for key, value in getattr(variation, table).items():
            if value == {}:
                yield Wrong((table, key), f"nothing is said of '{key}'")


def _no_distribution(line: Line, declared: Mapping[str, Sequence[str]]) -> str:
    """Message for `coulomb_torque = { relatve = 0.02 }`, which looks like an interface."""
    name, *parts = line.keys
    parameters = {each for names in declared.values() for each in names}
    if not parts or name in declared or name not in parameters:
        return ""
    return f"unknown key '{parts[0]}'; {choices(parts[0], Scatter.model_fields)}"


def acting(variation: VariationOptions, friction: Mapping[str, Any]) -> VariationOptions:
    """`variation` without paths that match nothing in this friction; other draws are unchanged."""
    tree = variation.model_dump(mode="json")
    for wrong in reversed(list(wrong_scatter(variation, friction))):
        *keys, last = wrong.keys
        if not isinstance(last, int):
            tree = without(tree, wrong.keys)
            continue
        table: Any = tree
        for key in keys:
            table = table[key]
        del table[last]
        if not table:  # a common draw without parameters
            tree = without(tree, keys[:-1])
    return VariationOptions.model_validate(tree)
