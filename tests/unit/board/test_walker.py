"""One walk: what a section says of itself decides reader, messages, references and schema."""

import tomllib
from typing import Annotated

import pytest

from vbus import plugins
from vbus.boardfile.key import NAME, Below, Names, Section, Wires, below, row, rows
from vbus.boardfile.schema import schema
from vbus.boardfile.sections import BoardFile
from vbus.boardfile.source import BoardFileError, Source
from vbus.boardfile.walker import Walker
from vbus.core.options import Option
from vbus.core.values.units import DIMENSIONS


class Wheel(Section, frozen=True, kw_only=True):
    """``[wheels.NAME]``."""

    name: str
    turns: Annotated[int, row("how often it turns", low=1, high=9)]
    drives: Annotated[Names, row("wheels it drives", ref="wheels|none")] = ()
    wires: Wires = {}


class Bell(Section, frozen=True, kw_only=True):
    """``[[bells]]``."""

    wheel: Annotated[str, row("the wheel that rings it", ref="wheels")]
    note: Annotated[str, row("what it is called", NAME)] = ""
    loud: Annotated[bool, row("it can be heard afar", needs="note")] = False


class Clock(Section, frozen=True, kw_only=True):
    """A whole file."""

    wheels: tuple[Wheel, ...] = ()
    bells: tuple[Bell, ...] = ()
    words: dict[str, Annotated[str, row("", choices=("on", "off"))]] = {}


def read(text: str) -> Clock:
    source = Source("c.toml", text)
    walker = Walker(source, tomllib.loads(text))
    found = walker.section(Clock, (), tomllib.loads(text))
    walker.resolve()
    source.finish()
    assert found is not None
    return found


GOOD = """\
[wheels.big]
turns = 1
drives = ["small", "none", "none"]
wires = { a = "x", b = ["y", "z"] }
[wheels.small]
turns = 9
[[bells]]
wheel = "big"
note = "ding"
[words]
a.b = "on"
"c.d" = "off"
"""


def test_a_file_is_read_as_its_sections_say() -> None:
    clock = read(GOOD)
    assert [wheel.name for wheel in clock.wheels] == ["big", "small"]
    assert clock.wheels[0].drives == ("small", "none", "none")
    assert clock.wheels[0].wires == {"a": ("x",), "b": ("y", "z")}
    assert clock.bells == (Bell(wheel="big", note="ding"),)
    assert clock.words == {"a.b": "on", "c.d": "off"}
    assert read("") == Clock()


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("[wheels.big]", "[wheel.big]", 'c.toml:1: wheel: unknown section; did you mean "wheels"?'
         " allowed are wheels, bells, words"),
        ("turns = 1", "turn = 1", 'c.toml:2: wheels.big.turn: unknown key; did you mean "turns"?'
         " allowed are drives, turns, wires"),
        ("turns = 1\n", "", 'c.toml:1: wheels.big: key "turns" is missing: how often it turns;'
         " write a whole number without unit, from 1 to 9"),
        ("turns = 9", "turns = 10", "c.toml:6: wheels.small.turns: found 10; out of range: from 1"
         " to 9"),
        ('["small",', '["smal",', "c.toml:3: wheels.big.drives[1]: there is no [wheels.smal]; did"
         ' you mean "small"? this file has big, small'),
        ('["small", "none"', '["small", "small"', 'c.toml:3: wheels.big.drives[2]: "small" stands'
         " in the list twice"),
        ('["small", "none", "none"]', '"small"', 'c.toml:3: wheels.big.drives: found "small";'
         ' write a list of names, such as ["x"]'),
        ('["y", "z"]', '["y", 3]', 'c.toml:4: wheels.big.wires.b: found ["y", 3]; write a list of'
         ' names, such as ["x"]'),
        ('wheel = "big"', 'wheel = "bigg"', "c.toml:8: bells[1].wheel: there is no [wheels.bigg];"
         ' did you mean "big"? this file has big, small'),
        ('"ding"', '"a b"', 'c.toml:9: bells[1].note: found "a b"; a name begins with a letter and'
         " goes on with letters, digits, - and _"),
        ('"on"', '"onn"', 'c.toml:11: words.a.b: found "onn"; did you mean "on"? allowed are "on",'
         ' "off"'),
        ("[[bells]]", "[bells]", 'c.toml:7: bells: found {wheel = "big", note = "ding"}; this is a'
         " list of tables: [[bells]]"),
        ('note = "ding"', "loud = true", 'c.toml:9: bells[1].loud: "loud" needs "note" (what it is'
         " called)"),
        ("[wheels.small]", '[wheels."small.one"]', 'c.toml:5: wheels."small.one": a name begins'
         " with a letter and goes on with letters, digits, - and _"),
    ],
)  # fmt: skip
def test_a_mistake_has_its_line_and_the_nearest_name(before: str, after: str, message: str) -> None:
    assert before in GOOD
    with pytest.raises(BoardFileError) as caught:
        read(GOOD.replace(before, after))
    assert message in str(caught.value).split("\n")


def test_a_name_that_cannot_be_read_is_no_unknown_name() -> None:
    with pytest.raises(BoardFileError) as caught:
        read(GOOD.replace("turns = 9", "turns = 0"))
    assert [problem.key for problem in caught.value.problems] == ["wheels.small.turns"]


def keys(section: type[Section], path: str = "") -> list[tuple[str, Option]]:
    """Return every key of a section and of those below, with its path."""
    found = [(f"{path}.{one.name}", one) for one in rows(section)]
    for inner in below(section):
        if isinstance(inner.of, type) and issubclass(inner.of, Section):
            found += keys(inner.of, f"{path}.{inner.name}")
    return found


def test_every_key_of_a_board_file_says_what_it_is_and_what_it_refers_to() -> None:
    everything = keys(BoardFile)
    assert len(everything) > 90
    sections = {one.name for one in below(BoardFile) if isinstance(one, Below) and one.named}
    groups = {plugins.CHIPS, plugins.PLANTS, plugins.PROTOCOLS, plugins.TRANSPORTS}
    known = {"count", "ratio", "rate", "flag", "choice", "text", "name", "names", *DIMENSIONS}
    for path, key in everything:
        assert key.title, path
        assert key.kind in known, path
        assert key.ref.partition("|")[0] in {"", *sections, *groups}, path
        if key.kind == "choice":
            assert key.default in ("", None, *key.choices), path


def test_the_schema_has_every_section_in_the_order_of_the_messages() -> None:
    assert list(schema()["properties"]) == [one.name for one in below(BoardFile)]
