"""The made-up run and the report made from it."""

from __future__ import annotations

import hashlib
import importlib.util
import pickle
import sys
from pathlib import Path
from types import ModuleType

import pytest

from campaign.report.build import Report
from campaign.report.drawing.drawn import Drawn
from campaign.report.drawing.pdf import keeps_pdf
from campaign.report.page.drawings import Drawable, Drawing, Overview

KEPT: dict[str, Drawn | None] = {}
"""Drawings by what they show, for tests of what stands around them."""


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
    from campaign.report.build import build_report

    folder = tmp_path_factory.mktemp("report")
    return build_report(
        made_up.made_up_run(folder),
        folder / "report",
        experiments=made_up.EXPERIMENTS,
        packaged_templates=made_up.TEMPLATES,
    )


@pytest.fixture
def drawings_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """What was drawn for one test is not drawn again for another: most of a page's time."""
    for kind in (Drawing, Overview):
        monkeypatch.setattr(kind, "made", _kept(kind))


def _kept(kind: type[Drawing] | type[Overview]):
    make = kind.made

    def made(drawable: Drawable) -> Drawn | None:
        if keeps_pdf():  # the sheet is wanted, too
            return make(drawable)
        shown = hashlib.sha256(pickle.dumps(drawable)).hexdigest()
        if shown not in KEPT:
            KEPT[shown] = make(drawable)
        return KEPT[shown]

    return made
