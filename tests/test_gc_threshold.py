"""Garbage collection."""

from __future__ import annotations

import gc

import pytest

from campaign.gc_threshold import paused_collection


@pytest.mark.parametrize("enabled", [True, False])
def test_a_pause_ends_with_its_block_also_after_an_error(enabled: bool) -> None:
    before = gc.isenabled()
    try:
        (gc.enable if enabled else gc.disable)()
        with pytest.raises(ZeroDivisionError), paused_collection():
            1 / gc.isenabled()
        assert gc.isenabled() is enabled
    finally:
        (gc.enable if before else gc.disable)()
