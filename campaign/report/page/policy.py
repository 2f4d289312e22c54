"""Content-Security-Policy of the page."""

from __future__ import annotations

import base64
import hashlib

NOTHING = ("default-src 'none'", "base-uri 'none'", "form-action 'none'")
LOOKS = ("style-src 'unsafe-inline'", "img-src data:")
"""The page's own style sheet and styles in its figures; dense scatters are images in the page."""


def policy(*scripts: str) -> str:
    """The policy of a page with exactly these scripts in it, letter by letter; none by default."""
    allowed = " ".join(f"'sha256-{_hash(script)}'" for script in scripts)
    return "; ".join([*NOTHING, *LOOKS, *([f"script-src {allowed}"] if scripts else [])])


def _hash(script: str) -> str:
    return base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
