"""Types of what the client makes at its import: ``.pyi`` files, for editors and type checkers."""

import inspect
from collections.abc import Iterator
from types import FunctionType

from vbus.chips.family import Family
from vbus.cli.generate.layout import docstring, folder_of, formatted


def calls(family: Family) -> str:
    """Return the stub of what ``calls_of`` makes of a family's tables."""
    cls = calls_class(family)
    assert cls is not None
    base = cls.__bases__[0].__name__
    lines = [f'"""The calls of the {family.title}, for asyncio."""']
    lines += [f"from {family.home}.host import {base}", "", f"class {cls.__name__}({base}):"]
    lines += docstring(*_paragraphs(cls), indent=4)
    lines += [line for call in vars(cls).values() if inspect.isfunction(call)
              for line in _call(call)]  # fmt: skip
    head = "# Made from the chip's tables by vbus.cli.generate; change that.\n"
    return formatted(head + "\n".join(lines), str(folder_of(family) / "calls.pyi"))


def calls_class(family: Family) -> type | None:
    """Return what ``calls_of`` has made of a family's tables for its client; None: nothing."""
    host = family.object("host")
    made = [cls for cls in host.__mro__ if cls.__name__.endswith("Calls")] if host else []
    return made[0] if made else None


def _call(call: FunctionType) -> Iterator[str]:
    yield ""
    yield f"    async def {call.__name__}{inspect.signature(call, eval_str=True)}:"
    yield from docstring(*_paragraphs(call))


def _paragraphs(what: object) -> tuple[str, list[str]]:
    summary, *rest = (inspect.getdoc(what) or "").split("\n\n")
    return summary, rest
