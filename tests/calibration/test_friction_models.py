"""A bench with any friction model is calibrated: its parameters are paths, no name is known."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from campaign.calibration.objective import Simulation
from campaign.calibration.outcome import calibrate
from campaign.experiments import experiments
from campaign.options import describe
from campaign.physics.friction import friction_models
from tests.physics.friction.cases import CURVE, MODELS

from .laboratory import ACCELERATION, BENCH, FREQUENCIES, INERTIA, PROTOCOL, problem, table, write

STIFFNESS = 3000.0
"""The truth, N m/rad."""
PARAMETER = """\
[[calibration.parameter]]
name = "{name}"
path = "friction.load.{name}"
lower = "{lower} {unit}"
upper = "{upper} {unit}"
"""
BEFORE = PROTOCOL[: PROTOCOL.index("[[calibration.parameter]]")]
EVERY = {
    "coulomb": {"coulomb_torque": 26.0, "viscous_friction": 4.0},
    "stribeck": CURVE,
    **MODELS,
}


def bench(friction: str) -> str:
    """The laboratory's bench with other friction of the load."""
    return re.sub(r"(?s)(?<=\[friction\.load\]\n).*?(?=\[controller)", friction, BENCH)


def quantities(model: str) -> dict[str, tuple[float, str]]:
    """Value and unit of each parameter of `EVERY` that has one."""
    units = {info.name: info.quantity for info in describe(friction_models()[model].options)}
    return {
        name: (value, quantity.si)
        for name, value in EVERY[model].items()
        if (quantity := units[name]) is not None
    }


def test_every_model_is_among_them() -> None:
    assert set(EVERY) == set(friction_models())


@pytest.mark.parametrize("model", EVERY)
def test_each_parameter_of_each_model_is_a_path(tmp_path: Path, model: str) -> None:
    told = quantities(model)
    written = [f'{name} = "{value} {unit}"\n' for name, (value, unit) in told.items()]
    asked = [
        PARAMETER.format(name=name, unit=unit, lower=0.99 * value, upper=1.01 * value)
        for name, (value, unit) in told.items()
    ]
    path = write(tmp_path, BEFORE + "".join(asked), bench(f'model = "{model}"\n{"".join(written)}'))
    made = problem(path)
    assert [parameter.name for parameter in made.space.parameters] == list(told)
    moved = made.space.bench(made.calibration.bench.tree, [v for v, _ in told.values()])
    assert moved["friction"]["load"]["coulomb_torque"] == f"{told['coulomb_torque'][0]!r} N m"


def spring_error(frequency: float) -> float:
    """Stabilization error (rad, 1 sigma) of a load on bristles that never slip.

    As `laboratory.error`, with K/s in place of B.
    """
    s = 2j * np.pi * frequency
    p, c, k, held = 20 + 2000 / s, 200 + 6000 / s, 100 * 0.1, STIFFNESS / s
    impedance = 0.2e-3 * s + 0.1 + p
    rate = (impedance * held / k) / (impedance * (INERTIA * s + held) / k + p * c)
    return float(abs(rate / s) * ACCELERATION / (2 * np.pi * frequency) / np.sqrt(2))


def cells(found: list[float]) -> str:
    """The laboratory's table with these errors (urad)."""
    rows = "\n".join(f'"{f}" = [{value:.9g}]' for f, value in zip(FREQUENCIES, found, strict=True))
    return re.sub(r'(?s)(?<=\[table\.cells\]\n)"1\.0".*?(?=\n\[\[table)', rows, table())


BRISTLE = PARAMETER.format(name="bristle_stiffness", unit="N m/rad", lower=1000, upper=8000)


def fitted(path: Path) -> tuple[float, ...]:
    made = problem(path)
    return calibrate(
        made, experiments(), workers=1, display=lambda progress: None, leave_out=False
    ).values


@pytest.mark.slow
@pytest.mark.parametrize("model", ["dahl", "gms"])
def test_bristles_that_never_slip_are_found_from_a_closed_form(tmp_path: Path, model: str) -> None:
    told = {name: unit for name, (_, unit) in quantities(model).items()}
    # No bristle slips below a torque of 1e6 N m: the load is on a spring.
    values = {**dict.fromkeys(told, 1.0), "viscous_friction": 0.0, "bristle_stiffness": 2000.0}
    values |= {"coulomb_torque": 1e6, "static_torque": 1e6}
    lines = "".join(f'{name} = "{values[name]} {unit}"\n' for name, unit in told.items())
    published = cells([1e6 * spring_error(f) for f in FREQUENCIES])
    inertia = PROTOCOL[PROTOCOL.index("[[cal") : PROTOCOL.rindex("[[cal")]
    # On a spring the start of the motion dies away slowly.
    one = BEFORE.replace("starts = 2", "starts = 1").replace(
        "settle_cycles = 1", "settle_cycles = 8"
    )
    path = write(tmp_path, one + inertia + BRISTLE, bench(f'model = "{model}"\n{lines}'), published)
    assert fitted(path) == pytest.approx((INERTIA, STIFFNESS), rel=5e-3)


@pytest.mark.slow
def test_friction_that_slides_is_found_from_simulated_cells(tmp_path: Path) -> None:
    """Parameters of gms by their effect alone."""
    friction = """\
model = "gms"
coulomb_torque = "{coulomb} N m"
static_torque = "40 N m"
stribeck_velocity = "0.03 rad/s"
viscous_friction = "4 N m s/rad"
bristle_stiffness = "{stiffness} N m/rad"
attraction = "3000 N m/s"
"""
    torque = PARAMETER.format(name="coulomb_torque", unit="N m", lower=15, upper=39)
    protocol = BEFORE.replace("starts = 2", "starts = 1") + torque + BRISTLE
    truth = write(tmp_path, protocol, bench(friction.format(coulomb=26, stiffness=3000)))
    seen = Simulation(problem(truth), experiments(), 1).check().found
    published = cells(list(seen.values()))
    guess = bench(friction.format(coulomb=35, stiffness=5000))
    path = write(tmp_path, protocol, guess, published)
    assert fitted(path) == pytest.approx((26.0, 3000.0), rel=0.01)
