"""The command line itself: quick help, and one place that turns errors into exit codes."""

from __future__ import annotations

import io
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from campaign.cli import main as command_line
from campaign.cli import output
from campaign.cli.kinds import show_kind
from campaign.cli.output import PlainConsole, bytes_text, print_json, print_line, print_table
from campaign.cli.prepare import find_protocol
from campaign.cli.schemas import init_folder
from campaign.cli.status import show_status
from campaign.errors import (
    ArchiveError,
    BackendError,
    ExitCode,
    LimitError,
    Problem,
    ProtocolError,
    UsageError,
)
from campaign.execution.run_reference import typed
from campaign.resources import protocols_folder
from campaign.wire.codes import Fault, LatchCause, State
from campaign.wire.messages import Holder, Latch, Message, Status, framed

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


def test_a_name_means_the_file_then_the_one_in_protocols_then_the_shipped_one(
    tmp_path: Path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    shipped, own = protocols_folder() / "quickstart.toml", Path("protocols/quickstart.toml")
    assert find_protocol("quickstart") == find_protocol("quickstart.toml") == shipped
    init_folder(Path())
    Path("quickstart").mkdir()  # a folder is no protocol
    capsys.readouterr()
    assert find_protocol("quickstart") == own
    assert capsys.readouterr().err == f"protocol: {own}\n"
    Path("quickstart").rmdir()
    Path("quickstart").touch()
    assert find_protocol("quickstart") == Path("quickstart")
    assert find_protocol(str(own)) == own
    assert capsys.readouterr().err == ""  # a path says itself which file it is
    with pytest.raises(UsageError, match=r"no such file.*did you mean 'quickstart'"):
        find_protocol("elsewhere/quickstarts.toml")
    with pytest.raises(UsageError, match=r"^ramp\.csv: no such file$"):  # names no protocol
        find_protocol("ramp.csv")


def test_without_a_terminal_a_table_is_tab_separated_and_one_line_per_row(capsys):
    print_table(("a", "b"), [("1", "two\nlines\tand a tab")])
    assert capsys.readouterr().out == "a\tb\n1\ttwo lines and a tab\n"


def on_a_terminal(monkeypatch: pytest.MonkeyPatch, width: int) -> io.StringIO:
    """What is printed from now on, as a terminal of that width is given it."""
    shown = io.StringIO()
    out = PlainConsole(shown)
    out._force_terminal, out._color_system, out.width = True, None, width
    monkeypatch.setattr(output, "console", lambda: out)
    return shown


RUN = "2026-11-22T19-57-33-a-name-that-is-long"


@pytest.mark.parametrize("width", [40, 60, 80, 120])
def test_a_table_on_a_terminal_breaks_no_word(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], width: int
) -> None:
    shown = on_a_terminal(monkeypatch, width)
    headings = ("run", "status", "what", "size")
    told = "failed because of a reason that nobody can read in one line"
    print_table(headings, [(RUN, "failed", told, "317.2 MB")], spare=("size",))
    lines = [line.rstrip() for line in shown.getvalue().splitlines()]
    assert max(map(len, lines)) <= width
    words = {word for line in lines for word in line.split()}
    assert {RUN, "failed", *told.split()} <= words
    assert ("317.2" in words) == (width != 60)  # spare, or below the others
    assert ("left out: size; with `| cat` all is shown" in lines) == (width == 60)
    assert capsys.readouterr().err == ""


def test_json_is_not_wrapped_on_a_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A line end inside a string would be no JSON."""
    on_a_terminal(monkeypatch, 40)
    tree = {"reason": "one sentence that is longer than a line of this terminal is wide"}
    print_json(tree)
    assert json.loads(capsys.readouterr().out) == tree


@pytest.mark.parametrize("width", range(60, 125, 7))
def test_a_long_word_among_many_is_whole(monkeypatch: pytest.MonkeyPatch, width: int) -> None:
    """Where columns share a line, no longest word is cut to `controller.relative_rate…`."""
    shown = on_a_terminal(monkeypatch, width)
    row = (
        "one count of the encoder in one sample against the Stribeck velocity",
        "305 %",
        "Steps like the Stribeck velocity: raise controller.relative_rate_filter, or take another.",
    )
    print_table(("value against limit", "share", "what to do"), [row])
    assert {*" ".join(row).split()} <= {*shown.getvalue().split()}
    assert max(map(len, shown.getvalue().splitlines())) <= width


@pytest.mark.parametrize("width", range(24, 64, 3))
def test_an_uncertainty_is_in_one_line_with_its_number(
    monkeypatch: pytest.MonkeyPatch, width: int
) -> None:
    shown = on_a_terminal(monkeypatch, width)
    told = "the LuGre compensation reduces the error by a factor of 3.87 ± 0.03 in all tests"
    print_line(told)
    print_table(("what", "change of the error"), [(told, f"larger, {told}"), ("a", "b")])
    assert "±" in shown.getvalue()
    assert all("3.87 ± 0.03" in line for line in shown.getvalue().splitlines() if "±" in line)


@pytest.mark.parametrize("width", [20, 60])
def test_a_command_to_be_typed_is_in_one_line(monkeypatch: pytest.MonkeyPatch, width: int) -> None:
    shown = on_a_terminal(monkeypatch, width)
    print_line(f"interrupted: 17 trials are done; to continue:\n{typed('resume', RUN, '--yes')}")
    assert shown.getvalue().splitlines()[-1] == f"  campaign resume {RUN} --yes"


@pytest.mark.parametrize("width", [40, 60, 80])
def test_a_message_on_a_terminal_goes_on_between_words(
    monkeypatch: pytest.MonkeyPatch, width: int
) -> None:
    shown = on_a_terminal(monkeypatch, width)
    path = "results/" + RUN + "/a/path/that/is/longer/than/the/terminal.toml:3:14:"
    text = f"{path} there is no such-and-such key; did you mean another-one-that-is-long?"
    print_line(f"  {text}")
    lines = shown.getvalue().splitlines()
    assert [word for line in lines for word in line.split()] == text.split()
    assert all(len(line) <= width for line in lines if path not in line)
    assert all(line.startswith("  ") for line in lines)


def completions(monkeypatch: pytest.MonkeyPatch, capsys, *words: str) -> list[str]:
    monkeypatch.setattr("sys.argv", ["campaign"])
    monkeypatch.setenv("_CAMPAIGN_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", " ".join(("campaign", *words)))
    monkeypatch.setenv("COMP_CWORD", str(len(words)))
    with pytest.raises(SystemExit):
        command_line()
    return capsys.readouterr().out.split()


def test_the_shell_completes_commands_runs_protocols_and_kinds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "quick").mkdir()
    (tmp_path / "quick/own.toml").touch()
    results = tmp_path / "runs"
    for name in ("2026-01-01-a.nxs", "2026-01-02-b.partial", "notes.txt"):
        results.mkdir(exist_ok=True)
        (results / name).touch()

    def complete(*words: str) -> list[str]:
        return completions(monkeypatch, capsys, *words)

    assert set(complete("re")) == {"resume", "rerun", "report"}
    assert complete("show", "--results", str(results), "2026") == ["2026-01-02-b", "2026-01-01-a"]
    assert complete("run", "quick") == ["quickstart", "quick/"]
    assert complete("run", "quick/") == ["quick/own.toml"]
    assert complete("kinds", "stabi") == ["stabilization"]
    assert complete("show", "--results", "/nowhere/at/all", "2026") == []


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
    assert told["variation.trial_to_trial.NAME.paths"] == ["list of text", "none"]


def test_kinds_go_down_to_the_last_table(capsys):
    """Of tables that are one of several, each one's options, and the word that they come with."""
    show_kind("bench")
    rows = [tuple(line.split("\t")) for line in capsys.readouterr().out.splitlines()]
    integral = {
        row[1]: row[3].partition(":")[0] for row in rows if row[0].endswith("rate.integral")
    }
    assert integral == {"1/s": "With form = ideal", "A/rad or A/m": "With form = parallel"}
    names = [row[0] for row in rows]
    assert names.count("controller.rate.proportional") == 1  # both forms have it
    assert "friction.NAME.bristle_stiffness" in names
    assert len(set(rows)) == len(rows) < 160
    same = next(row[3] for row in rows if row[0] == "compensation.NAME.friction")
    assert same.endswith("Same options as friction.")
    curve = [row[3] for row in rows if row[0] == "friction.NAME.stribeck_velocity"]
    assert [text.partition(":")[0] for text in curve] == [
        "With model = armstrong",
        "With model = elasto-plastic | gms | karnopp | leuven | lugre | lugre-fading | stribeck",
    ]
    assert not any(name.endswith((".form", ".model", ".method")) for name in names)


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


class Answering:
    """A port that has these messages to read, again and again."""

    def __init__(self, *messages: Message) -> None:
        self.data = b"".join(map(framed, messages))

    def write(self, data: bytes) -> None: ...

    def close(self) -> None: ...

    def read(self) -> bytes:
        return self.data


ANSWERS = (
    Status(State.IDLE, Fault.NONE, True, False, 1, 0.0, 0, 0.0, 0, 0, 0, 0),
    Latch(latched=False, count=0, cause=LatchCause.NONE, age=None),
    Holder(held=False, age=None),
)


@pytest.mark.parametrize("missing", [None, *range(3)])
def test_a_status_is_shown_once_each_answer_has_come(
    missing: int | None, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    port = Answering(*(each for k, each in enumerate(ANSWERS) if k != missing))
    monkeypatch.setattr("campaign.cli.status.open_port", lambda *given, **more: port)
    if missing is None:
        assert show_status("port", 1, 60.0, as_json=False) is ExitCode.DONE
        assert "state:  idle, drive off, at rest" in capsys.readouterr().out
    else:
        with pytest.raises(BackendError, match="no answer from a controller"):
            show_status("port", 1, 0.01, as_json=False)
