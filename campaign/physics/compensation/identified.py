"""Names of identified compensations: NAME-identified beside NAME."""

from __future__ import annotations

ENDING = "-identified"


def identified_name(stated: str) -> str:
    """Name of the copy of a compensation with identified values."""
    return f"{stated}{ENDING}"


def stated_name(name: str) -> str:
    """Name of the compensation that this one was copied from; "" if it is no such copy."""
    return name.removesuffix(ENDING) if name.endswith(ENDING) else ""
