"""Everything that reads what others wrote, as functions of bytes.

Each either takes its input or refuses it in one clear sentence; nothing else may be raised.
"""

import hashlib
import io
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from itertools import islice
from typing import Final

from tests.unit.fake_port import FakePort
from tests.unit.faults.bench import DC, LM, build
from vbus.board.board import Board
from vbus.board.check.checks import all_rules
from vbus.board.config import read_board_text
from vbus.board.snapshot import MAGIC as SNAPSHOT
from vbus.board.snapshot import read as read_snapshot
from vbus.circuit.stream import PacketReader
from vbus.core.errors import VbusError
from vbus.core.kernel import US
from vbus.events.watch import Watch
from vbus.faults.trigger import read_when
from vbus.network import envelope
from vbus.nodes.machine_snapshot import MAGIC as MACHINE_SNAPSHOT
from vbus.nodes.machine_snapshot import read as read_machine_snapshot
from vbus.nodes.messages import decode as decode_message
from vbus.nodes.node import Node
from vbus.nodes.plan import Plan
from vbus.nodes.scenario import read_scenario
from vbus.protocols.base import Protocol
from vbus.protocols.byte import ByteProtocol
from vbus.protocols.framed import FramedProtocol
from vbus.protocols.frames import frame
from vbus.protocols.info import decode_hello
from vbus.protocols.port import HostPort
from vbus.protocols.serial_line import BREAK, DTR, RTS, ModemPins, SerialLine
from vbus.protocols.terminal import TerminalProtocol
from vbus.protocols.text import TextProtocol
from vbus.record.format import MAGIC as JOURNAL
from vbus.record.format import Header, JournalReader, header_block
from vbus.record.view import play
from vbus.serve.nodes.ordering import read_request, take_order
from vbus.views.findings.suppress import read_suppressions
from vbus.views.silicon.capture import Capture
from vbus.views.silicon.capture_csv import read_csv
from vbus.views.silicon.capture_sr import read_sr
from vbus.views.silicon.capture_vcd import read_vcd
from vbus.views.wave.wave import Wave

LONGEST_SENTENCE: Final = 2000
MOST_SAMPLES: Final = 2000
"""Samples read of a capture: a file of a few bytes may hold a great many."""


class Unclear(AssertionError):
    """An input was refused, and not in words."""


@contextmanager
def _refusals() -> Iterator[None]:
    """Some refuse by a ValueError, and say so."""
    try:
        yield
    except ValueError as error:
        if type(error) not in (ValueError, envelope.EnvelopeError):
            raise
        raise VbusError(str(error)) from error


def _protocol(kind: Callable[[HostPort], Protocol], data: bytes) -> None:
    """Whatever is received, and however it is cut, the answers are the same."""
    answers = []
    for cuts in ((len(data),), (1,), (3, 7)):
        wire = kind(FakePort())
        place = turn = 0
        while place < len(data):
            size = cuts[turn % len(cuts)]
            wire.receive(data[place : place + size])
            place, turn = place + size, turn + 1
        answers.append(wire.take())
    if len(set(answers)) > 1:
        raise Unclear("the answer depends on how the bytes were cut")


def byte_protocol(data: bytes) -> None:
    _protocol(ByteProtocol, data)


def text_protocol(data: bytes) -> None:
    _protocol(TextProtocol, data)


def terminal_protocol(data: bytes) -> None:
    _protocol(TerminalProtocol, data)


def serial_line_protocol(data: bytes) -> None:
    """A byte protocol behind a line, with marks of modem lines among its bytes."""
    modem = ModemPins(((DTR, 0), (RTS, 1), (BREAK, 2)), (3,), 1000)
    _protocol(lambda port: SerialLine(port, ByteProtocol(port), 100, modem), data)


def framed_protocol(data: bytes) -> None:
    """Half of the inputs are in good frames, or no request would ever be reached."""
    if data[:1] >= b"\x80":
        pieces = data[1:].split(b"\xa5\xa5")
        data = b"".join(frame(number, piece[:255]) for number, piece in enumerate(pieces))
    _protocol(FramedProtocol, data)


def _text(data: bytes) -> str:
    return data.decode("utf-8", "replace")


def board_file(data: bytes) -> None:
    read_board_text(_text(data))


def scenario(data: bytes) -> None:
    read_scenario(_text(data), "s.txt", {"x": {"/RST", "HI"}, "y": {"/IN"}}, US)


def journal(data: bytes) -> None:
    """Inputs that begin with 1 are the blocks of a journal, whose checksums are made to fit."""
    if data[:1] == b"\x01":
        file = header_block(Header("b", "b.toml", "", "", 0, "lockstep", {"x": "lm628"}))
        for piece in data[1:].split(b"\xff\xff"):
            body = zlib.compress(piece, 1)
            file += len(body).to_bytes(4, "big") + zlib.crc32(body).to_bytes(4, "big") + body
    elif data[:1] == b"\x02":
        body = zlib.compress(data[1:], 1)
        file = JOURNAL + len(body).to_bytes(4, "big") + zlib.crc32(body).to_bytes(4, "big") + body
    else:
        file = data
    reader = JournalReader(io.BytesIO(file))
    play(reader.header, reader, PacketReader())


def snapshot(data: bytes) -> None:
    """Inputs that begin with 1 have a checksum made to fit."""
    if data[:1] == b"\x01":
        data = SNAPSHOT + hashlib.sha256(data[1:]).digest() + data[1:]
    read_snapshot(data)


def machine_snapshot(data: bytes) -> None:
    """Inputs that begin with 1 have a checksum made to fit."""
    if data[:1] == b"\x01":
        data = MACHINE_SNAPSHOT + hashlib.sha256(data[1:]).digest() + data[1:]
    read_machine_snapshot(data)


def _capture(read: Callable[[io.BytesIO, str], Capture], data: bytes) -> None:
    for _ in islice(read(io.BytesIO(data), "capture").samples, MOST_SAMPLES):
        pass


def capture_csv(data: bytes) -> None:
    _capture(read_csv, data)


def capture_sr(data: bytes) -> None:
    _capture(read_sr, data)


def capture_vcd(data: bytes) -> None:
    _capture(read_vcd, data)


@cache
def _board() -> Board:
    return build(LM, DC)


def fault(data: bytes) -> None:
    """The lines are the name of a fault, its target, when it begins and until when it lasts."""
    lines = [*_text(data).split("\n"), "", "", "", ""]
    board = _board()
    with _refusals():
        read_when(lines[2])
        armed = board.faults.arm(lines[0], lines[1], lines[2] or None, lines[3] or None)
        board.faults.clear(armed.number)


def conditions(data: bytes) -> None:
    board = _board()
    watch = Watch(_text(data), board)
    watch.begin()
    watch.look()
    watch.end()


def wave_trigger(data: bytes) -> None:
    signals, _, trigger = _text(data).partition("\n")
    chosen = tuple(signals.split(",")) if signals else ()
    Wave(_board(), io.StringIO(), "full", chosen, trigger, 0, 0, US)


def suppressions(data: bytes) -> None:
    read_suppressions(_text(data), "s.toml", [rule.name for rule in all_rules()])


def hello(data: bytes) -> None:
    with _refusals():
        decode_hello(data)


def node_message(data: bytes) -> None:
    decode_message(data, "n", 3, 4)


def node_order(data: bytes) -> None:
    node = Node(Plan("b", ("n",), (0,), (), "", "realtime"), 0)
    node.begin(build(LM, DC))
    answer = take_order(node, read_request(data), 1000)
    if answer.error:
        raise VbusError(answer.error)


def numbered_message(data: bytes) -> None:
    with _refusals():
        envelope.unpack(data)


TARGETS: Final[dict[str, Callable[[bytes], None]]] = {
    target.__name__: target
    for target in (
        byte_protocol, text_protocol, terminal_protocol, serial_line_protocol, framed_protocol,
        board_file, scenario,
        journal, snapshot, machine_snapshot, capture_csv, capture_sr, capture_vcd, fault,
        conditions, wave_trigger,
        suppressions, hello, node_message, node_order, numbered_message,
    )
}  # fmt: skip


def tried(name: str, data: bytes) -> str:
    """Give an input to a target; return the sentence that refuses it, or "".

    Raises:
        Unclear: it is refused otherwise.
    """
    try:
        TARGETS[name](data)
    except VbusError as error:
        sentence = str(error)
        if not sentence or len(sentence) > LONGEST_SENTENCE + 20 * len(data):
            raise Unclear(f"refused with {len(sentence)} characters") from error
        return sentence
    return ""
