"""Friction interfaces of one model, evaluated in one call.

In a single trial the processor then computes them in parallel, like the lanes of a block. Latency
(an exponential after a division after an exponential) then occurs once.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence

from campaign.physics.blocks import Array, zeros

SIZES = (4, 2, 1)
"""Sizes of groups: vectors have a power of two of lanes."""


def alike(kinds: Sequence[Hashable], alone: Sequence[bool]) -> list[slice]:
    """Slices of adjacent interfaces of one kind; each one that is `alone` has a separate slice.

    Only adjacent ones: torques are summed in the order of the interfaces in the bench.
    """
    groups: list[slice] = []
    while (first := groups[-1].stop if groups else 0) < len(kinds):
        like = 1
        while not alone[first] and kinds[first : first + like + 1] == [kinds[first]] * (like + 1):
            like += 1
        free = alone[first : first + like]
        size = next(size for size in SIZES if size <= like and (size == 1 or not any(free[:size])))
        groups.append(slice(first, first + size))
    return groups


def side_by_side(rows: Array, groups: Sequence[slice]) -> Array:
    """Rearrange (interfaces, rows, lanes) to (rows, interfaces, lanes) within each group."""
    arranged = zeros(*rows.shape)
    for group in groups:
        by_row = rows[group].transpose(1, 0, 2)
        arranged[group].reshape(by_row.shape)[:] = by_row
    return arranged
