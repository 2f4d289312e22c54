"""Names of identified compensations: NAME-identified, beside NAME."""

from __future__ import annotations

ENDING = "-identified"


def identified_name(stated: str) -> str:
    """Of a compensation's twin, which holds what was identified in place of what it held."""
    return f"{stated}{ENDING}"


def stated_name(name: str) -> str:
    """Of the compensation that this one is the twin of; "" where it is none's."""
    return name.removesuffix(ENDING) if name.endswith(ENDING) else ""
