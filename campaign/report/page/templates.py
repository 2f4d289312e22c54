"""Rendering templates: packaged ones, and custom ones that override them.

A file of the laboratory's folder stands in for the packaged one of the same name. The packaged ones
stay within reach under the prefix `campaign/`, so that one's own `report.html` can extend it:
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
"""What the packaged templates are called by, where a laboratory's own has taken their name."""


class _Compiled(BytecodeCache):
    """Templates that this process has compiled, by name, file and text: half of their time."""

    def __init__(self) -> None:
        self._codes: dict[tuple[str, str], CodeType] = {}

    def load_bytecode(self, bucket: Bucket) -> None:
        """The code of a template; none, where its text is another now."""
        bucket.code = self._codes.get((bucket.key, bucket.checksum))

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Keep what was compiled."""
        if bucket.code is not None:
            self._codes[bucket.key, bucket.checksum] = bucket.code


_COMPILED = _Compiled()


class Templates:
    """The templates of a report, ready to be filled: autoescaped, unknown names are errors."""

    def __init__(self, packaged: Path, own: Path | None) -> None:
        """Raises UsageError when `own` is no folder of templates, or when one of them is wrong."""
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
        """The text that the template `name` makes of `context`, with a line's end behind it.

        Raises UsageError, with file and line, for what a template does wrong.
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
            told = (
                f"there is no name '{unknown[1]}'{nearest_name(unknown[1], context)}"
                if unknown
                else ""
            )
            raise UsageError(f"{self._place(error) or name}: {told or error}") from None
        except TemplateError as error:
            raise UsageError(f"{self._place(error) or name}: {one_line(error)}") from None
        except Exception as error:
            # What fails in a laboratory's own template is theirs; in a packaged one it is ours.
            place = self._place(error)
            if self._own is None or not place.startswith(str(self._own)):
                raise
            raise UsageError(f"{place}: cannot be filled: {one_line(error)}") from None

    def _place(self, error: BaseException) -> str:
        """File and line of the innermost template that the error came from; empty without any."""
        folders = [str(folder) for folder in (self._own, self._packaged) if folder is not None]
        frames = traceback.extract_tb(error.__traceback__)
        inside = [f for f in frames if any(f.filename.startswith(folder) for folder in folders)]
        return f"{inside[-1].filename}:{inside[-1].lineno}" if inside else ""


def _loader(packaged: Path, own: Path | None) -> BaseLoader:
    ours = FileSystemLoader(packaged)
    theirs = [] if own is None else [FileSystemLoader(own)]
    return ChoiceLoader([PrefixLoader({PREFIX: ours}), *theirs, ours])


class _Told(StrictUndefined):
    """A name that does not exist is an error that says the nearest one that does, or all."""

    __slots__ = ()

    @property
    def _undefined_message(self) -> str:
        there, wanted = self._undefined_obj, self._undefined_name
        if self._undefined_hint or there is missing:
            return super()._undefined_message
        if isinstance(there, Sequence) and not isinstance(wanted, str):
            return f"a {type(there).__name__} of {len(there)} has no element {wanted!r}"
        told = f"{_called(there)} has no {wanted!r}"
        names = [*map(str, there)] if isinstance(there, Mapping) else dir(there)
        names = [name for name in names if name[:1] != "_" and name != wanted]
        plain = there is None or isinstance(there, str | int | float)
        return told if plain else told + nearest_name(str(wanted), names)


def _called(thing: object) -> str:
    """What a template has in its hands, in a word: the manual names the program's own kinds."""
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
