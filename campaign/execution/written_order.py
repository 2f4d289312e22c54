"""Order of a bench's tables as in its file.

The archive keeps trees by their content, whose keys have no order; but torques of several
interfaces are added in the order in which the file names them, which decides their last bits.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from typing import Any

from campaign.trial import Tree


def in_written_order(bench: Tree, texts: Iterable[str]) -> Tree:
    """`bench` with its tables as in the one of these TOML texts that has its name.

    What a text does not have keeps its place behind; without such a text it stays as it is.
    """
    for text in texts:
        try:
            written = tomllib.loads(text)
        except tomllib.TOMLDecodeError:
            continue  # archived, and edited since; its trials stand for themselves
        if written.get("name") == bench.get("name"):
            ordered: Tree = _ordered(bench, written)
            return ordered
    return bench


def _ordered(tree: Any, written: Any) -> Any:
    if not (isinstance(tree, Mapping) and isinstance(written, Mapping)):
        return tree
    names = [*(name for name in written if name in tree), *(n for n in tree if n not in written)]
    return {name: _ordered(tree[name], written.get(name)) for name in names}
