"""Translation of step functions: what is refused, and how names become names of a target."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any, get_type_hints

import pytest

from campaign.cli.bench_commands import export_compensation_command
from campaign.controller_code.compensation import SampledCompensation
from campaign.controller_code.syntax import INTEGER, MOTION, ROWS, Syntax, plain
from campaign.controller_code.targets import c, matlab, structured_text, targets
from campaign.controller_code.transpile import Program
from campaign.errors import UsageError
from campaign.physics.compilation import called
from campaign.physics.elementary import bits_of, double_of, exp, where
from campaign.protocol.bench_file import simulable
from tests.controller_code.cases import of_an_evil_name

SYNTAXES = [c.syntax(), structured_text.syntax(""), matlab.syntax()]


def sorts(parameters: Any, state: Any, motion: Any) -> tuple[float, float]:
    """A step function that no target has."""
    return sorted(state)[0], where(motion.rate_end > 0.0, exp(motion.rate_end), 0.0)


@pytest.mark.parametrize("syntax", SYNTAXES, ids=lambda each: each.language)
def test_what_has_no_counterpart_is_refused_by_name(syntax: Syntax) -> None:
    told = rf"test_transpile\.sorts: 'sorted\(state\)\[0\]' has no counterpart in {syntax.language}"
    with pytest.raises(UsageError, match=told):
        Program(syntax).function(sorts, [ROWS, ROWS, MOTION], [1, 1])


def by_twos(state: Any) -> float:
    total = 0.0
    for i in range(0, 4, 2):
        total += state[i]
    return total


def ends_otherwise(state: Any) -> float:
    total = 0.0
    for i in range(4):
        total += state[i]
    else:
        total = 0.0
    return total


def range_changes(state: Any) -> float:
    count = 4
    for i in range(count):
        state[i] = 0.0
        count = 2
    return state[0]


def read_after(state: Any) -> float:
    for i in range(4):
        state[i] = 0.0
    return state[i]


def first_that_is_not_zero(state: Any) -> float:
    return state[0] or state[1]


def from_the_end(state: Any) -> float:
    return state[-1]


@called
def shifts(state: Any) -> float:
    state[0] = state[0] + 1.0
    return state[0]


def reads_and_shifts(state: Any) -> float:
    return state[0] + shifts(state)


def shifts_perhaps(state: Any) -> float:
    return shifts(state) if state[0] > 0.0 else 0.0


def calls_itself(state: Any) -> float:
    return calls_itself(state)


@pytest.mark.parametrize("syntax", SYNTAXES, ids=lambda each: each.language)
@pytest.mark.parametrize(
    "step",
    [
        by_twos, ends_otherwise, range_changes, read_after, first_that_is_not_zero, from_the_end,
        reads_and_shifts, shifts_perhaps, calls_itself,
    ],
)  # fmt: skip
def test_what_a_target_would_do_otherwise_is_refused(step: Any, syntax: Syntax) -> None:
    with pytest.raises(
        UsageError, match=rf"test_transpile\.{step.__name__}: .* in {syntax.language}"
    ):
        Program(syntax).function(step, [ROWS], [4])


def masks(state: Any) -> float:
    return double_of(bits_of(state[0]) & 1)


@pytest.mark.parametrize("syntax", SYNTAXES[1:], ids=lambda each: each.language)
def test_bits_are_for_c_alone(syntax: Syntax) -> None:
    with pytest.raises(UsageError, match=f"bits_of, .* in {syntax.language}"):
        Program(syntax).function(masks, [ROWS], [1])


def test_a_power_of_whole_numbers_stays_whole() -> None:
    def shifted(bits: int) -> int:
        return bits + 2**52

    program = Program(c.syntax())
    assert program.function(shifted, [INTEGER])[:2] == ("shifted_p0", INTEGER)
    assert f"INT64_C({2**52})" in program.texts[0]


def test_a_target_is_a_file() -> None:
    """And the help of the command names all of them."""
    assert list(targets()) == ["c", "c-single", "matlab", "json", "st"]
    said = get_type_hints(export_compensation_command, include_extras=True)["target"]
    assert set(said.__metadata__[0].metavar.split("|")) == set(targets())


def test_code_for_a_linear_axis_has_its_units() -> None:
    text = c.c_code(SampledCompensation.of(simulable("linear"), "lugre"), [])
    assert re.search(r"\bN at the load", text)
    assert "(m/s; m, relative; m at the load" in text
    assert not re.search(r"\bN m\b|\brad\b", text)


def test_names_in_code_are_no_words_of_a_language_and_not_long() -> None:
    assert plain("END_IF") == "end_if"  # a number follows
    assert plain("_σ") == "t"
    assert plain("Ts__") == "ts"
    made = replace(of_an_evil_name(), name="END_FUNCTION " * 20)
    assert len(made.identifier) <= 50
    assert re.fullmatch("([A-Za-z0-9]+_)*[A-Za-z0-9]+", made.identifier)
