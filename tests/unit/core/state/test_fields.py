"""Declared state: what is saved, what is refused before anything is set, what is migrated."""

from typing import Any, ClassVar

import msgpack
import pytest

from tests.undeclared import undeclared
from vbus.core import state
from vbus.core.errors import SnapshotError
from vbus.core.state.fields import kind_of
from vbus.plant.dc_motor import DcMotor
from vbus.plant.ideal import IdealPlant

MOST = (1 << 63) - 1


class Inner:
    STATE: ClassVar[state.Names] = ("place", "level: float")

    def __init__(self) -> None:
        self.place = 1
        self.level = 0.5


class Everything:
    """One field of each kind."""

    STATE: ClassVar[state.Names] = (
        "word", "wide: int", "flag: bool", "real: float", "text: str", "octets: bytes[...]",
        "pair: bytes[2]", "rows: list[(i64, float, tuple[str, ...]), levels]",
        "file: bytearray", "line: bytearray[...]", "levels: list[i64]", "names: list[str, ...]",
        "course: tuple[i64, ...]", "noted: set[i64]", "queue: heap[(i64, str)]", "inner: part",
        "spare: part | None", "axes: parts",
    )  # fmt: skip
    DERIVED: ClassVar[state.Names] = ("calls",)

    def __init__(self) -> None:
        self.word = 3
        self.wide = 4
        self.flag = True
        self.real = 0.25
        self.text = "t"
        self.octets = b"o"
        self.pair = b"pq"
        self.rows = [(1, 0.5, ("a", "b")), (2, 1.5, ())]
        self.file = bytearray(b"abc")
        self.line = bytearray(b"1")
        self.levels = [1, 0]
        self.names = ["x"]
        self.course: tuple[int, ...] = (1, 2, 3)
        self.noted = {5, 2}
        self.queue = [(7, "c"), (2, "b")]
        self.inner = Inner()
        self.spare: Inner | None = None
        self.axes = [Inner(), Inner()]
        self.calls: list[str] = []

    def before_save(self) -> None:
        self.calls.append("before_save")

    def after_load(self) -> None:
        self.calls.append(f"after_load {self.inner.place}")


INNER = {"place": 1, "level": 0.5}
SAVED = {
    "word": 3, "wide": 4, "flag": True, "real": 0.25, "text": "t",
    "octets": b"o", "pair": b"pq", "rows": ((1, 0.5, ("a", "b")), (2, 1.5, ())),
    "file": b"abc", "line": b"1", "levels": (1, 0), "names": ("x",),
    "course": (1, 2, 3), "noted": (2, 5), "queue": ((2, "b"), (7, "c")), "inner": INNER,
    "spare": None, "axes": (INNER, INNER),
}  # fmt: skip


def test_a_part_is_saved_by_the_names_of_its_fields() -> None:
    part = Everything()
    assert state.save(part) == SAVED
    assert list(state.save(part)) == list(SAVED)
    assert part.calls == ["before_save", "before_save"]


def test_what_was_saved_is_loaded_through_a_file() -> None:
    part = Everything()
    part.word, part.wide, part.flag, part.real = -(1 << 63), -(1 << 70), False, -0.5
    part.text, part.octets, part.line, part.names = "other", b"", bytearray(), ["a", "b"]
    part.file[:] = b"xyz"
    part.pair, part.rows = b"xy", [(-1, 8.0, ()), (MOST, 0.0, ("c",))]
    part.levels, part.course, part.noted, part.queue = [0, 9], (), set(), [(1, "a")]
    part.inner.place, part.axes[1].level = 77, 8.0
    saved = state.save(part)
    assert saved["wide"] == str(-(1 << 70))
    twin = Everything()
    file, inner = twin.file, twin.inner
    packed = msgpack.packb(saved)
    state.load(twin, msgpack.unpackb(packed, use_list=False))
    assert twin.calls == ["after_load 77"]
    assert state.save(twin) == saved
    assert twin.file is file
    assert file == b"xyz"
    assert twin.inner is inner
    assert twin.rows == part.rows
    assert type(twin.levels) is list
    assert type(twin.course) is tuple
    assert type(twin.noted) is set
    assert twin.wide == -(1 << 70)
    state.load(twin, msgpack.unpackb(packed))
    assert state.save(twin) == saved


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("word", MOST + 1, "p.word: wants an integer of 64 bits, not 9223372036854775808"),
        ("word", True, "p.word: wants an integer of 64 bits, not True"),
        ("word", 1.0, "p.word: wants an integer of 64 bits, not 1.0"),
        ("wide", "12x", "p.wide: wants an integer, not '12x'"),
        ("wide", False, "p.wide: wants an integer, not False"),
        ("flag", 1, "p.flag: wants true or false, not 1"),
        ("real", "1", "p.real: wants a number, not '1'"),
        ("real", True, "p.real: wants a number, not True"),
        ("text", b"t", "p.text: wants a text, not b't'"),
        ("octets", "o", "p.octets: wants bytes, not 'o'"),
        ("pair", b"p", "p.pair: wants 2 bytes, not 1"),
        ("rows", (), "p.rows: wants 2 values, not 0"),
        ("rows", ((MOST + 1, 0.5, ()), (1, 0.5, ())), "p.rows: wants an integer of 64 bits, not 9"),
        ("rows", ((1, 0.5, ()), (True, 0.5, ())), "p.rows: wants an integer of 64 bits, not True"),
        ("rows", ((1, 0.5, ()), (1, 0.5)), "p.rows: wants 3 values in a row, not (1, 0.5)"),
        ("rows", ((1, 0.5, ()), (1, 0.5, (1,))), "p.rows: wants a text, not 1"),
        ("file", b"abcd", "p.file: wants 3 bytes, not 4"),
        ("line", 7, "p.line: wants bytes, not 7"),
        ("levels", (1, 0, 0), "p.levels: wants 2 values, not 3"),
        ("levels", (1, None), "p.levels: wants an integer of 64 bits, not None"),
        ("levels", (1, True), "p.levels: wants an integer of 64 bits, not True"),
        ("levels", (1, -MOST - 2), "p.levels: wants an integer of 64 bits, not -92"),
        ("names", ("a", 1), "p.names: wants a text, not 1"),
        ("course", 5, "p.course: wants several values, not 5"),
        ("noted", ("2",), "p.noted: wants an integer of 64 bits, not '2'"),
        ("queue", ((2,),), "p.queue: wants 2 values in a row, not (2,)"),
        ("queue", ((2, 3),), "p.queue: wants a text, not 3"),
        ("inner", (1, 2), "p.inner: wants the fields of Inner by name, not (1, 2)"),
        ("inner", {**INNER, "level": None}, "p.inner.level: wants a number, not None"),
        ("inner", {"place": 1}, "p.inner.level: is missing"),
        ("inner", {**INNER, "more": 1}, "p.inner.more: is no field of Inner"),
        ("inner", {**INNER, "STATE_VERSION": 2},
         "p.inner: version 2 of Inner: this vbus knows 1 to 1"),
        ("spare", INNER, "p.spare: there is nothing here to load it into"),
        ("axes", (INNER,), "p.axes: wants 2 parts"),
        ("axes", (INNER, {**INNER, "place": "here"}),
         "p.axes.1.place: wants an integer of 64 bits, not 'here'"),
    ],
)  # fmt: skip
def test_nothing_is_set_before_everything_is_checked(name: str, value: Any, text: str) -> None:
    part = Everything()
    part.inner.place = 1
    bad = {**SAVED, "word": 99, "inner": {**INNER, "place": 99}, name: value}
    with pytest.raises(SnapshotError) as caught:
        state.load(part, bad, "p")
    assert str(caught.value).startswith(text)
    part.calls = []
    assert state.save(part) == SAVED


def test_a_field_that_is_missing_or_unknown_is_named() -> None:
    part = Inner()
    with pytest.raises(SnapshotError, match=r"^p.place: is missing$"):
        state.load(part, {"level": 0.5}, "p")
    for version in (None, 0, True, 1.0):
        with pytest.raises(SnapshotError, match=rf"^p: version {version} of Inner"):
            state.load(part, {**INNER, "STATE_VERSION": version}, "p")


class Later:
    STATE: ClassVar[state.Names] = ("speed", "home: bool")
    STATE_VERSION: ClassVar[int] = 3

    def __init__(self) -> None:
        self.speed = 0
        self.home = False

    def migrate(self, version: int, saved: state.Saved) -> state.Saved:
        """Version 1 had tenths, version 2 no home."""
        speed = saved["speed"] // 10 if version == 1 else saved["speed"]
        return {"speed": speed, "home": False}


@pytest.mark.parametrize(("version", "speed", "expected"), [(1, 70, 7), (2, 70, 70)])
def test_a_state_of_an_earlier_version_is_migrated(version: int, speed: int, expected: int) -> None:
    part = Later()
    part.home = True
    state.load(part, {"STATE_VERSION": version, "speed": speed})
    assert (part.speed, part.home) == (expected, False)
    assert state.save(part) == {"speed": expected, "home": False, "STATE_VERSION": 3}


class Nothing(DcMotor.__mro__[-2]):  # type: ignore[misc]
    """A plant that says nothing about its state."""


def test_a_plant_that_declares_nothing_is_refused() -> None:
    with pytest.raises(NotImplementedError, match="Nothing declares no STATE: name the fields"):
        state.save(Nothing())


def test_a_compiled_class_takes_what_it_takes_interpreted() -> None:
    plant = IdealPlant()
    plant.pulses(30)
    saved = state.save(plant)
    for name, value in (("_steps", 1.5), ("_three", 1), ("count", MOST + 1), ("points", (0.5,))):
        twin = IdealPlant()
        before = state.save(twin)
        if name == "points":
            state.load(twin, {**saved, "base": 299, "_pieces": 0, "points": (1,)})
            assert state.save(twin)["points"] == (1.0,)
            continue
        with pytest.raises(SnapshotError, match=rf"^plant.{name}: wants"):
            state.load(twin, {**saved, name: value}, "plant")
        assert state.save(twin) == before


def test_an_attribute_that_is_declared_nowhere_is_found() -> None:
    part = Everything()
    assert undeclared(part) == set()
    part.more = 1  # type: ignore[attr-defined]
    assert undeclared(part) == {"more"}
    assert undeclared(DcMotor()) == set()


@pytest.mark.parametrize("text", ["i32", "list", "list[", "(i64", "list[i32]", "deque[i64]", ""])
def test_a_kind_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="is no kind of field"):
        kind_of(text)


class Outer:
    STATE: ClassVar[state.Names] = ("level = inner.level: float", "first = inner: part")

    def __init__(self) -> None:
        self.inner = Inner()


def test_a_field_that_another_object_has_is_saved_under_its_own_name() -> None:
    part = Outer()
    part.inner.level = 2.5
    saved = state.save(part)
    assert saved == {"level": 2.5, "first": {"place": 1, "level": 2.5}}
    other = Outer()
    state.load(other, saved)
    assert (other.inner.place, other.inner.level) == (1, 2.5)
    assert undeclared(other) == set()
    with pytest.raises(SnapshotError, match=r"state\.level: "):
        state.load(other, {**saved, "level": "x"})
