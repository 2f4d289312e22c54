"""Base classes of everything written in TOML and listed by `campaign kinds`.

A friction model, a compensation method, an experiment, a backend and a bench each declare what
they accept as one `Options` class: fields with a physical quantity from `campaign.units`, a
default and a meaning. Validation, error messages and documentation all come from there.
"""

from __future__ import annotations

import ast
import hashlib
import inspect
import re
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from dataclasses import field as attribute
from functools import cache
from itertools import pairwise
from typing import Any, ClassVar, Literal, get_args, get_origin

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    GetCoreSchemaHandler,
    SerializerFunctionWrapHandler,
    ValidationInfo,
    model_serializer,
)
from pydantic_core import PydanticUndefined, core_schema

from campaign.choice import Choice
from campaign.units import Quantity


class Options(BaseModel):
    """A frozen set of options: unknown names, NaN and infinity are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    def without_effect(self) -> frozenset[str]:
        """Names of options without effect, given the others; a report does not list them."""
        return frozenset()


class LaterOptions(Options):
    """Options of which some were added later: the normalised tree omits these at their default.

    So older archives keep their fingerprints.
    """

    later: ClassVar[frozenset[str]] = frozenset()
    """Names of these options."""

    @model_serializer(mode="wrap")
    def _as_ever(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        tree: dict[str, Any] = dump(self)
        for name in self.later:
            if getattr(self, name) == type(self).model_fields[name].default:
                tree.pop(name, None)
        return tree


def spelled(pattern: str, words: str) -> AfterValidator:
    """Validator of a text that must match the whole `pattern`; `words` describe it to a user."""

    def check(text: str) -> str:
        if re.fullmatch(pattern, text) is None:
            raise ValueError(f"must be {words}")
        return text

    return AfterValidator(check)


def is_archived(info: ValidationInfo) -> bool:
    """Whether the validated tree is normalised (SI), not as written by a user."""
    return isinstance(info.context, Mapping) and bool(info.context.get("si"))


@dataclass(frozen=True)
class TextFile:
    """An option that names a text file, such as a CSV: a path in TOML, its text after validation.

    The loader of the protocol reads the file, relative to the protocol, and keeps its text among
    the sources. Normalised options contain only name and digest, and are read without the text.

    Attributes:
        name: as written, among the sources of the protocol.
        text: None if it is not available.
    """

    name: str
    text: str | None = attribute(default=None, repr=False)

    def __str__(self) -> str:
        if self.text is None:
            return self.name
        digest = hashlib.sha256(self.text.encode()).hexdigest()
        return f"{self.name} (SHA-256 {digest[:16]})"

    @classmethod
    def __get_pydantic_core_schema__(
        cls, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.with_info_plain_validator_function(
            cls._validate, serialization=core_schema.to_string_ser_schema()
        )

    @classmethod
    def _validate(cls, value: Any, info: ValidationInfo) -> TextFile:
        if isinstance(value, TextFile):
            return value
        if isinstance(value, str) and is_archived(info):
            return cls(value)
        raise ValueError("not the path of a text file, in quotes")


@dataclass(frozen=True)
class OptionInfo:
    """One line of `campaign kinds NAME`.

    Attributes:
        name: dotted, for an option of a table within a table.
        quantity: its physical quantity (value in SI); None without one.
        accepts: other accepted values: `text`, `true or false`, allowed words, a table's models.
        default: SI; None without a default.
        when: word that selects its table, such as `form = ideal`; "" for always.
    """

    name: str
    quantity: Quantity | None
    accepts: str
    default: Any
    required: bool
    meaning: str
    when: str = ""

    @property
    def unit(self) -> str:
        """Display unit, or empty; with the alternative unit of a linear axis."""
        if self.quantity is None:
            return ""
        own, linear = self.quantity, self.quantity.linear
        return f"{own.display} or {linear.display}" if linear else own.display


def describe(options: type[BaseModel], prefix: str = "") -> Iterator[OptionInfo]:
    """The options of a class in order of declaration, including those of its tables.

    For a table that is one of several, the options of each follow; `NAME` stands for a key that the
    user may choose.
    """
    for name, field in options.model_fields.items():
        types = tuple(_leaf_types(field.annotation))
        candidates = (*field.metadata, *types)
        quantities = [m for m in candidates if isinstance(m, Quantity)]
        default = field.get_default(call_default_factory=True, validated_data={})
        nested = isinstance(default, BaseModel) or default is PydanticUndefined
        yield OptionInfo(
            name=prefix + name,
            quantity=quantities[0] if quantities else None,
            accepts=_accepts(field.annotation, types, quantified=bool(quantities)),
            default=None if nested else default,
            required=field.is_required(),
            meaning=meaning_of(options, name),
        )
        key = "NAME." if dict in tuple(_origins(field.annotation)) else ""
        yield from _within(candidates, f"{prefix}{name}.{key}")


def meaning_of(model: type[BaseModel], name: str) -> str:
    """Meaning of a field: its description, or else the docstring below it.

    Not by `use_attribute_docstrings`: pydantic would read the source of every class at each start.
    """
    text = model.model_fields[name].description
    owners = (each for each in model.__mro__ if name in inspect.get_annotations(each))
    return " ".join((text or _docstrings(next(owners)).get(name, "")).split())


@cache
def _docstrings(owner: type) -> Mapping[str, str]:
    """Docstrings of a class' fields by name, from its source; empty without source."""
    try:
        body = ast.parse(textwrap.dedent(inspect.getsource(owner))).body[0].body  # type: ignore[attr-defined]
    except (OSError, SyntaxError):
        return {}
    return {
        field.target.id: text.value.value
        for field, text in pairwise(body)
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
        and isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant)
        and isinstance(text.value.value, str)
    }  # fmt: skip


def _within(found: tuple[Any, ...], prefix: str) -> Iterator[OptionInfo]:
    """The options of all tables that a field accepts."""
    tables = {_tag(table): table for table in _tables(found)}
    for choice in found:
        if isinstance(choice, Choice):
            tables |= {f"{choice.tag} = {word}": one for word, one in choice.tables().items()}
    infos = {label: list(describe(table, prefix)) for label, table in tables.items()}
    for label, of_table in infos.items():
        for info in of_table:
            everywhere = all(info in others for others in infos.values())
            if everywhere and label == next(iter(infos)):
                yield info
            elif not everywhere and label != f"{info.name.removeprefix(prefix)} = {info.accepts}":
                yield replace(info, when=", ".join(filter(None, (label, info.when))))


def _origins(annotation: Any) -> Iterator[Any]:
    """The generic types in an annotation."""
    if (origin := get_origin(annotation)) is not None:
        yield origin
        for argument in get_args(annotation):
            yield from _origins(argument)


def _leaf_types(annotation: Any) -> Iterator[Any]:
    """Every type and every Quantity inside optional, list, dict, union and Annotated types."""
    if isinstance(annotation, Quantity):
        yield annotation
        return
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Literal:
        yield annotation
    elif origin is dict:
        yield from _leaf_types(arguments[1])
    elif arguments:
        for argument in arguments:
            yield from _leaf_types(argument)
    elif annotation is not type(None) and annotation is not Ellipsis:
        yield annotation


_PLAIN: dict[Any, str] = {
    str: "text",
    int: "whole number",
    float: "number",
    bool: "true or false",
    TextFile: "path of a file",
}


def _accepts(annotation: Any, types: tuple[Any, ...], *, quantified: bool) -> str:
    words = [str(w) for t in types if get_origin(t) is Literal for w in get_args(t)]
    tables = _tables(types)
    plain = [_PLAIN[t] for t in types if isinstance(t, type) and t in _PLAIN]
    if quantified:  # numbers come with their unit, as text
        plain = []
    chosen = [f"{t.tag} = {word}" for t in types if isinstance(t, Choice) for word in t.words()]
    if chosen:
        plain.append(f"table: {' | '.join(chosen)}")
    if tables:
        plain.append("table" if len(tables) == 1 else f"table: {' | '.join(map(_tag, tables))}")
    accepted = " | ".join(dict.fromkeys((*words, *plain)))
    if get_origin(annotation) is dict and not tables and not chosen:
        return f"table of {accepted}"
    many = get_origin(annotation) in (tuple, list)
    return f"list of {accepted or 'values'}" if many else accepted


def _tables(types: tuple[Any, ...]) -> list[type[BaseModel]]:
    """The table classes among `types`, without repetition."""
    tables = (t for t in types if isinstance(t, type) and issubclass(t, BaseModel))
    return list(dict.fromkeys(tables))


def _tag(table: type[BaseModel]) -> str:
    """Word that identifies a table: of its first field with exactly one allowed word."""
    for name, field in table.model_fields.items():
        allowed = get_args(field.annotation)
        if get_origin(field.annotation) is Literal and len(allowed) == 1:
            return f"{name} = {allowed[0]}"
    return table.__name__
