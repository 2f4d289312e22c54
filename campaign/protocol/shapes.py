"""Walking pydantic models along a path of keys.

Error locations of pydantic contain tags of unions, which are not in the file, and no alternatives;
both are derived from the declared types.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel, Tag
from pydantic.fields import FieldInfo

from campaign.choice import Choice
from campaign.options import TextFile, meaning_of
from campaign.protocol.positions import Keys
from campaign.units import Quantity


@dataclass(frozen=True)
class Shape:
    """The type declared for a value.

    Attributes:
        members: the permitted types, without None.
        discriminator: the field that distinguishes models, or "".
        quantity: the physical quantity, if any.
        owner: model and name, if it is a field.
        choice: the tables that the discriminator selects, in place of members.
    """

    members: tuple[Any, ...]
    discriminator: str = ""
    quantity: Quantity | None = None
    owner: tuple[type[BaseModel], str] | None = None
    choice: Choice | None = None

    @property
    def meaning(self) -> str:
        """The documentation of the field."""
        return meaning_of(*self.owner) if self.owner else ""

    @property
    def is_union(self) -> bool:
        """Whether pydantic labels a member in the location of an error."""
        return self.choice is not None or len(self.members) > 1

    def models(self) -> tuple[type[BaseModel], ...]:
        return tuple(m for m in self.members if isinstance(m, type) and issubclass(m, BaseModel))

    def tags(self) -> tuple[str, ...]:
        """The allowed values of the discriminator."""
        if self.choice is not None:
            return self.choice.words()
        return tuple(tag for model in self.models() for tag in _tags(model, self.discriminator))

    def tagged(self, tag: object) -> Shape:
        """This shape with the union narrowed to the member that pydantic labels `tag`."""
        if self.choice is not None:
            options = self.choice.options(tag)
            return Shape((options,) if options is not None else ())
        chosen = [
            member
            for member in self.models()
            if tag in _tags(member, self.discriminator) or tag == member.__name__
        ]
        return Shape(tuple(chosen))

    def narrowed(self, value: Any) -> Shape:
        """This shape with a discriminated union narrowed by the discriminator in `value`."""
        if self.is_union and self.discriminator and isinstance(value, Mapping):
            return self.tagged(value.get(self.discriminator))
        return self

    def child(self, key: str | int) -> Shape | None:
        """The shape of the value under `key`, or None if none is declared."""
        for member in self.members:
            if isinstance(member, type) and issubclass(member, BaseModel):
                if str(key) in member.model_fields:
                    return _of_field(member, str(key))
                continue
            arguments = get_args(member)
            if get_origin(member) in (dict, Mapping) and len(arguments) == 2:
                return shape_of(arguments[1])
            if get_origin(member) in (tuple, list, Sequence) and arguments:
                return shape_of(arguments[0])
        return None

    def names(self) -> tuple[str, ...]:
        """The permitted fields, in the order of declaration."""
        return tuple(dict.fromkeys(name for model in self.models() for name in model.model_fields))


def shape_of(annotation: Any) -> Shape:
    """The shape of a type, `Annotated` and optional ones included."""
    metadata: list[Any] = []
    while get_origin(annotation) is Annotated:
        annotation, *more = get_args(annotation)
        metadata += more
    choice = next((m for m in metadata if isinstance(m, Choice)), None)
    if choice is not None:
        return Shape((), choice.tag, choice=choice)
    members = (annotation,)
    if get_origin(annotation) in (Union, UnionType):
        members = tuple(_untagged(m) for m in get_args(annotation) if m is not NoneType)
    discriminator = next(
        (m.discriminator for m in metadata if isinstance(m, FieldInfo) and m.discriminator), ""
    )
    shape = Shape(
        members,
        discriminator if isinstance(discriminator, str) else "",
        next((m for m in metadata if isinstance(m, Quantity)), None),
    )
    if len(members) == 1 and get_origin(members[0]) is Annotated:
        inner = shape_of(members[0])
        return Shape(
            inner.members,
            shape.discriminator or inner.discriminator,
            shape.quantity or inner.quantity,
        )
    return shape


def _untagged(member: Any) -> Any:
    """A member of a union without the label of a discriminator function."""
    if get_origin(member) is Annotated and any(isinstance(m, Tag) for m in get_args(member)[1:]):
        return get_args(member)[0]
    return member


def from_location(
    root: type[BaseModel], location: Sequence[str | int]
) -> tuple[Keys, Shape | None]:
    """The path in the file of a pydantic location, and the shape declared there."""
    keys: Keys = ()
    shape: Shape | None = Shape((root,))
    for part in location:
        if shape is not None and shape.is_union:
            shape = shape.tagged(part)
            continue
        keys = (*keys, part)
        shape = shape.child(part) if shape is not None else None
    return keys, shape


def shape_at(root: type[BaseModel], tree: Any, keys: Keys) -> Shape | None:
    """The shape at `keys` of a tree of values, which narrow its unions."""
    shape: Shape | None = Shape((root,))
    for key in keys:
        if shape is None:
            return None
        shape = shape.narrowed(tree).child(key)
        tree = tree.get(key) if isinstance(tree, Mapping) else None
    return shape


def _of_field(model: type[BaseModel], name: str) -> Shape:
    field = model.model_fields[name]
    shape = shape_of(field.annotation)
    discriminator = field.discriminator if isinstance(field.discriminator, str) else ""
    quantity = next((m for m in field.metadata if isinstance(m, Quantity)), None)
    return Shape(
        shape.members,
        discriminator or shape.discriminator,
        quantity or shape.quantity,
        (model, name),
        shape.choice,
    )


def _tags(model: type[BaseModel], discriminator: str) -> tuple[Any, ...]:
    field = model.model_fields.get(discriminator)
    if field is None or get_origin(field.annotation) is not Literal:
        return ()
    return get_args(field.annotation)


Read = Callable[[Keys, str], TextFile]
"""Reads the file that is named at some keys; an unreadable file has no text."""


def attach(options: type[BaseModel], tree: Mapping[str, Any], read: Read) -> dict[str, Any]:
    """`tree` with every path of an option of type `TextFile` replaced by that file."""
    attached: dict[str, Any] = _attached(Shape((options,)), dict(tree), (), read)
    return attached


def attach_values(
    options: type[BaseModel], tree: Mapping[str, Any], keys: Keys, values: Any, read: Read
) -> Any:
    """The same for the listed values of a swept option at `keys`."""
    shape = shape_at(options, tree, keys)
    if shape is None or not isinstance(values, list):
        return values
    return [_attached(shape, value, (index,), read) for index, value in enumerate(values)]


def _attached(shape: Shape | None, value: Any, keys: Keys, read: Read) -> Any:
    if shape is None:
        return value
    if shape.members == (TextFile,) and isinstance(value, str):
        return read(keys, value)
    if not isinstance(value, Mapping | list):
        return value
    narrow = shape.narrowed(value)
    if isinstance(value, list):
        return [_attached(narrow.child(i), v, (*keys, i), read) for i, v in enumerate(value)]
    return {k: _attached(narrow.child(k), v, (*keys, k), read) for k, v in value.items()}
