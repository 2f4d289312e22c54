"""IEC 61131-3 Structured Text: a function block in LREAL with its own functions and types."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Mapping, Sequence

from campaign.controller_code.compensation import INPUTS, SampledCompensation
from campaign.controller_code.sample import MEMORY, Rows, rows_of, sample
from campaign.controller_code.syntax import INTEGER, NUMBER, TRUTH, Argument, Syntax, signs
from campaign.controller_code.targets import BOUND, Array, Target, about, vectors
from campaign.controller_code.transpile import Program
from campaign.errors import UsageError
from campaign.physics import elementary

COMPILER = "matiec 6bb2c339df6fd096d52f5342be228b0811fef771"
WHOLE: dict[type, str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.FloorDiv: "/"}
OWN = """\
(* e^x - 1, also where x is nearly 0 (W. Kahan). *)
FUNCTION {p}expm1 : LREAL
VAR_INPUT x : LREAL; END_VAR
VAR grown : LREAL; END_VAR
    grown := EXP(x);
    IF grown = 1.0 THEN
        {p}expm1 := x;
    ELSIF (grown - 1.0 = -1.0) OR (x > 40.0) THEN
        {p}expm1 := grown - 1.0;
    ELSE
        {p}expm1 := (grown - 1.0) * x / LN(grown);
    END_IF;
END_FUNCTION

(* base to a power above 0. *)
FUNCTION {p}raised : LREAL
VAR_INPUT base : LREAL; exponent : LREAL; END_VAR
    IF exponent = 1.0 THEN
        {p}raised := base;
    ELSIF exponent = 2.0 THEN
        {p}raised := base * base;
    ELSIF base > 0.0 THEN
        {p}raised := EXP(exponent * LN(base));
    ELSE
        {p}raised := 0.0;
    END_IF;
END_FUNCTION

FUNCTION {p}tangens : LREAL
VAR_INPUT x : LREAL; END_VAR
VAR grown : LREAL; END_VAR
    grown := {p}expm1(2.0 * MIN(ABS(x), 20.0));
    {p}tangens := SEL(x < 0.0, grown, -grown) / (grown + 2.0);
END_FUNCTION
"""
"""Functions that the language lacks; TANH is evaluated by EXP."""


def syntax(prefix: str) -> Syntax:
    """Syntax of Structured Text. All names of a project share one scope, hence the prefix."""
    own = {elementary.expm1: "expm1", elementary.power: "raised", elementary.tanh: "tangens"}
    names = {"exp": "EXP", "log": "LN", "sin": "SIN", "cos": "COS"}
    return Syntax(
        language="Structured Text",
        kinds={NUMBER: "LREAL", INTEGER: "DINT", TRUTH: "BOOL"},
        literal=_literal,
        integer=lambda n: f"({n})" if n < 0 else str(n),
        truths=("FALSE", "TRUE"),
        signs=signs("NOT ", Eq="=", NotEq="<>", And="AND", Or="OR"),
        whole={op: f"({{}} {sign} {{}})" for op, sign in WHOLE.items()},
        known={
            "fma": "({} * {} + {})", "divide": "({} / {})", "where": "SEL({0}, {2}, {1})",
            "any_of": "{}", "abs": "ABS({})",
            "finite": "(({0} = {0}) AND (ABS({0}) <= 1.0E+38))",
        },
        comment=_comment,
        element="{}[{}]",
        assign="{} := {};",
        branch=("IF {} THEN", "ELSE", "END_IF;"),
        # WHILE, as FOR includes its end, and differs from Python if the end is below the start.
        loop=("{0} := {1};\nWHILE {0} < {2} DO", "    {0} := {0} + 1;\nEND_WHILE;"),
        result="{} := {};\nRETURN;",
        call=_call,
        function=_function,
        struct=_struct,
        rows=lambda name, count: (
            f"TYPE\n    {name} : ARRAY [0..{count - 1}] OF LREAL;\nEND_TYPE\n"
        ),
        numbers={INTEGER: "DINT_TO_LREAL({})", TRUTH: "SEL({}, 0.0, 1.0)"},
        functions={function: prefix + name for function, name in own.items()}
        | {getattr(elementary, name): own for name, own in names.items()},
        prefix=prefix,
    )  # fmt: skip


def _literal(value: float) -> str:
    """Decimal literal, exact to the last bit."""
    if not math.isfinite(value):
        raise UsageError(f"{value} has no counterpart in Structured Text")
    mantissa, _, exponent = f"{value!r}".partition("e")
    text = mantissa if "." in mantissa else f"{mantissa}.0"
    text += f"E{exponent}" if exponent else ""
    return f"({text})" if text.startswith("-") else text


def _comment(line: str) -> str:
    """A comment line; text of a bench file cannot end it, begin another, or be a pragma."""
    text = re.sub(r"[*{}$]+", "", " ".join(line.split()))
    return f"(* {text} *)"


def _call(name: str, to: str, given: Mapping[str, str], written: Sequence[str]) -> str:
    return f"{to} := {name}({', '.join(f'{own} := {text}' for own, text in given.items())});"


def _function(
    name: str, kind: str, arguments: Sequence[Argument], declared: Mapping[str, str],
    lines: Sequence[str],
) -> str:  # fmt: skip
    parts = {  # VAR_IN_OUT is not copied
        "VAR_INPUT": {e.name: e.kind for e in arguments if not e.rows},
        "VAR_IN_OUT": {e.name: e.kind for e in arguments if e.rows},
        "VAR": declared,
    }
    return "\n".join([
        f"FUNCTION {name} : {kind}",
        *(_variables(head, own) for head, own in parts.items() if own),
        *lines, "END_FUNCTION", "",
    ])  # fmt: skip


def _variables(head: str, own: Mapping[str, str]) -> str:
    return "\n".join([head, *(f"    {n} : {kind};" for n, kind in own.items()), "END_VAR"])


def _struct(name: str, fields: Mapping[str, str]) -> str:
    members = "\n".join(f"        {n} : {kind};" for n, kind in fields.items())
    return f"TYPE\n    {name} : STRUCT\n{members}\n    END_STRUCT;\nEND_TYPE\n"


def st_code(made: SampledCompensation, head: Sequence[str]) -> str:
    """Text of `NAME.st`; head: its first lines."""
    name = made.identifier
    program = Program(syntax(f"{name}_"))
    main, rows = sample(program, made), rows_of(made)
    kinds = {e.name: a.kind for e, a in zip(rows, main.arguments, strict=False)}
    given = {a.name: n for a, n in zip(main.arguments, [*kinds, *INPUTS], strict=True)}
    zeroed = [f"{e.name}[{k}]" for e in rows if not e.values for k in range(max(1, e.size))]
    notes = [
        f"This file was not run; its vectors: {name}.csv. Code like it is tested with",
        f"{COMPILER}, to {BOUND:g} of the largest torque;",
        "not with TwinCAT or CODESYS, and not on a controller.",
        "reset: state as at power-up, before this sample.",
        f"memory: {', '.join(MEMORY)}",
    ]
    return "\n".join([
        *map(_comment, [*about(made, head), *notes]),
        OWN.format(p=program.syntax.prefix), *program.texts,
        f"FUNCTION_BLOCK {name}",
        _variables("VAR_INPUT", {"reset": "BOOL", **dict.fromkeys(INPUTS, "LREAL")}),
        _variables("VAR_OUTPUT", {"torque": "LREAL"}),
        _variables("VAR", {e.name: kinds[e.name] + _start(e) for e in rows}),
        "    IF reset THEN", *(f"        {each} := 0.0;" for each in zeroed), "    END_IF;",
        "    " + _call(main.name, "torque", given, ()),
        "END_FUNCTION_BLOCK", "",
    ])  # fmt: skip


def _start(rows: Rows) -> str:
    return f" := [{', '.join(map(_literal, rows.values))}]" if rows.values else ""


def csv(made: SampledCompensation, inputs: Array) -> str:
    """Test vectors: a header line, then one line per sample (SI)."""
    rows = vectors(made, inputs).tolist()
    return "\n".join([",".join([*INPUTS, "torque"]), *(",".join(map(repr, r)) for r in rows), ""])


def _files(made: SampledCompensation, head: Sequence[str], inputs: Array) -> dict[str, str]:
    name = made.identifier
    return {f"{name}.st": st_code(made, head), f"{name}.csv": csv(made, inputs)}


TARGETS = (Target("st", _files),)
