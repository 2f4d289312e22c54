"""Errors in custom templates that Jinja2 does not report.

Jinja2 silently ignores a file without a template of this name, a block that the extended template
lacks, and text outside of all blocks. A template that extends itself would never end.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from jinja2 import Environment, TemplateNotFound, TemplateSyntaxError, nodes

from campaign.errors import UsageError
from campaign.text import nearest

SUFFIXES = (".html", ".htm", ".css", ".jinja", ".jinja2", ".j2")
"""Suffixes of templates; other files of the folder are ignored."""


@dataclass(frozen=True)
class _Reference:
    """A template that another one names; `name` is None if it is computed during rendering."""

    line: int
    name: str | None
    extends: bool
    optional: bool


def check_own_templates(environment: Environment, own: Path, packaged: Path, prefix: str) -> None:
    """Raise UsageError with all errors in the templates of `own`, a line each.

    Args:
        environment: its loader loads these and the packaged templates.
        own: the laboratory's folder.
        packaged: folder of the packaged templates.
        prefix: prefix of the packaged templates: `campaign/report.html`.
    """
    parsed: dict[str, nodes.Template] = {}
    problems: list[str] = []
    for name in template_names(own):
        try:
            parsed[name] = _read(environment, own / name)
        except UsageError as error:
            problems.append(str(error))
    if problems:  # only readable templates have known references
        raise UsageError("\n".join(problems))
    references = {name: tuple(_references(tree)) for name, tree in parsed.items()}
    names = template_names(packaged)
    known = [*parsed, *names, *(f"{prefix}/{name}" for name in names)]
    problems += _misnamed(own, references, names)
    for name, tree in parsed.items():
        wrong = list(_wrong_references(environment, name, references[name], prefix, known))
        wrong = wrong or list(_wrong_blocks(environment, tree, references[name]))
        problems += [f"{own / name}:{line}: {message}" for line, message in wrong]
    if problems:
        raise UsageError("\n".join(problems))


def template_names(folder: Path) -> list[str]:
    """Templates of a folder, sorted; templates in subfolders are loaded by reference only."""
    return sorted(
        path.name
        for path in folder.iterdir()
        if path.suffix in SUFFIXES and path.is_file() and not path.name.startswith(".")
    )


def _read(environment: Environment, path: Path) -> nodes.Template:
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise UsageError(f"{path}: is no UTF-8 text") from None
    except OSError as error:
        raise UsageError(f"{path}: cannot be read: {error.strerror}") from None
    return _parsed(environment, path.name, text, str(path))


def _parsed(environment: Environment, name: str, text: str, file: str | None) -> nodes.Template:
    try:
        return environment.parse(text, name, file)
    except TemplateSyntaxError as error:
        raise UsageError(f"{file or name}:{error.lineno}: {error.message}") from None


def _references(tree: nodes.Template) -> Iterator[_Reference]:
    kinds = (nodes.Extends, nodes.Include, nodes.Import, nodes.FromImport)
    for node in tree.find_all(kinds):
        named = node.template  # type: ignore[attr-defined]
        optional = bool(getattr(node, "ignore_missing", False))
        constant = isinstance(named, nodes.Const) and isinstance(named.value, str)
        name = named.value if constant else None
        yield _Reference(node.lineno, name, isinstance(node, nodes.Extends), optional)


def _misnamed(
    own: Path, references: Mapping[str, tuple[_Reference, ...]], names: list[str]
) -> Iterator[str]:
    """Files that replace no template, and that no other template names."""
    every = [reference for each in references.values() for reference in each]
    if any(reference.name is None for reference in every):
        return  # a computed name may be any of them
    named = {reference.name for reference in every}
    for name in references:
        if name not in names and name not in named:
            what = f"no template of the report is called {name!r}, and none of these includes it"
            yield f"{own / name}: {what}{nearest_name(name, names)}"


def _wrong_references(
    environment: Environment,
    name: str,
    references: tuple[_Reference, ...],
    prefix: str,
    there: Sequence[str],
) -> Iterator[tuple[int, str]]:
    for each in references:
        if each.name == name and each.extends:
            packaged = f"{prefix}/{name}"
            message = f"{name} extends itself; the packaged one is called {packaged!r}"
            yield each.line, f'{message}: write {{% extends "{packaged}" %}}'
        elif each.name is not None and not each.optional and not _found(environment, each.name):
            yield each.line, f"there is no template {each.name!r}{nearest(each.name, there)}"


def _found(environment: Environment, name: str) -> bool:
    try:
        _source(environment, name)
    except TemplateNotFound:
        return False
    return True


def _source(environment: Environment, name: str) -> tuple[str, str | None]:
    """Text and file of a template."""
    if environment.loader is None:
        raise TemplateNotFound(name)
    source, file, _ = environment.loader.get_source(environment, name)
    return source, file


def _wrong_blocks(
    environment: Environment, tree: nodes.Template, references: tuple[_Reference, ...]
) -> Iterator[tuple[int, str]]:
    """Blocks that the extended template lacks, and text outside of all blocks."""
    parents = [reference.name for reference in references if reference.extends]
    if not parents or None in parents:
        return
    parent = str(parents[0])
    blocks = sorted(set(_blocks(environment, parent, ())))
    for block in _outermost_blocks(tree):
        if block.name not in blocks:
            yield (
                block.lineno,
                f"{parent} has no block {block.name!r}{nearest_name(block.name, blocks)}",
            )
    outside = f"stands outside of all blocks and would not be shown; {parent} has the blocks "
    for node in tree.body:
        if line := _line_of_words(node):
            yield line, outside + ", ".join(blocks)


def _blocks(environment: Environment, name: str, seen: tuple[str, ...]) -> Iterator[str]:
    """Names of the blocks of a template and of all that it extends."""
    if name in seen:
        return
    source, file = _source(environment, name)
    tree = _parsed(environment, name, source, file)
    yield from (block.name for block in tree.find_all(nodes.Block))
    for reference in _references(tree):
        if reference.extends and reference.name is not None:
            yield from _blocks(environment, reference.name, (*seen, name))


def nearest_name(word: str, names: Iterable[str]) -> str:
    """Suggestion of the nearest name, or the list of all names if none is near."""
    known = sorted(names)
    return nearest(word, known) or (f"; there are {', '.join(known)}" if known else "")


def _outermost_blocks(node: nodes.Node) -> Iterator[nodes.Block]:
    """Blocks that are not within another block: an inner block may be new, and is shown."""
    for child in node.iter_child_nodes():
        if isinstance(child, nodes.Block):
            yield child
        else:
            yield from _outermost_blocks(child)


def _line_of_words(node: nodes.Node) -> int:
    """Line where a node writes something other than space; 0 if it writes nothing."""
    if isinstance(node, nodes.Include):
        return node.lineno
    for each in node.nodes if isinstance(node, nodes.Output) else ():
        if not isinstance(each, nodes.TemplateData):
            return each.lineno
        words = each.data.lstrip()
        if words:
            return each.lineno + each.data.removesuffix(words).count("\n")
    return 0
