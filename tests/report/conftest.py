"""The made-up run and the report made from it."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

from campaign.report.build import Report
from tests.drawings import keep_drawings


def _made_up() -> ModuleType:
    spec = importlib.util.spec_from_file_location(
        "made_up_report", Path(__file__).with_name("made_up.py")
    )
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def made_up() -> ModuleType:
    return _made_up()


@pytest.fixture(scope="session")
def report(made_up: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Report:

    folder = tmp_path_factory.mktemp("report")
    return made_up.build(made_up.made_up_run(folder), folder / "report")


@pytest.fixture
def drawings_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """What was drawn for one test is not drawn again for another: most of a page's time."""
    keep_drawings(monkeypatch)
