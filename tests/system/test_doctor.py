"""`campaign doctor`: libraries held against what is asked for, and what is wrong ends with 2."""

from __future__ import annotations

import importlib.metadata
import json
from pathlib import Path

import pytest

from campaign.cli.doctor import examine
from campaign.errors import ExitCode
from tests.system.user import campaign


def asked(monkeypatch: pytest.MonkeyPatch, *requirements: str) -> None:
    monkeypatch.setattr(importlib.metadata, "requires", lambda name: list(requirements))


def told(capsys: pytest.CaptureFixture[str], code: ExitCode) -> dict[str, tuple[str, str, str]]:
    assert examine(Path("results"), as_json=True) is code
    rows = json.loads(capsys.readouterr().out)
    return {row["what"]: (row["is"], row["verdict"], row["advice"]) for row in rows}


def test_this_installation_is_fine(tmp_path: Path) -> None:
    done = campaign(tmp_path, "doctor")
    lines = dict(line.split("\t")[:3:2] for line in done.out.splitlines()[1:])
    assert {"campaign", "Python", "numpy", "disk", "compiled engine"} <= lines.keys()
    assert "wrong" not in lines.values()


def test_a_library_that_is_too_old_or_not_there_is_wrong(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked(monkeypatch, "numpy>=999", "nobody-has-this>=1", "scipy>=1")
    found = told(capsys, ExitCode.USAGE)
    assert found["numpy"][1:] == ("wrong", "required is >=999: pip install 'numpy>=999'")
    assert found["nobody-has-this"][:2] == ("absent", "wrong")
    assert found["scipy"][1] == "fine"


def test_an_extra_that_is_absent_is_no_fault(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked(monkeypatch, "nobody-has-this>=1 ; extra == 'mdf'", "campaign[mdf] ; extra == 'all'")
    found = told(capsys, ExitCode.DONE)
    assert found["extra mdf: nobody-has-this"][1:] == ("absent", "pip install 'campaign[mdf]'")
    assert not any("extra all" in each for each in found)


def test_a_disk_that_is_nearly_full_is_said(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("campaign.cli.doctor.LITTLE", 10**18)
    assert told(capsys, ExitCode.DONE)["disk"][1:] == ("look", "runs of hours need more")
