"""`campaign model`: what a model's picture and numbers show against closed forms; mistakes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.system.user import campaign

BENCH = """\
name = "alone"
[friction.load]
model = "dahl"
coulomb_torque = "2 N m"
bristle_stiffness = "100 N m/rad"
viscous_friction = "0.5 N m s/rad"
"""
MOTION = ("--rate", "0.4 rad/s", "--frequency", "2 Hz")
WAY = 0.4 / (2.0 * np.pi * 2.0)
"""rad: half of what the load moves."""


def shown(folder: Path, *arguments: str) -> pd.DataFrame:
    done = campaign(folder, "model", *arguments)
    picture = folder / done.out.splitlines()[-1]
    assert picture.read_text(encoding="utf-8").startswith("<?xml")
    return pd.read_csv(picture.with_suffix(".csv"))


def test_dahl_and_coulomb_are_their_closed_forms(tmp_path: Path) -> None:
    (tmp_path / "alone.toml").write_text(BENCH, encoding="utf-8")
    found = shown(tmp_path, "dahl", "coulomb", *MOTION, "--bench", "alone.toml")
    time, rate, angle, dahl, coulomb = (found[name].to_numpy() for name in found)
    assert time[-1] == pytest.approx(0.5 - time[1])
    np.testing.assert_allclose(rate, 0.4 * np.sin(4.0 * np.pi * time), atol=1e-9)
    np.testing.assert_allclose(angle, -WAY * np.cos(4.0 * np.pi * time), atol=1e-9)
    moving = np.abs(rate) > 0.01
    dry = coulomb - 0.5 * rate
    np.testing.assert_allclose(dry[moving], 2.0 * np.sign(rate)[moving], rtol=1e-6)
    # From one end of the way to the other the deflection is forgotten by exp(-sigma0 x / Tc).
    most = 2.0 * np.tanh(100.0 * WAY / 2.0)
    forth = time < 0.25
    bent = 2.0 - (2.0 + most) * np.exp(-100.0 * (angle + WAY) / 2.0)
    np.testing.assert_allclose((dahl - 0.5 * rate)[forth], bent[forth], atol=2e-3)


def test_a_slow_lugre_slides_as_its_steady_curve(tmp_path: Path) -> None:
    """And a parameter that is set counts for every model that has it."""
    found = shown(
        tmp_path, "lugre", "stribeck", "--frequency", "0.01 Hz", "--set", "static_torque=40 N m",
        "--output", "both.svg",
    )  # fmt: skip
    fast = found["rate_rad_per_s"].abs() > 0.9 * found["rate_rad_per_s"].max()
    np.testing.assert_allclose(found["lugre_N_m"][fast], found["stribeck_N_m"][fast], rtol=2e-3)
    assert found["stribeck_N_m"].max() == pytest.approx(40.0, rel=2e-3)


@pytest.mark.slow
def test_specimens_are_drawn_beside_a_model_with_its_parameters(tmp_path: Path) -> None:
    """The bench of the thesis states all that they need; its viscous friction is not theirs."""
    motion = ("--rate", "5 deg/s", "--frequency", "0.1 Hz")
    found = shown(
        tmp_path, "asperity", "random-bristle", "dahl", *motion, "--set", "bristles=10000"
    )
    rate, asperity, bristle, dahl = found.iloc[:, [1, 3, 4, 5]].to_numpy().T
    assert [*found.columns[3:]] == ["asperity_N_m", "random-bristle_N_m", "dahl_N_m"]
    slides = np.abs(rate) > 0.06
    np.testing.assert_allclose(bristle[slides], (dahl - 4.0 * rate)[slides], rtol=0.02)
    np.testing.assert_allclose(np.abs(asperity[slides]), 26.0, rtol=0.15)  # 2000 asperities
    assert np.array_equal(np.sign(asperity[slides]), np.sign(rate[slides]))
    assert "no friction model 'asperitie'; did you mean 'asperity'?" in " ".join(
        campaign(tmp_path, "model", "asperitie", code=2).err.split()
    )
    (tmp_path / "alone.toml").write_text(BENCH.replace("dahl", "asperity"), encoding="utf-8")
    done = campaign(tmp_path, "model", "asperity", "--bench", "alone.toml", code=2)
    assert "'static_torque' is missing" in done.err


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("lugr",), "did you mean 'lugre'?"),
        (("gms",), "'attraction' is missing"),
        (("dahl", "--set", "attraction=1 N m/s"), "not a parameter of dahl"),
        (("dahl", "--rate", "2 N m"), "is not a unit of angular rate"),
        (("dahl", "--output", "dahl.png"), "a picture's name ends in .svg"),
        (("dahl", "--bench", "nobody"), "nobody"),
    ],
)
def test_mistakes_are_said_in_a_line(tmp_path: Path, arguments: tuple[str, ...], why: str) -> None:
    assert why in " ".join(campaign(tmp_path, "model", *arguments, code=2).err.split())
    assert list(tmp_path.glob("*.svg")) == []
