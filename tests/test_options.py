"""What `campaign kinds` says about options, whatever way they are declared."""

from __future__ import annotations

from typing import Annotated, Literal

import pytest
from pydantic import Field

from campaign.options import Options, describe
from campaign.physics.bench import Bench
from campaign.units import ANGLE, TIME, Angle, Frequency, Time


class Soft(Options):
    shape: Literal["soft"] = "soft"


class Hard(Options):
    shape: Literal["hard"] = "hard"


class Stop(Options):
    angle: Angle = Field(gt=0)
    """Where it is."""


class Example(Options):
    rate: Frequency | None = None
    """Absent for
    continuous."""
    times: tuple[Time, ...] = (0.001,)
    order: Literal["forward", "random"] = "forward"
    stop: Stop
    end: Annotated[Soft | Hard, Field(discriminator="shape")] = Soft()
    many: dict[str, Soft | Hard] = {}
    quick: bool = False


@pytest.fixture
def info():
    return {info.name: info for info in describe(Example)}


def test_a_quantity_is_found_inside_optional_and_list_types(info):
    assert info["rate"].unit == "Hz"
    assert (info["times"].quantity, info["times"].accepts) == (TIME, "list of values")
    assert info["times"].default == (0.001,)


def test_a_table_is_followed_by_what_is_in_it(info):
    assert list(info)[3:5] == ["stop", "stop.angle"]
    assert info["stop"].required
    assert (info["stop.angle"].quantity, info["stop.angle"].meaning) == (ANGLE, "Where it is.")


def test_alternatives_are_told_by_the_word_that_chooses_them(info):
    assert info["order"].accepts == "forward | random"
    assert info["end"].accepts == "table: shape = soft | shape = hard"
    assert info["many"].accepts == "table: shape = soft | shape = hard"


def test_a_meaning_is_one_line(info):
    assert info["rate"].meaning == "Absent for continuous."


def test_a_flag_says_so(info):
    assert (info["quick"].accepts, info["quick"].default) == ("true or false", False)


@pytest.mark.slow
def test_a_table_of_paths_is_listed_with_what_its_values_take():
    found = {info.name: info for info in describe(Bench)}
    shares = found["gear.preload.shares"]
    assert (shares.accepts, shares.default) == ("table of number", {"static_torque": 1.0})
    for table in ("variation.day_to_day", "variation.trial_to_trial"):
        within = found[f"{table}.NAME.relative"]
        assert (found[table].accepts, within.accepts) == ("table", "number")
        assert found[f"{table}.NAME.paths"].accepts == "list of text"
