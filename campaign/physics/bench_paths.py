"""Check that scatter and preload of a bench refer to existing friction."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from campaign.physics.friction_paths import Keys, as_written
from campaign.physics.preload import PreloadOptions, wrong_shares
from campaign.physics.scatter import VariationOptions, wrong_scatter


def wrong_paths(
    tree: Any,
    friction: Mapping[str, Any],
    variation: VariationOptions | None,
    preload: PreloadOptions | None,
) -> Iterator[tuple[Keys, str]]:
    """Locations in a bench's original `tree` of paths that match no friction, and the messages."""
    scattered = wrong_scatter(variation, friction) if variation is not None else ()
    loaded = wrong_shares(preload, friction) if preload is not None else ()
    for table, wrong in ((("variation",), scattered), (("gear", "preload"), loaded)):
        raw = tree
        for key in table:
            raw = raw.get(key) if isinstance(raw, Mapping) else None
        for each in wrong:
            yield (*table, *as_written(raw, each.keys)), each.message
