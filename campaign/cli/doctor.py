"""`campaign doctor`: the installation, its problems, and advice."""

from __future__ import annotations

import importlib.metadata
import platform
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Literal, NamedTuple

from packaging.requirements import Requirement

from campaign.cli.output import bytes_text, print_json, print_table
from campaign.errors import ExitCode

LITTLE = 2_000_000_000
"""Free bytes of a disk that may be too few for a run of hours."""
Verdict = Literal["fine", "absent", "look", "wrong"]


class Finding(NamedTuple):
    """One line. `verdict`: `absent` is an optional extra; `wrong` prevents some function."""

    what: str
    is_: str
    verdict: Verdict = "fine"
    advice: str = ""


def examine(results: Path, *, as_json: bool) -> ExitCode:
    """Print all findings; return USAGE if one of them is wrong."""
    findings = [*_program(), *_libraries(), *_plug_ins(), *_cache(), *_disk(results), *_ports()]
    if as_json:
        keys = ("what", "is", "verdict", "advice")
        print_json([dict(zip(keys, finding, strict=True)) for finding in findings])
    else:
        print_table(("what", "is", "verdict", "what to do"), findings)
    return ExitCode.USAGE if any(f.verdict == "wrong" for f in findings) else ExitCode.DONE


def _program() -> Iterator[Finding]:
    from campaign.execution.provenance import versions

    numbers = versions()
    yield Finding("campaign", f"{numbers.pop('campaign')} at {Path(__file__).parents[1]}")
    own = (f"{name} {numbers[name]}" for name in ("engine", "format", "wire"))
    yield Finding("formats", ", ".join(own))
    where = f"{platform.python_version()} at {sys.executable}"
    yield Finding("Python", f"{where}, {platform.system()} {platform.machine()}")


def _libraries() -> Iterator[Finding]:
    """Libraries that the installed package requires, compared with its version ranges."""
    for text in importlib.metadata.requires("campaign") or ():
        asked = Requirement(text)
        extra = str(asked.marker or "").partition("extra == ")[2].strip("'\"")
        if extra in ("all", "test", "mutants") or asked.name == "campaign":
            continue
        label = f"extra {extra}: {asked.name}" if extra else asked.name
        try:
            version = importlib.metadata.version(asked.name)
        except importlib.metadata.PackageNotFoundError:
            if extra:
                yield Finding(label, "absent", "absent", f"pip install 'campaign[{extra}]'")
            else:
                yield Finding(label, "absent", "wrong", "install campaign again with pip")
            continue
        if asked.specifier.contains(version, prereleases=True):
            yield Finding(label, version)
        else:
            advice = f"required is {asked.specifier}: pip install '{asked.name}{asked.specifier}'"
            yield Finding(label, version, "wrong", advice)


def _plug_ins() -> Iterator[Finding]:
    """Kinds of other packages; for a broken one, the reason."""
    from campaign.cli.kinds import rooms

    for room in rooms():
        for name, kind in room.described():
            if isinstance(kind, str):
                yield Finding(f"{room.room} {name}", "broken", "wrong", kind)
            elif (plug_in := room.plug_in(name)) is not None:
                yield Finding(f"{room.room} {name}", f"{plug_in.distribution} {plug_in.version}")


def _cache() -> Iterator[Finding]:
    from campaign.physics.compilation import distrusted
    from campaign.physics.machine_code import WIDTHS, folder, is_made

    where = folder()
    if where is None:
        advice = distrusted() or "set NUMBA_CACHE_DIR to a folder that can be written"
        yield Finding("compiled engine", "not kept: each run compiles", "look", advice)
        return
    size = bytes_text(sum(each.stat().st_size for each in where.rglob("*") if each.is_file()))
    made = all(map(is_made, WIDTHS))
    state = f"{'made' if made else 'not made'}, {size} in {where}"
    yield Finding(
        "compiled engine", state, "fine" if made else "look", "" if made else "campaign warmup"
    )


def _disk(results: Path) -> Iterator[Finding]:
    existing = next(
        each for each in (results.absolute(), *results.absolute().parents) if each.exists()
    )
    free = shutil.disk_usage(existing).free
    advice = "runs of hours need more" if free < LITTLE else ""
    yield Finding(
        "disk", f"{bytes_text(free)} free at {existing}", "look" if advice else "fine", advice
    )


def _ports() -> Iterator[Finding]:
    try:
        from serial.tools import list_ports
    except ImportError:
        return  # `_libraries` reports the absent extra
    ports = [f"{each.device} ({each.description})" for each in list_ports.comports()]
    yield Finding("serial ports", ", ".join(ports) or "none")
