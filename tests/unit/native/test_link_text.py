"""link_text: one text out of HELLO's description, however the chips are called."""

import subprocess
from pathlib import Path

import msgpack
import pytest

from tests.left_out import require
from vbus import native

PROGRAM = """
#include "link_text.h"
#include <stdio.h>
int main(int count, char **arguments)
{
    static unsigned char map[70000];
    static char text[LINK_TEXT_ROOM];
    size_t size = fread(map, 1, sizeof map, stdin);
    int length = link_text(map, size, arguments[1], text);

    printf("%d %s", length, text);
    return count != 2;
}
"""


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("link_text")
    (folder / "main.c").write_text(PROGRAM)
    sources = Path(native.include_dir())
    subprocess.run(
        [require("gcc"), "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic",
         "-fsanitize=address,undefined", f"-I{sources}", "-o", folder / "main",
         folder / "main.c", sources / "link_text.c"],
        check=True,
    )  # fmt: skip
    return folder / "main"


def found(program: Path, description: bytes, key: str) -> str:
    done = subprocess.run([program, key], input=description, capture_output=True, check=True)
    return done.stdout.decode()


DESCRIPTION = {
    "version": 1,
    "rate": 0.5,
    "chips": [
        {"name": "card", "part": "policy", "cycle": 1_000_000},
        {"name": "policy", "part": "x" * 40, "cycle": 70_000_000_000},
    ],
    "pins": ["card./RST"] * 20,
    "policy": "slaved",
    "card": "r340=0.1 " * 40,
    "wiring": "",
}


@pytest.mark.parametrize("key", ["policy", "card", "wiring"])
def test_a_chip_called_like_a_key_is_not_taken_for_it(program: Path, key: str) -> None:
    text = str(DESCRIPTION[key])

    assert found(program, msgpack.packb(DESCRIPTION), key) == f"{len(text)} {text}"


@pytest.mark.parametrize("key", ["chips", "rate", "name", "nothing"])
def test_what_is_no_text_of_the_map_itself_is_not_found(program: Path, key: str) -> None:
    assert found(program, msgpack.packb(DESCRIPTION), key) == "-1 "


def test_a_description_that_is_cut_anywhere_is_survived(program: Path) -> None:
    whole = msgpack.packb({"chips": [{"name": "a"}], "n": 2**40, "card": "r1=0.0"})

    for end in range(len(whole)):
        assert found(program, whole[:end], "card") == "-1 "


def test_a_text_too_long_for_its_room_is_refused(program: Path) -> None:
    assert found(program, msgpack.packb({"card": "x" * 16384}), "card") == "-1 "
    assert found(program, msgpack.packb({"card": "x" * 16383}), "card").startswith("16383 x")
