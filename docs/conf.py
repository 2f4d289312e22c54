"""Settings of Sphinx: `make docs` writes README.md and docs/ as a site that needs no network."""

from __future__ import annotations

from importlib import metadata
from typing import Any

project, author, release = "campaign", "", metadata.version("campaign")
extensions = ["myst_parser"]
root_doc = "README"
include_patterns = ["*.md", "docs/*.md", "docs/developers/*.md", "docs/decisions/*.md"]
myst_heading_anchors = 4  # as GitHub names them
suppress_warnings = ["misc.highlighting_failure"]  # Pygments has no CSV
html_theme = "furo"
html_show_sphinx = False
html_copy_source = False

# docs/a* is architecture.md, for developers.
CONTENTS = """
```{toctree}
:hidden:
:glob:
:caption: For users
docs/tutorial
docs/[b-z]*
CHANGELOG
```
```{toctree}
:hidden:
:glob:
:caption: For developers
docs/architecture
CONTRIBUTING
SECURITY
docs/developers/*
docs/decisions/*
```
"""


def add_contents(_app: Any, page: str, source: list[str]) -> None:
    """Append the side bar's contents to the first page of the site; the file stays as it is."""
    if page == root_doc:
        source[0] += CONTENTS


def setup(app: Any) -> None:
    """Sphinx calls this."""
    app.connect("source-read", add_contents)
