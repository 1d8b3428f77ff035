"""The rules by which faults are drawn: every place of a source where a sign, a constant, a condition or a
term can go wrong.

Left out is what no test of behaviour is for: texts, `raise`, `assert`, type hints, decorators, defaults of
settings, progress and warnings; and what changes nothing: tolerances that only keep a division finite, zeros,
ones as factors, `is None`.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass

SIGN, CONSTANT, CONDITION, TERM = "sign turned", "constant times 0.3", "condition dropped", "term removed"
RULES = (SIGN, CONSTANT, CONDITION, TERM)
SHARE = 0.3  # what a constant is multiplied by
SMALL, LARGE = 1e-5, 1e5  # below it a constant keeps a division finite, above it it stands for infinity
TOLD = {"print", "warn", "warning", "info", "debug", "tell", "log", "progress", "note"}
TUNING = {
    "eps",
    "tol",
    "atol",
    "rtol",
    "ftol",
    "xtol",
    "gtol",
    "axis",
    "seed",
    "ddof",
    "default",
    "description",
}
SIGNS = {ast.Add: "-", ast.Sub: "+"}


@dataclass(frozen=True)
class Candidate:
    """A fault that could be planted: its rule, line number, the lines before and after without indent, and
    the function."""

    rule: str
    number: int
    line: str
    planted: str
    function: str


def candidates(source: str) -> list[Candidate]:
    """All faults of a module, from top to bottom."""
    lines = source.splitlines()
    found = {}
    for function, node in _eligible(ast.parse(source), ""):
        for rule, number, start, end, text in _changes(node, lines):
            raw = lines[number - 1].encode()
            planted = (raw[:start] + text.encode() + raw[end:]).decode().strip()
            line = lines[number - 1].strip()
            if planted != line:
                found[number, planted] = Candidate(rule, number, line, planted, function)
    return sorted(found.values(), key=lambda c: (c.number, c.planted))


Change = tuple[
    str, int, int, int, str
]  # rule, line, first and last byte in the line, what stands there instead


def _eligible(node: ast.AST, function: str) -> Iterator[tuple[str, ast.expr | ast.stmt]]:
    """(function, node) of the statements and expressions in which a fault may be planted."""
    if isinstance(node, ast.FunctionDef):
        if (isinstance(node.returns, ast.Name) and node.returns.id == "str") or node.name in (
            "__repr__",
            "__str__",
        ):
            return
        function = f"{function}.{node.name}".strip(".")
        children: list[ast.AST] = [*node.args.defaults, *node.body]
    elif isinstance(node, ast.ClassDef):
        function = f"{function}.{node.name}".strip(".")
        children = [n for n in node.body if isinstance(n, ast.FunctionDef)]
    elif _left_out(node):
        return
    elif isinstance(node, ast.AnnAssign):
        children = [node.value] if node.value else []
    elif isinstance(node, ast.Subscript):
        children = [node.value]
    else:
        children = list(ast.iter_child_nodes(node))
    if isinstance(node, ast.expr | ast.stmt) and not isinstance(node, ast.FunctionDef | ast.ClassDef):
        yield function, node
    for child in children:
        yield from _eligible(child, function)


def _left_out(node: ast.AST) -> bool:
    if isinstance(node, ast.keyword):
        return node.arg in TUNING
    if isinstance(node, ast.Expr):
        call = node.value
        return not isinstance(call, ast.Call) or _last_name(call.func) in TOLD
    return isinstance(node, ast.Raise | ast.Assert | ast.JoinedStr | ast.Import | ast.ImportFrom)


def _last_name(node: ast.expr) -> str:
    return node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else ""


def _changes(node: ast.expr | ast.stmt, lines: list[str]) -> Iterator[Change]:
    """Changes of one node; a node that spans lines has none, but what it is made of may."""
    if isinstance(node, ast.If):
        yield from _negated(node.test, lines, node.body)
    elif isinstance(node, ast.IfExp):
        yield from _negated(node.test, lines, [])
    elif isinstance(node, ast.AugAssign) and type(node.op) in SIGNS and _is_number(node.value):
        yield from _operator(node.target, node.value, node.op, lines, "=")
    if node.lineno != node.end_lineno:
        return
    if isinstance(node, ast.BinOp):
        yield from _of_operation(node, lines)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub) and not _is_index(node.operand):
        yield SIGN, node.lineno, node.col_offset, node.col_offset + len("-"), ""
    elif isinstance(node, ast.Constant) and type(node.value) is float and SMALL < abs(node.value) < LARGE:
        yield CONSTANT, node.lineno, node.col_offset, _end(node), repr(float(f"{SHARE * node.value:.6g}"))
    elif isinstance(node, ast.BoolOp):
        yield from _without_each(node)
    elif isinstance(node, ast.ListComp | ast.SetComp | ast.GeneratorExp | ast.DictComp):
        yield from _unfiltered(node)


def _end(node: ast.expr) -> int:
    assert node.end_col_offset is not None
    return node.end_col_offset


def _between(left: ast.expr, right: ast.expr, lines: list[str]) -> str:
    return lines[left.lineno - 1].encode()[_end(left) : right.col_offset].decode()


def _operator(
    left: ast.expr, right: ast.expr, op: ast.operator, lines: list[str], after: str = ""
) -> Iterator[Change]:
    """The sign between two expressions turned; it stands alone between them but for brackets and blanks."""
    if left.end_lineno != right.lineno:
        return
    old = ("+" if isinstance(op, ast.Add) else "-") + after
    gap = _between(left, right, lines)
    if gap.count(old) == 1:
        yield SIGN, left.lineno, _end(left), right.col_offset, gap.replace(old, SIGNS[type(op)] + after)


def _of_operation(node: ast.BinOp, lines: list[str]) -> Iterator[Change]:
    left, right = node.left, node.right
    if not (_is_number(left) and _is_number(right)):
        return
    raw = lines[node.lineno - 1].encode()
    gap = _between(left, right, lines)
    for sign in ("**", "//", "+", "-", "*", "/", "&", "|"):
        if sign in gap:
            break
    else:
        return
    split = _end(left) + len(gap[: gap.index(sign)].encode())
    first = raw[node.col_offset : split].decode().rstrip()
    last = raw[split + len(sign) : _end(node)].decode().lstrip()
    if isinstance(node.op, ast.BitAnd | ast.BitOr):
        yield CONDITION, node.lineno, node.col_offset, _end(node), first
        yield CONDITION, node.lineno, node.col_offset, _end(node), last
    if isinstance(node.op, ast.Add | ast.Sub):
        yield from _operator(left, right, node.op, lines)
    if isinstance(node.op, ast.Add | ast.Sub | ast.Mult | ast.Div):
        yield TERM, node.lineno, node.col_offset, _end(node), first
    if isinstance(node.op, ast.Add | ast.Mult):
        yield TERM, node.lineno, node.col_offset, _end(node), last


def _is_number(node: ast.expr) -> bool:
    """Whether an operand may be a number or an array that counts: no text, list or path, not zero, one or a
    guard."""
    if isinstance(node, ast.Constant):
        value = node.value
        return (
            isinstance(value, int | float)
            and not isinstance(value, bool)
            and (value != 0)
            and (value == 1 or abs(value) > SMALL)
        )
    if isinstance(node, ast.Call):
        return _last_name(node.func) not in {"list", "tuple", "str", "sorted", "Path"}
    if isinstance(node, ast.Name):
        return node.id not in {"folder", "path", "root"}
    return not isinstance(node, ast.List | ast.Tuple | ast.ListComp | ast.JoinedStr | ast.Dict | ast.Set)


def _is_index(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, int)


def _negated(test: ast.expr, lines: list[str], body: list[ast.stmt]) -> Iterator[Change]:
    """`not` before a condition; not where it would only raise or fall over None at once."""
    crashes = any(isinstance(o, ast.Is | ast.IsNot) for n in ast.walk(test) for o in getattr(n, "ops", []))
    typed = isinstance(test, ast.Call) and _last_name(test.func) == "isinstance"
    refuses = bool(body) and isinstance(body[-1], ast.Raise)
    if crashes or typed or refuses or test.lineno != test.end_lineno:
        return
    said = lines[test.lineno - 1].encode()[test.col_offset : _end(test)].decode()
    if isinstance(test, ast.UnaryOp) and isinstance(test.op, ast.Not):
        yield CONDITION, test.lineno, test.col_offset, test.col_offset + len("not"), ""
    else:
        yield CONDITION, test.lineno, test.col_offset, _end(test), f"not ({said})"


def _without_each(node: ast.BoolOp) -> Iterator[Change]:
    """One of several conditions left out."""
    if any(isinstance(o, ast.Is | ast.IsNot) for n in node.values for o in getattr(n, "ops", [])):
        return  # what follows `is not None and` needs it
    if not any(isinstance(n, ast.Compare | ast.BoolOp | ast.UnaryOp) for n in node.values):
        return  # `given or DEFAULT` is no condition
    for value in node.values:
        yield (
            CONDITION,
            value.lineno,
            value.col_offset,
            _end(value),
            "True" if isinstance(node.op, ast.And) else "False",
        )


def _unfiltered(node: ast.ListComp | ast.SetComp | ast.GeneratorExp | ast.DictComp) -> Iterator[Change]:
    """A comprehension without its condition."""
    for test in (i for g in node.generators for i in g.ifs):
        names_something = any(isinstance(n, ast.NamedExpr) for n in ast.walk(test))
        if test.lineno == test.end_lineno and not names_something:
            yield CONDITION, test.lineno, test.col_offset, _end(test), "True"
