"""Differences between the languages of controllers: types, operators, forms of statements."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from campaign.physics.step_function import Motion

NUMBER, INTEGER, TRUTH, ROWS = "number", "integer", "truth", "rows"
WHOLE = (
    ast.Add, ast.Sub, ast.Mult, ast.FloorDiv, ast.BitAnd, ast.BitOr, ast.BitXor, ast.LShift,
    ast.RShift,
)  # fmt: skip
OF_TRUTHS = {ast.BitAnd: ast.And, ast.BitOr: ast.Or}


@dataclass(frozen=True)
class Several:
    """Type of a tuple: types of its values, and their names for a named tuple."""

    kinds: tuple[Any, ...]
    names: tuple[str, ...] = ()
    title: str = "several"

    @property
    def fields(self) -> list[str]:
        """Field names in the target. The numbers at their ends avoid reserved words."""
        names = self.names or ("value",) * len(self.kinds)
        return [f"{plain(name)}_{place}" for place, name in enumerate(names)]


MOTION = Several((NUMBER,) * len(Motion._fields), Motion._fields, "motion")


def finite(x: float) -> bool:
    """Whether x is neither infinite nor NaN; each language has its own form."""
    return bool(abs(x) < float("inf"))


ASKED = {
    "fma": ((NUMBER,) * 3, NUMBER), "divide": ((NUMBER,) * 2, NUMBER), "any_of": ((TRUTH,), TRUTH),
    "nearest": ((NUMBER,), NUMBER), "where": ((TRUTH, NUMBER, NUMBER), NUMBER),
    "bits_of": ((NUMBER,), INTEGER), "double_of": ((INTEGER,), NUMBER),
    "abs": ((NUMBER,), NUMBER), "finite": ((NUMBER,), TRUTH),
}  # fmt: skip
"""Argument and result types of the functions for which a language can have a form."""
BY_NAME = {"abs": abs, "finite": finite}


SIGNS: dict[type, str] = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Lt: "<", ast.LtE: "<=",
    ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=", ast.And: "&&", ast.Or: "||",
}  # fmt: skip
"""Operators of most languages."""


def signs(no: str = "!", **others: str) -> dict[type, str]:
    """Forms of operators; no: negation; others: operators that differ from `SIGNS`."""
    symbols = SIGNS | {getattr(ast, name): sign for name, sign in others.items()}
    forms = {op: f"({{}} {sign} {{}})" for op, sign in symbols.items()}
    return {**forms, ast.USub: "(-{})", ast.Not: f"({no}{{}})"}


class Argument(NamedTuple):
    """Argument of a target function: name and type there, whether it is rows, and written to."""

    name: str
    kind: str
    rows: bool
    written: bool


@dataclass(frozen=True)
class Syntax:
    """Syntax of a language. Texts with braces are forms for `str.format`.

    Attributes:
        kinds: types of `NUMBER`, `INTEGER` and `TRUTH`.
        numbers: conversions of `INTEGER` and `TRUTH` to `NUMBER`.
        truths: false and true.
        signs: operators of numbers and truths, by class of the syntax tree.
        whole: operators of integers.
        known: forms of the functions in `ASKED`, by name.
        functions: library functions by function of `elementary`; their bits can differ.
        branch: lines of if, else and end.   loop: lines of head and end.
        call: from name, result, arguments by the callee's names, and written arguments.
        function: from name, type of the result, arguments, declared names and types, and lines.
        struct: type with these fields; rows: type of `count` numbers; "" for none.
    """

    language: str
    kinds: Mapping[str, str]
    literal: Callable[[float], str]
    integer: Callable[[int], str]
    truths: tuple[str, str]
    signs: Mapping[type, str]
    whole: Mapping[type, str]
    known: Mapping[str, str]
    comment: Callable[[str], str]
    element: str
    assign: str
    branch: tuple[str, str, str]
    loop: tuple[str, str]
    result: str
    call: Callable[[str, str, Mapping[str, str], Sequence[str]], str]
    function: Callable[[str, str, Sequence[Argument], Mapping[str, str], Sequence[str]], str]
    struct: Callable[[str, Mapping[str, str]], str] = lambda name, fields: ""
    rows: Callable[[str, int], str] = lambda name, count: ""
    numbers: Mapping[str, str] = field(default_factory=lambda: {INTEGER: "{}", TRUTH: "{}"})
    functions: Mapping[Any, str] = field(default_factory=dict)
    prefix: str = ""


def plain(name: str) -> str:
    """A name in characters that every language accepts; the caller adds a number."""
    text = "_".join(re.findall("[a-z0-9]+", name.lower()))
    return text if text[:1].isalpha() else f"t{text}"
