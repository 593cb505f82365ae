"""What is made for one chip family, and from what; the types of its calls (``calls.pyi``)."""

import inspect
from collections.abc import Iterator
from functools import partial
from types import FunctionType
from typing import Final

from vbus.chips.clauses import clauses_of
from vbus.chips.family import Family
from vbus.cli.generate import chip_pages, registers, sigrok
from vbus.cli.generate.layout import ROOT, Target, docstring, folder_of, formatted

_GENERATED: Final = '"""Made from the tables of the chip by vbus.cli.generate."""\n'


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
    # The class with the calls stands among the bases of the client, under a name of this form.
    made = [cls for cls in host.__mro__ if cls.__name__.endswith("Calls")] if host else []
    return made[0] if made else None


def _call(call: FunctionType) -> Iterator[str]:
    yield ""
    yield f"    async def {call.__name__}{inspect.signature(call, eval_str=True)}:"
    yield from docstring(*_paragraphs(call))


def _paragraphs(what: object) -> tuple[str, list[str]]:
    summary, *rest = (inspect.getdoc(what) or "").split("\n\n")
    return summary, rest


def client_targets(family: Family) -> list[Target]:
    """Return what is made of a chip family's tables, in its folder: numbers, and types of calls.

    Numbers are bits, and registers, if the rows say when each of them counts.
    """
    folder = folder_of(family)
    place = f"{folder.relative_to(ROOT) if folder.is_relative_to(ROOT) else folder}"
    made = f"{place}/generated"
    found: list[Target] = []
    if calls_class(family) is not None:
        found.append((f"{place}/calls.pyi", partial(calls, family)))
    # A row that does not say when it counts gives no number: such a chip keeps plain bytes.
    counted = any(row.counts for row in family.registers)
    if counted or family.bits:
        found.append((f"{made}/__init__.py", lambda: _GENERATED))
        found.append((f"{made}/bits.py", partial(registers.bits, family)))
    if counted:
        found.append((f"{made}/registers.py", partial(registers.registers, family)))
    return found


def family_targets(family: Family) -> list[Target]:
    """Return all that is made for one chip family, in the folder it is installed in.

    That is what its client needs, its pages, and its decoder for sigrok.
    """
    made = folder_of(family) / "generated"
    pages = [(f"{made}/{family.name}.md", partial(chip_pages.page, family))]
    if clauses_of(family.home):
        path = f"{made}/{family.name}-clauses.md"
        pages.append((path, partial(chip_pages.clause_page, family)))
    return [*client_targets(family), *pages, *sigrok.decoder_targets(family, f"{made}/sigrok")]
