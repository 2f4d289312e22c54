"""The device of docs/developers/writing-a-backend.md, as `campaign new backend` writes it."""

from __future__ import annotations

from typing import Any

from campaign.cli.new_package import package_files

_names: dict[str, Any] = {"__name__": __name__}
exec(package_files("backend", "tx1")["tests/drive.py"], _names)
Drive: Any = _names["Drive"]
