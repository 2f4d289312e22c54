"""A hostile package that is as good as installed, for this process and for others."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.attacks.laboratory import Here, installed_here, packed, write_protocols
from tests.packages import Packages


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Nothing of it is left for the tests of other rooms."""
    with installed_here(packed(tmp_path_factory.mktemp("hostile"))):
        yield


@pytest.fixture
def here(
    installed: None,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> Here:
    """Commands in this process."""
    return Here(tmp_path, monkeypatch, capfd)


@pytest.fixture
def apart(tmp_path: Path) -> Packages:
    """For commands in processes of their own."""
    write_protocols(tmp_path)
    return packed(tmp_path)
