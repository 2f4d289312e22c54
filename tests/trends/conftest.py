"""Runs of the platform a month apart: with a drift, with a jump, with neither."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from campaign.trends import members
from tests.analysed_once import analysed_once
from tests.trends.laboratory import STATIC, archived, monthly


@pytest.fixture(autouse=True, scope="package")
def analyses() -> Iterator[None]:
    """The same runs are followed by many tests."""
    with analysed_once(members):
        yield


@pytest.fixture(scope="session")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of runs `drift-N`, `jump-N` and `still-N`; 0 is the first of each."""
    folder = tmp_path_factory.mktemp("trends")
    drift = [[f'{STATIC}="{20.84 * (1 + 0.03 * n):.4f} N m"'] for n in range(8)]
    jump = [[f'{STATIC}="{23.0 if n >= 5 else 20.84} N m"'] for n in range(8)]
    wanted = {f"drift-{n}": run for n, run in enumerate(monthly(drift, 100))}
    wanted |= {f"jump-{n}": run for n, run in enumerate(monthly(jump, 200))}
    wanted |= {f"still-{n}": run for n, run in enumerate(monthly([[]] * 8, 300))}
    archived(folder, wanted)
    return folder / "results"
