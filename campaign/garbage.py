"""How often garbage is looked for."""

from __future__ import annotations

import gc

SELDOM = 100_000, 50, 50
"""As `gc.set_threshold` has it."""


def seldom() -> None:
    """From now on in this process: imports and trials make a million objects, few of them garbage.

    Cycles are still found, a hundred thousand objects later.
    """
    gc.set_threshold(*SELDOM)
