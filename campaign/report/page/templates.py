"""Rendering of packaged templates, and of custom ones that override them.

A file of the laboratory's folder replaces the packaged one of the same name. The packaged ones are
also available with the prefix `campaign/`, so that a custom `report.html` can extend them:
`{% extends "campaign/report.html" %}`.
"""

from __future__ import annotations

import re
import traceback
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import CodeType
from typing import Any

from jinja2 import (
    BaseLoader,
    BytecodeCache,
    ChoiceLoader,
    Environment,
    FileSystemLoader,
    PrefixLoader,
    StrictUndefined,
    TemplateError,
    TemplateNotFound,
    TemplateSyntaxError,
    UndefinedError,
)
from jinja2.bccache import Bucket
from jinja2.environment import TemplateModule
from jinja2.utils import missing

from campaign.api.analysis import one_line
from campaign.errors import UsageError
from campaign.report.page.own_templates import check_own_templates, nearest_name

PREFIX = "campaign"
"""Prefix of the packaged templates, for use in custom ones of the same name."""


class _Compiled(BytecodeCache):
    """Cache of compiled templates by name, file and text, which saves half of their time."""

    def __init__(self) -> None:
        self._codes: dict[tuple[str, str], CodeType] = {}

    def load_bytecode(self, bucket: Bucket) -> None:
        """Load the code of a template, unless its text has changed."""
        bucket.code = self._codes.get((bucket.key, bucket.checksum))

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Store compiled code."""
        if bucket.code is not None:
            self._codes[bucket.key, bucket.checksum] = bucket.code


_COMPILED = _Compiled()


class Templates:
    """Templates of a report: autoescaped; unknown names are errors."""

    def __init__(self, packaged: Path, own: Path | None) -> None:
        """Raise UsageError when `own` is no folder of templates, or one of them has an error."""
        if own is not None and not own.is_dir():
            raise UsageError(f"{own}: is no folder of templates")
        self._own = own
        self._packaged = packaged
        self._environment = Environment(
            loader=_loader(packaged, own),
            autoescape=True,
            undefined=_Told,
            trim_blocks=True,
            lstrip_blocks=True,
            bytecode_cache=_COMPILED,
        )
        if own is not None:
            check_own_templates(self._environment, own, packaged, PREFIX)

    def fill(self, name: str, context: Mapping[str, Any]) -> str:
        """Render the template `name` with `context`; the text ends with a newline.

        Raises UsageError, with file and line, for an error in a template.
        """
        try:
            return self._environment.get_template(name).render(context) + "\n"
        except TemplateSyntaxError as error:
            place = f"{error.filename or error.name}:{error.lineno}"
            raise UsageError(f"{place}: {error.message}") from None
        except TemplateNotFound as error:
            message = f"there is no template {error.name!r}"
            raise UsageError(f"{self._place(error) or name}: {message}") from None
        except RecursionError:
            raise UsageError(
                f"{self._own or self._packaged}/{name}: the templates include each other without"
                f" end; the packaged one is called {PREFIX}/NAME"
            ) from None
        except UndefinedError as error:
            unknown = re.fullmatch(r"'(\w+)' is undefined", str(error))
            suggestion = (
                f"there is no name '{unknown[1]}'{nearest_name(unknown[1], context)}"
                if unknown
                else ""
            )
            raise UsageError(f"{self._place(error) or name}: {suggestion or error}") from None
        except TemplateError as error:
            raise UsageError(f"{self._place(error) or name}: {one_line(error)}") from None
        except Exception as error:
            # Only an error in a custom template is a usage error.
            place = self._place(error)
            if self._own is None or not place.startswith(str(self._own)):
                raise
            raise UsageError(f"{place}: cannot be filled: {one_line(error)}") from None

    def _place(self, error: BaseException) -> str:
        """File and line of the innermost template of an error; empty without any."""
        folders = [str(folder) for folder in (self._own, self._packaged) if folder is not None]
        frames = traceback.extract_tb(error.__traceback__)
        inside = [f for f in frames if any(f.filename.startswith(folder) for folder in folders)]
        return f"{inside[-1].filename}:{inside[-1].lineno}" if inside else ""


def _loader(packaged: Path, own: Path | None) -> BaseLoader:
    packaged_loader = FileSystemLoader(packaged)
    own_loaders = [] if own is None else [FileSystemLoader(own)]
    return ChoiceLoader([PrefixLoader({PREFIX: packaged_loader}), *own_loaders, packaged_loader])


class _Told(StrictUndefined):
    """Undefined name whose error suggests the nearest known name, or lists all."""

    __slots__ = ()

    @property
    def _undefined_message(self) -> str:
        value, wanted = self._undefined_obj, self._undefined_name
        if self._undefined_hint or value is missing:
            return super()._undefined_message
        if isinstance(value, Sequence) and not isinstance(wanted, str):
            return f"a {type(value).__name__} of {len(value)} has no element {wanted!r}"
        message = f"{_called(value)} has no {wanted!r}"
        names = [*map(str, value)] if isinstance(value, Mapping) else dir(value)
        names = [name for name in names if name[:1] != "_" and name != wanted]
        plain = value is None or isinstance(value, str | int | float)
        return message if plain else message + nearest_name(str(wanted), names)


def _called(thing: object) -> str:
    """Short description of a value in a template; the manual describes the program's own types."""
    if thing is None:
        return "nothing (None)"
    for kinds, word in (
        (TemplateModule, "the imported template"),
        (Mapping, "a table of names"),
        (str, "a text"),
        ((int, float), "a number"),
        (Sequence, "a list"),
    ):
        if isinstance(thing, kinds):
            return word
    return f"a {type(thing).__name__}"
