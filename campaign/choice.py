"""An option that is one of several tables, selected by a key.

The tables are looked up at the validation of a file, not at the definition of the class. So the
kinds of other packages are imported only if a file names them, and can be imported first.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Protocol

from pydantic import BaseModel, GetCoreSchemaHandler, TypeAdapter, ValidationInfo
from pydantic_core import PydanticCustomError, PydanticKnownError, core_schema

from campaign.errors import UsageError

_MISSING = object()


class HasOptions(Protocol):
    """A kind with options."""

    @property
    def options(self) -> type[BaseModel]: ...


@dataclass(frozen=True)
class Choice:
    """Metadata of a field: `Annotated[Any, Choice("model", friction_models)]`.

    Errors are those of pydantic's discriminated union, and `unusable_kind` for a word whose kind
    cannot be imported.

    Attributes:
        tag: field whose word selects the table.
        kinds: available kinds by word. A look-up may raise UsageError.
    """

    tag: str
    kinds: Callable[[], Mapping[str, HasOptions]]

    def words(self) -> tuple[str, ...]:
        """Words that may be selected."""
        return tuple(self.kinds())

    def options(self, word: object) -> type[BaseModel] | None:
        """Options class of the table; None for an unknown or unusable word."""
        try:
            return self.kinds()[word].options if isinstance(word, str) else None
        except (KeyError, UsageError):
            return None

    def tables(self) -> dict[str, type[BaseModel]]:
        """Options class of each usable table, by its word."""
        tables = {word: self.options(word) for word in self.words()}
        return {word: table for word, table in tables.items() if table is not None}

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.with_info_plain_validator_function(self._validate)

    def _validate(self, value: Any, info: ValidationInfo) -> BaseModel:
        if isinstance(value, BaseModel):
            word = getattr(value, self.tag, _MISSING)
        elif isinstance(value, Mapping):
            word = value.get(self.tag, _MISSING)
        else:
            raise PydanticKnownError("model_attributes_type")
        if word is _MISSING:
            raise PydanticKnownError("union_tag_not_found", {"discriminator": f"'{self.tag}'"})
        kinds = self.kinds()
        if not isinstance(word, str) or word not in kinds:
            expected = ", ".join(f"'{each}'" for each in kinds)
            context = {"discriminator": f"'{self.tag}'", "tag": str(word)}
            raise PydanticKnownError("union_tag_invalid", {**context, "expected_tags": expected})
        try:
            options = kinds[word].options
        except UsageError as error:
            context = {"message": str(error), "discriminator": self.tag}
            raise PydanticCustomError("unusable_kind", "{message}", context) from None
        valid = _labelled(options).validate_python({word: value}, context=info.context)
        return valid[word]


@cache
def _labelled(options: type[BaseModel]) -> TypeAdapter[dict[str, BaseModel]]:
    """Validator whose error locations contain the word, as in a discriminated union."""
    return TypeAdapter(dict[str, options])  # type: ignore[valid-type]
