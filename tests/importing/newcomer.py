"""What a person does with a guessed mapping: no more than its comments ask for."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import campaign
from campaign.cli.import_command import import_recordings
from campaign.cli.run_options import RunOptions
from campaign.errors import ExitCode
from campaign.importing.guess import guess, mapping_text

_LINE = re.compile(r"# \? (\[columns\.\w+\.\w+\]|column = .*|unit = .*|times = .*)")
_HEAD = re.compile(r"(?:# \? )?\[columns\.\w+\.(\w+)\]")


def rig(text: str) -> str:
    """The rig.toml that the head of a mapping asks for, with names filled in."""
    lines = [line[9:] for line in text.splitlines() if line.startswith("#        ")]
    return "\n".join(lines).replace('"..."', '"stand"') + "\n"


def completed(
    text: str,
    units: Mapping[str, str],
    channels: Mapping[str, tuple[str, str]] | None = None,
    times: str | Mapping[str, str] = "",
) -> str:
    """A guessed mapping, completed.

    Args:
        units: by channel, where the file and the guess have none.
        channels: of columns that were taken for nothing: which channel each is, and its unit.
        times: the constant of each channel that measures something else; alone that of the
            drive's torque, "" where it has a column.
    """
    constants = {"drive_torque": times} if isinstance(times, str) else times
    found: list[str] = []
    at = ""
    lines = iter(text.splitlines())
    for line in lines:
        if line.endswith(".CHANNEL]"):
            column = next(lines)
            unit = next(lines)
            name = re.findall(r'"(.*)"', column)[0]
            if name in (channels or {}):
                channel, its = (channels or {})[name]
                head = line.removeprefix("# ").replace("CHANNEL", channel)
                found += [head, column.removeprefix("# "), f'unit = "{its}"']
                assert "unit" in unit
            continue
        asked = _LINE.match(line)
        if asked is None:
            found += [] if line.startswith("# ?") else [line]
        line = asked[1] if asked else line
        at = found_head[1] if (found_head := _HEAD.match(line)) else at
        constant = constants.get(at, "")
        if asked is None or (line.startswith("[") and not constant):
            continue
        if line.startswith(("times", "[", "column")):
            line = f'times = "{constant}"' if line.startswith("times") else line
            found += [line] if constant else []
        elif '"..."' in line:
            unit = units.get(at, "")
            found += [f'unit = "{unit}"'] if unit else []
        elif at != "drive_torque" or constant:
            found.append(line.split("  #")[0])
    return "\n".join(found) + "\n"


def imported(files: list[Path], **completing: Any) -> Any:
    """The run that a newcomer's import of these files makes, with its report."""
    folder = files[0].parent
    text = mapping_text(guess(files), folder)
    (folder / "rig.toml").write_text(rig(text), encoding="utf-8")
    (folder / "mapping.toml").write_text(completed(text, **completing), encoding="utf-8")
    mapping = str(folder / "mapping.toml")
    code = import_recordings([mapping], folder / "results", RunOptions(workers=1, report=True))
    assert code is ExitCode.DONE
    assert next((folder / "results").glob("*-report")) / "report.html"
    return campaign.open(next((folder / "results").glob("*-mapping.nxs")))
