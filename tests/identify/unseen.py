"""Rigs as other laboratories have them, made up small: what each records, and what is true."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from campaign.cli.import_command import import_recordings
from campaign.errors import ExitCode
from campaign.estimate import Estimate
from campaign.identify import experiments_by_model
from campaign.identify.identification import Section, identify
from campaign.identify.material import choose

HEAD = 'schema = 2\ntitle = "Made up"\npublished = "none"\n'


def random(seed: int) -> np.random.Generator:
    return np.random.Generator(np.random.PCG64(seed))


def staircase(speeds: np.ndarray, hold: float, ramp: float, rate: float) -> np.ndarray:
    """A rate that stops between speeds, both directions of each, shape (n,)."""
    up = np.linspace(0.0, 1.0, round(ramp * rate), endpoint=False)
    one = np.concatenate([up, np.ones(round(hold * rate)), up[::-1], np.zeros(len(up))])
    return np.concatenate([sign * speed * one for speed in speeds for sign in (1.0, -1.0)])


def curve(
    speed: np.ndarray, coulomb: float, static: float, stribeck: float, viscous: float
) -> np.ndarray:
    return np.asarray(
        coulomb + (static - coulomb) * np.exp(-((speed / stribeck) ** 2)) + viscous * speed
    )


def imported(
    folder: Path,
    columns: dict[str, tuple[str, np.ndarray]],
    rate: float,
    *,
    name: str = "own",
    kind: str = "rotary",
    bench: str = "",
    test: str = "",
    accept: tuple[str, ...] = (),
) -> Path:
    """A text file with these columns (unit, samples) by channel, imported; its run's folder."""
    count = len(next(iter(columns.values()))[1])
    table = np.column_stack([np.arange(count) / rate, *(each for _, each in columns.values())])
    np.savetxt(
        folder / f"{name}.csv",
        table,
        delimiter=",",
        header=",".join(["t", *columns]),
        comments="",
        fmt="%.9g",
    )
    axis = f'schema = 3\nname = "rig"\n[axis]\nname = "axis"\nkind = "{kind}"\n'
    (folder / "rig.toml").write_text(axis + bench, encoding="utf-8")
    text = HEAD + '[columns.a.time]\ncolumn = "t"\nunit = "s"\n'
    for channel, (unit, _) in columns.items():
        text += f'[columns.a.{channel}]\ncolumn = "{channel}"\nunit = "{unit}"\n'
        text += f"accept = {list(accept)}\n" if accept else ""
    text += f'[[test]]\nname = "{name}"\nkind = "motion"\nbench = "./rig.toml"\n{test}'
    text += f'[[test.recording]]\nfile = "{name}.csv"\n'
    (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    code = import_recordings([str(folder / f"{name}.toml")], folder / f"results-{name}")
    assert code is ExitCode.DONE
    return folder / f"results-{name}"


def identified(results: Path, method: str, *settings: str) -> Section:
    """What one method makes of the only run there is."""
    run = next(path for path in results.glob("*.nxs") if not path.stem.endswith("-results"))
    chosen = choose(results, run.stem)
    return identify(chosen, experiments_by_model(), models=(method,), settings=settings).sections[0]


def told(section: Section) -> dict[str, Estimate]:
    """Its numbers by name."""
    assert section.result is not None, section.problem
    return {each.estimate.name: each.estimate for each in section.identified.parameters}


def notes(section: Section) -> str:
    """What it says besides."""
    assert section.result is not None, section.problem
    return " ".join(section.result.notes)
