"""The C client against a board that is played byte by byte: every form HELLO may have."""

import socket
import struct
import subprocess
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.left_out import require
from tests.unit.native.conftest import compile_c
from tests.waiting import PATIENCE

HERE = Path(__file__).parent
BUILDS = {
    "c": ["gcc", "-std=c99"],
    "c++": ["g++", "-x", "c++", "-std=c++11"],
    "32 bit": ["gcc", "-m32", "-std=c99"],
}


@pytest.fixture(scope="module", params=BUILDS)
def host(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("stream")
    command = BUILDS[request.param]
    (folder / "probe.c").write_text("#include <stdint.h>\nint main(void) { return 0; }\n")
    probe = [require(command[0]), *command[1:], "-o", str(folder / "probe"), f"{folder}/probe.c"]
    if subprocess.run(probe, capture_output=True, check=False).returncode:
        pytest.skip(f"needs {' '.join(command)}")
    compile_c(command, HERE / "exercise.c", folder / "exercise")
    return folder / "exercise"


Answer = Callable[[socket.socket], None]


def play(host: Path, calls: str | list[str], answer: Answer) -> list[str]:
    """Let the host make its calls while ``answer`` plays the board."""
    words = calls.split() if isinstance(calls, str) else calls
    ours, theirs = socket.socketpair()
    with ours, theirs:
        ours.settimeout(PATIENCE)
        process = subprocess.Popen(
            [str(host), f"fd:{theirs.fileno()}", *words],
            pass_fds=[theirs.fileno()], stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        theirs.close()
        failures: list[BaseException] = []

        def serve() -> None:
            try:
                answer(ours)
            except BaseException as error:
                failures.append(error)
            finally:
                ours.close()

        board = threading.Thread(target=serve)
        board.start()
        said, _ = process.communicate(timeout=PATIENCE)
        board.join()
    assert failures == []
    return said.splitlines()


def expect(link: socket.socket, wanted: str) -> None:
    data = bytes.fromhex(wanted)
    got = b""
    while len(got) < len(data):
        more = link.recv(len(data) - len(got))
        assert more, f"the host has gone after {got.hex()}"
        got += more
    assert got.hex() == data.hex()


# -- msgpack, with lengths of any width ------------------------------------------------------------

WIDTHS = {8: "B", 16: "H", 32: "I"}


def text(value: str, width: int) -> bytes:
    return (
        bytes(({8: 0xD9, 16: 0xDA, 32: 0xDB}[width],))
        + struct.pack(">" + WIDTHS[width], len(value))
        + value.encode()
    )


def items(first: int, values: list[bytes], width: int) -> bytes:
    """Return a list (first DC) or a map (DE); their lengths have 16 or 32 bits."""
    width = max(width, 16)
    head = bytes((first + (width == 32),)) + struct.pack(
        ">" + WIDTHS[width], len(values) if first == 0xDC else len(values) // 2
    )
    return head + b"".join(values)


def integer(value: int, width: int) -> bytes:
    return bytes(({8: 0xCC, 16: 0xCD, 32: 0xCE, 64: 0xCF}[width],)) + value.to_bytes(
        width // 8, "big"
    )


def unknown(width: int) -> list[bytes]:
    """Return values a later version might add: of every kind."""
    blob = bytes(({8: 0xC4, 16: 0xC5, 32: 0xC6}[width],))
    blob += struct.pack(">" + WIDTHS[width], 200) + b"\xdb" * 200
    kinds = [
        b"\xc0", b"\xc3", b"\x7f", b"\xe0", b"\xca" + bytes(4), b"\xcb" + bytes(8), b"\xd0\x80",
        b"\xd1" + bytes(2), b"\xd2" + bytes(4), b"\xd3" + bytes(8), integer(1, 64), blob,
        items(0xDC, [text("pins", width), b"\x92\xc0\x81\xa1a\x90"], width),
        items(0xDE, [text("pins", width), items(0xDC, [], width)], width),
    ]  # fmt: skip
    return [part for n, kind in enumerate(kinds) for part in (text(f"later{n}", width), kind)]


def description(width: int, cycle: bytes = b"\x01", extra: int = 0) -> bytes:
    names = [text(name, width) for name in ("x./RST", "x./IN", "y./RST")]
    chip = items(0xDE, [text("name", width), text("x", width), *unknown(width),
                        text("cycle_ps", width), cycle], width)  # fmt: skip
    more = [part for n in range(extra) for part in (text(f"more{n}", width), b"\xc0")]
    return items(
        0xDE,
        [*unknown(width), *more, text("chips", width), items(0xDC, [chip], width),
         text("features", width), items(0xDC, [text("polled_at", width)], width),
         text("pins", width), items(0xDC, names, width)],
        width,
    )  # fmt: skip


def hello(link: socket.socket, what: bytes, chunk: int = 1 << 16) -> None:
    expect(link, "01 01")
    data = b"V" + len(what).to_bytes(2, "big") + what
    for start in range(0, len(data), chunk):
        link.sendall(data[start : start + chunk])


@pytest.mark.parametrize("width", [8, 16, 32])
@pytest.mark.parametrize("chunk", [1, 7, 1 << 16])
def test_names_are_found_whatever_the_width_of_lengths(host: Path, width: int, chunk: int) -> None:
    def answer(link: socket.socket) -> None:
        for _ in range(3):
            hello(link, description(width), chunk)
        expect(link, "02 07")
        link.sendall(b"E\x07")

    said = play(host, "number pins /IN number pins y./RST number pins /RST echo 7", answer)
    assert said == [
        "number 1", "number 2",
        "number: no such name, or several chips have it", "echo 7",
    ]  # fmt: skip


def test_names_are_found_in_a_map_of_thousands(host: Path) -> None:
    def answer(link: socket.socket) -> None:
        hello(link, description(16, extra=4000))

    assert play(host, "number pins /IN", answer) == ["number 1"]


@pytest.mark.parametrize(
    "cycle", [b"\x32", integer(50, 8), integer(50, 16), integer(50, 32), integer(50, 64)]
)
def test_the_cycle_time_of_leases_is_a_number_of_any_width(host: Path, cycle: bytes) -> None:
    def answer(link: socket.socket) -> None:
        hello(link, description(16, cycle))
        expect(link, "61 01 10")
        link.sendall(b"L\x85" + struct.pack(">IQQ", 0, 100, 201))  # polls at 150 and 200
        expect(link, "54 00 0002 10")
        link.sendall(b"D\x84")

    assert play(host, "leases 1 read 0 read 0 read 0 read 0", answer) == [
        "leases 0", "read 85", "read 85", "read 85", "read 84",
    ]  # fmt: skip


def test_stamped_polls_travel_together_and_a_stamp_that_is_left_over_follows(host: Path) -> None:
    us = 10**6
    polls = [200, 300, 300 + 4294, 300 + 4294 + 4295]  # a step has 32 bits: 4294.9 us
    last = polls[-1] + 9

    def at(instant: int) -> str:
        return f"{instant * us:016x}"

    def answer(link: socket.socket) -> None:
        hello(link, description(16, b"\x32"))
        expect(link, f"61 01 51 {at(100)} 10")
        link.sendall(b"L\x85" + struct.pack(">IQQ", 0, 100 * us, 1 << 50))
        expect(link, f"55 00 {at(polls[0])} 08 {100 * us:08x} {4294 * us:08x}")
        expect(link, f"55 00 {at(polls[3])} 00 51 {at(last)} 20 01 10")
        link.sendall(b"D\x84")

    reads = " ".join(f"at {when:x} read 0" for when in [100, *polls])
    said = play(host, f"buffer leases 1 {reads} at {last:x} write 0 1 read 0", answer)
    assert [line for line in said if line.startswith("read")] == ["read 85"] * 5 + ["read 84"]


@pytest.mark.parametrize("width", [8, 16, 32])
def test_a_description_that_lies_about_its_lengths_ends_the_session(host: Path, width: int) -> None:
    whole = description(width)

    def answer(link: socket.socket) -> None:
        hello(link, whole[:-20])  # complete as a reply, cut as msgpack

    no = "what came is no reply of the byte protocol; is it this link's protocol?"
    assert play(host, "number pins nobody read 0", answer) == [f"number: {no}", f"read: {no}"]


def test_signals_that_interrupt_every_call_lose_nothing(host: Path) -> None:
    data = bytes(range(255))

    def answer(link: socket.socket) -> None:
        for _ in range(3):
            expect(link, "32 01 ff")
            reply = b"B\xff" + data
            for start in range(0, len(reply), 50):
                link.sendall(reply[start : start + 50])
                time.sleep(0.005)  # several signals: the client waits for the rest meanwhile

    calls = "signals reads 1 ff reads 1 ff reads 1 ff interrupted"
    reads = "reads 0 " + " ".join(f"{value:02x}" for value in data)
    assert play(host, calls, answer) == ["signals 0", reads, reads, reads, "interrupted 1"]


def test_the_greatest_arguments_are_sent(host: Path) -> None:
    def answer(link: socket.socket) -> None:
        expect(link, "44 ff 01 45 ff")
        link.sendall(b"D\x01")
        expect(link, "31 ff ff 30 ff")
        link.sendall(b"D\xff")
        expect(link, "03 ffff 40 ffff ffff 41 ff 02 ff")
        link.sendall(b"E\xff")

    calls = "pin ff 1 getpin ff write ff ff read ff select ffff lines ffff ffff drive ff echo ff"
    assert play(host, calls, answer) == [
        "pin 0", "getpin 1", "write 0", "read ff", "select 0", "lines 0", "drive 0", "echo ff",
    ]  # fmt: skip


def test_what_a_caller_does_not_want_need_not_have_a_place(host: Path) -> None:
    def answer(link: socket.socket) -> None:
        expect(link, f"34 {10**6:016x}")
        link.sendall(b"R\x01" + struct.pack(">Q", 7))
        expect(link, "43")
        link.sendall(b"P\x05" + struct.pack(">I", 9))
        for _ in range(2):
            expect(link, "53")
            link.sendall(b"S" + struct.pack(">IQ", 0xA, 11))
        expect(link, f"56 {10**6:016x}")
        link.sendall(b"W" + struct.pack(">IQ", 12, 13))

    said = play(host, "nulls", answer)
    assert said == ["wait 1 sample 5 sync 0 sync 0 pass 0 a until 11"]


@pytest.mark.parametrize("reply", [b"B\x02ab", b"B\x04abcd", b"B\x00"])
def test_a_reply_of_another_length_than_asked_for_ends_the_session(
    host: Path, reply: bytes
) -> None:
    def answer(link: socket.socket) -> None:
        expect(link, "32 00 03")
        link.sendall(reply)

    no = "what came is no reply of the byte protocol; is it this link's protocol?"
    assert play(host, "reads 0 3 read 0", answer) == [f"reads: {no}", f"read: {no}"]


def test_what_the_system_takes_in_small_pieces_arrives_whole(tmp_path: Path) -> None:
    compile_c(["gcc", "-std=c99"], HERE / "exercise.c", tmp_path / "host", HERE / "short.c")
    words = b"the quick brown fox".hex()

    def answer(link: socket.socket) -> None:
        expect(link, f"33 01 13 {words} 20 01 10")
        link.sendall(b"D\x84")

    calls = ["buffer", "writes", "1", "the quick brown fox", "write", "0", "1", "read", "0"]
    assert play(tmp_path / "host", calls, answer) == ["buffer 0", "writes 0", "write 0", "read 84"]
