"""The fit whose exponent is held, on a map that ends below the Stribeck velocity."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.estimation.velocity_map import fit_direction

COULOMB = 30.2353
"""N m, of the bench as it was simulated, whose exponent is 2."""


POINTS = np.array([
    [0.0008726545986170941, 37.643127019958825, 0.003987120033287109],
    [0.0009789702919134342, 37.64212693548167, 0.003711786672807829],
    [0.0010982381553507972, 37.640732726758614, 0.0034578920316561527],
    [0.0012320361515957875, 37.638849284052164, 0.0032224107964456705],
    [0.0013821344726345573, 37.636352510213776, 0.003005070225429519],
    [0.001550518981225414, 37.63308453044632, 0.002801082762383066],
    [0.0017394250202889274, 37.62931081214366, 0.0002795130507140555],
    [0.0019513374244788566, 37.62382937216665, 2.153146210690179e-07],
    [0.0021890657343597826, 37.61674660447724, 6.522457060344975e-11],
    [0.0024557561020724615, 37.60771087495119, 7.105427357601002e-15],
    [0.0027549369295775832, 37.59620829670617, 0.0],
    [0.0030905664774909082, 37.58159431820636, 7.105427357601002e-15],
    [0.003467085234959605, 37.563062199894595, 7.105427357601002e-15],
    [0.003889474668810585, 37.5396046545485, 0.0],
    [0.004363323129983685, 37.50996772736335, 0.0],
])  # fmt: skip
"""Rate (rad/s), torque and its scatter (N m) of a noiseless map up to a seventh of vs."""


def test_a_held_exponent_that_is_the_true_one_fits_as_well_as_a_free_one() -> None:
    """The grid ends with the fastest speed, where no Stribeck effect at all is a local minimum."""
    speed, torque, scatter = POINTS.T
    fits = fit_direction(speed, torque, scatter).fits
    assert fits["2"].chi_square < 1.1 * fits["free"].chi_square
    assert fits["2"].values["coulomb_torque"] == pytest.approx(COULOMB, rel=1e-3)
