"""A folder for the latches of a test's controllers."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.device.test_controller import Rig


@pytest.fixture(autouse=True)
def latches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Rig, "folder", tmp_path)
