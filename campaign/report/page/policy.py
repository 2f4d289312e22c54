"""Content-Security-Policy of the page."""

from __future__ import annotations

import base64
import hashlib

NOTHING = ("default-src 'none'", "base-uri 'none'", "form-action 'none'")
LOOKS = ("style-src 'unsafe-inline'", "img-src data:")
"""Permits the page's style sheet, styles in figures, and images of dense scatters."""


def policy(script: str) -> str:
    """Policy of a page that permits exactly this script."""
    return "; ".join([*NOTHING, *LOOKS, f"script-src '{hashed(script)}'"])


def hashed(text: str) -> str:
    """Hash by which a policy identifies a text within the page."""
    digest = hashlib.sha256(text.encode()).digest()
    return f"sha256-{base64.b64encode(digest).decode('ascii')}"
