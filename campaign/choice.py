"""An option that is one of several tables, selected by a key.

Which tables there are is looked up when a file is validated, not when the class is made: the kinds
of another package are then imported only for who names them, and can themselves be imported first.
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
    """A kind, as far as its options go."""

    @property
    def options(self) -> type[BaseModel]: ...


@dataclass(frozen=True)
class Choice:
    """Metadata of a field: `Annotated[Any, Choice("model", friction_models)]`.

    What pydantic reports is what it reports of a discriminated union, and beyond that
    `unusable_kind` for a word whose kind cannot be imported.

    Attributes:
        tag: the field whose word chooses.
        kinds: the kinds there are, by word. Looking one up may raise UsageError.
    """

    tag: str
    kinds: Callable[[], Mapping[str, HasOptions]]

    def words(self) -> tuple[str, ...]:
        """What may be chosen."""
        return tuple(self.kinds())

    def options(self, word: object) -> type[BaseModel] | None:
        """What the table may contain; None for a word that there is nothing of."""
        try:
            return self.kinds()[word].options if isinstance(word, str) else None
        except (KeyError, UsageError):
            return None

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
    """Its errors lie below the word, as those of a discriminated union do."""
    return TypeAdapter(dict[str, options])  # type: ignore[valid-type]
