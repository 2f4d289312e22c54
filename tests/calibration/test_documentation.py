"""docs/calibration.md names every key, and its example is accepted."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from campaign.protocol.calibration import CalibrationOptions, CalibrationParameter

PAGE = (Path(__file__).parents[2] / "docs" / "calibration.md").read_text(encoding="utf-8")


def test_every_key_is_documented() -> None:
    for key in CalibrationOptions.model_fields:
        assert f"`{key}`" in PAGE or f"`[[calibration.{key}]]`" in PAGE, key
    for key in CalibrationParameter.model_fields:
        assert f"`{key}`" in PAGE, key


def test_example_is_valid() -> None:
    (block,) = re.findall(r"^```toml\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
    made = CalibrationOptions.model_validate(tomllib.loads(block)["calibration"])
    assert [parameter.name for parameter in made.parameter] == ["inertia", "gain"]


def test_defaults_of_the_page_are_the_programs() -> None:
    for key, default in re.findall(r"^\| `(\w+)` \| (?:whole )?number, ([\d.e-]+) \|", PAGE, re.M):
        assert CalibrationOptions.model_fields[key].default == float(default), key
