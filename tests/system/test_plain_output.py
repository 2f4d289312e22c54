"""Nothing that a file, a name or an archive has brought commands the terminal."""

from __future__ import annotations

import json
import os
import pty
import subprocess
import unicodedata
from pathlib import Path

import pytest

from campaign.cli.output import PlainConsole, PlainStream
from tests.system.user import ROOT, command, completed, environment

EVIL = "\x1b]0;owned\x07\x1b[2J\u202e\u2066\x9b31m\x7f\r[red]x[/red]"
"""A window's title, a cleared screen, writing turned round, colours in C1 and in rich's markup."""
MARKS = [mark.encode() for mark in ("\x1b]0;owned", "\x07", "\x1b[2J", "\u202e", "\u2066", "\x9b")]

PROTOCOL = f"""\
title = {json.dumps(EVIL)}
description = {json.dumps(EVIL)}
operator = {json.dumps(EVIL)}
notes = {json.dumps(EVIL)}
tags = [{json.dumps(EVIL)}, "plain"]

[[test]]
name = "sea"
kind = "stabilization"
title = {json.dumps(EVIL)}
description = {json.dumps(EVIL)}
bench = "own.toml"
cycles = 1
settle_cycles = 1

[[test]]
name = "sea-limited"
kind = "stabilization"
bench = "own.toml"
cycles = 1
settle_cycles = 1
[test.matrix]
"bench.limits.current" = ["3.18 A"]
[[test.operator]]
text = {json.dumps("Look at " + EVIL)}
"""

BROKEN = f"""\
title = 3
{json.dumps(EVIL)} = 1
include = [{json.dumps(EVIL)}]
[[test]]
name = {json.dumps(EVIL)}
kind = {json.dumps(EVIL)}
bench = {json.dumps(EVIL)}
frequency = {json.dumps("1 " + EVIL)}
[test.matrix]
{json.dumps(EVIL)} = [1]
"""


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a name of its own, and protocol, bench and archive of such texts in it."""
    folder = tmp_path_factory.mktemp("place") / EVIL.replace("/", "")
    folder.mkdir()
    bench = (ROOT / "protocols" / "benches" / "simulink.toml").read_text(encoding="utf-8")
    bench = bench.replace('name = "simulink"', f"name = {json.dumps(EVIL)}", 1)
    bench = bench.replace("[friction.load]", f"[friction.{json.dumps(EVIL)}]", 1)
    (folder / "own.toml").write_text(bench, encoding="utf-8")
    (folder / "evil.toml").write_text(PROTOCOL, encoding="utf-8")
    (folder / "broken.toml").write_text(BROKEN, encoding="utf-8")
    (folder / f"{EVIL.replace('/', '')}.toml").write_text("\x1b[2J = ]", encoding="utf-8")
    results = str(folder / "results")
    said = run(folder, "run", "evil.toml", "--results", results, "--note", EVIL, "--tag", EVIL)
    assert "1 trial done, 1 limit" in said
    return folder


def run(folder: Path, *arguments: str) -> str:
    """Everything that a command prints."""
    done = completed(folder, *arguments)
    return done.stdout + done.stderr


def on_a_terminal(folder: Path, *arguments: str) -> bytes:
    """Everything that a command prints on a terminal that knows colours."""
    ours, theirs = pty.openpty()
    with subprocess.Popen(
        command(*arguments),
        cwd=folder,
        env={**environment(), "TERM": "xterm-256color", "COLUMNS": "200"},
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
    ):
        os.close(theirs)
        said = b""
        try:
            while block := os.read(ours, 65536):
                said += block
        except OSError:  # the other end is closed
            pass
    os.close(ours)
    return said


FILE = EVIL.replace("/", "") + ".toml"
COMMANDS = [
    ("plan", "evil.toml"),
    ("plan", "evil.toml", "--json"),
    ("plan", "broken.toml"),
    ("plan", FILE),
    ("plan", f"no{EVIL}"),
    ("plan", "evil.toml", "--only", EVIL),
    ("plan", "evil.toml", "--set", f"{EVIL}=1"),
    ("plan", "evil.toml", "--set", f"sea.frequency={EVIL}"),
    ("plan", "evil.toml", "--backend", EVIL),
    ("run", "broken.toml"),
    ("run", "evil.toml", "--results", "own.toml"),
    ("run", "evil.toml", "--workers", EVIL),
    ("run", "evil.toml"),
    ("list",),
    ("list", "--json"),
    ("list", "--status", EVIL),
    ("list", "--since", EVIL),
    ("list", "--results", EVIL),
    ("show",),
    ("show", "--json"),
    ("show", EVIL),
    ("verify", "2*"),
    ("verify", "2*", "--json"),
    ("verify", EVIL),
    ("report",),
    ("report", "--output", "own.toml"),
    ("report", "--templates", EVIL),
    ("export", "2*", "--to", "csv", "--output", EVIL.replace("/", "") + "-csv"),
    ("export", "2*", "--to", EVIL),
    ("resume", "2*"),
    ("rerun", "2*", "1"),
    ("rerun", "2*", EVIL),
    ("calibrate", "evil.toml"),
    ("calibrate", "broken.toml"),
    ("kinds", EVIL),
    ("check", "own.toml"),
    ("check", "own.toml", "--json"),
    ("check", FILE),
    ("init", "own.toml"),
    ("init", EVIL.replace("/", "") + "-init"),
    ("status", "--port", EVIL),
    ("stop", "--port", EVIL),
    ("device", "--bench", EVIL),
    (EVIL,),
    (f"--{EVIL}",),
    ("plan", f"--{EVIL}"),
]


@pytest.mark.slow
def test_no_output_of_any_command_holds_a_control_character(place: Path):
    name = next((place / "results").glob("*.nxs")).stem
    for arguments in COMMANDS:
        said = run(place, *(name if word == "2*" else word for word in arguments))
        assert said.strip(), arguments
        strange = {c for c in said if unicodedata.category(c) in ("Cc", "Cf", "Cs")} - {"\n", "\t"}
        assert not strange, (arguments, strange, said)


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments", [("plan", "evil.toml"), ("list",), ("show",), ("run", "evil.toml"), (EVIL,)]
)
def test_a_terminal_is_told_nothing_but_what_we_tell_it(place: Path, arguments: tuple[str, ...]):
    said = on_a_terminal(place, *arguments)
    assert said.strip()
    for mark in MARKS:
        assert mark not in said, (mark, said)


@pytest.mark.slow
def test_markup_is_text(place: Path):
    assert "[red]x[/red]" in run(place, "plan", "evil.toml")
    assert b"[red]x[/red]" in on_a_terminal(place, "plan", "evil.toml")


def test_json_loses_no_letter(place: Path):
    said = run(place, "list", "--json")
    assert EVIL in json.loads(said)[0]["tags"]


@pytest.mark.slow
def test_the_files_of_a_report_hold_no_control_characters(place: Path):
    run(place, "report", "--output", "page")
    files = [path for path in (place / "page").rglob("*") if path.is_file()]
    assert {path.suffix for path in files} >= {".html", ".csv", ".svg"}
    for path in files:
        text = path.read_bytes().decode("utf-8")
        strange = {c for c in text if unicodedata.category(c) in ("Cc", "Cs")} - {"\n", "\t"}
        assert not strange | {c for c in text if c in "\u202e\u2066"}, path


def test_every_way_to_print_goes_through_a_door(tmp_path: Path):
    """Live displays, tables, texts and plain writes alike: what is given loses its commands."""
    from rich.table import Table

    with (tmp_path / "out").open("w+", encoding="utf-8") as out:
        console = PlainConsole(PlainStream(out))
        table = Table(EVIL, title=EVIL)
        table.add_row(EVIL)
        with console.status(EVIL):
            console.print(EVIL, table)
        PlainStream(out).writelines([EVIL])
        print(EVIL, file=PlainStream(out))
        out.seek(0)
        said = out.read()
    assert "owned" in said
    assert not {c for c in said if unicodedata.category(c) in ("Cc", "Cf")} - {"\n"}
    assert not hasattr(PlainStream(out), "buffer")
