"""Rendering packaged templates of pages without custom ones."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any


def fill_packaged(name: str, context: Mapping[str, Any], packaged: Path) -> str:
    """The text that the template `name` makes: autoescaped, and an unknown name is an error."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(str(packaged)),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(name).render(context) + "\n"
