"""What differs between the languages of controllers: types, signs, forms of statements."""

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
    """The type of several numbers: that of each, and their names where it is a named tuple."""

    kinds: tuple[Any, ...]
    names: tuple[str, ...] = ()
    title: str = "several"

    @property
    def fields(self) -> list[str]:
        """Their names in the target: no word of any language ends with a number like that."""
        names = self.names or ("value",) * len(self.kinds)
        return [f"{plain(name)}_{place}" for place, name in enumerate(names)]


MOTION = Several((NUMBER,) * len(Motion._fields), Motion._fields, "motion")


def finite(x: float) -> bool:
    """Whether it is neither infinite nor NaN; each language has its own way to ask."""
    return bool(abs(x) < float("inf"))


ASKED = {
    "fma": ((NUMBER,) * 3, NUMBER), "divide": ((NUMBER,) * 2, NUMBER), "any_of": ((TRUTH,), TRUTH),
    "nearest": ((NUMBER,), NUMBER), "where": ((TRUTH, NUMBER, NUMBER), NUMBER),
    "bits_of": ((NUMBER,), INTEGER), "double_of": ((INTEGER,), NUMBER),
    "abs": ((NUMBER,), NUMBER), "finite": ((NUMBER,), TRUTH),
}  # fmt: skip
"""Types of arguments and result of what each language has a form for."""
BY_NAME = {"abs": abs, "finite": finite}


SIGNS: dict[type, str] = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Lt: "<", ast.LtE: "<=",
    ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=", ast.And: "&&", ast.Or: "||",
}  # fmt: skip
"""As most languages have them."""


def signs(no: str = "!", **others: str) -> dict[type, str]:
    """Forms of operators; others: signs that the language has of its own."""
    told = SIGNS | {getattr(ast, name): sign for name, sign in others.items()}
    forms = {op: f"({{}} {sign} {{}})" for op, sign in told.items()}
    return {**forms, ast.USub: "(-{})", ast.Not: f"({no}{{}})"}


class Argument(NamedTuple):
    """Of a function in the target: name and type there, whether it is rows, and written to."""

    name: str
    kind: str
    rows: bool
    written: bool


@dataclass(frozen=True)
class Syntax:
    """A language. Texts with braces are forms for `str.format`.

    Attributes:
        kinds: types of `NUMBER`, `INTEGER` and `TRUTH`.
        numbers: `INTEGER` and `TRUTH` as a number.
        truths: false and true.
        signs: by operator of the syntax tree, of numbers and truths.
        whole: of integers.
        known: by name in `ASKED`.
        functions: by function of `elementary`: the language's own, which promise no bits.
        branch: lines of if, else and end.   loop: of its head and its end.
        call: from name, result, arguments by name of the callee, and those that are written.
        function: from name, type of the result, arguments, declared names and types, and lines.
        struct: a type of these fields; or "", as `rows`: a type of so many numbers.
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
    """A name in letters that every language has, to which a number is added."""
    told = "_".join(re.findall("[a-z0-9]+", name.lower()))
    return told if told[:1].isalpha() else f"t{told}"
