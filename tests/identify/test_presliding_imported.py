"""Small motions from elsewhere: a mapping as docs/identification.md has it, and what is refused."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from campaign.cli.import_command import import_recordings
from campaign.errors import ExitCode
from campaign.identify import experiments_by_model
from campaign.identify.identification import Section, identify
from campaign.identify.material import choose
from tests.estimation.bristle_plants import Array, Interface, Truth, multisine
from tests.estimation.coverage import holds

PLANT = Truth(2.0, 1.0, (Interface(5000.0, 60.0, 8.0, 6.0, 0.01),))
"""2 kg m^2, held by 5000 N m/rad and 60 + 1 N m s/rad; slips at 8 N m."""
LATE = 1300
"""Samples before which nobody recorded: the recording begins in the middle of a motion."""
TIME = np.arange(0.0, 10.0, 1e-3)
DOCUMENT = Path(__file__).parents[2] / "docs" / "identification.md"


def triangle(time: Array) -> Array:
    """A slow torque that reverses: 4 N m, every second."""
    return np.asarray(4.0 * (2.0 / np.pi) * np.arcsin(np.sin(np.pi * time)))


def sliding(time: Array) -> Array:
    """A torque far above breakaway."""
    return np.asarray(30.0 * np.sin(2.0 * np.pi * 0.5 * time))


MOTIONS: dict[str, Callable[[Array], Array]] = {
    "small-1": multisine(1, 0.5, 0.5, 40.0),
    "small-2": multisine(2, 1.0, 0.5, 40.0),
    "reversals": triangle,
    "sliding": sliding,
}


def documented(name: str) -> str:
    """The file of that name as the document has it."""
    text = DOCUMENT.read_text(encoding="utf-8")
    found = re.search(rf"```toml\n(# {re.escape(name)}\n.*?)```", text, re.DOTALL)
    assert found is not None, name
    return found.group(1)


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("small")
    rng = np.random.default_rng(6)
    for name, torque in MOTIONS.items():
        angle, _ = PLANT.answer(torque, TIME)
        rows = np.column_stack(
            [
                TIME,
                torque(TIME) + 3e-3 * rng.standard_normal(len(TIME)),
                angle + 2e-7 * rng.standard_normal(len(TIME)),
            ]
        )
        path = folder / f"{name}.csv"
        np.savetxt(path, rows[LATE:], delimiter=",", header="t,T,q", comments="", fmt="%.9g")
    (folder / "tilt.toml").write_text(documented("tilt.toml"), encoding="utf-8")
    mapping = documented("small.toml")
    for name in ("reversals", "sliding"):
        mapping += (
            f'\n[[test]]\nname = "{name}"\nkind = "motion"\nbench = "./tilt.toml"\n'
            f'\n[[test.recording]]\nfile = "{name}.csv"\n'
        )
    (folder / "small.toml").write_text(mapping, encoding="utf-8")
    code = import_recordings([str(folder / "small.toml")], folder / "results")
    assert code is ExitCode.DONE
    return folder / "results"


def section(results: Path, test: str) -> Section:
    run = next(results.glob("*-small.nxs")).stem
    found = identify(
        choose(results, f"{run}:{test}"), experiments_by_model(), models=("presliding",)
    )
    (own,) = found.sections
    return own


@pytest.mark.slow
def test_an_imported_small_motion_tells_stiffness_damping_and_inertia(results: Path) -> None:
    own = section(results, "small")
    assert own.result is not None, own.problem
    assert len(own.trials) == 2
    told = {each.estimate.name: each for each in own.identified.parameters}
    for name, true, key in (
        ("stiffness_at_rest", 5000.0, "friction.load.bristle_stiffness"),
        ("bristle_damping", 60.0, "friction.load.bristle_damping"),
        ("inertia", 2.0, "axis.inertia"),
    ):
        assert holds(told[name].estimate, true), (name, told[name].estimate)
        assert told[name].estimate.half_width < 0.02 * true
        assert told[name].bench == key
    assert any("These were not planned" in note for note in own.result.notes)


def test_slow_reversals_tell_stiffness_and_no_inertia(results: Path) -> None:
    own = section(results, "reversals")
    assert own.result is not None, own.problem
    told = {each.estimate.name: each.estimate for each in own.identified.parameters}
    stiffness = told["stiffness_at_rest"]
    assert not stiffness.has_interval or holds(stiffness, 5000.0)
    inertia = told.get("inertia")
    assert inertia is None or not inertia.has_interval or holds(inertia, 2.0)


def test_a_sliding_recording_is_not_taken_and_the_reason_is_told(results: Path) -> None:
    own = section(results, "sliding")
    assert own.result is None
    assert own.trials == ()  # nothing was fitted
    assert "no trial is a small motion below breakaway" in own.problem
    assert "slides" in own.problem or "does not come back" in own.problem
