"""Numeric constants at module level: how many there are, and which say nothing of themselves.

`python benchmarks/constants.py ROOM ...` names those of rooms. A constant says where it comes from
in the text below it, or in a comment on its line.
"""

from __future__ import annotations

import ast
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]


def is_numeric(value: ast.expr) -> bool:
    match value:
        case ast.Constant(value=number):
            return isinstance(number, int | float) and not isinstance(number, bool)
        case ast.UnaryOp(operand=inner):
            return is_numeric(inner)
        case ast.BinOp(left=left, right=right):
            return is_numeric(left) or is_numeric(right)
    return False


def constants(source: str) -> Iterator[tuple[str, bool]]:
    """Name of each, and whether anything is said of it."""
    lines, body = source.splitlines(), ast.parse(source).body
    for node, following in zip(body, [*body[1:], None], strict=True):
        match node:
            case (
                ast.Assign(targets=[ast.Name(id=name)], value=value)
                | ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as value)
            ) if is_numeric(value):
                text = isinstance(following, ast.Expr) and isinstance(following.value, ast.Constant)
                yield name, text or "#" in lines[node.end_lineno - 1]


def main() -> None:
    rooms, silent = Counter(), Counter()
    for path in sorted((ROOT / "campaign").rglob("*.py")):
        room = path.relative_to(ROOT / "campaign").parts[0]
        for name, told in constants(path.read_text(encoding="utf-8")):
            rooms[room] += 1
            silent[room] += not told
            if not told and room in sys.argv[1:]:
                print(f"{path.relative_to(ROOT)}: {name}")
    for room, count in rooms.most_common():
        print(f"{room:20}{count:5}{silent[room]:5}")
    print(f"{'all':20}{rooms.total():5}{silent.total():5}")


if __name__ == "__main__":
    main()
