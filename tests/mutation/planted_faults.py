"""Planted faults: every change of one operator, comparison, constant, sign or bound in a source text."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass

OPERATORS: dict[type[ast.operator], tuple[str, str]] = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.Pow: ("**", "*"),
    ast.FloorDiv: ("//", "%"),
    ast.Mod: ("%", "//"),
    ast.BitAnd: ("&", "|"),
    ast.BitOr: ("|", "&"),
}
REVERSED: dict[type[ast.cmpop], tuple[str, str]] = {
    ast.Lt: ("<", ">"),
    ast.Gt: (">", "<"),
    ast.LtE: ("<=", ">="),
    ast.GtE: (">=", "<="),
    ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="),
}
# Whether the limit itself is included; not beside a fraction, which no computed number equals.
LIMITS: dict[type[ast.cmpop], tuple[str, str]] = {
    ast.Lt: ("<", "<="),
    ast.Gt: (">", ">="),
    ast.LtE: ("<=", "<"),
    ast.GtE: (">=", ">"),
}

# Functions of which an argument is dropped: what remains is the first argument.
BOUNDS = {"min", "max", "minimum", "maximum", "clip", "lower", "higher", "abs"}

# Calls whose numbers are no part of a result.
MESSAGES = {"InvalidInput", "TypeVar", "Finding"}


@dataclass(frozen=True)
class Fault:
    """One change of a source text.

    Attributes:
        kind: operator, comparison, limit, constant, sign, bound or logic.
        function: name of the function around it, with its class; "" at the top of a module.
        line: from 1.
        begin, end: offsets of the replaced characters.
        replacement: their replacement.
        before, after: the changed expression, for people.
    """

    kind: str
    function: str
    line: int
    begin: int
    end: int
    replacement: str
    before: str
    after: str

    def planted(self, text: str) -> str:
        """The text with this fault."""
        return text[: self.begin] + self.replacement + text[self.end :]


def planted_faults(text: str) -> list[Fault]:
    """All faults of a Python source text, in the order of its syntax tree."""
    return list(_Search(text).of(ast.parse(text), ""))


class _Search:
    def __init__(self, text: str) -> None:
        self.text = text
        self.starts = [0]
        for line in text.splitlines(keepends=True):
            self.starts.append(self.starts[-1] + len(line))
        self.lines = text.splitlines(keepends=True)

    def of(self, node: ast.AST, function: str) -> Iterator[Fault]:
        """The faults in a node and below it."""
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            function = f"{function}.{node.name}" if function else node.name
        yield from self._here(node, function)
        for child in self._below(node):
            yield from self.of(child, function)

    def _below(self, node: ast.AST) -> Iterator[ast.AST]:
        """The nodes below that are part of a computation: no types, texts, decorators and error messages."""
        if isinstance(node, ast.Raise | ast.Assert | ast.JoinedStr | ast.Import | ast.ImportFrom):
            return
        # Validation of input is not numerics.
        if isinstance(node, ast.If) and all(isinstance(one, ast.Raise) for one in node.body):
            for one in node.orelse:
                yield one
            return
        if isinstance(node, ast.Call) and _name(node.func) in MESSAGES:
            return
        for field, value in ast.iter_fields(node):
            if field in ("annotation", "returns", "decorator_list", "type_params"):
                continue
            for one in value if isinstance(value, list) else [value]:
                if isinstance(one, ast.AST) and not _is_text(one):
                    yield one

    def _here(self, node: ast.AST, function: str) -> Iterator[Fault]:
        if isinstance(node, ast.BinOp | ast.AugAssign) and type(node.op) in OPERATORS:
            old, new = OPERATORS[type(node.op)]
            if isinstance(node, ast.BinOp):
                yield from self._between("operator", node, node.left, old, new, node.right, function)
            else:
                target = node.target
                yield from self._between("operator", node, target, old + "=", new + "=", node.value, function)
        elif isinstance(node, ast.Compare):
            operands = [node.left, *node.comparators]
            for k, op in enumerate(node.ops):
                for kind, table in (("comparison", REVERSED), ("limit", LIMITS)):
                    beside = operands[k : k + 2]
                    if type(op) in table and not (kind == "limit" and any(map(_is_fraction, beside))):
                        yield from self._between(
                            kind, node, operands[k], *table[type(op)], operands[k + 1], function
                        )
        elif isinstance(node, ast.BoolOp):
            old, new = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
            for left, right in zip(node.values, node.values[1:], strict=False):
                yield from self._between("logic", node, left, old, new, right, function)
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not):
            kind = "sign" if isinstance(node.op, ast.USub) else "logic"
            inside = self._segment(node.operand)
            if not (kind == "sign" and isinstance(node.operand, ast.Constant) and node.operand.value == 0):
                yield self._fault(kind, node, *self._span(node), f"({inside})", function)
        elif isinstance(node, ast.Constant):
            if isinstance(node.value, bool):
                yield self._fault("constant", node, *self._span(node), str(not node.value), function)
            elif isinstance(node.value, int):
                yield self._fault("constant", node, *self._span(node), str(node.value + 1), function)
            elif isinstance(node.value, float):
                value = 2.0 * node.value if node.value else 1.0
                yield self._fault("constant", node, *self._span(node), repr(value), function)
        elif isinstance(node, ast.Call) and _name(node.func) in BOUNDS and node.args and not node.keywords:
            # A generator or a list is reduced, not bounded.
            some = len(node.args) > 1 or _name(node.func) == "abs"
            for argument in node.args[: (1 if _name(node.func) == "clip" else 2) if some else 0]:
                if not isinstance(argument, ast.Starred):
                    kept = f"({self._segment(argument)})"
                    yield self._fault("bound", node, *self._span(node), kept, function)

    def _between(
        self, kind: str, node: ast.AST, left: ast.AST, old: str, new: str, right: ast.AST, function: str
    ) -> Iterator[Fault]:
        """The operator in the text between two operands."""
        first, last = self._span(left)[1], self._span(right)[0]
        match = re.search(rf"(?<![*/<>=!&|+\-]){re.escape(old)}(?![*/<>=&|])", self.text[first:last])
        if match:
            begin, end = first + match.start(), first + match.end()
            yield self._fault(kind, node, begin, end, new, function)

    def _fault(self, kind: str, node: ast.AST, begin: int, end: int, new: str, function: str) -> Fault:
        low, high = self._span(node)
        before = self.text[low:high]
        after = before[: begin - low] + new + before[end - low :]
        if isinstance(node, ast.Constant) or isinstance(getattr(node, "operand", None), ast.Constant):
            # A bare number says nothing: its whole line does.
            row = node.lineno - 1
            low, high = self.starts[row], self.starts[row + 1]
            before = self.text[low:high]
            after = before[: begin - low] + new + before[end - low :]
        return Fault(kind, function, node.lineno, begin, end, new, _short(before), _short(after))

    def _span(self, node: ast.AST) -> tuple[int, int]:
        return (
            self._offset(node.lineno, node.col_offset),
            self._offset(node.end_lineno, node.end_col_offset),
        )

    def _offset(self, line: int, column: int) -> int:
        """Columns of the syntax tree count bytes of UTF-8."""
        return self.starts[line - 1] + len(self.lines[line - 1].encode()[:column].decode())

    def _segment(self, node: ast.AST) -> str:
        low, high = self._span(node)
        return self.text[low:high]


def _name(function: ast.AST) -> str:
    if isinstance(function, ast.Attribute):
        return function.attr
    return function.id if isinstance(function, ast.Name) else ""


def _is_text(node: ast.AST) -> bool:
    """A docstring or another string."""
    if isinstance(node, ast.Expr):
        node = node.value
    return isinstance(node, ast.Constant) and isinstance(node.value, str | bytes)


def _is_fraction(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, float)


def _short(text: str) -> str:
    return " ".join(text.split())
