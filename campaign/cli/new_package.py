"""`campaign new`: an installable package with one kind and its test.

The texts are in `package_templates`; the pages of docs/developers show the same ones.
"""

from __future__ import annotations

import importlib.util
import keyword
import re
from pathlib import Path
from string import Template

from campaign.cli.output import print_line
from campaign.errors import UsageError, writing

TEMPLATES = Path(__file__).with_name("package_templates")
POINTS = {
    "experiment": ("campaign.experiments", "EXPERIMENT"),
    "model": ("campaign.friction", "FRICTION"),
    "method": ("campaign.compensation", "COMPENSATION"),
    "backend": ("campaign.backends", "BACKEND"),
    "format": ("campaign.exports", "EXPORT"),
}
"""Group of the entry point, and the object in the module, by kind."""


def new_package(kind: str, name: str, folder: Path) -> None:
    """Write the package NAME with a kind of that name into a new folder, and print the next steps.

    Raises UsageError for an unknown kind, an invalid or used name, and a folder that exists or
    cannot be written.
    """
    if kind not in POINTS:
        raise UsageError(f"there is no package for {kind!r}; there are {', '.join(POINTS)}")
    _check_name(name)
    package = folder / name
    if package.exists():
        raise UsageError(f"{package} is there already; nothing was written")
    with writing(package):
        for path, text in package_files(kind, name).items():
            (package / path).parent.mkdir(parents=True, exist_ok=True)
            (package / path).write_text(text, encoding="utf-8", newline="\n")
            print_line(str(package / path))
    print_line(f"now: pip install -e {package}; pytest {package}; campaign kinds {name}")


def package_files(kind: str, name: str) -> dict[str, str]:
    """Texts of the files by path in the package."""
    group, attribute = POINTS[kind]
    words = {
        "name": name,
        "dashed": name.replace("_", "-"),
        "Name": "".join(part.capitalize() for part in name.split("_")),
        "group": group,
        "object": attribute,
    }
    texts = {"pyproject.toml": TEMPLATES / "pyproject.toml.txt"}
    for source in sorted((TEMPLATES / kind).rglob("*.txt")):
        path = source.relative_to(TEMPLATES / kind).with_suffix("").as_posix()
        own = {"module.py": f"{name}.py", "tests/test.py": f"tests/test_{name}.py"}
        texts[own.get(path, path)] = source
    return {
        path: Template(source.read_text(encoding="utf-8")).substitute(words)
        for path, source in texts.items()
    }


def _check_name(name: str) -> None:
    if not re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", name) or len(name) > 60:
        raise UsageError(
            f"{name!r} is not valid: use lower-case letters and digits, with single _ between"
        )
    spec = importlib.util.find_spec(name)  # a plain folder has one too, without an origin
    if keyword.iskeyword(name) or (spec is not None and spec.origin is not None):
        raise UsageError(f"{name!r} is a name of Python or of an installed package; use another")
