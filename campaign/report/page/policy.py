"""Content-Security-Policy of the page."""

from __future__ import annotations

import base64
import hashlib

NOTHING = ("default-src 'none'", "base-uri 'none'", "form-action 'none'")
LOOKS = ("style-src 'unsafe-inline'", "img-src data:")
"""The page's own style sheet and styles in its figures; dense scatters are images in the page."""


def policy(*scripts: str) -> str:
    """The policy of a page with exactly these scripts in it, letter by letter; none by default."""
    allowed = " ".join(f"'{hashed(script)}'" for script in scripts)
    return "; ".join([*NOTHING, *LOOKS, *([f"script-src {allowed}"] if scripts else [])])


def hashed(text: str) -> str:
    """As a policy names a text within the page."""
    digest = hashlib.sha256(text.encode()).digest()
    return f"sha256-{base64.b64encode(digest).decode('ascii')}"
