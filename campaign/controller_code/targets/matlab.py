"""MATLAB: a function with local functions, for scripts and MATLAB Function blocks of Simulink."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Mapping, Sequence

import numpy as np

from campaign.controller_code.compensation import INPUTS, SampledCompensation
from campaign.controller_code.sample import MEMORY, rows_of, sample
from campaign.controller_code.syntax import INTEGER, NUMBER, TRUTH, Argument, Syntax, signs
from campaign.controller_code.targets import BOUND, Array, Target, about, vectors
from campaign.controller_code.transpile import Program
from campaign.physics import elementary

TESTED = "Octave 7.3"
WHOLE: dict[type, str] = {ast.Add: "({} + {})", ast.Sub: "({} - {})", ast.Mult: "({} * {})"}
OWN = """\
function value = pick(yes, one, other)
    if yes
        value = one;
    else
        value = other;
    end
end

function value = raised(base, exponent)
    if base < 0 && exponent ~= 1 && exponent ~= 2
        value = NaN; % and no complex number
    else
        value = power(base, exponent);
    end
end

function value = logarithm(x)
    if x < 0
        value = NaN;
    else
        value = log(x);
    end
end
"""


def syntax() -> Syntax:
    """Syntax of MATLAB. Integers are doubles: its integer types saturate and do not mix."""
    names = {name: name for name in ("exp", "expm1", "sin", "cos", "tanh")}
    names |= {"power": "raised", "log": "logarithm"}
    return Syntax(
        language="MATLAB",
        kinds={NUMBER: "", INTEGER: "", TRUTH: ""},
        literal=_literal,
        integer=lambda n: f"({n})" if n < 0 else str(n),
        truths=("false", "true"),
        signs=signs("~", NotEq="~="),
        whole={**WHOLE, ast.FloorDiv: "floor({} / {})"},
        known={
            "fma": "({} * {} + {})", "divide": "({} / {})", "where": "pick({}, {}, {})",
            "any_of": "{}", "abs": "abs({})", "finite": "isfinite({})",
        },
        comment=_comment,
        element="{}({} + 1)",
        assign="{} = {};",
        branch=("if {}", "else", "end"),
        loop=("for {0} = {1}:({2} - 1)", "end"),
        result="result = {1};\nreturn;",
        call=_call,
        function=_function,
        functions={getattr(elementary, name): own for name, own in names.items()},
    )  # fmt: skip


def _literal(value: float) -> str:
    """Decimal literal, exact to the last bit."""
    text = repr(value) if math.isfinite(value) else {"inf": "Inf", "nan": "NaN"}[f"{abs(value)}"]
    text = f"-{text}" if value == -math.inf else text
    return f"({text})" if text.startswith("-") else text


def _comment(line: str) -> str:
    """A comment line; text of a bench file cannot leave it."""
    return "% " + " ".join(line.split())


def _call(name: str, to: str, given: Mapping[str, str], written: Sequence[str]) -> str:
    results = f"[{', '.join([to, *written])}]" if written else to
    return f"{results} = {name}({', '.join(given.values())});"


def _function(
    name: str, kind: str, arguments: Sequence[Argument], declared: Mapping[str, str],
    lines: Sequence[str],
) -> str:  # fmt: skip
    to = ", ".join(["result", *(each.name for each in arguments if each.written)])
    head = f"function [{to}] = {name}({', '.join(each.name for each in arguments)})"
    body = [re.sub(r"\((\d+) \+ 1\)", lambda match: f"({int(match[1]) + 1})", e) for e in lines]
    return "\n".join([head, *body, "end", ""])


def m_code(made: SampledCompensation, head: Sequence[str]) -> str:
    """Text of `NAME.m`; head: its first lines."""
    name, program = made.identifier, Program(syntax())
    main, rows = sample(program, made), rows_of(made)
    states = [each for each in rows if not each.values]
    notes = [
        f"This file was not run; its test: {name}_test.m. Code like it is tested with {TESTED},",
        f"to {BOUND:g} of the largest torque; not with MATLAB or Simulink.",
        "reset: true for the state as at power-up, before this sample. The state is persistent:",
        "so a MATLAB Function block needs no bus of states, and each block has its own.",
        f"memory: {', '.join(MEMORY)}",
    ]
    given = {each: each for each in (*(each.name for each in rows), *INPUTS)}
    written = [e.name for e, a in zip(rows, main.arguments, strict=False) if a.written]
    call = _call(main.name, "torque", given, written)
    return "\n".join([
        f"function torque = {name}(reset, {', '.join(INPUTS)})",
        "%#codegen",
        *map(_comment, [*about(made, head), *notes]),
        f"    persistent {' '.join(each.name for each in states)}",
        f"    if isempty({states[0].name}) || reset",
        *(f"        {each.name} = zeros(1, {max(1, each.size)});" for each in states),
        "    end",
        *(f"    {e.name} = [{', '.join(map(_literal, e.values))}];" for e in rows if e.values),
        f"    {call}", "end", "", OWN, *program.texts,
    ])  # fmt: skip


def script(made: SampledCompensation, inputs: Array) -> str:
    """Test script; an error if a torque deviates by more than `BOUND` of the largest."""
    name, rows = made.identifier, vectors(made, inputs)
    most = BOUND * float(np.max(np.abs(rows[:, 4])))
    table = "\n".join(" ".join(map(_literal, row)) for row in rows.tolist())
    unit = made.unit("N m")
    return f"""\
% Test vectors of {name}.m: {", ".join(INPUTS)}, torque (SI). An error where one is off.
rows = [
{table}
];
torques = zeros(size(rows, 1), 1);
for k = 1:size(rows, 1)
    torques(k) = {name}(k == 1, rows(k, 1), rows(k, 2), rows(k, 3), rows(k, 4));
end
wrong = sum(~(abs(torques - rows(:, 5)) <= {most!r}));
fprintf('%d of %d samples differ by more than {most:.3g} {unit}\\n', wrong, size(rows, 1));
if wrong > 0
    error('the code does not give the torques of campaign');
end
"""


def _files(made: SampledCompensation, head: Sequence[str], inputs: Array) -> dict[str, str]:
    name = made.identifier
    return {f"{name}.m": m_code(made, head), f"{name}_test.m": script(made, inputs)}


TARGETS = (Target("matlab", _files),)
