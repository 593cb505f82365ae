"""Types of the blocking client, made from the asyncio side."""

import ast
from pathlib import Path
from typing import Final

from vbus.chips.family import Family
from vbus.cli.generate.layout import ROOT, folder_of, formatted

_CLIENT: Final = ROOT / "vbus" / "client"
_ROLES: Final = ("calls", "host")
"""Modules of a chip's folder that have its client: what is made of tables, and ``host.py``."""


def _about(path: Path) -> str:
    return f'"""{ast.get_docstring(ast.parse(path.read_text()))}"""'


def blocking(name: str) -> str:
    """Return the stub of a module of the client whose asyncio side is the file of this name."""
    path = _CLIENT / "aio" / f"{name}.py"
    return _blocking([path.read_text()], f"aio/{name}.py", _CLIENT / f"{name}.py")


def client(family: Family) -> str:
    """Return the stub of the blocking client of a family of this source tree."""
    folder = folder_of(family)
    files = (folder / "calls.pyi", folder / "host.py")
    sources = [path.read_text() for path in files if path.exists()]
    named = f"{folder.relative_to(ROOT)} ({', '.join(_ROLES)})"
    return _blocking(sources, named, _CLIENT / f"{family.name}.py", own=f"{family.home}.")


def _blocking(sources: list[str], origin: str, path: Path, own: str = "-") -> str:
    """Return what is blocking of asyncio sources; names of modules ``own...`` are in them."""
    imports, rest = [], []
    for source in sources:
        body = ast.parse(source).body
        # Under TYPE_CHECKING stand names that a stub needs like all others.
        for_types = [one for node in body if isinstance(node, ast.If) for one in node.body]
        for node in [*for_types, *body]:
            # The tree, not the text: comments and layout are made anew by ruff.
            text = ast.unparse(_BlockingStub().visit(node))
            if isinstance(node, ast.ImportFrom):
                if (node.module or "").removeprefix(own) not in _ROLES:
                    imports.append(text)
            # Functions of a module are written by hand on the blocking side.
            elif _is_public(node) and not isinstance(node, ast.FunctionDef):
                rest.append(text)
    text = "\n".join([_about(path), *imports, *rest])
    # Each asyncio module has a blocking one of the same name above it.
    text = text.replace("vbus.client.aio.", "vbus.client.")
    stub = path.with_suffix(".pyi").relative_to(ROOT)
    head = f"# Made from {origin} by contrib.generate; change that.\n"
    return formatted(head + text, str(stub))


def _name(node: ast.AST) -> str:
    """Return the name that a statement defines; "" if none, or one without a type."""
    if isinstance(node, ast.AnnAssign):
        target = node.target
        return target.id if isinstance(target, ast.Name) else getattr(target, "attr", "")
    return getattr(node, "name", "")


def _is_public(node: ast.AST) -> bool:
    name = _name(node)
    return name != "" and (not name.startswith("_") or name.endswith("__"))


class _BlockingStub(ast.NodeTransformer):
    """Makes a blocking stub of an asyncio source."""

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.ClassDef:
        # Attributes get their types in __init__, which a stub does not show: they are declared
        # instead.
        fields = [
            ast.AnnAssign(ast.Name(step.target.attr), step.annotation, None, 1)
            for made in node.body
            if isinstance(made, ast.FunctionDef) and made.name == "__init__"
            for step in made.body
            if isinstance(step, ast.AnnAssign) and isinstance(step.target, ast.Attribute)
        ]
        about = node.body[:1] if ast.get_docstring(node) else []
        members = [self.visit(one) for one in [*fields, *node.body] if _is_public(one)]
        node.body = [*about, *members] or [ast.Expr(ast.Constant(...))]
        node.bases = [
            ast.Name("Blocking" if ast.unparse(base) == "Core" else ast.unparse(base))
            for base in node.bases
        ]
        return node

    def visit_ImportFrom(self, node: ast.ImportFrom) -> ast.ImportFrom:
        if [alias.name for alias in node.names if alias.name == "Core"]:
            return ast.ImportFrom("vbus.client.blocking", [ast.alias("Blocking")], 0)
        return node

    def visit_AsyncFunctionDef(self, node: ast.AsyncFunctionDef) -> ast.FunctionDef:
        # __aenter__ and __aexit__ are __enter__ and __exit__ of a blocking class.
        name = node.name.replace("__a", "__") if node.name.endswith("__") else node.name
        plain = ast.FunctionDef(name, node.args, node.body, node.decorator_list, node.returns)
        return self.visit_FunctionDef(ast.copy_location(plain, node))

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.FunctionDef:
        about = node.body[:1] if ast.get_docstring(node) else []
        # Editors show docstrings of stubs.
        node.body = about or [ast.Expr(ast.Constant(...))]
        return node
