"""A bench without dry friction, whose stabilization error has a closed form, and its protocol."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from campaign.calibration.problem import CalibrationProblem, make_problem
from campaign.experiments import experiments
from campaign.protocol import load_protocol
from campaign.published.values import published_values

INERTIA, VISCOUS = 35.0, 12.0
"""The truth: kg m^2, N m s/rad."""
FREQUENCIES = (1.0, 3.0, 6.0, 10.0)
ACCELERATION = 2.0

BENCH = """\
# A made-up platform.
name = "smooth"                # no dry friction
[axis]
name = "azimuth"
inertia = "50000 g m^2"        # a guess
[motor]
torque_constant = "0.1 N m/A"
back_emf_constant = "0 V s/rad"
resistance = "0.1 ohm"
inductance = "0.2 mH"
[gear]
ratio = 100
[friction.load]
model = "stribeck"
static_torque = "0 N m"
coulomb_torque = "0 N m"
stribeck_velocity = "0.03 rad/s"
viscous_friction = "20 N m s/rad"  # another
[controller.rate]
form = "parallel"
proportional = "200 A s/rad"
integral = "6000 A/rad"
[controller.current]
form = "parallel"
proportional = "20 V/A"
integral = "2000 V/(A s)"
[compensation.static]
method = "friction-model"
gain = 0.8
friction = { load = { model = "stribeck", static_torque = "1 N m", coulomb_torque = "1 N m", \
stribeck_velocity = "0.03 rad/s" } }
[limits]
angle = "200 deg"
rate = "200 deg/s"
acceleration = "1000 deg/s^2"
torque = "5 kN m"
current = "500 A"
duration = "1 h"
"""

PROTOCOL = """\
published = "table.toml"
[[test]]
name = "sea"
kind = "stabilization"
bench = "bench.toml"
reproduces = ["A.1"]
acceleration = "2 rad/s^2"
cycles = 2
settle_cycles = 1
matrix = { frequency = ["1 Hz", "3 Hz", "6 Hz", "10 Hz"] }
[calibration]
bench = "bench.toml"
cells = ["A.1"]
starts = 2
max_evaluations = 30
longest_step = "0.5 ms"
weights = { "A.1" = "1 %" }
[[calibration.parameter]]
name = "inertia"
path = "axis.inertia"
lower = "20 kg m^2"
upper = "80 kg m^2"
scale = "log"
[[calibration.parameter]]
name = "viscous"
path = "friction.load.viscous_friction"
lower = "5 N m s/rad"
upper = "40 N m s/rad"
"""


def error(frequency: float) -> float:
    """Stabilization error (rad, 1 sigma) of the true bench, from its transfer function by hand.

    With P = Kpc + Kic/s, C = Kpv + Kiv/s, k = N Kt and no back-EMF:
    w [(L s + R + P) (J s + B) / k + P C] = (L s + R + P) (B / k) wb.
    """
    s = 2j * np.pi * frequency
    p, c, k = 20 + 2000 / s, 200 + 6000 / s, 100 * 0.1
    impedance = 0.2e-3 * s + 0.1 + p
    rate = (impedance * VISCOUS / k) / (impedance * (INERTIA * s + VISCOUS) / k + p * c)
    base_rate = ACCELERATION / (2 * np.pi * frequency)
    return float(abs(rate / s) * base_rate / np.sqrt(2))


def table(scale: tuple[float, ...] = (1.0,) * len(FREQUENCIES)) -> str:
    """A published table of these errors, each times its entry of `scale`."""
    cells = "\n".join(
        f'"{f}" = [{1e6 * error(f) * factor:.6g}]'
        for f, factor in zip(FREQUENCIES, scale, strict=True)
    )
    return f"""\
source = "worked out by hand"
[[table]]
name = "A.1"
title = "Stabilization error of a smooth platform"
quantity = "stabilization_error"
unit = "urad"
conditions = {{ acceleration = "2 rad/s^2" }}
rows = {{ condition = "frequency", unit = "Hz" }}
column.error = {{}}
[table.cells]
{cells}
[[table]]
name = "B.1"
title = "Nothing that was measured"
quantity = "mystery"
unit = "Hz"
rows = {{ condition = "what" }}
column.value = {{}}
[table.cells]
this = [1.0]
"""


def write(
    folder: Path, protocol: str = PROTOCOL, bench: str = BENCH, published: str | None = None
) -> Path:
    """The three files in `folder`; path of the protocol."""
    for name, text in (
        ("calibrate.toml", protocol),
        ("bench.toml", bench),
        ("table.toml", table() if published is None else published),
    ):
        (folder / name).write_text(text, encoding="utf-8")
    return folder / "calibrate.toml"


def problem(path: Path) -> CalibrationProblem:
    """The problem as the command makes it."""
    protocol = load_protocol(path, experiments(), shipped=path.parent)
    own = protocol.sources[protocol.published]
    return make_problem(protocol, published_values(own, protocol.published))
