"""A pager for what is longer than the terminal; never in pipes, in JSON, or where it is refused."""

from __future__ import annotations

import io
import os
import sys
from contextlib import suppress

import pytest

from campaign.cli import output
from campaign.cli.app import PAGED
from campaign.cli.output import paged, print_line


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What the pager was given; the terminal has ten lines."""
    given: list[str] = []
    monkeypatch.setattr(output, "_paged", lambda _, text: given.append(text) or True)
    size = os.terminal_size((80, 10))
    monkeypatch.setattr("campaign.cli.output.shutil.get_terminal_size", lambda: size)
    monkeypatch.setenv("PAGER", "sh")
    return given


def told(monkeypatch: pytest.MonkeyPatch, lines: int, stream: io.StringIO) -> str:
    monkeypatch.setattr(sys, "stdout", stream)
    with paged():
        for line in range(lines):
            print_line(f"line {line}\x1b[2J")
    return stream.getvalue()


def test_what_is_long_is_paged_without_what_would_command_the_terminal(shown, monkeypatch):
    assert told(monkeypatch, 11, Terminal()) == ""
    assert len(shown) == 1
    assert "line 10" in shown[0]
    assert "\x1b[2J" not in shown[0]


@pytest.mark.parametrize(("lines", "stream"), [(9, Terminal()), (99, io.StringIO())])
def test_what_is_short_or_no_terminal_is_written(shown, monkeypatch, lines, stream):
    text = told(monkeypatch, lines, stream)
    assert text.count("line") == lines
    assert not shown


@pytest.mark.parametrize("pager", ["", "no-such-program-there"])
def test_no_pager_is_no_error(shown, monkeypatch, pager):
    monkeypatch.setenv("PAGER", pager)
    assert "line 10" in told(monkeypatch, 11, Terminal())
    assert not shown


def test_what_was_told_before_an_error_is_shown(shown, monkeypatch):
    monkeypatch.setattr(sys, "stdout", stream := Terminal())
    with suppress(ValueError), paged():
        print_line("early")
        raise ValueError
    assert "early" in stream.getvalue()


def test_no_live_command_is_paged():
    assert not PAGED & {
        "run",
        "resume",
        "import",
        "calibrate",
        "stop",
        "status",
        "device",
        "schema",
    }
