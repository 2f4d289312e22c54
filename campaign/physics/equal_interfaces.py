"""Friction interfaces of one model, evaluated in one call.

In a single trial the processor then computes them side by side, as it does the lanes of a block:
what it waits for (an exponential after a division after an exponential) it waits for once.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence

from campaign.physics.blocks import Array, zeros

SIZES = (4, 2, 1)
"""How many may go together: vectors have a power of two of lanes."""


def alike(kinds: Sequence[Hashable], alone: Sequence[bool]) -> list[slice]:
    """Neighbours of one kind, as slices; those that are `alone` have one to themselves.

    Neighbours only: torques are summed in the order in which the bench has the interfaces.
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
    """(interfaces, rows, lanes), but in the place of each group (rows, its interfaces, lanes)."""
    arranged = zeros(*rows.shape)
    for group in groups:
        by_row = rows[group].transpose(1, 0, 2)
        arranged[group].reshape(by_row.shape)[:] = by_row
    return arranged
