"""Order of a bench's tables as in its file.

Archived trees have no order of keys. But torques of several interfaces are added in the order of
the bench file, which determines their last bits.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from typing import Any

from campaign.trial import Tree


def in_written_order(bench: Tree, texts: Iterable[str]) -> Tree:
    """`bench` with its tables in the order of the TOML text with the same `name`.

    Keys that the text lacks follow in their present order. `bench` is unchanged without a text.
    """
    for text in texts:
        try:
            written = tomllib.loads(text)
        except tomllib.TOMLDecodeError:
            continue  # edited since it was archived; the trials remain valid
        if written.get("name") == bench.get("name"):
            ordered: Tree = _ordered(bench, written)
            return ordered
    return bench


def _ordered(tree: Any, written: Any) -> Any:
    if not (isinstance(tree, Mapping) and isinstance(written, Mapping)):
        return tree
    names = [*(name for name in written if name in tree), *(n for n in tree if n not in written)]
    return {name: _ordered(tree[name], written.get(name)) for name in names}
