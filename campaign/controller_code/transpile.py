"""Translation of compiled step functions from Python to the language of a controller.

A step function and its callees are plain Python with numbers (`campaign.physics.step_function`).
Each function becomes one function of the target language per set of argument types. Operations
keep their order. A `Syntax` contains the differences between languages. Code without a counterpart
raises a UsageError that names it.

Calls of the program's functions, and named tuples, become separate statements. Some languages do
not allow them in expressions, and C does not define the order of evaluation there.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from typing import Any, NamedTuple

from campaign.controller_code.syntax import (
    ASKED,
    BY_NAME,
    INTEGER,
    NUMBER,
    OF_TRUTHS,
    ROWS,
    TRUTH,
    WHOLE,
    Argument,
    Several,
    Syntax,
    plain,
)
from campaign.errors import UsageError
from campaign.physics import elementary


@dataclass(frozen=True)
class Said:
    """Text and type of an expression."""

    text: str
    type: Any


class TargetFunction(NamedTuple):
    """A function of the target: name, type of the result, arguments."""

    name: str
    kind: Any
    arguments: Sequence[Argument] = ()


@dataclass
class Program:
    """Types and functions in the target language, each after those it uses."""

    syntax: Syntax
    texts: list[str] = field(default_factory=list)
    known: dict[Any, Any] = field(default_factory=dict)

    def named(self, name: str) -> str:
        """A unique name: it ends with `_p` and a number, variables with a number only."""
        return f"{self.syntax.prefix}{plain(name)}_p{len(self.known)}"

    def function(
        self, function: Callable[..., Any], types: Sequence[Any], rows: Sequence[int] = ()
    ) -> TargetFunction:
        """Translate a Python function for arguments of these types, once.

        rows: lengths of the arguments of type `ROWS`, in their order.
        """
        function = getattr(function, "py_func", function)
        key = (function, tuple(types), tuple(rows))
        if key not in self.known:
            scope = inspect.getclosurevars(function)
            names = {**scope.builtins, **function.__globals__, **scope.globals, **scope.nonlocals}
            where = f"{function.__module__}.{function.__qualname__}"
            source = textwrap.dedent(inspect.getsource(function))
            self.text_function(source, names, types, rows, where=where, key=key)
        translated: TargetFunction = self.known[key]
        return translated

    def text_function(
        self, source: str, scope: Mapping[str, Any], types: Sequence[Any], rows: Sequence[int] = (),
        *, where: str = "", key: Any = None,
    ) -> TargetFunction:  # fmt: skip
        """Translate a function given as Python text; `scope`: the values of its global names."""
        tree = ast.parse(source).body[0]
        if not isinstance(tree, ast.FunctionDef):
            raise UsageError(f"{where}: {source.splitlines()[0]!r} is no function")
        key = key or source
        name = self.named(tree.name)
        self.known[key] = TargetFunction(name, None)  # ends the recursion of self-calls
        made = _Function(self, name, tree, scope, types, rows, where or tree.name)
        self.known[key] = made.written()
        return self.known[key]  # type: ignore[no-any-return]

    def kind(self, kind: Any, rows: int = 0) -> str:
        """Name of a type in the target, after its declaration if it needs one."""
        if kind in self.syntax.kinds:
            return self.syntax.kinds[kind]
        if (kind, rows) not in self.known:
            if isinstance(kind, Several):
                kinds = [self.kind(each) for each in kind.kinds]
                name = self.named(kind.title)
                text = self.syntax.struct(name, dict(zip(kind.fields, kinds, strict=True)))
            else:
                name = self.named(f"rows_of_{rows}")
                text = self.syntax.rows(name, max(1, rows))
            self.known[kind, rows] = name
            self.texts += [text] if text else []
        return str(self.known[kind, rows])

    def polynomial(self, coefficients: Sequence[float]) -> TargetFunction:
        """Polynomial by Estrin's scheme, in the same order as `elementary.polynomial`."""
        terms, power = [repr(float(c)) for c in coefficients], "x"
        lines: list[str] = []
        while len(terms) > 1:
            count, level = len(terms) // 2, len(lines)
            lines += [
                f"t{level}_{k} = fma({terms[2 * k + 1]}, {power}, {terms[2 * k]})"
                for k in range(count)
            ]
            terms = [f"t{level}_{k}" for k in range(count)] + terms[2 * count :]
            if len(terms) > 1:
                lines.append(f"p{level} = {power} * {power}")
                power = f"p{level}"
        source = "\n    ".join(["def polynomial(x):", *lines, f"return {terms[0]}"])
        if source not in self.known:
            self.text_function(source, vars(elementary), [NUMBER])
        translated: TargetFunction = self.known[source]
        return translated


class _Function:
    """Translation of one Python function for one set of argument types."""

    def __init__(
        self, program: Program, name: str, tree: ast.FunctionDef, scope: Mapping[str, Any],
        types: Sequence[Any], rows: Sequence[int], where: str,
    ) -> None:  # fmt: skip
        self.program, self.syntax, self.name = program, program.syntax, name
        self.tree, self.scope, self.where = tree, scope, where
        self.names: dict[str, str] = {}
        self.declared: dict[str, str] = {}
        self.lines: list[str] = []
        self.depth = 1
        self.writes: set[str] = set()
        self.whole: ast.expr | None = None  # a value outside of any other expression
        self.result: Any = None
        arguments = [each.arg for each in tree.args.args]
        self.types: dict[str, Any] = dict(zip(arguments, types, strict=True))
        self.arguments = [self._named(each) for each in arguments]
        sized = [each for each in arguments if self.types[each] == ROWS]
        self.rows = dict(zip(sized, rows, strict=True))

    def written(self) -> TargetFunction:
        """Translate the body, and add the text to the program."""
        self._block(self.tree.body)
        arguments = []
        for each in [each.arg for each in self.tree.args.args]:
            kind = self.program.kind(self.types[each], self.rows.get(each, 0))
            own = self._named(each), kind, each in self.rows, each in self.writes
            arguments.append(Argument(*own))
        if self.result is None:
            raise self._refusal(self.tree, "returns nothing")
        result = self.program.kind(self.result)
        self.program.texts.append(
            self.syntax.function(self.name, result, arguments, self.declared, self.lines)
        )
        return TargetFunction(self.name, self.result, arguments)

    def _named(self, name: str) -> str:
        """A unique name in the target; some languages ignore the case of letters."""
        return self.names.setdefault(name, f"{plain(name)}_{len(self.names) + 1}")

    def _temporary(self, kind: Any) -> str:
        name = self._named(f"{len(self.names)}")
        self.declared[name] = self.program.kind(kind)
        return name

    def _line(self, form: str, *parts: str) -> None:
        for line in form.format(*parts).splitlines():
            self.lines.append("    " * self.depth + line)

    # Statements

    def _block(self, statements: Sequence[ast.stmt]) -> None:
        for each in statements:
            self._statement(each)

    def _statement(self, node: ast.stmt) -> None:
        match node:
            case ast.Expr(value=ast.Constant(value=str(text))):
                self._line("{}", self.syntax.comment(text.strip().splitlines()[0]))
            case ast.Pass():
                pass
            case ast.Expr(value=ast.Call() as value):
                self._value(value)
            case ast.Assign(targets=[target], value=value):
                self._assign(target, value)
            case ast.AnnAssign(target=target, value=value) if value is not None:
                self._assign(target, value)
            case ast.AugAssign(target=target, op=op, value=value):
                self._assign(target, ast.BinOp(left=_read(target), op=op, right=value))
            case ast.Return(value=value) if value is not None:
                one = self._several(value.elts) if isinstance(value, ast.Tuple) else None
                one = one or self._value(value)
                if self.result not in (None, one.type):
                    raise self._refusal(self.tree, "returns different things")
                self.result = one.type
                self._line(self.syntax.result, self.name, one.text)
            case ast.If(test=test, body=body, orelse=others):
                self._line(self.syntax.branch[0], self._as(TRUTH, test, self._said(test)))
                self._inside(body)
                if others:
                    self._line(self.syntax.branch[1])
                    self._inside(others)
                self._line(self.syntax.branch[2])
            case ast.For(target=ast.Name(id=name), iter=each, body=body, orelse=[]):
                self._for(name, each, body)
            case _:
                raise self._refusal(node, "has no counterpart")

    def _inside(self, statements: Sequence[ast.stmt]) -> None:
        self.depth += 1
        self._block(statements)
        self.depth -= 1

    def _assign(self, target: ast.expr, value: ast.expr) -> None:
        if isinstance(target, ast.Tuple):
            self._unpack(target.elts, value)
            return
        expression = self._value(value)
        self._line(self.syntax.assign, self._target(target, expression.type), expression.text)

    def _unpack(self, targets: Sequence[ast.expr], value: ast.expr) -> None:
        """Evaluate all values before the first assignment, as Python does."""
        read = {node.id for node in ast.walk(value) if isinstance(node, ast.Name)}
        if isinstance(value, ast.Tuple) and all(
            isinstance(each, ast.Name) and each.id not in read for each in targets
        ):
            for target, each in zip(targets, value.elts, strict=True):
                self._assign(target, each)
            return
        if isinstance(value, ast.Tuple):
            expressions = []
            for each in value.elts:
                one = self._value(each)
                expressions.append(Said(self._temporary(one.type), one.type))
                self._line(self.syntax.assign, expressions[-1].text, one.text)
        else:
            whole = self._value(value)
            if not isinstance(whole.type, Several):
                raise self._refusal(value, "is no several numbers")
            fields = zip(whole.type.fields, whole.type.kinds, strict=True)
            expressions = [Said(f"{whole.text}.{name}", kind) for name, kind in fields]
        for target, one in zip(targets, expressions, strict=True):
            self._line(self.syntax.assign, self._target(target, one.type), one.text)

    def _target(self, target: ast.expr, kind: Any) -> str:
        if isinstance(target, ast.Name):
            before = self.types.setdefault(target.id, kind)
            if before != kind:
                raise self._refusal(target, f"is a {before} and a {kind}")
            if (name := self._named(target.id)) not in self.arguments:
                self.declared[name] = self.program.kind(kind)
            return name
        if isinstance(target, ast.Subscript) and isinstance(target.value, ast.Name):
            self.writes.add(target.value.id)
            return self._said(_read(target)).text
        raise self._refusal(target, "is nothing to assign to")

    def _several(self, values: Sequence[ast.expr], names: Any = (), title: str = "several") -> Said:
        expressions = [self._said(each) for each in values]
        kind = Several(tuple(each.type for each in expressions), tuple(names), title)
        made = self._temporary(kind)
        for name, each in zip(kind.fields, expressions, strict=True):
            self._line(self.syntax.assign, f"{made}.{name}", each.text)
        return Said(made, kind)

    def _for(self, name: str, over: ast.expr, body: Sequence[ast.stmt]) -> None:
        if not (isinstance(over, ast.Call) and getattr(over.func, "id", "") == "range"):
            raise self._refusal(over, "is no range")
        ends = [self._said(each).text for each in over.args]
        if len(ends) > 2:
            raise self._refusal(over, "has no counterpart")
        first, last = ("0", *ends)[-2:]
        inside = [node for each in body for node in ast.walk(each) if isinstance(node, ast.Name)]
        stored = {node.id for node in inside if isinstance(node.ctx, ast.Store)}
        read = {node.id for node in ast.walk(over) if isinstance(node, ast.Name)}
        if name in self.types or stored & {name, *read}:  # Python fixes the range, C does not
            raise self._refusal(
                over, "is changed inside, or its variable used outside, which has no counterpart"
            )
        self.types[name] = INTEGER
        own = self._target(ast.Name(id=name), INTEGER)
        self._line(self.syntax.loop[0], own, first, last)
        self._inside(body)
        self._line(self.syntax.loop[1], own)
        del self.types[name]

    # Expressions

    def _value(self, node: ast.expr) -> Said:
        self.whole = node
        return self._said(node)

    def _said(self, node: ast.expr) -> Said:
        match node:
            case ast.Constant(value=bool() | int() | float()):
                return self._constant(node, node.value)
            case ast.Name(id=name) if name in self.types:
                return Said(self._named(name), self.types[name])
            case ast.Name(id=name):
                return self._constant(node, self._looked_up(node, name))
            case ast.Attribute(value=ast.Name(id=name), attr=attr) if name in self.types:
                return self._of_variable(node, name, attr)
            case ast.Attribute(value=ast.Name(id=name), attr=attr):
                return self._constant(node, getattr(self._looked_up(node, name), attr))
            case ast.Subscript(value=value, slice=place):
                return self._element(node, value, place)
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                return self._call(node, name, arguments)
            case _:
                return self._worked_out(node)

    def _worked_out(self, node: ast.expr) -> Said:
        """Translate an expression that contains others."""
        signs = self.syntax.signs
        match node:
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                inner = self._said(operand)
                return Said(signs[ast.USub].format(inner.text), inner.type)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                text = self._as(TRUTH, operand, self._said(operand))
                return Said(signs[ast.Not].format(text), TRUTH)
            case ast.BinOp(
                left=ast.Constant(value=int() | float() as base),
                op=ast.Pow(),
                right=ast.Constant(value=int() as to),
            ):
                return self._constant(node, base**to)
            case ast.BinOp(left=left, op=op, right=right):
                return self._operation(node, self._said(left), type(op), self._said(right))
            case ast.BoolOp(op=op, values=values):
                parts = [self._said(each) for each in values]
                if {each.type for each in parts} != {TRUTH}:  # Python returns an operand
                    raise self._refusal(node, "is a number")
                text = reduce(signs[type(op)].format, (each.text for each in parts))
                return Said(text, TRUTH)
            case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in signs:
                one, other = self._alike(node, self._said(left), self._said(right))
                return Said(signs[type(op)].format(one.text, other.text), TRUTH)
            case ast.IfExp(test=test, body=yes, orelse=no):
                text = self._as(TRUTH, test, self._said(test))
                one, other = self._alike(node, self._said(yes), self._said(no))
                return Said(self.syntax.known["where"].format(text, one.text, other.text), one.type)
        raise self._refusal(node, "has no counterpart")

    def _operation(self, node: ast.expr, left: Said, op: Any, right: Said) -> Said:
        if left.type == right.type == TRUTH and op in OF_TRUTHS:
            return Said(self.syntax.signs[OF_TRUTHS[op]].format(left.text, right.text), TRUTH)
        if left.type == right.type == INTEGER and op in WHOLE and op in self.syntax.whole:
            return Said(self.syntax.whole[op].format(left.text, right.text), INTEGER)
        if NUMBER in (left.type, right.type) and op in (ast.Add, ast.Sub, ast.Mult, ast.Div):
            one, other = self._alike(node, left, right)
            return Said(self.syntax.signs[op].format(one.text, other.text), NUMBER)
        raise self._refusal(node, "has no counterpart")

    def _alike(self, node: ast.expr, one: Said, other: Said) -> tuple[Said, Said]:
        if one.type == other.type:
            return one, other
        return (
            Said(self._as(NUMBER, node, one), NUMBER),
            Said(self._as(NUMBER, node, other), NUMBER),
        )

    def _as(self, kind: str, node: ast.expr, said: Said) -> str:
        """Text of an expression, converted to type `kind`."""
        if said.type == kind:
            return said.text
        if kind == NUMBER and said.type in self.syntax.numbers:
            return self.syntax.numbers[said.type].format(said.text)
        if kind == TRUTH and said.type in (NUMBER, INTEGER):
            zero = self._constant(node, 0.0 if said.type == NUMBER else 0)
            return self.syntax.signs[ast.NotEq].format(said.text, zero.text)
        raise self._refusal(node, "has no counterpart")

    def _of_variable(self, node: ast.expr, name: str, attr: str) -> Said:
        kind = self.types[name]
        if isinstance(kind, Several) and attr in kind.names:
            place = kind.names.index(attr)
            return Said(f"{self._named(name)}.{kind.fields[place]}", kind.kinds[place])
        if kind == ROWS and attr == "shape":
            return self._constant(node, self.rows[name])
        raise self._refusal(node, "has no counterpart")

    def _element(self, node: ast.expr, value: ast.expr, place: ast.expr) -> Said:
        if isinstance(place, ast.Slice | ast.UnaryOp):  # an index from the end
            raise self._refusal(node, "has no counterpart")
        if isinstance(value, ast.Name) and self.types.get(value.id) == ROWS:
            index = self._as(INTEGER, place, self._said(place))
            return Said(self.syntax.element.format(self._named(value.id), index), NUMBER)
        if isinstance(value, ast.Attribute) and value.attr == "shape":
            return self._said(value)
        if isinstance(value, ast.Name) and isinstance(place, ast.Constant):
            return self._constant(node, self._looked_up(node, value.id)[place.value])
        raise self._refusal(node, "has no counterpart")

    def _call(self, node: ast.Call, name: str, arguments: Sequence[ast.expr]) -> Said:
        if name == "len" and isinstance(arguments[0], ast.Name):
            return self._constant(node, self.rows[arguments[0].id])
        function = self._looked_up(node, name)
        if function is elementary.polynomial:
            made = self.program.polynomial(self._looked_up(node, getattr(arguments[1], "id", "")))
            return self._called(node, made, arguments[:1], [self._said(arguments[0])])
        if isinstance(function, type) and hasattr(function, "_fields"):
            return self._several(arguments, function._fields, function.__name__.lower())
        expressions = [self._said(each) for each in arguments]
        if name in self.syntax.known and function is BY_NAME.get(name, vars(elementary).get(name)):
            asked, kind = ASKED[name]
            pairs = zip(asked, arguments, expressions, strict=True)
            return Said(self.syntax.known[name].format(*(self._as(*each) for each in pairs)), kind)
        if function in self.syntax.functions:
            texts = ", ".join(map(self._as, [NUMBER] * len(expressions), arguments, expressions))
            return Said(f"{self.syntax.functions[function]}({texts})", NUMBER)
        if not inspect.isfunction(getattr(function, "py_func", function)):
            raise self._refusal(node, f"calls {name}, which is not of this program's")
        rows = [self.rows[getattr(a, "id", "")] for a in self._of_rows(arguments)]
        made = self.program.function(function, [each.type for each in expressions], rows)
        return self._called(node, made, arguments, expressions)

    def _of_rows(self, arguments: Sequence[ast.expr]) -> list[ast.expr]:
        return [a for a in arguments if self.types.get(getattr(a, "id", "")) == ROWS]

    def _called(
        self,
        node: ast.Call,
        made: TargetFunction,
        arguments: Sequence[ast.expr],
        said: Sequence[Said],
    ) -> Said:
        """Write a call as a statement."""
        if made.kind is None:
            raise self._refusal(node, "calls itself, which has no counterpart")
        pairs = list(zip(made.arguments, arguments, said, strict=True))
        written = {getattr(own, "id", "") for argument, own, _ in pairs if argument.written}
        if written and node is not self.whole:  # the order of reads is undefined
            raise self._refusal(node, "changes an argument within an expression: no counterpart")
        self.writes |= written
        result = self._temporary(made.kind)
        texts = {argument.name: each.text for argument, _, each in pairs}
        names = [texts[argument.name] for argument, _, _ in pairs if argument.written]
        self._line("{}", self.syntax.call(made.name, result, texts, names))
        return Said(result, made.kind)

    def _looked_up(self, node: ast.AST, name: str) -> Any:
        if name not in self.scope:
            raise self._refusal(node, f"names {name}, which is nowhere")
        return self.scope[name]

    def _constant(self, node: ast.AST, value: Any) -> Said:
        if isinstance(value, bool):
            return Said(self.syntax.truths[value], TRUTH)
        if isinstance(value, int):
            return Said(self.syntax.integer(value), INTEGER)
        if isinstance(value, float):
            return Said(self.syntax.literal(value), NUMBER)
        raise self._refusal(node, "has no counterpart")

    def _refusal(self, node: ast.AST, why: str) -> UsageError:
        shown = ast.unparse(node) if isinstance(node, ast.expr | ast.stmt) else ""
        first = shown.splitlines()[0] if shown else "it"
        return UsageError(f"{self.where}: {first!r} {why} in {self.syntax.language}")


def _read(target: ast.expr) -> ast.expr:
    """An assignment target as an expression to read."""
    return ast.parse(ast.unparse(target), mode="eval").body
