"""Numbers in the notation of bench files."""

from __future__ import annotations

from typing import Any

from campaign.estimate import Estimate

DIGITS = 6


def amount(value: float, unit: str) -> Any:
    """With its unit; a number where it has none."""
    return f"{value:.{DIGITS}g} {unit}" if unit else float(f"{value:.{DIGITS}g}")


def known_of(estimate: Estimate) -> dict[str, Any]:
    """Its entry in `known.values`."""
    low, high = estimate.combined
    if low is None or high is None:
        return {"origin": "measured"}
    ends = [amount(end, estimate.unit) for end in (low, high)]
    return {"interval": ends, "origin": "measured"}
