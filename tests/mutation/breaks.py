"""Operators that break one behaviour at a time, beside those of cosmic-ray.

They are for the question of :mod:`tests.mutation.clauses`. In the sample of ``run`` there is only
``Forget``, with a share of its own, so that it does not take the places of others.
"""

from collections.abc import Iterator
from typing import Any, Final

import parso
from cosmic_ray.operators.operator import Operator
from parso.python.tree import Keyword, Number
from parso.tree import NodeOrLeaf

Span = tuple[tuple[int, int], tuple[int, int]]

LEAST: Final = 4
"""Numbers below are no masks or limits that lose a bit."""


class Forget(Operator):
    """A statement that changes something is not carried out."""

    def mutation_positions(self, node: NodeOrLeaf) -> Iterator[Span]:
        if node.type == "simple_stmt" and _changes(_only(node)):
            yield _only(node).start_pos, _only(node).end_pos

    def mutate(self, node: NodeOrLeaf, index: int) -> NodeOrLeaf:
        old = _only(node)
        new = Keyword("pass", old.start_pos, prefix=old.get_first_leaf().prefix)  # type: ignore[union-attr]
        new.parent = node
        node.children[0] = new  # type: ignore[union-attr]
        return node

    @classmethod
    def examples(cls) -> tuple[Any, ...]:
        return ()


class Narrow(Operator):
    """A mask or a number has one bit less."""

    def mutation_positions(self, node: NodeOrLeaf) -> Iterator[Span]:
        if node.type == "and_expr":
            last = node.children[-1]  # type: ignore[union-attr]
            yield last.start_pos, last.end_pos
        elif isinstance(node, Number) and _value(node) >= LEAST:
            yield node.start_pos, node.end_pos

    def mutate(self, node: NodeOrLeaf, index: int) -> NodeOrLeaf:
        if isinstance(node, Number):
            return Number(str(_value(node) >> 1), node.start_pos, node.prefix)
        last = node.children[-1]  # type: ignore[union-attr]
        text = last.get_code(include_prefix=False)
        node.children[-1] = _expression(f"(({text}) >> 1)")  # type: ignore[union-attr]
        return node

    @classmethod
    def examples(cls) -> tuple[Any, ...]:
        return ()


class FirstOnly(Operator):
    """What is done for each is done for the first."""

    def mutation_positions(self, node: NodeOrLeaf) -> Iterator[Span]:
        if node.type in ("for_stmt", "sync_comp_for"):
            over = node.children[3]  # type: ignore[union-attr]
            yield over.start_pos, over.end_pos

    def mutate(self, node: NodeOrLeaf, index: int) -> NodeOrLeaf:
        text = node.children[3].get_code(include_prefix=False)  # type: ignore[union-attr]
        node.children[3] = _expression(f"[*({text})][:1]")  # type: ignore[union-attr]
        return node

    @classmethod
    def examples(cls) -> tuple[Any, ...]:
        return ()


BREAKS: Final = {operator.__name__: operator for operator in (Forget, Narrow, FirstOnly)}


def _only(node: NodeOrLeaf) -> Any:
    return node.children[0]  # type: ignore[union-attr]


def _changes(node: Any) -> bool:
    """Whether a simple statement is an assignment, or a call for what the call does."""
    if node.type == "expr_stmt":
        kind = node.children[1]
        # A declaration gives a name, and whether its value matters is seen where it is used.
        return kind.type != "annassign" and "." in node.children[0].get_code()
    return node.type == "atom_expr" and node.children[-1].type == "trailer" and (
        node.children[-1].children[0].value == "("
    )  # fmt: skip


def _value(node: Number) -> int:
    try:
        return int(node.value, 0)
    except ValueError:
        return 0


def _expression(text: str) -> Any:
    part = parso.parse(f"{text}\n").children[0].children[0]
    part.get_first_leaf().prefix = " "
    return part
