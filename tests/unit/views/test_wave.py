"""Waveforms: two profiles, triggers, what came before them, and files that take no more."""

import io

import pytest
from vcd.reader import TokenKind, tokenize

from tests.unit.views.conftest import LM629, lm629_command, lm629_move
from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.board.host_bus import HostBus
from vbus.chips.lm628.packets import Lm628Decoder
from vbus.core.errors import VbusError
from vbus.core.kernel import MS, US
from vbus.core.signals import Violation
from vbus.views.wave.signals import Signal, bit_names, plain
from vbus.views.wave.vcd_file import VcdFile
from vbus.views.wave.wave import DONE, Wave

Changes = dict[str, list[tuple[int, object]]]


def read(text: str) -> tuple[dict[str, str], Changes]:
    """Return kinds of variables, and changes with instants in ps, by name."""
    names: dict[str, str] = {}
    kinds: dict[str, str] = {}
    changes: Changes = {}
    now = 0
    scope = ""
    for token in tokenize(io.BytesIO(text.encode())):
        if token.kind is TokenKind.SCOPE:
            scope = token.scope.ident
        elif token.kind is TokenKind.VAR:
            name = f"{scope}.{token.var.reference}"
            names[token.var.id_code] = name
            kinds[name] = token.var.type_.value
            changes[name] = []
        elif token.kind is TokenKind.CHANGE_TIME:
            now = token.time_change * 100
        elif token.kind in (TokenKind.CHANGE_SCALAR, TokenKind.CHANGE_VECTOR,
                            TokenKind.CHANGE_REAL, TokenKind.CHANGE_STRING):  # fmt: skip
            change = token.data
            value = change.value
            if value in ("0", "1"):
                value = int(value)
            changes[names[change.id_code]].append((now, value))
    return kinds, changes


def record(host: object = lm629_move, text: str = LM629, **options: object) -> str:
    board = load_board_text(text)
    file = io.StringIO()
    wave = Wave(board, file, **options)  # type: ignore[arg-type]
    wave.start()
    host(board.open_port("h"))  # type: ignore[operator]
    wave.stop()
    assert wave.error == ""
    return file.getvalue()


def test_the_time_scale_is_100_ps_and_instants_are_chip_time() -> None:
    text = record(lambda port: port.write(0, 0x02))
    assert "$timescale 100 ps $end" in text
    _, changes = read(text)
    # A whole cycle: /WR is low for 100 ns and rises at the latching edge, 1 us.
    assert [c for c in changes["x./WR"] if c[0]] == [(900_000, 0), (1_000_000, 1)]


def test_the_full_profile_has_vectors_values_packets_and_violations() -> None:
    kinds, changes = read(record())
    assert kinds["x.D0-D7"] == "wire"
    assert kinds["x.real"] == kinds["x.error"] == "real"
    assert kinds["x.packet"] == kinds["x.violation"] == "string"
    assert (820_000, 0x84) in changes["x.D0-D7"]
    packets = [str(value).replace("\\x20", " ") for _, value in changes["x.packet"]]
    assert "LFIL kp=300 kd=2000 ds=1 samples" in packets
    assert [v for _, v in changes["x.violation"] if v] == ["lm628.busy-write"]
    positions = [value for _, value in changes["x.real"]]
    assert positions == sorted(positions)  # type: ignore[type-var]
    assert positions[-1] > 50  # type: ignore[operator]


def test_the_sigrok_profile_has_single_bits_with_plain_names() -> None:
    kinds, changes = read(record(profile="sigrok"))
    assert set(kinds.values()) == {"wire"}
    names = {name.removeprefix("vbus.") for name in kinds}
    assert {"x_CS", "x_PS", "x_RD", "x_WR", "x_RST", "x_HI"} <= names
    assert {f"x_D{n}" for n in range(8)} <= names
    assert all(name.isidentifier() and name.isascii() for name in names)
    assert changes["vbus.x_D7"][1][1] == 1


def test_names_of_wires() -> None:
    assert bit_names("x.D0-D7", 8) == [f"x_D{n}" for n in range(8)]
    assert bit_names("x.MC0-MC11", 12)[-1] == "x_MC11"
    assert bit_names("x.Data0-11", 12)[0] == "x_Data0"
    assert bit_names("x.DAC16Addr0-1", 2) == ["x_DAC16Addr0", "x_DAC16Addr1"]
    assert bit_names("x1-y.Home1", 1) == ["x1_y_Home1"]
    assert bit_names("x.strange", 2) == ["x_strange_0", "x_strange_1"]
    assert plain("x.~HostSlct") == "x_HostSlct"
    assert plain("x.R/W") == "x_RW"


def test_recording_changes_nothing_but_time_of_the_machine() -> None:
    def run(wave: bool) -> Board:
        board = load_board_text(LM629)
        if wave:
            Wave(board, io.StringIO()).start()
        lm629_move(board.open_port("h"))
        return board

    plain_board, recorded = run(False), run(True)
    assert recorded.now == plain_board.now
    assert recorded.chips[0].telemetry() == plain_board.chips[0].telemetry()
    assert list(recorded.violations) == list(plain_board.violations)
    assert recorded.kernel.now == plain_board.kernel.now
    assert len(recorded.kernel.dues) == len(plain_board.kernel.dues)


def test_only_the_signals_asked_for_are_there() -> None:
    kinds, _ = read(record(signals=["x./?R", "x.HI"], profile="sigrok"))
    assert set(kinds) == {"vbus.x_WR", "vbus.x_HI"}
    kinds, _ = read(record(signals=["x.real", "x.p*", "x.D0-D7"]))
    assert set(kinds) == {"x.real", "x.packet", "x.D0-D7"}
    _, changes = read(record(signals=["x.HI"], trigger="command STT"))
    assert set(changes) == {"x.HI"}  # a trigger may look at what is not shown
    _, changes = read(record(signals=["x.real"], trigger="x./WR rises"))
    assert set(changes) == {"x.real"}
    with pytest.raises(VbusError, match=r'no signal matches "y\.\*"; there are x\./CS'):
        record(signals=["y.*"])


def times(text: str) -> list[int]:
    return [int(line[1:]) * 100 for line in text.splitlines() if line.startswith("#")]


def pulses(port: HostBus) -> None:
    """Something every 100 us: DFH; at 1 ms one command too early."""
    for step in range(20):
        port.write(0, 0x02)
        if step == 10:
            port.write(0, 0x02)
        port.delay(100 * US)
    lm629_command(port, 0x1F, 0)


@pytest.mark.parametrize(
    ("trigger", "instant"),
    [
        ("violation", 1_012_000_000),
        ("violation lm628", 1_012_000_000),
        ("violation lm628.busy-write", 1_012_000_000),
        ("x./WR rises", 1_000_000),
        ("x./WR falls", 900_000),
        ("command LTRJ", None),
        ("x.command == LTRJ", None),
    ],
)
def test_recording_begins_at_its_trigger_with_what_came_before(
    trigger: str, instant: int | None
) -> None:
    text = record(pulses, trigger=trigger, before=50 * US, duration=20 * US)
    found = times(text)
    if instant is None:
        assert found[0] > 1_900_000_000
    else:
        assert found[0] == max(0, instant - 50 * US)
        assert found[-1] <= instant + 20 * US
        assert any(time >= instant for time in found)


def test_an_edge_is_named_by_the_pin_also_where_the_net_has_a_name_of_its_own() -> None:
    file = io.StringIO()
    board = load_board_text(LM629 + '\n[nets.IRQ]\npins = ["x.HI"]\n')
    wave = Wave(board, file, signals=["x.D0-D7"], trigger="x.HI falls")
    wave.start()
    port = board.open_port("h")
    port.delay(2 * MS)
    lm629_command(port, 0x1C, 0)
    port.delay(MS)
    assert wave.state == "recording"
    wave.stop()
    assert "IRQ" not in file.getvalue()
    assert "D0-D7" in file.getvalue()


def test_a_position_can_be_a_trigger() -> None:
    _, changes = read(record(trigger="x.real > 30", sample=100 * US))
    assert changes["x.real"][0][1] <= 30  # type: ignore[operator]
    assert changes["x.real"][1][1] > 30  # type: ignore[operator]


def test_the_head_has_the_values_of_its_own_instant() -> None:
    def host(port: HostBus) -> None:
        port.pin(port.pin_number("A"), 1)
        port.delay(MS)
        port.pin(port.pin_number("B"), 1)

    _, changes = read(record(host, trigger="x.B rises", signals=["x.A", "x.B"], profile="sigrok"))
    assert changes["vbus.x_A"] == [(MS, 1)]
    assert changes["vbus.x_B"] == [(MS, 0), (MS, 1)]


@pytest.mark.parametrize(
    ("trigger", "begins"),
    [
        ("x.B rises and x.A", 2 * MS),
        ("x.A rises and x.B", None),  # both at their instants: never together
        ("x.A stable for 1.5 ms", 2 * MS + MS // 2),
        ("x.A and x.B", 2 * MS),
        ("not x./IN and x.A", None),
        ("time >= 1.25 ms", 5 * MS // 4),
        ("rising(x.A or x.B)", MS),
        ("x.A or x.HI", None),  # HI is high from the beginning
        ("command STT or x.B", 2 * MS),
    ],
)
def test_a_condition_begins_a_recording_when_it_becomes_true(
    trigger: str, begins: int | None
) -> None:
    def host(port: HostBus) -> None:
        for pin in ("A", "B"):
            port.delay(MS)
            port.pin(port.pin_number(pin), 1)
        port.delay(2 * MS)

    text = record(host, trigger=trigger, before=100 * US, signals=["x.A", "x.B"])
    assert (times(text)[0] + 100 * US if text else None) == begins


def test_a_trigger_that_does_not_come_leaves_nothing() -> None:
    assert record(trigger="x.HI falls", before=MS) == ""


def test_a_recording_ends_after_its_duration_though_nobody_stops_it() -> None:
    board = load_board_text(LM629)
    file = io.StringIO()
    wave = Wave(board, file, duration=2 * MS)
    wave.start()
    port = board.open_port("h")
    port.delay(5 * MS)
    assert wave.state == DONE
    assert times(file.getvalue())[-1] == 2 * MS
    assert board.kernel.observed == 0
    assert not board.observers


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"profile": "fst"}, "profile 'fst': allowed are full, sigrok"),
        ({"trigger": "sometimes"}, 'trigger "sometimes": no "sometimes" at character 1; this boa'),
        ({"trigger": "x.HO rises"}, 'no "x.HO" at character 1; did you mean "x.HI"? x has the va'),
        ({"trigger": "x.speed > 3"}, 'no "x.speed" at character 1; did you mean "x.desired"? x'),
        ({"trigger": "command SST"}, 'no command "SST" at character 1; did you mean "STT"? there '),
        ({"trigger": "violation lm628.T41"}, 'no rule "lm628.T41" at character 1; did you mean "'),
        ({"trigger": "violation mc1241a"}, 'no rule "mc1241a" at character 1; '),
    ],
)
def test_what_makes_no_sense_is_refused_with_what_does(
    options: dict[str, str], message: str
) -> None:
    with pytest.raises(VbusError) as caught:
        Wave(load_board_text(LM629), io.StringIO(), **options)  # type: ignore[arg-type]
    assert message in str(caught.value)


class _Pipe(io.StringIO):
    """A pipe whose other end goes away after some text."""

    def __init__(self, room: int, error: Exception) -> None:
        super().__init__()
        self._room = room
        self._error = error

    def write(self, text: str) -> int:
        self._room -= len(text)
        if self._room < 0:
            raise self._error
        return len(text)


@pytest.mark.parametrize("room", [0, 300, 2000, 10_000])
@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (OSError(28, "No space left on device"), "No space left on device"),
        (BrokenPipeError(32, "Broken pipe"), "Broken pipe"),
        (ValueError("I/O operation on closed file"), "closed file"),
    ],
)
def test_a_file_that_takes_no_more_ends_the_recording_and_not_the_board(
    room: int, error: Exception, reason: str
) -> None:
    board = load_board_text(LM629)
    told: list[str] = []
    wave = Wave(board, _Pipe(room, error), report=told.append)
    wave.start()
    port = board.open_port("h")
    lm629_move(port)
    wave.stop()
    assert port.read(0) & 0x80 == 0
    assert (wave.state, len(told)) == (DONE, 1)
    assert told[0] == wave.error
    assert wave.error.startswith("the waveform ends after ")
    assert wave.error.endswith(reason)
    assert board.kernel.observed == 0


def test_changes_of_lazy_chips_stand_in_the_order_of_time() -> None:
    assert times(record()) == sorted(set(times(record())))


def test_a_packet_that_was_cut_short_stands_where_it_was_found_to_be_so() -> None:
    def host(port: HostBus) -> None:
        port.write(0, 0x1D)
        port.delay(3 * MS)  # values are looked at meanwhile
        port.write(0, 0x02)

    text = record(host)
    assert times(text) == sorted(set(times(text)))
    _, changes = read(text)
    packets = [(when, str(v).replace("\\x20", " ")) for when, v in changes["x.packet"] if v]
    assert packets[0][0] == 3 * MS + 2 * US
    assert packets[0][1].startswith("RSTI cut after 0 of 1 words")


def test_what_is_told_late_stands_as_early_as_the_file_allows() -> None:
    board = load_board_text(LM629)
    file = io.StringIO()
    wave = Wave(board, file)
    wave.start()
    board.run_until(5 * MS + 10)
    board.file_violation(
        Violation(2 * MS, "x", "lm628.T16", "LM-TIM-16", "error", 0, 0, "found out late")
    )
    board.run_until(6 * MS)
    wave.stop()
    assert wave.error == ""
    _, changes = read(file.getvalue())
    assert [(when, v) for when, v in changes["x.violation"] if v] == [(5 * MS, "lm628.T16")]


def test_what_is_told_after_a_later_edge_stands_before_it() -> None:
    board = load_board_text(LM629)
    file = io.StringIO()
    wave = Wave(board, file)
    wave.start()
    port = board.open_port("h")
    port.lines(0xF, 0xF)
    board.pass_until(300 * US)  # as a served board does: a chip may tell later of what was before
    port.lines(0xF, 0xE)
    board.file_violation(
        Violation(200 * US, "x", "lm628.T16", "LM-TIM-16", "error", 0, 0, "found out late")
    )
    wave.stop()
    _, changes = read(file.getvalue())
    assert [(when, v) for when, v in changes["x.violation"] if v] == [(200 * US, "lm628.T16")]
    ticks = [int(line[1:]) for line in file.getvalue().splitlines() if line[:1] == "#"]
    assert ticks == sorted(ticks)
    assert ticks[-1] * 100 == 300 * US


def test_a_waveform_is_started_once() -> None:
    wave = Wave(load_board_text(LM629), io.StringIO())
    wave.start()
    wave.stop()
    wave.stop()
    with pytest.raises(VbusError, match="can be started once"):
        wave.start()


def test_of_single_bits_only_those_that_differ_are_written() -> None:
    board = load_board_text(LM629)
    bus = board.chip("x").bus_net
    other = board.chip("x").pins["/CS"].net
    signals = [Signal(bus.name, "net", bus), Signal(other.name, "net", other)]
    text = io.StringIO()
    file = VcdFile(text, "sigrok")
    file.begin(signals, {signals[0]: 0x0F, signals[1]: 1}, 0)
    head = len(text.getvalue())
    file.write([(0, signals[1], 1), (200, signals[0], 0x1E), (200, signals[0], 0x1E)])
    file.write([(250, signals[1], 0), (300, signals[0], 0x0F), (400, signals[0], 0x1E)])
    file.close(400)
    lines = text.getvalue()[head:].splitlines()
    assert [line if line[0] == "#" else line[0] for line in lines] == [
        "#2", "0", "1", "0", "#3", "1", "0", "#4", "0", "1"
    ]  # fmt: skip


def test_a_value_that_the_head_has_is_not_written_again() -> None:
    board = load_board_text(LM629)
    signal, word = Signal("x.real", "value"), Signal("x.packet", "text")
    text = io.StringIO()
    file = VcdFile(text, "full")
    file.begin([signal, word], {signal: None}, 500)  # type: ignore[dict-item]
    head = len(text.getvalue())
    assert board.now == 0
    file.write([(600, signal, 0), (700, word, ""), (800, signal, 1.5)])
    file.close(800)
    assert [line.split()[0] for line in text.getvalue()[head:].splitlines()] == ["#8", "r1.5"]


def test_a_value_that_changes_for_one_look_is_shown_until_the_next(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    board = load_board_text(LM629)
    told = {"x.real": 7}
    monkeypatch.setattr("vbus.views.wave.wave.values_of", lambda _: dict(told))
    file = io.StringIO()
    wave = Wave(board, file, sample=100 * US)
    wave.start()
    for value in (7, 8, 7, 7, 9, 9, 7):
        told["x.real"] = value
        board.run_for(100 * US)
    wave.stop()
    _, changes = read(file.getvalue())
    shown = [(when // (100 * US), value) for when, value in changes["x.real"]]
    assert shown == [(0, 7.0), (2, 8.0), (3, 7.0), (5, 9.0), (7, 7.0)]


def test_a_poll_is_not_decoded_again_and_shown_all_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    known = record()
    monkeypatch.setattr(Lm628Decoder, "APART", frozenset())
    assert record() == known


def test_a_poll_that_the_chip_does_not_take_is_shown_as_lost() -> None:
    board = load_board_text(LM629)
    file = io.StringIO()
    wave = Wave(board, file)
    wave.start()
    port = board.open_port("h")
    polled = port.read(0)
    board.run_for(US)
    rule = "lm628.busy-read"
    board.file_violation(Violation(board.now, "x", rule, "LM-BUS-7", "error", 0, 0, ""))
    for _ in range(2):  # the second is taken
        for observer in board.observers:
            observer.bus_cycle(board.now, "h", "x", False, 0, polled)
        board.run_for(US)
    wave.stop()
    _, changes = read(file.getvalue())
    taken, lost, again = [str(value) for _, value in changes["x.packet"] if value]
    assert taken == again
    assert rule in lost


def test_a_command_of_the_same_byte_is_no_poll() -> None:
    board = load_board_text(LM629)
    file = io.StringIO()
    wave = Wave(board, file)
    wave.start()
    port = board.open_port("h")
    polled = port.read(0)
    board.run_for(US)
    for write in (False, True):
        for observer in board.observers:
            observer.bus_cycle(board.now, "h", "x", write, 0, polled)
        board.run_for(US)
    wave.stop()
    _, changes = read(file.getvalue())
    read_twice, written = [str(value) for _, value in changes["x.packet"] if value]
    assert read_twice.startswith("RDSTAT")
    assert "command" in written
