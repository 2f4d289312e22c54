"""Translation of compiled step functions from Python to C.

A step function is plain Python of numbers (`campaign.physics.step_function`), and so is all that it
calls, down to the exponential. Each function becomes a C function for each set of argument types;
operations keep their order, so that the results have the same bits. What has no counterpart is
refused by name.
"""

from __future__ import annotations

import ast
import inspect
import math
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from campaign.errors import UsageError
from campaign.physics import elementary
from campaign.physics.step_function import Motion

NUMBER, INTEGER, TRUTH, MOTION, ROWS = "real", "int64_t", "int", "motion", "real *"
LETTERS = {NUMBER: "r", INTEGER: "i", TRUTH: "t"}
OPERATORS = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
SHARED = {**OPERATORS, ast.FloorDiv: "/"}  # of whole numbers, none below 0
WHOLE = {ast.BitAnd: "&", ast.BitOr: "|", ast.BitXor: "^", ast.LShift: "<<", ast.RShift: ">>"}
COMPARED = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=",
}  # fmt: skip
RESERVED = frozenset({
    "auto", "break", "case", "char", "const", "default", "do", "double", "enum", "extern", "float",
    "goto", "inline", "int", "long", "register", "restrict", "short", "signed", "sizeof", "static",
    "struct", "switch", "typedef", "union", "unsigned", "void", "volatile",
})  # fmt: skip
"""Words of C that Python has as names."""
PRELUDE = """\
typedef double real;
static inline real pick(int yes, real one, real other) { return yes ? one : other; }
static inline int64_t bits_of(double x) { int64_t b; memcpy(&b, &x, sizeof b); return b; }
static inline double double_of(int64_t b) { double x; memcpy(&x, &b, sizeof x); return x; }
"""
SINGLE_PRELUDE = """\
typedef float real;
static inline real pick(int yes, real one, real other) { return yes ? one : other; }
"""
OF_SINGLES = {
    elementary.exp: "expf", elementary.expm1: "expm1f", elementary.log: "logf",
    elementary.power: "powf", elementary.sin: "sinf", elementary.cos: "cosf",
    elementary.tanh: "tanhf",
}  # fmt: skip
"""Of the C library: in single precision no bits are promised."""
KNOWN = {
    "fma": (NUMBER, "fma{f}({}, {}, {})"),
    "divide": (NUMBER, "({} / {})"),
    "nearest": (NUMBER, "rint{f}({})"),
    "where": (NUMBER, "pick({}, {}, {})"),
    "bits_of": (INTEGER, "bits_of({})"),
    "double_of": (NUMBER, "double_of({})"),
    "any_of": (TRUTH, "({})"),
}


@dataclass(frozen=True)
class Several:
    """The type of several numbers: that of each, and their names where it is a named tuple."""

    kinds: tuple[str, ...]
    names: tuple[str, ...] = ()


@dataclass(frozen=True)
class Said:
    """An expression: its text and its type."""

    text: str
    type: Any


@dataclass
class Program:
    """C functions, in the order in which they can be compiled."""

    texts: list[str] = field(default_factory=list)
    known: dict[tuple[Any, ...], tuple[str, Any]] = field(default_factory=dict)
    single: bool = False

    @property
    def suffix(self) -> str:
        """Of literals and of functions of the C library."""
        return "f" if self.single else ""

    def literal(self, value: float) -> str:
        """A number to its last bit."""
        if math.isnan(value):
            return "NAN"
        if math.isinf(value):
            return "INFINITY" if value > 0 else "(-INFINITY)"
        text = float(value).hex() + self.suffix
        return f"({text})" if value < 0 else text

    def function(
        self, function: Callable[..., Any], types: Sequence[Any], rows: Sequence[int] = ()
    ) -> tuple[str, Any]:
        """Name and type of a Python function for arguments of these types; written once.

        rows: how many numbers each argument of type `ROWS` has, in their order.
        """
        plain = getattr(function, "py_func", function)
        key = (plain, tuple(types), tuple(rows))
        if key not in self.known:
            name = f"{plain.__name__.strip('_')}_{len(self.known)}"
            self.known[key] = name, None  # a function that calls itself ends there
            made = _Function(self, plain, types, rows)
            text, kind = made.written(name)
            self.texts.append(text)
            self.known[key] = name, kind
        return self.known[key]

    def struct(self, several: Several) -> str:
        """The C type of several numbers."""
        name = "several_" + "".join(LETTERS[kind] for kind in several.kinds)
        parts = " ".join(f"{kind} v{place};" for place, kind in enumerate(several.kinds))
        text = f"typedef struct {{ {parts} }} {name};\n"
        if text not in self.texts:
            self.texts.append(text)
        return name

    def polynomial(self, coefficients: Sequence[float]) -> str:
        """Estrin's scheme, as `elementary.polynomial` has it."""
        key = ("polynomial", tuple(coefficients))
        if key not in self.known:
            name = f"polynomial_{len(self.known)}"
            lines, terms, power, level = [], [self.literal(c) for c in coefficients], "x", 0
            while len(terms) > 1:
                unpaired = terms[len(terms) // 2 * 2 :]
                joined = []
                for place, (even, odd) in enumerate(zip(terms[::2], terms[1::2], strict=False)):
                    made = f"t{level}_{place}"
                    lines.append(f"    const real {made} = fma({odd}, {power}, {even});")
                    joined.append(made)
                terms = joined + unpaired
                lines.append(f"    const real p{level} = {power} * {power};")
                power, level = f"p{level}", level + 1
            if lines:
                lines.pop()  # the last power serves nothing
            body = "\n".join([*lines, f"    return {terms[0]};"])
            self.texts.append(f"static real {name}(real x)\n{{\n{body}\n}}\n")
            self.known[key] = name, NUMBER
        return self.known[key][0]


class _Function:
    """One Python function, for one set of argument types."""

    def __init__(
        self, program: Program, function: Callable[..., Any], types: Sequence[Any],
        rows: Sequence[int],
    ) -> None:  # fmt: skip
        self.program, self.function = program, function
        source = textwrap.dedent(inspect.getsource(function))
        tree = _Renamed().visit(ast.parse(source)).body[0]
        if not isinstance(tree, ast.FunctionDef):
            raise self._refusal(tree, "is no function")
        self.tree = tree
        names = [each.arg for each in tree.args.args]
        self.types: dict[str, Any] = dict(zip(names, types, strict=True))
        self.arguments = names
        self.rows = dict(zip([n for n in names if self.types[n] == ROWS], rows, strict=True))
        self.result: Any = None
        self.temporaries = 0

    def written(self, name: str) -> tuple[str, Any]:
        """Its C text, and the type of its result."""
        lines = self._block(self.tree.body)
        own = [(n, kind) for n, kind in self.types.items() if n not in self.arguments]
        declared = [f"    {self._c(kind)} {n};" for n, kind in own]
        kind = self.result
        told = self._c(kind)
        shown = ", ".join(f"{_argument(self.types[n])}{n}" for n in self.arguments)
        body = "\n".join([*declared, *lines])
        return f"static {told} {name}({shown})\n{{\n{body}\n}}\n", kind

    # Statements

    def _block(self, statements: Sequence[ast.stmt]) -> list[str]:
        lines: list[str] = []
        for each in statements:
            lines += self._statement(each)
        return lines

    def _statement(self, node: ast.stmt) -> list[str]:
        match node:
            case ast.Expr(value=ast.Constant()) | ast.Pass():
                return []
            case ast.Assign(targets=[target], value=value):
                return self._assign(target, value)
            case ast.AnnAssign(target=target, value=value) if value is not None:
                return self._assign(target, value)
            case ast.AugAssign(target=target, op=op, value=value):
                return self._assign(target, ast.BinOp(left=_read(target), op=op, right=value))
            case ast.Return(value=value) if value is not None:
                return self._return(value)
            case ast.If(test=test, body=body, orelse=others):
                lines = [f"    if ({self._said(test).text}) {{", *self._block(body)]
                return [
                    *lines,
                    *(["    } else {", *self._block(others)] if others else []),
                    "    }",
                ]
            case ast.For(target=ast.Name(id=name), iter=each, body=body, orelse=[]):
                return self._for(name, each, body)
        raise self._refusal(node, "has no counterpart")

    def _assign(self, target: ast.expr, value: ast.expr) -> list[str]:
        if isinstance(target, ast.Tuple):
            return self._unpack(target.elts, value)
        said = self._said(value)
        return [f"    {self._target(target, said.type)} = {said.text};"]

    def _unpack(self, targets: Sequence[ast.expr], value: ast.expr) -> list[str]:
        """All values are there before the first target has its own."""
        if isinstance(value, ast.Tuple):
            said = [self._said(each) for each in value.elts]
            names = [self._temporary() for _ in said]
            lines = [
                f"    const {self._c(s.type)} {n} = {s.text};"
                for s, n in zip(said, names, strict=True)
            ]
            pairs = zip(targets, said, names, strict=True)
            return [*lines, *(f"    {self._target(t, s.type)} = {n};" for t, s, n in pairs)]
        several, name = self._said(value), self._temporary()
        if not isinstance(several.type, Several):
            raise self._refusal(value, "is no several numbers")
        lines = [f"    const {self._c(several.type)} {name} = {several.text};"]
        for place, (target, each) in enumerate(zip(targets, several.type.kinds, strict=True)):
            lines.append(f"    {self._target(target, each)} = {name}.v{place};")
        return lines

    def _target(self, target: ast.expr, kind: Any) -> str:
        if isinstance(target, ast.Name):
            before = self.types.setdefault(target.id, kind)
            if before != kind:
                raise self._refusal(target, f"is a {before} and a {kind}")
            return target.id
        if isinstance(target, ast.Subscript):
            return self._said(_read(target)).text
        raise self._refusal(target, "is nothing to assign to")

    def _return(self, value: ast.expr) -> list[str]:
        one = self._several(value.elts) if isinstance(value, ast.Tuple) else self._said(value)
        self._results(one.type)
        return [f"    return {one.text};"]

    def _several(self, values: Sequence[ast.expr], names: tuple[str, ...] = ()) -> Said:
        said = [self._said(each) for each in values]
        kind = Several(tuple(each.type for each in said), names)
        text = ", ".join(each.text for each in said)
        return Said(f"({self.program.struct(kind)}){{ {text} }}", kind)

    def _c(self, kind: Any) -> str:
        return self.program.struct(kind) if isinstance(kind, Several) else str(kind)

    def _results(self, kind: Any) -> None:
        if self.result not in (None, kind):
            raise self._refusal(self.tree, "returns different things")
        self.result = kind

    def _for(self, name: str, over: ast.expr, body: Sequence[ast.stmt]) -> list[str]:
        if not (isinstance(over, ast.Call) and getattr(over.func, "id", "") == "range"):
            raise self._refusal(over, "is no range")
        ends = [self._said(each).text for each in over.args]
        if len(ends) > 2:
            raise self._refusal(over, "has no counterpart")
        first, last = ("0", *ends)[-2:]
        inside = [node for each in body for node in ast.walk(each) if isinstance(node, ast.Name)]
        stored = {node.id for node in inside if isinstance(node.ctx, ast.Store)}
        read = {node.id for node in ast.walk(over) if isinstance(node, ast.Name)}
        if name in self.types or stored & {name, *read}:  # Python keeps its range, C would not
            raise self._refusal(
                over, "is changed inside, or its variable used outside, which has no counterpart"
            )
        self.types[name] = INTEGER
        lines = self._block(body)
        del self.types[name]
        head = f"    for (int64_t {name} = {first}; {name} < {last}; {name}++) {{"
        return [head, *lines, "    }"]

    def _temporary(self) -> str:
        self.temporaries += 1
        return f"now_{self.temporaries}"

    # Expressions

    def _said(self, node: ast.expr) -> Said:
        match node:
            case ast.Constant(value=bool() | int() | float()):
                return self._constant(node.value)
            case ast.Name(id=name) if name in self.types:
                return Said(name, self.types[name])
            case ast.Name(id=name):
                return self._global(node, self._looked_up(node, name))
            case ast.Attribute(value=ast.Name(id=name), attr=attr) if name in self.types:
                return self._of_argument(node, name, attr)
            case ast.Attribute(value=ast.Name(id=name), attr=attr):
                return self._global(node, getattr(self._looked_up(node, name), attr))
            case ast.Subscript(value=value, slice=place):
                return self._element(node, value, place)
            case _:
                return self._worked_out(node)

    def _worked_out(self, node: ast.expr) -> Said:
        """An expression of others."""
        match node:
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                said = self._said(operand)
                return Said(f"(-{said.text})", said.type)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return Said(f"(!{self._said(operand).text})", TRUTH)
            case ast.BinOp(
                left=ast.Constant(value=int() | float() as base),
                op=ast.Pow(),
                right=ast.Constant(value=int() as to),
            ):
                return self._constant(base**to)
            case ast.BinOp(left=left, op=op, right=right):
                return self._operation(node, self._said(left), op, self._said(right))
            case ast.BoolOp(op=op, values=values):
                sign = " && " if isinstance(op, ast.And) else " || "
                parts = [self._said(each) for each in values]
                if {each.type for each in parts} != {TRUTH}:  # one of them is the result in Python
                    raise self._refusal(node, "is a number")
                return Said(f"({sign.join(each.text for each in parts)})", TRUTH)
            case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in COMPARED:
                sides = self._said(left).text, self._said(right).text
                return Said(f"({sides[0]} {COMPARED[type(op)]} {sides[1]})", TRUTH)
            case ast.IfExp(test=test, body=yes, orelse=no):
                one, other = self._said(yes), self._said(no)
                text = f"({self._said(test).text} ? {one.text} : {other.text})"
                return Said(text, NUMBER if NUMBER in (one.type, other.type) else one.type)
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                return self._call(node, name, arguments)
        raise self._refusal(node, "has no counterpart")

    def _operation(self, node: ast.expr, left: Said, op: ast.operator, right: Said) -> Said:
        if type(op) in OPERATORS and NUMBER in (left.type, right.type):
            return Said(f"({left.text} {OPERATORS[type(op)]} {right.text})", NUMBER)
        if type(op) in SHARED and not isinstance(op, ast.Div):
            # Unsigned, as a signed sum may not overflow in C.
            text = f"(uint64_t){left.text} {SHARED[type(op)]} (uint64_t){right.text}"
            return Said(f"((int64_t)({text}))", INTEGER)
        if isinstance(op, ast.RShift):
            return Said(f"({left.text} >> {right.text})", INTEGER)
        if type(op) in WHOLE:
            text = f"(uint64_t){left.text} {WHOLE[type(op)]} {right.text}"
            return Said(f"((int64_t)({text}))", INTEGER)
        raise self._refusal(node, "has no counterpart")

    def _of_argument(self, node: ast.expr, name: str, attr: str) -> Said:
        if self.types[name] == MOTION and attr in Motion._fields:
            return Said(f"{name}->{attr}", NUMBER)
        kind = self.types[name]
        if isinstance(kind, Several) and attr in kind.names:
            place = kind.names.index(attr)
            return Said(f"{name}.v{place}", kind.kinds[place])
        if self.types[name] == ROWS and attr == "shape":
            return Said(str(self.rows[name]), "shape")
        raise self._refusal(node, "has no counterpart")

    def _element(self, node: ast.expr, value: ast.expr, place: ast.expr) -> Said:
        if isinstance(place, ast.Slice | ast.UnaryOp):  # an index from the end
            raise self._refusal(node, "has no counterpart")
        if isinstance(value, ast.Name) and self.types.get(value.id) == ROWS:
            return Said(f"{value.id}[{self._said(place).text}]", NUMBER)
        if isinstance(value, ast.Attribute) and value.attr == "shape":
            return Said(self._said(value).text, INTEGER)
        if isinstance(value, ast.Name) and isinstance(place, ast.Constant):
            return self._constant(self._looked_up(node, value.id)[place.value])
        raise self._refusal(node, "has no counterpart")

    def _call(self, node: ast.expr, name: str, arguments: Sequence[ast.expr]) -> Said:
        if name == "len" and isinstance(arguments[0], ast.Name):
            return Said(str(self.rows[arguments[0].id]), INTEGER)
        if name == "abs":
            return Said(f"fabs{self.program.suffix}({self._said(arguments[0]).text})", NUMBER)
        function = self._looked_up(node, name)
        if function is elementary.polynomial:
            coefficients = self._looked_up(node, getattr(arguments[1], "id", ""))
            made = self.program.polynomial(coefficients)
            return Said(f"{made}({self._said(arguments[0]).text})", NUMBER)
        said = [self._said(each) for each in arguments]
        if name in KNOWN and function is getattr(elementary, name):
            kind, form = KNOWN[name]
            return Said(form.format(*(each.text for each in said), f=self.program.suffix), kind)
        if self.program.single and function in OF_SINGLES:
            return Said(f"{OF_SINGLES[function]}({', '.join(e.text for e in said)})", NUMBER)
        if isinstance(function, type) and hasattr(function, "_fields"):
            return self._several(arguments, tuple(function._fields))
        if not callable(function) or not hasattr(function, "py_func"):
            raise self._refusal(node, f"calls {name}, which is not of this program's")
        rows = [
            self.rows[getattr(a, "id", "")]
            for a, s in zip(arguments, said, strict=True)
            if s.type == ROWS
        ]
        made, kind = self.program.function(function, [each.type for each in said], rows)
        return Said(f"{made}({', '.join(each.text for each in said)})", kind)

    def _looked_up(self, node: ast.AST, name: str) -> Any:
        found = inspect.getclosurevars(self.function)
        for place in (found.nonlocals, found.globals, found.builtins, self.function.__globals__):
            if name in place:
                return place[name]
        raise self._refusal(node, f"names {name}, which is nowhere")

    def _constant(self, value: Any) -> Said:
        if isinstance(value, bool):
            return Said(str(int(value)), TRUTH)
        if isinstance(value, int):
            text = f"INT64_C({value})" if value != -(2**63) else "INT64_MIN"
            return Said(text, INTEGER)
        return Said(self.program.literal(float(value)), NUMBER)

    def _global(self, node: ast.AST, value: Any) -> Said:
        if isinstance(value, bool | int | float):
            return self._constant(value)
        raise self._refusal(node, "has no counterpart")

    def _refusal(self, node: ast.AST, why: str) -> UsageError:
        where = f"{self.function.__module__}.{self.function.__qualname__}"
        shown = ast.unparse(node) if isinstance(node, ast.expr | ast.stmt) else ""
        return UsageError(f"{where}: {shown.splitlines()[0] if shown else 'it'!r} {why} in C")


class _Renamed(ast.NodeTransformer):
    """No name is a word of C."""

    def visit_Name(self, node: ast.Name) -> ast.Name:
        node.id += "_" * (node.id in RESERVED)
        return node

    def visit_arg(self, node: ast.arg) -> ast.arg:
        node.arg += "_" * (node.arg in RESERVED)
        return node


def _read(target: ast.expr) -> ast.expr:
    """A target as an expression."""
    return ast.parse(ast.unparse(target), mode="eval").body


def _argument(kind: Any) -> str:
    if kind == MOTION:
        return "const motion *"
    return kind if kind.endswith("*") else f"{kind} "
