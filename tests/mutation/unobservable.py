"""What is left out of mutation because no test of behaviour could tell the difference.

Annotations and type aliases, code for type checkers only, what merely keeps a programmer from a
mistake or saves time or memory, functions nobody may call, and constants of 2^62, which stand for
"never" and "for ever": no run comes to so many cycles or picoseconds.
"""

import ast
from collections.abc import Iterator
from typing import Final

Span = tuple[tuple[int, int], tuple[int, int]]
"""Begin and end: line, from 1, and column, from 0, in characters."""

# `==` and `is` agree wherever this code uses either: small whole numbers, enum members, None.
SAME: Final = frozenset(("Eq_Is", "Is_Eq", "NotEq_IsNot", "IsNot_NotEq"))

TYPING: Final = frozenset(("typing", "collections.abc"))
DECORATORS: Final = frozenset(
    ("abstractmethod", "cache", "final", "lru_cache", "mypyc_attr", "overload", "override",
     "runtime_checkable")
)  # fmt: skip
GUARDS: Final = frozenset(("allow_interpreted_subclasses", "frozen", "maxsize", "slots", "strict"))


def same_by_construction(operator: str) -> bool:
    """Whether an operator of the library makes code that does the same."""
    return operator.endswith(tuple(f"Operator_{pair}" for pair in SAME))


def unobservable(source: str) -> list[Span]:
    """Return the parts of a file that are not mutated: begin and end of each."""
    lines = source.splitlines()
    return [_span(lines, node) for node in _left_out(ast.parse(source))]


def _span(lines: list[str], node: ast.expr | ast.stmt) -> Span:
    """Turn the byte offsets of ``ast`` into columns."""
    last = node.end_lineno or node.lineno
    begin = len(lines[node.lineno - 1].encode()[: node.col_offset].decode())
    end = len(lines[last - 1].encode()[: node.end_col_offset].decode())
    return (node.lineno, begin), (last, end)


def _left_out(tree: ast.Module) -> Iterator[ast.expr | ast.stmt]:
    typing = {
        alias.asname or alias.name
        for node in tree.body
        if isinstance(node, ast.ImportFrom) and node.module in TYPING
        for alias in node.names
    }
    for statement in tree.body:
        if isinstance(statement, ast.Assign) and _is_alias(statement):
            yield statement
        if isinstance(statement, ast.AnnAssign) and "1 << 62" in ast.unparse(statement):
            yield statement
    for node in ast.walk(tree):
        match node:
            case ast.AnnAssign():
                yield node.annotation
            case ast.arg(annotation=ast.expr() as annotation):
                yield annotation
            case ast.If(test=ast.Name("TYPE_CHECKING")):
                yield node
            case ast.Subscript(value=ast.Name(name)) if name in typing:
                yield node
            case ast.Call(func=ast.Name("cast"), args=[ast.expr() as kind, _]):
                yield kind
            case ast.FunctionDef() | ast.ClassDef() | ast.AsyncFunctionDef():
                if not isinstance(node, ast.ClassDef):
                    if node.returns is not None:
                        yield node.returns
                    if _refuses(node):
                        yield from node.decorator_list
                yield from _guards(node.decorator_list)
                yield from (word.value for word in getattr(node, "keywords", ())
                            if word.arg in GUARDS)  # fmt: skip


def _is_alias(statement: ast.Assign) -> bool:
    """Whether this gives a type a name: ``Number = int | float``."""
    name = statement.targets[0]
    return isinstance(name, ast.Name) and name.id[0].isupper() and not name.id.isupper()


def _refuses(function: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    """Whether only other classes' functions in its place are called."""
    match function.body:
        case [ast.Expr(ast.Constant(str())), ast.Raise(ast.Name("NotImplementedError"))]:
            return True
    return False


def _guards(decorators: list[ast.expr]) -> Iterator[ast.expr]:
    for decorator in decorators:
        called = decorator.func if isinstance(decorator, ast.Call) else decorator
        name = getattr(called, "attr", getattr(called, "id", ""))
        if name in DECORATORS:
            yield decorator
        elif isinstance(decorator, ast.Call):
            yield from (word.value for word in decorator.keywords if word.arg in GUARDS)
