"""MAT version 5, which MATLAB, Octave and SciPy read.

Each channel is a column variable. The structs `units` and `labels` have a field per variable. The
struct `trial` contains the executed trial, its ending, and the damage of its run.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from campaign.api import TrialView
from campaign.archive.reading.damage_words import in_words
from campaign.errors import UsageError
from campaign.export.interface import ExportKind
from campaign.recording import Recording
from campaign.result import is_number
from campaign.trial import canonical_json

LARGEST = 2**31 - 1
"""Most bytes of a variable in version 5; version 7.3 would be HDF5, as the archive is."""

_LONGEST = 63  # characters of a name
_STRUCTS = ("units", "labels", "trial")
_KEYWORDS = (
    "break case catch classdef continue else elseif end for function global if otherwise parfor "
    "persistent return spmd switch try while"
)


def _write(trial: TrialView, recording: Recording, path: Path) -> None:
    from scipy.io import savemat

    check_size(trial.name, len(recording.time))
    channels = list(recording.channels.values())
    names = matlab_names(["time", *(channel.name for channel in channels)], taken=_STRUCTS)
    series = [recording.time, *(channel.samples for channel in channels)]
    units = ["s", *(channel.unit for channel in channels)]
    labels = ["Time", *(channel.label for channel in channels)]
    variables: dict[str, Any] = dict(zip(names, series, strict=True))
    variables["units"] = dict(zip(names, map(_ascii, units), strict=True))
    variables["labels"] = dict(zip(names, map(_ascii, labels), strict=True))
    variables["trial"] = _about(trial)
    savemat(path, variables, long_field_names=True, do_compression=True, oned_as="column")


def check_size(name: str, samples: int) -> None:
    """Check that a series of this many samples fits. Raises UsageError."""
    if samples * 8 > LARGEST:
        raise UsageError(
            f"{name}: {samples} samples are more than a variable of a MAT file of version 5 holds "
            "(2 GB); export to parquet, or read the archive itself: it is HDF5"
        )


def matlab_names(names: Iterable[str], taken: Iterable[str] = ()) -> list[str]:
    """Convert names to valid, unique MATLAB names: at most 63 letters, digits and `_`."""
    used = {*taken, *_KEYWORDS.split()}
    valid = []
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9_]", "_", name)
        plain = plain if plain[:1].isalpha() else f"x{plain}"
        choice, number = plain[:_LONGEST], 1
        while choice in used:
            number += 1
            choice = f"{plain[: _LONGEST - len(str(number)) - 1]}_{number}"
        used.add(choice)
        valid.append(choice)
    return valid


def _about(trial: TrialView) -> dict[str, Any]:
    executed, ending = trial.trial, trial.ending
    return {
        "number": float(executed.number),
        "test": _ascii(executed.test),
        "kind": _ascii(executed.kind),
        "role": executed.role.value,
        "repeat": float(executed.repeat),
        "point": _struct(executed.point),
        "seed": np.uint64(executed.seed),  # a double cannot hold its 63 bits
        "outcome": ending.outcome.value,
        "reason": _ascii(ending.reason),
        "damaged": _ascii("\n".join(map(in_words, trial.damaged))),
        "json": canonical_json(executed.model_dump(mode="json")),
    }


def _struct(tree: Mapping[str, Any]) -> dict[str, Any]:
    """Struct of swept values: numbers, booleans and text unchanged, anything else as JSON."""
    plain = [
        float(value)
        if is_number(value)
        else value
        if isinstance(value, bool)
        else _ascii(value if isinstance(value, str) else canonical_json(value))
        for value in tree.values()
    ]
    return dict(zip(matlab_names(tree), plain, strict=True))


def _ascii(text: str) -> str:
    r"""Replace other letters by escapes such as `\xb0`, because Octave cuts a text at them."""
    return text.encode("ascii", "backslashreplace").decode("ascii")


EXPORT = ExportKind("mat", "version 5, for MATLAB and Octave", ".mat", _write)
