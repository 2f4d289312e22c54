"""From what ten laboratories hand over to a bench file, by the commands of the docs alone."""

from __future__ import annotations

from pathlib import Path

import pytest

from campaign.cli.main import app
from campaign.physics.bench import Bench
from campaign.protocol.bench_file import load_bench
from tests.importing.laboratories import LABORATORIES, Laboratory
from tests.importing.newcomer import completed, rig

PLACES = {
    "inertia": "axis.inertia",
    "coulomb positive": "friction.load.coulomb_torque",
    "coulomb negative": "friction.load.negative.coulomb_torque",
    "viscous positive": "friction.load.viscous_friction",
    "viscous negative": "friction.load.negative.viscous_friction",
}
EXCITED = {"inertia", "coulomb positive", "coulomb negative"}
"""What each of these motions asks for; viscous friction of some is small beside the others."""
EVERY_METHOD = {"linear motor", "joint"}
"""Identified by every method, as the docs begin; the others by one that all of them suffice for, as
what methods make of a motion is tried in tests/identify."""


def campaign(*words: str) -> None:
    assert not app(list(words), prog_name="campaign", standalone_mode=False)


def bench_of(folder: Path, laboratory: Laboratory, capsys: pytest.CaptureFixture[str]) -> Bench:
    """By docs/import.md and docs/identification.md, with what the mapping asks for filled in."""
    laboratory.write(folder)
    capsys.readouterr()
    campaign("import", "--guess", *laboratory.files)
    guessed = capsys.readouterr().out
    filled = completed(guessed, laboratory.units, times=laboratory.times)
    (folder / "mapping.toml").write_text(filled, encoding="utf-8")
    (folder / "rig.toml").write_text(rig(guessed), encoding="utf-8")
    campaign("plan", "mapping.toml", "--backend", "import")
    campaign("import", "mapping.toml")
    (run,) = (folder / "results").glob("*.nxs")
    own = () if laboratory.name in EVERY_METHOD else ("--model", "inverse_dynamics")
    campaign("identify", str(run), "--output", "bench.toml", *own)
    return load_bench("bench.toml")


@pytest.mark.slow
@pytest.mark.parametrize("laboratory", LABORATORIES, ids=lambda each: each.name)
def test_a_bench_from_files(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    laboratory: Laboratory,
) -> None:
    """Truth lies within twice the 95 % interval, as there is one seed for each of 50 numbers."""
    monkeypatch.chdir(tmp_path)
    bench = bench_of(tmp_path, laboratory, capsys)
    known = {name: bench.known.values[path] for name, path in PLACES.items()}
    assert bench.axis.kind == ("linear" if laboratory.linear else "rotary")
    measured = {name for name, each in known.items() if each.origin == "measured"}
    assert measured >= EXCITED
    for name in measured:
        interval = known[name].interval
        assert interval is not None
        low, high = map(float, interval)
        middle, half = (low + high) / 2, (high - low) / 2
        assert abs(middle - laboratory.rig.truth[name]) <= 2 * half, (name, interval)
        assert half < 0.1 * middle or name not in EXCITED, (name, interval)
