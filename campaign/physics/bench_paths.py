"""Check that scatter and preload of a bench refer to existing friction."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from campaign.physics.friction_paths import Keys, as_written
from campaign.physics.preload import PreloadOptions, wrong_shares
from campaign.physics.scatter import VariationOptions, wrong_scatter

_VARIATION: Keys = ("variation",)
_PRELOAD: Keys = ("gear", "preload")


def wrong_paths(
    tree: Any,
    friction: Mapping[str, Any],
    variation: VariationOptions | None,
    preload: PreloadOptions | None,
) -> Iterator[tuple[Keys, str]]:
    """Locations in a bench's original `tree` of paths that match no friction, and the messages."""
    if variation is not None:
        raw = _at(tree, _VARIATION)
        for wrong in wrong_scatter(variation, friction):
            yield (*_VARIATION, *as_written(raw, wrong.keys)), wrong.message
    if preload is not None:
        raw = _at(tree, _PRELOAD)
        for wrong in wrong_shares(preload, friction):
            yield (*_PRELOAD, *as_written(raw, wrong.keys)), wrong.message


def _at(tree: Any, keys: Keys) -> Mapping[str, Any]:
    """Table at `keys`; an empty one by default."""
    for key in keys:
        tree = tree.get(key) if isinstance(tree, Mapping) else None
    return tree if isinstance(tree, Mapping) else {}
