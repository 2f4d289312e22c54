"""Everything that reads an archive, run on one of which a bit may have been flipped."""

from __future__ import annotations

import json
import random
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from unittest.mock import patch

import h5py
import pandas as pd
import typer.testing
from typer.main import get_command
from typer.testing import CliRunner

import campaign
from campaign.archive.layout.journal import Decision
from campaign.archive.layout.names import results_path
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.results_file import read_results
from campaign.archive.reading.run_list import find_run
from campaign.archive.reading.run_reader import RunReader
from campaign.cli.bench_commands import app
from campaign.errors import ArchiveError, CampaignError
from campaign.recording import Recording
from campaign.report.output import MARKER

PROTOCOL = """
title = "A stabilized axis"

[[test]]
name = "stabilization"
kind = "stabilization"
bench = "simulink"
seed = 5
frequency = "20 Hz"
acceleration = "18 deg/s^2"
settle_cycles = 1
cycles = 3

[test.matrix]
compensation = ["none", "static"]
"""
TOLD = "damaged, missing or not as it was archived"


@dataclass(frozen=True)
class Said:
    """What one reader answered.

    Attributes:
        code: its exit code; of Python 4 for a warning or an ArchiveError.
        told: whether it said that something is damaged, on screen and in every folder or archive
            that it made.
        made: what it delivered, by name; equal for equal archives.
    """

    code: int
    told: bool
    made: dict[str, object]


def make_archive(folder: Path) -> Path:
    """Two short trials, run, sealed."""
    protocol = folder / "axis.toml"
    protocol.write_text(PROTOCOL, encoding="utf-8")
    done = run_campaign("run", protocol, "--results", folder / "results", "--workers", "1")
    assert done.exit_code == 0, done.output
    return find_run(folder / "results")


def answers(archive: Path, scratch: Path, *, quick: bool = False) -> dict[str, Said]:
    """What each reader makes of the archive; the `quick` ones only, if asked.

    Args:
        archive: as `make_archive` made it, or damaged since.
        scratch: a new folder.
    """
    scratch.mkdir()
    protocol = archive.parents[1] / "axis.toml"
    said = {
        "open": _open(archive),
        "show": _show(archive),
        "show --json": _show(archive, "--json"),
        "export": _export(archive, scratch / "csv"),
    }
    if quick:
        return said
    return said | {
        "report": _report(archive, scratch / "report"),
        "rerun": _new_run(scratch / "rerun", "rerun", archive, "1"),
        "replay": _new_run(
            scratch / "replay", "run", protocol, "--backend", "replay", "--from", archive
        ),
    }


def places(archive: Path, rng: random.Random, count: int) -> Iterator[tuple[int, int]]:
    """Byte and bit of `count` flips, three of four of them outside the samples."""
    size = archive.stat().st_size
    stored = _stored_samples(archive)
    samples = [byte for first, length in stored for byte in range(first, first + length)]
    inside = set(samples)
    others = [byte for byte in range(size) if byte not in inside]
    for _ in range(count):
        yield rng.choice(samples if rng.random() < 0.25 else others), rng.randrange(8)


def flipped(content: bytes, place: tuple[int, int]) -> bytes:
    byte, bit = place
    changed = bytearray(content)
    changed[byte] ^= 1 << bit
    return bytes(changed)


def silently_wrong(said: dict[str, Said], whole: dict[str, Said]) -> list[str]:
    """Readers that neither behaved as on the whole archive nor told, with what they did."""
    return [
        f"{name}: exit {one.code}, told {one.told}, "
        f"{'' if one.made == whole[name].made else 'not '}as on the whole archive"
        for name, one in said.items()
        if not (one.told and one.code in (3, 4))
        and (one.code, one.made) != (whole[name].code, whole[name].made)
    ]


def wrongly_delivered(said: dict[str, Said], whole: dict[str, Said]) -> list[str]:
    """What a reader delivered of the damaged archive as good, and is not what was archived.

    An exported trial may lack its damaged channels; the others are as they were.
    """
    return [
        f"{name}: {key}"
        for name in said.keys() & {"open", "export", "rerun", "replay"}
        for key, value in said[name].made.items()
        if key.startswith("trial-")
        and value != whole[name].made.get(key)
        and not (key.endswith(".csv") and _columns(value) <= _columns(whole[name].made.get(key)))
    ]


def _columns(content: object) -> set[tuple[bytes, ...]]:
    """The columns of a CSV file, each from its heading on."""
    assert isinstance(content, bytes)
    return set(zip(*(line.split(b",") for line in content.splitlines()), strict=True))


def run_campaign(*arguments: object):
    with patch.object(typer.testing, "_get_command", what_can_be_typed):
        return CliRunner().invoke(app, [str(argument) for argument in arguments])


what_can_be_typed = cache(get_command)
"""It takes as long to find out as many a command."""


def code_of(done) -> int:
    """The exit code that `campaign.cli.main` would end with."""
    if isinstance(done.exception, CampaignError):
        return int(done.exception.exit_code)
    assert done.exception is None or isinstance(done.exception, SystemExit), repr(done.exception)
    return done.exit_code


def _told(done) -> bool:
    return TOLD in done.stderr or isinstance(done.exception, ArchiveError)


def _open(archive: Path) -> Said:
    made: dict[str, object] = {}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            run = campaign.open(archive)
            made["tests"], made["trials"] = run.tests.to_csv(), run.trials.to_csv()
            for trial in run:
                made[trial.name] = trial.frame().to_csv()
            for key, table in run.test("stabilization").tables.items():
                made[key] = table.to_csv()
        except ArchiveError:
            return Said(4, told=True, made=_trials(made))
    told = any(issubclass(each.category, campaign.ArchiveWarning) for each in caught)
    if told and run.damaged:
        assert run.trials.attrs["damaged"]
        assert _strict_refuses(archive)
    return Said(4 if told else 0, told, made)


def _trials(made: dict[str, object]) -> dict[str, object]:
    return {name: value for name, value in made.items() if name.startswith("trial-")}


def _strict_refuses(archive: Path) -> bool:
    try:
        campaign.open(archive, strict=True)
    except ArchiveError:
        return True
    return False


def _show(archive: Path, *options: str) -> Said:
    done = run_campaign("show", archive, *options)
    return Said(code_of(done), _told(done), {"text": done.stdout})


def _export(archive: Path, folder: Path) -> Said:
    done = run_campaign("export", archive, "--to", "csv", "--output", folder)
    files = _files(folder)
    listed = files.pop("damaged.csv", b"").count(b"\n") > 1
    told = _told(done) and (listed or not folder.exists())
    recordings = {name: text for name, text in files.items() if name.startswith("trial-")}
    table = pd.read_csv(folder / "trials.csv").to_dict("records") if folder.exists() else []
    return Said(code_of(done), told, recordings | {f"row {r['number']}": repr(r) for r in table})


def _report(archive: Path, folder: Path) -> Said:
    done = run_campaign("report", archive, "--output", folder)
    files = _files(folder)
    told = _told(done)
    if folder.exists():
        digest = open_run(archive).sha256.encode()
        del files[MARKER]  # hashes of the others
        page, numbers = files["report.html"], files["report.json"]
        for name in ("report.html", "report.json"):
            assert digest in files[name]  # of the file as it is: it differs by any flip
            files[name] = files[name].replace(digest, b"")
        told = told and bool(json.loads(numbers)["damaged"])
        if "not changed: it was made" not in done.stderr:  # results of before the damage
            root = open_run(archive).identity
            told = told and bool(read_results(results_path(archive), root).damaged)
        told = told and b"damage-heading" in page and b"tables/damaged.csv" in _names(files)
        told = told and all(TOLD.encode() in text for n, text in files.items() if n[-4:] == ".svg")
    return Said(code_of(done), told, dict(files))


def _names(files: dict[str, bytes]) -> bytes:
    return "\n".join(files).encode()


def _new_run(results: Path, *arguments: object) -> Said:
    done = run_campaign(*arguments, "--results", results)
    made: dict[str, object] = {}
    told = _told(done)
    if results.exists() and list(results.glob("*.nxs")):
        run = open_run(find_run(results))
        made = {t.trial.name: _content(t.recording()) for t in run.trials if t.ending.fault is None}
        faults = [t.ending.reason for t in run.trials if t.ending.fault is not None]
        told = bool(faults) or (told and "source damaged" in _decisions(run))
        made["said"] = "" if told else done.stdout.splitlines()[:-1]
    return Said(code_of(done), told, made)


def _decisions(run: RunReader) -> set[str]:
    return {entry.decision for entry in run.story.all(Decision)}


def _content(recording: Recording) -> tuple[object, ...]:
    channels = {name: channel.samples.tobytes() for name, channel in recording.channels.items()}
    return recording.time.tobytes(), channels, recording.events, recording.ending


def _files(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def _stored_samples(archive: Path) -> list[tuple[int, int]]:
    """Offset and length of every piece of samples."""
    found: list[tuple[int, int]] = []

    def visit(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and item.chunks is not None:
            for number in range(item.id.get_num_chunks()):
                info = item.id.get_chunk_info(number)
                found.append((info.byte_offset, info.size))

    with h5py.File(archive, "r") as file:
        file.visititems(visit)
    return found
