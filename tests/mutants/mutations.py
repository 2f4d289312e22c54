"""Small bugs that can be put into a source file: those of cosmic-ray, and a few that it lacks."""

from __future__ import annotations

import ast
import difflib
import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from random import Random

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.operators.provider import OperatorProvider

THEIRS = (
    *("ReplaceComparisonOperator_Lt_LtE", "ReplaceComparisonOperator_Lt_GtE"),
    *("ReplaceComparisonOperator_LtE_Lt", "ReplaceComparisonOperator_LtE_Gt"),
    *("ReplaceComparisonOperator_Gt_GtE", "ReplaceComparisonOperator_Gt_LtE"),
    *("ReplaceComparisonOperator_GtE_Gt", "ReplaceComparisonOperator_GtE_Lt"),
    *("ReplaceComparisonOperator_Eq_NotEq", "ReplaceComparisonOperator_NotEq_Eq"),
    *("ReplaceComparisonOperator_Is_IsNot", "ReplaceComparisonOperator_IsNot_Is"),
    *("ReplaceBinaryOperator_Add_Sub", "ReplaceBinaryOperator_Sub_Add"),
    *("ReplaceBinaryOperator_Mul_Div", "ReplaceBinaryOperator_Div_Mul"),
    *("ReplaceBinaryOperator_Pow_Mul", "ReplaceBinaryOperator_Mod_Div"),
    *("ReplaceBinaryOperator_FloorDiv_Div", "ReplaceBinaryOperator_FloorDiv_Mul"),
    *("ReplaceBinaryOperator_BitAnd_BitOr", "ReplaceBinaryOperator_BitOr_BitAnd"),
    *("ReplaceUnaryOperator_Delete_Not", "ReplaceUnaryOperator_USub_UAdd"),
    *("ReplaceUnaryOperator_Delete_Invert", "AddNot", "ReplaceTrueWithFalse"),
    *("ReplaceFalseWithTrue", "ReplaceAndWithOr", "ReplaceOrWithAnd"),
    *("ReplaceBreakWithContinue", "ReplaceContinueWithBreak", "ExceptionReplacer"),
    *("NumberReplacer", "RemoveDecorator", "ZeroIterationForLoop"),
)
"""One change of each kind: cosmic-ray's other ones ask the same question of the tests again."""


@dataclass(frozen=True)
class Mutant:
    """One bug.

    Attributes:
        line: the first line that it changes.
        function: what encloses that, or empty; with `was` and `now` it names the bug wherever the
            lines move.
        was: the changed lines before, without indentation.
        now: the changed lines after.
        source: the whole file.
    """

    file: str
    line: int
    function: str
    was: str
    now: str
    source: str

    @property
    def place(self) -> str:
        return f"{self.file}:{self.line} {self.function}"

    @property
    def key(self) -> tuple[str, str, str, str]:
        return self.file, self.function, self.was, self.now


def mutants(file: str, source: str) -> list[Mutant]:
    """Every bug once, in the order of the lines; those that change nothing are left out."""
    tree = ast.parse(source)
    seen, found = {_meaning(source)}, []
    for make in _changes(source, tree):
        mutated = make()
        meaning = _meaning(mutated)
        if meaning not in seen | {None}:
            seen.add(meaning)
            found.append(_described(file, source, tree, mutated))
    return sorted(found, key=lambda mutant: mutant.line)


def drawn(file: str, source: str, chosen: Random) -> Mutant | None:
    """One bug, every change as likely as another; None where a file has none."""
    tree, same = ast.parse(source), (_meaning(source), None)
    changes = _changes(source, tree)
    for make in chosen.sample(changes, len(changes)):
        if _meaning(mutated := make()) not in same:
            return _described(file, source, tree, mutated)
    return None


def _changes(source: str, tree: ast.Module) -> list[Callable[[], str]]:
    """What makes the changed file, for each change."""
    return [*_theirs(source), *(partial(str, mutated) for mutated in _ours(source, tree))]


def _theirs(source: str) -> Iterator[Callable[[], str]]:
    operators = OperatorProvider()
    nodes = list(ast_nodes(get_ast(source)))
    for name in THEIRS:
        operator = operators[name]()
        for number in range(sum(len(list(operator.mutation_positions(node))) for node in nodes)):
            yield partial(mutate_code, source, operator, number)


def _ours(source: str, tree: ast.Module) -> Iterator[str]:
    """A statement, a keyword or an operand left out; a membership turned round."""
    text = source.encode()
    lines = list(itertools.accumulate(map(len, text.splitlines(keepends=True)), initial=0))
    for node in ast.walk(tree):
        for instead in _instead(node):
            begin = lines[node.lineno - 1] + node.col_offset
            end = lines[node.end_lineno - 1] + node.end_col_offset
            yield (text[:begin] + instead.encode() + text[end:]).decode()


def _instead(node: ast.AST) -> Iterator[str]:
    match node:
        case ast.Expr(value=ast.Constant()):
            pass  # a docstring
        case ast.Expr() | ast.Assign() | ast.AugAssign() | ast.Return() | ast.Raise():
            yield "pass"
        case ast.BoolOp(op=op, values=values):
            for operand in values:
                rest = [other for other in values if other is not operand]
                left = ast.BoolOp(op, rest) if len(rest) > 1 else rest[0]
                yield f"({ast.unparse(left)})"
        case ast.BinOp(left=left, right=right):
            yield f"({ast.unparse(left)})"
            yield f"({ast.unparse(right)})"
        case ast.Compare(ops=[ast.In()], left=left, comparators=right):
            yield f"({ast.unparse(ast.Compare(left, [ast.NotIn()], right))})"
        case ast.Call(func=func, args=args, keywords=keywords):
            for keyword in keywords:
                rest = [other for other in keywords if other is not keyword]
                yield ast.unparse(ast.Call(func, args, rest))


class _Bare(ast.NodeTransformer):
    """Leaves out annotations, and the values of named constants.

    Nothing evaluates an annotation or an alias for one here; and how long a deadline is, is a
    decision, not a fact of which a test could tell whether it is right.
    """

    def visit_arg(self, node: ast.arg) -> ast.arg:
        node.annotation = None
        return node

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        node.returns = None
        return self.generic_visit(node)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST:
        node.annotation = ast.Constant(None)
        return self.generic_visit(node)

    def visit_Module(self, node: ast.Module) -> ast.AST:
        for statement in node.body:
            match statement:
                case ast.Assign(targets=[ast.Name(id=name)], value=value) if _is_number(value):
                    statement.value = ast.Constant(name)
        node.body = [statement for statement in node.body if not _is_alias(statement)]
        return self.generic_visit(node)


def _is_number(value: ast.expr) -> bool:
    """Whether it is a number as it is written, e.g. `0.5` or `1 << 20`."""
    match value:
        case ast.Constant(value=number):
            return isinstance(number, int | float)
        case ast.BinOp(left=left, right=right):
            return _is_number(left) and _is_number(right)
    return False


def _is_alias(statement: ast.stmt) -> bool:
    match statement:
        case ast.Assign(targets=[ast.Name(id=name)], value=ast.Subscript()):
            return name[0].isupper() and not name.isupper()
        case ast.Pass():  # what is left where one was
            return True
    return False


def _meaning(source: str) -> str | None:
    """What tells two files apart; None where one cannot be parsed."""
    try:
        return ast.dump(_Bare().visit(ast.parse(source)))
    except SyntaxError:
        return None


def _described(file: str, source: str, tree: ast.Module, mutated: str) -> Mutant:
    before, after = source.splitlines(), mutated.splitlines()
    changes = [
        change
        for change in difflib.SequenceMatcher(None, before, after, autojunk=False).get_opcodes()
        if change[0] != "equal"
    ]
    begin, end = changes[0][1], changes[-1][2]
    new = after[changes[0][3] : changes[-1][4]]
    was, now = (" ".join(line.strip() for line in lines) for lines in (before[begin:end], new))
    return Mutant(file, begin + 1, _enclosing(tree, begin + 1), was, now, mutated)


def _enclosing(tree: ast.Module, line: int) -> str:
    names: list[str] = []
    body: list[ast.stmt] = tree.body
    while body:
        for node in body:
            named = isinstance(node, ast.FunctionDef | ast.ClassDef)
            if named and node.lineno <= line <= node.end_lineno:
                names.append(node.name)
                body = node.body
                break
        else:
            break
    return ".".join(names)
