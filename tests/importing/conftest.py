"""What tests of this room have in common."""

from __future__ import annotations

import pytest

from tests.importing import readers


@pytest.fixture(autouse=True)
def forked(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Files are read in forks, but where a test asks how a reader is started."""
    if "started" not in request.fixturenames:
        monkeypatch.setattr("campaign.importing.subprocess_reader.subprocess", readers)


@pytest.fixture
def started() -> None:
    """Files are read in processes that start Python."""
