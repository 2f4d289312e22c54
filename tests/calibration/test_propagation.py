"""The covariance of a calibration and what it makes of reproduced numbers, against closed forms."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from campaign.calibration.document import result_text
from campaign.calibration.outcome import CalibrationOutcome, calibrate
from campaign.calibration.propagation import principal_steps
from campaign.experiments import experiments
from campaign.published.calibration_covariance import calibration_part

from . import laboratory
from .laboratory import BENCH, FREQUENCIES, PROTOCOL, problem, table, write

SCALE = (1.02, 0.98, 1.02, 0.98)


def outcome(
    folder: Path, *, fit: bool = True, protocol: str = PROTOCOL, bench: str = BENCH
) -> CalibrationOutcome:
    plain = protocol.replace("starts = 2", 'starts = 1\nloss = "linear"')
    path = write(folder, plain, bench, published=table(SCALE))
    return calibrate(
        problem(path), experiments(), workers=1, display=lambda _: None, leave_out=False, fit=fit
    )


def gradient(inertia: float, viscous: float) -> np.ndarray:
    """d ln(error) / d share of range by the closed form: inertia logarithmic, viscous linear."""

    def log_error(j: float, b: float) -> np.ndarray:
        before = laboratory.INERTIA, laboratory.VISCOUS
        laboratory.INERTIA, laboratory.VISCOUS = j, b
        try:
            return np.log([laboratory.error(f) for f in FREQUENCIES])
        finally:
            laboratory.INERTIA, laboratory.VISCOUS = before

    step = 1e-4
    by_inertia = log_error(inertia * 4.0**step, viscous) - log_error(inertia / 4.0**step, viscous)
    by_viscous = log_error(inertia, viscous + 35 * step) - log_error(inertia, viscous - 35 * step)
    return np.stack([by_inertia, by_viscous], axis=1) / (2 * step)


def test_principal_steps_make_up_the_covariance() -> None:
    root = np.array([[2.0, 0.0, 1.0], [0.5, 1.0, 0.0]])
    covariance = root.T @ root  # of rank 2
    steps = principal_steps(covariance)
    assert steps.shape == (2, 3)
    np.testing.assert_allclose(steps.T @ steps, covariance, atol=1e-12)


@pytest.mark.slow
def test_covariance_and_propagation_are_those_of_least_squares(tmp_path: Path) -> None:
    """C = s^2 (J'J)^-1 with weights of 1 %; a cell's relative variance is g C g'."""
    found = outcome(tmp_path)
    assert found.uncertainty is not None
    assert found.propagation is not None
    slopes = gradient(*found.values)
    # Four cells, two unknowns: two degrees of freedom; the residuals widen, as they exceed 1 %.
    scatter = found.uncertainty.scatter
    assert scatter > 1.5
    expected = (0.01 * scatter) ** 2 * np.linalg.inv(slopes.T @ slopes)
    np.testing.assert_allclose(found.uncertainty.covariance, expected, rtol=0.03)
    relative = np.sqrt(np.einsum("ni,ij,nj->n", slopes, expected, slopes))
    for frequency, size in zip(FREQUENCIES, relative, strict=True):
        path = f"A.1/{frequency}/error"
        value = found.fitted.found[path]
        assert found.propagation.uncertainty[path] == pytest.approx(size * value, rel=0.03)


@pytest.mark.slow
def test_the_result_is_read_where_it_is_needed(tmp_path: Path) -> None:
    found = outcome(tmp_path)
    bench = '[known]\nfingerprint = { bench = "0123456789abcdef" }'
    text = result_text(found, "b.toml", bench)
    part = calibration_part({"calibration/b.toml": text}, "0123456789abcdef")
    assert part.freedom == 2
    assert found.propagation is not None
    for path, size in found.propagation.uncertainty.items():
        assert part.standard_uncertainty[path] == pytest.approx(size, rel=1e-5)
    matrix = tomllib.loads(text)["covariance"]["matrix"]
    assert found.uncertainty is not None
    np.testing.assert_allclose(matrix, found.uncertainty.covariance, rtol=1e-5)


def test_without_a_fit_the_bench_stays_as_it_is(tmp_path: Path) -> None:
    bench = BENCH.replace("50000 g m^2", "36 kg m^2").replace('"20 N m s/rad"', '"12 N m s/rad"')
    found = outcome(tmp_path, fit=False, bench=bench)
    assert found.values == pytest.approx((36.0, 12.0))
    assert found.starts == ()
    assert found.uncertainty is not None
    assert found.propagation is not None
    result = tomllib.loads(result_text(found, "b.toml"))
    assert result["starts"] == 0
    assert result["parameter"][0]["value"] == result["parameter"][0]["before"] == "36 kg m^2"


@pytest.mark.slow
def test_an_unknown_that_is_not_determined_leaves_no_covariance(tmp_path: Path) -> None:
    idle = """
[[calibration.parameter]]
name = "idle"
path = "compensation.static.gain"
lower = 0.1
upper = 1.0
"""
    found = outcome(tmp_path, protocol=PROTOCOL + idle)
    assert found.uncertainty is not None
    assert found.uncertainty.covariance is None
    assert found.propagation is None
    assert "propagation" not in tomllib.loads(result_text(found, "b.toml"))
