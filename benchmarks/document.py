"""Writing measurements into a page, docs/developers/performance.md for one, between two marks."""

from __future__ import annotations

import platform
import re
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

DOCS = Path(__file__).parents[1] / "docs"
PAGE = DOCS / "developers" / "performance.md"
IMAGES = DOCS / "images"


def write_section(name: str, text: str, at: Path = PAGE) -> None:
    """In the page `at`, replace what stands between `<!-- NAME -->` and `<!-- /NAME -->`."""
    begin, end = f"<!-- {name} -->\n", f"<!-- /{name} -->"
    page = at.read_text(encoding="utf-8")
    before, _, rest = page.partition(begin)
    _, found, after = rest.partition(end)
    if not found:
        raise ValueError(f"{at} has no section {name}")
    at.write_text(f"{before}{begin}{text.strip()}\n{end}{after}", encoding="utf-8")


def table(headings: list[str], rows: list[list[str]]) -> str:
    """A Markdown table."""
    rule = ["---"] * len(headings)
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (headings, rule, *rows))


def machine() -> str:
    """The processor and the versions that matter, without the name of anybody's computer."""
    packages = ", ".join(
        f"{name} {number}"
        for name in ("numba", "numpy", "scipy", "numbalsoda")
        if (number := _version(name))
    )
    return f"{_processor()}; Python {platform.python_version()}, {packages}"


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ""


def _processor() -> str:
    """Its model; where only a general name is known, with the numbers of family and model."""
    try:
        told = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return platform.processor() or platform.machine()
    fields = {
        key: match.group(1)
        for key in ("model name", "cpu family", "model")
        if (match := re.search(rf"^{key}\s*: (.+)$", told, re.MULTILINE))
    }
    name = fields.get("model name", platform.machine())
    return f"{name} (family {fields.get('cpu family', '?')}, model {fields.get('model', '?')})"
