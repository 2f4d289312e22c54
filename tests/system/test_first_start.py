"""The engine is compiled once per installation, and whoever waits for it is told."""

from __future__ import annotations

from pathlib import Path

import pytest

from campaign.cli.compile_engine import COMPILING
from tests.system.user import SEA, campaign, write


@pytest.mark.slow
def test_what_warmup_has_compiled_it_finds_again(tmp_path: Path) -> None:
    again = first = campaign(tmp_path, "warmup")
    if not first.out.startswith("nothing to compile: all "):  # else a process before it did
        again = campaign(tmp_path, "warmup")
    assert again.out.startswith("nothing to compile: all ")
    assert COMPILING not in again.err
    kept = Path(again.last_line.removeprefix("kept in "))
    assert list(kept.rglob("engine.advance_block*.nbc"))
    assert first.last_line == again.last_line


@pytest.mark.soak
def test_a_first_run_compiles_what_it_needs_and_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    write(tmp_path, SEA)
    first = campaign(tmp_path, "run", "protocol.toml")
    assert first.err.splitlines()[0] == COMPILING
    assert not list((tmp_path / "cache").rglob("engine.advance_block*.nbc"))
    second = campaign(tmp_path, "run", "protocol.toml")
    assert COMPILING not in second.err
    assert not campaign(tmp_path, "warmup").out.startswith("nothing to compile")


@pytest.mark.soak
def test_a_mistake_in_a_protocol_does_not_wait_for_the_compiler(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    write(tmp_path, SEA.replace("simulink", "simulant"))
    done = campaign(tmp_path, "run", "protocol.toml", code=2)
    assert COMPILING not in done.err
    assert not list((tmp_path / "cache").rglob("engine.*.nbc")), "it had no time to"
