"""Result trees as JSON: NaN and NumPy values become plain values."""

from __future__ import annotations

import json
import math
from typing import Any


def json_text(tree: Any) -> str:
    """JSON text of a tree: non-finite numbers are null, NumPy scalars plain numbers."""
    return json.dumps(_finite(tree), indent=1, ensure_ascii=False) + "\n"


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _finite(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(each) for each in value]
    if hasattr(value, "item"):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
