"""What a chip family is required to do, clause by clause, and the tests that prove it.

Data beside the chip, for those who explain it: nothing here is read before it is asked for, and no
chip needs it to work.

``clauses.toml`` has one table per clause, named by its id, with the keys of :class:`Clause`.
``proofs.toml``, which is generated, names the tests that carry the id as their mark.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Final

LIST: Final = "clauses.toml"
PROOFS: Final = "proofs.toml"

MANUAL: Final = "manual"
RULING: Final = "ruling"
SILICON: Final = "silicon"
KINDS: Final = (MANUAL, RULING, SILICON)

_TESTED: Final = "tested"
_OPEN: Final = "open"
_REQUIRED: Final = ("title", "section", "kind", "text", "state")
_KEYS: Final = (*_REQUIRED, "evidence", "reason")


@dataclass(frozen=True, slots=True)
class Clause:
    """One numbered requirement.

    Attributes:
        name: its id, such as ``"LM-BUS-7"``.
        title: what it is about.
        section: where the manual says it, or should.
        kind: :data:`MANUAL`, :data:`RULING` (the manual is silent or contradicts itself, and this
            was decided) or :data:`SILICON` (decided by what real parts are known to do).
        text: what is required, in Markdown.
        state: ``"tested"`` or ``"open"``.
        reason: why it is open.
        evidence: what real parts, or drivers that work with them, have shown of it. A clause of
            kind :data:`SILICON` has one; a ruling may have one that does not decide it. Agreement
            with a reference model is none: it is written from the same rulings.
    """

    name: str
    title: str
    section: str
    kind: str
    text: str
    state: str
    reason: str
    evidence: str = ""

    @property
    def tested(self) -> bool:
        """Whether tests must prove it."""
        return self.state == _TESTED


def read_clauses(text: str, where: str) -> dict[str, Clause]:
    """Return the clauses of a list, by id.

    Args:
        text: what the file says.
        where: its name, for messages.

    Raises:
        ValueError: a clause is incomplete, or has a key that means nothing.
    """
    clauses = {}
    for name, row in tomllib.loads(text).items():
        place = f"{where}: {name}"
        if not isinstance(row, dict):
            raise ValueError(f"{place} is no table")
        for key, value in row.items():
            if key not in _KEYS or not isinstance(value, str) or not value.strip():
                raise ValueError(f"{place}: {key} is not one of {', '.join(_KEYS)} with a text")
        if missing := [key for key in _REQUIRED if key not in row]:
            raise ValueError(f"{place} needs {' and '.join(missing)}")
        if row["state"] not in (_TESTED, _OPEN):
            raise ValueError(f'{place}: state is "{_TESTED}" or "{_OPEN}"')
        if row["kind"] not in KINDS:
            raise ValueError(f"{place}: kind is one of {', '.join(KINDS)}")
        if row["kind"] == SILICON and "evidence" not in row:
            raise ValueError(f"{place}: what real parts have decided needs evidence")
        # An open clause says why no test can prove it, and only an open one may.
        if (row["state"] == _OPEN) != ("reason" in row):
            raise ValueError(f"{place}: a reason belongs to an open clause, and only to one")
        clauses[name] = Clause(name, **{key: row.get(key, "").strip() for key in _KEYS})
    return clauses


def _text(package: str, name: str) -> str | None:
    """Return a file of the package, None if it has none of that name."""
    file = files(package) / name
    return file.read_text(encoding="utf-8") if file.is_file() else None


@cache
def clauses_of(package: str) -> Mapping[str, Clause]:
    """Return the clauses of the chip family in ``package``, by id; none if it has no list."""
    text = _text(package, LIST)
    return {} if text is None else read_clauses(text, f"{package}/{LIST}")


@cache
def proofs_of(package: str) -> Mapping[str, list[str]]:
    """Return the tests of each clause of the family in ``package``, as ``"file::test"``."""
    text = _text(package, PROOFS)
    return {} if text is None else tomllib.loads(text)
