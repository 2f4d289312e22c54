"""The command line itself: quick help, and one place that turns errors into exit codes."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from campaign.cli import main as command_line
from campaign.cli.kinds import show_kind
from campaign.cli.output import bytes_text, print_table
from campaign.cli.prepare import find_protocol
from campaign.errors import (
    ArchiveError,
    BackendError,
    LimitError,
    Problem,
    ProtocolError,
    UsageError,
)
from campaign.resources import protocols_folder

HEAVY = ("h5py", "jinja2", "matplotlib", "numba", "numpy", "pandas", "scipy", "tree_sitter")
COMMANDS = (
    "plan",
    "run",
    "check",
    "calibrate",
    "report",
    "list",
    "show",
    "verify",
    "kinds",
    "init",
)


@pytest.mark.parametrize("arguments", [[], *([command] for command in COMMANDS)])
def test_help_imports_nothing_heavy(arguments: list[str]):
    # typer itself imports pydantic, where it is installed, for a command that has parameters.
    heavy = HEAVY if arguments else (*HEAVY, "pydantic")
    script = (
        "import sys, campaign.cli\n"
        f"sys.argv = {['campaign', *arguments, '--help']!r}\n"
        "try:\n    campaign.cli.main()\n"
        "except SystemExit as end:\n    assert not end.code\n"
        f"print(sorted(set({heavy!r}) & set(sys.modules)), file=sys.stderr)\n"
    )
    root = Path(__file__).parents[1]
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, cwd=root, timeout=60
    )
    assert done.stderr.strip() == "[]"


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (UsageError("no such run"), 2, "campaign: no such run\n"),
        (ProtocolError([Problem(Path("p.toml"), 3, 8, "what")]), 2, "p.toml:3:8: what\n"),
        (LimitError("too fast"), 3, "campaign: too fast\n"),
        (BackendError("the port closed"), 3, "campaign: the port closed\n"),
        (ArchiveError("a.nxs: cut off"), 4, "campaign: a.nxs: cut off\n"),
        (KeyboardInterrupt(), 130, "campaign: interrupted\n"),
    ],
)
def test_every_error_is_one_message_and_its_code(
    error: BaseException, code: int, message: str, monkeypatch, capsys
):
    assert leave_with(error, monkeypatch) == code
    assert capsys.readouterr().err == message


def test_a_bug_says_how_to_get_its_traceback_and_has_a_code_of_its_own(monkeypatch, capsys):
    assert leave_with(ZeroDivisionError("oops"), monkeypatch) == 70
    error = capsys.readouterr().err
    assert "ZeroDivisionError: oops" in error
    assert "CAMPAIGN_DEBUG=1" in error
    assert "Traceback" not in error
    monkeypatch.setenv("CAMPAIGN_DEBUG", "1")
    assert leave_with(ZeroDivisionError("oops"), monkeypatch) == 70
    assert "Traceback" in capsys.readouterr().err


def leave_with(error: BaseException, monkeypatch: pytest.MonkeyPatch) -> int:
    def fail(prog_name: str) -> None:
        raise error

    monkeypatch.setattr(sys.modules["campaign.cli.main"], "app", fail)
    with pytest.raises(SystemExit) as end:
        command_line()
    return int(end.value.code)


def test_a_file_comes_before_a_shipped_protocol_of_the_same_name(tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert find_protocol("quickstart") == protocols_folder() / "quickstart.toml"
    Path("quickstart").touch()
    assert find_protocol("quickstart") == Path("quickstart")
    with pytest.raises(UsageError, match="no such file"):
        find_protocol("elsewhere/quickstart.toml")


def test_without_a_terminal_a_table_is_tab_separated_and_one_line_per_row(capsys):
    print_table(("a", "b"), [("1", "two\nlines\tand a tab")])
    assert capsys.readouterr().out == "a\tb\n1\ttwo lines and a tab\n"


@pytest.mark.parametrize(
    ("count", "text"), [(0, "0 B"), (999, "999 B"), (14_230_000, "14.2 MB"), (2e15, "2000.0 TB")]
)
def test_sizes_are_decimal(count: int, text: str):
    assert bytes_text(count) == text


def test_the_kind_of_a_bench_tells_its_tables_of_paths(capsys):
    show_kind("bench")
    rows = [line.split("\t") for line in capsys.readouterr().out.splitlines()]
    told = {row[0]: row[1:3] for row in rows if len(row) == 4}
    assert told["gear.preload.shares"] == ["table of number", "{ static_torque = 1.0 }"]
    assert told["variation.day_to_day"] == ["table", "none"]
    assert told["variation.trial_to_trial.paths"] == ["list of text", "none"]


def test_the_version_names_what_is_numbered_for_itself(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["campaign", "--version"])
    with pytest.raises(SystemExit):
        command_line()
    first, second = capsys.readouterr().out.splitlines()
    assert re.fullmatch(r"campaign \d+\.\d+\.\d+.*", first)
    names = r"engine \d+, format \d+, wire \d+, bench schema \d+, protocol schema \d+"
    assert re.fullmatch(names, second)


STUCK = """
import threading, sys
import campaign.__main__ as program
import campaign.cli.main

def fail():
    threading.Thread(target=threading.Event().wait).start()  # a backend that never comes back
    print("said", flush=False)
    sys.exit(3)

sys.modules["campaign.cli.main"].main = fail
program.main()
"""


def test_a_thread_that_never_comes_back_does_not_keep_a_failed_command_from_ending():
    ended = subprocess.run(
        [sys.executable, "-c", STUCK], capture_output=True, text=True, timeout=60, check=False
    )
    assert (ended.returncode, ended.stdout) == (3, "said\n"), ended.stderr
