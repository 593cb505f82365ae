"""Line numbers of keys, whatever way of writing TOML has for them."""

import tomllib
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vbus.boardfile.lines import Path, TomlLines

TEXT = '''# line 1
[board]
name = "a # not a comment" # x
"q.k" . b = 1979-05-27T07:32:00Z
[chips.x]  # line 5
part = """
mult " ] } \\""" = 3
"quoted"""""
arr = [ 1, # c ]
  [2, {a = 1, b."c d" = [
    5]}],
]
[[hosts]]
transport = 'lit#\\'
raw = \'\'\'
it's ''\'\'\'
[hosts.sub]
k = {a=1,b={c=2}}
[[hosts]]
z=1
[[hosts.deep]]
y=inf
[[hosts.deep]]
y=2'''


@pytest.mark.parametrize(
    ("path", "line"),
    [
        (("board",), 2),
        (("board", "name"), 3),
        (("board", "q.k", "b"), 4),
        (("chips", "x"), 5),
        (("chips", "x", "part"), 6),
        (("chips", "x", "arr"), 9),
        (("chips", "x", "arr", 0), 9),
        (("chips", "x", "arr", 1, 0), 10),
        (("chips", "x", "arr", 1, 1, "b", "c d"), 10),
        (("chips", "x", "arr", 1, 1, "b", "c d", 0), 11),
        (("hosts", 0), 13),
        (("hosts", 0, "transport"), 14),
        (("hosts", 0, "raw"), 15),
        (("hosts", 0, "sub", "k", "b", "c"), 18),
        (("hosts", 1), 19),
        (("hosts", 1, "z"), 20),
        (("hosts", 1, "deep", 0, "y"), 22),
        (("hosts", 1, "deep", 1, "y"), 24),
    ],
)
def test_every_key_has_the_line_it_stands_on(path: Path, line: int) -> None:
    tomllib.loads(TEXT)
    assert TomlLines(TEXT).line(path) == line


def test_an_absent_key_has_the_line_of_its_table() -> None:
    assert TomlLines(TEXT).line(("chips", "x", "clock")) == 5
    assert TomlLines(TEXT).line(("nowhere", "at", "all")) == 1


def test_line_ends_of_other_systems_count_once() -> None:
    assert TomlLines("a = 1\r\nb = 2\r\n[c]\r\nd = 3\r\n").line(("c", "d")) == 4


def test_a_text_may_end_with_the_header_of_a_list() -> None:
    assert TomlLines("a = 1\n[[b]]").line(("b", 0)) == 2


def paths_of(value: Any, path: Path = ()) -> list[Path]:
    found = [path]
    if isinstance(value, dict):
        for key, item in value.items():
            found += paths_of(item, (*path, key))
    elif isinstance(value, list):
        for place, item in enumerate(value):
            found += paths_of(item, (*path, place))
    return found


def written(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return '"' + "".join(f"\\U{ord(char):08x}" for char in value) + '"'
    if isinstance(value, list):
        return "[ # ]\n" + ", # ,\n".join(written(item) for item in value) + "\n]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{written(k)}={written(v)}" for k, v in value.items()) + "}"
    return str(value)


KEYS = st.text(st.characters(exclude_categories=["Cs"]), max_size=4)
VALUES = st.recursive(
    st.integers(-9, 9) | st.booleans() | KEYS | st.floats(allow_nan=False, allow_infinity=False),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=3),
    max_leaves=8,
)


@given(st.dictionaries(KEYS, VALUES, max_size=4), st.integers(0, 3))
def test_every_key_of_any_document_is_found_on_its_line(data: dict[str, Any], gap: int) -> None:
    text = ""
    starts = {}
    for key, value in data.items():
        text += "\n" * gap
        starts[key] = text.count("\n") + 1
        text += f"{written(key)} = {written(value)}\n"
    assert tomllib.loads(text) == data
    index = TomlLines(text)
    for path in paths_of(data):
        if path:
            assert path in index._lines
            assert index.line(path) >= starts[path[0]]
    for key, line in starts.items():
        assert index.line((key,)) == line
