"""Bus cycles in the manual's words: three families, whole, cut, unknown, ignored."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.views.conftest import LM629
from vbus.board.build import load_board_text
from vbus.chips.lm628 import datasheet as lm628
from vbus.chips.mc1241a import datasheet as mc1241a
from vbus.chips.packets import Cycle, Packet
from vbus.circuit.stream import PacketStream, PacketTaker, decoder_of
from vbus.core.kernel import MS
from vbus.core.signals import Violation
from vbus.events.watch import Watch


def cycles(text: str) -> list[Cycle]:
    """Read ``"w 0 1F"``, separated by commas, one microsecond apart."""
    result = []
    for place, item in enumerate(text.split(",")):
        way, address, data = item.split()
        result.append(Cycle(place * 10**6, way == "w", int(address, 16), int(data, 16)))
    return result


def decoded(family: str, text: str) -> list[Packet]:
    decoder = decoder_of(family)
    packets = [packet for cycle in cycles(text) for packet in decoder.feed(cycle)]
    return packets + decoder.finish()


def typed(family: str, text: str) -> list[Packet]:
    decoder = decoder_of(family)
    data = [int(item, 16) for item in text.split()]
    packets = [packet for cycle in decoder.typed(data) for packet in decoder.feed(cycle)]
    return packets + decoder.finish()


@pytest.mark.parametrize(
    ("family", "text", "expected"),
    [
        (
            "lm628",
            "1F 00 2A 00 00 00 14 00 06 D1 EC 00 03 0D 40",
            "LTRJ pos=+200000 vel=6.8200 cnt/sample acc=0.0003052 cnt/sample/sample",
        ),
        ("lm628", "1F 00 03 FF FF FF FE", "LTRJ pos=-2 rel"),
        ("lm628", "21 FF FF FF FE", "SBPR -2 cnt"),
        ("lm628", "1F 18 08 00 01 00 00", "LTRJ vel=1.0000 cnt/sample FORWARD VELOCITY_MODE"),
        ("lm628", "1F 00 0C FF FF 80 00", "LTRJ vel=-0.5000 cnt/sample rel"),
        ("lm628", "1F 04 00", "LTRJ STOP_SMOOTHLY"),
        ("lm628", "1F 00 00", "LTRJ nothing loaded"),
        ("lm628", "1E 02 0B 00 64 03 E8 01 00", "LFIL kp=100 kd=1000 il=256 ds=3 samples"),
        ("lm628", "1D 00 3B", "RSTI resets BREAKPOINT TRAJECTORY_COMPLETE"),
        ("lm628", "1C FF 04", "MSKI enables TRAJECTORY_COMPLETE"),
        ("lm628", "1B 00 C8", "LPEI 200 cnt"),
        ("lm628", "20 FF FF FF 9C", "SBPA -100 cnt"),
        ("lm628", "21 FF FF FF 9C", "SBPR -100 cnt"),
        ("lm628", "0A 00 00 04 D2", "RDRP +1234 cnt"),
        ("lm628", "07 FF FE 80 00", "RDDV -1.5000 cnt/sample"),
        ("lm628", "0B FF F6", "RDRV -10 cnt/sample"),
        ("lm628", "0D 80 00", "RDSUM -32768"),
        (
            "lm628",
            "0C 85 44",
            "RDSIGS 8544H HOST_INTERRUPT ON_TARGET PORT8 BREAKPOINT TRAJECTORY_COMPLETE",
        ),
        ("lm628", "02", "DFH"),
        ("mc1241a", "10 FF FF FF FF", "SET_POS -1 ustep"),
        ("mc1241a", "11 00 06 D1 EC", "SET_VEL 6.8200 ustep/cycle"),
        ("mc1241a", "12 FF FF 00 00", "SET_ACC -1.0000 ustep/cycle/cycle"),
        ("mc1241a", "13 00 00 40 00", "SET_JERK 3.815e-06 ustep/cycle/cycle/cycle"),
        ("mc1241a", "14 00 01 80 00", "SET_RATIO +1.5000 ustep/cnt"),
        ("mc1241a", "4A 00 00 00 05", "GET_POS +5 ustep"),
        ("mc1241a", "1D 00 00 00 05", "GET_TRGT_POS +5 ustep"),
        ("mc1241a", "37 00 00 00 05", "GET_ACTL_POS +5 cnt"),
        ("mc1241a", "36 00 00 00 05", "GET_CAPT +5 cnt"),
        ("mc1241a", "29 00 05", "SET_POS_ERR 5 cnt"),
        ("mc1241a", "55 00 05", "GET_POS_ERR 5 cnt"),
        ("mc1241a", "60 FF FB", "GET_ACTL_POS_ERR -5 cnt"),
        ("mc1241a", "4D 00 00 00 05", "SET_ACTL_POS +5"),
        ("mc1241a", "16 00 00 00 05", "SET_BRK_PNT +5"),
        ("mc1241a", "31 13 01", "GET_STATUS 1301H axis 2: axis_on motor_on motion_complete"),
        ("mc1241a", "48 48 80", "GET_MODE 4880H velocity phase 2: auto_stop"),
        ("mc1241a", "2F 00 21", "SET_INTRPT_MASK enables positive_limit motion_complete"),
        ("mc1241a", "34 FF FE", "RST_STATUS resets motion_complete"),
        ("mc1241a", "6C 4A 0B", "GET_VRSN 4A0BH generation 1, 2 axes, part 31, version 1.3"),
        ("mc1241a", "6E 00 02", "GET_OUTPUT_MODE DAC16"),
        ("mc1241a", "3E 00 00 00 10", "GET_TIME 16 cycles"),
        ("mc1241a", "68 01 80", "SET_STEP_RATIO 1.5000 cnt/ustep"),
        ("mc1241a", "5B 00 03", "MULTI_UPDATE 0003H"),
        ("mc1241a", "1A", "UPDATE"),
        ("mcp1200", "05 03", "write MODE 03H control"),
        ("mcp1200", "0C FF 0D FF 0E FE", "write COMMAND_POSITION -2"),
        ("mcp1200", "26 80 27 01", "write ACCELERATION 1.5000"),
        ("mcp1200", "00 08", "write FLAG 08H sets F0"),
        ("mcp1200", "00 03", "write FLAG 03H clears F3"),
        ("mcp1200", "04 49", "write EXCEPTION 49H error=idle breakpoint=report"
         " stop=decelerate limit=idle"),
        ("mcp1200", "0F 40", "write SAMPLE_TIMER 40H (64)"),
        ("mcp1200", "01 18", "write FEATURE 18H S_CURVE PID"),
    ],
)  # fmt: skip
def test_a_packet_has_the_manuals_name_and_scaled_values(
    family: str, text: str, expected: str
) -> None:
    (packet,) = typed(family, text)
    assert packet.text == expected
    assert packet.kind == "packet"
    assert packet.clause


@pytest.mark.spec("MCP-BUS-9")
@pytest.mark.parametrize(("config", "name"), [(0x02, "MODE"), (0x03, "DEADBAND")])
def test_bit_6_of_an_address_is_looked_at_after_the_configuration_says_so(
    config: int, name: str
) -> None:
    packets = typed("mcp1200", f"02 {config:02X} 45 03")
    assert packets[1].name == f"write {name}"


@pytest.mark.parametrize(
    ("family", "words"),
    [
        ("lm628", {"status": 8, "signals": 16}),
        ("mc1241a", {"status": 16, "mode": 16, "version": 16, "adapter": 8}),
        ("mcp1200", dict.fromkeys(
            ("status", "flag", "feature", "config", "capture", "exception"), 8)),
    ],
)  # fmt: skip
def test_words_that_are_explained_by_themselves_have_the_width_of_their_register(
    family: str, words: dict[str, int]
) -> None:
    decoder = decoder_of(family)
    assert words == decoder.WORDS
    for name, bits in words.items():
        assert decoder.word(name, (1 << bits) - 1).startswith("F" * (bits // 4) + "H ")
        with pytest.raises(ValueError, match=f"does not fit into the {bits} bits of {name}"):
            decoder.word(name, 1 << bits)


def test_status_reads_belong_to_no_packet_and_disturb_none() -> None:
    packets = decoded("lm628", "w 0 0A, r 0 01, r 1 00, r 0 84, r 1 00, r 1 12, r 1 34")
    assert [(p.kind, p.text) for p in packets] == [
        ("status", "RDSTAT 01H BUSY"),
        ("status", "RDSTAT 84H MOTOR_OFF TRAJECTORY_COMPLETE"),
        ("packet", "RDRP +4660 cnt"),
    ]
    assert (packets[2].begin, packets[2].end) == (0, 6 * 10**6)


@pytest.mark.parametrize(
    ("family", "text", "expected"),
    [
        ("lm628", "w 0 1F, w 1 00, w 0 01", ["LTRJ cut after 0 of 1 words, byte 00H dropped",
                                               "STT"]),
        ("lm628", "w 0 1F, w 1 00, w 1 02, w 1 12", ["LTRJ cut after 1 of 3 words,"
                                                       " byte 12H dropped"]),
        ("lm628", "w 0 3F", ["undefined command 3FH"]),
        ("lm628", "r 1 00", ["data read of 00H after no command"]),
        ("lm628", "w 0 1F, r 1 00, w 1 00, w 1 00, w 1 55",
         ["data read of 00H inside LTRJ", "LTRJ nothing loaded",
          "data write of 55H after the end of LTRJ"]),
        ("mc1241a", "w 1 11, w 0 00, w 0 01, w 1 1A", ["SET_VEL cut after 1 of 2 words",
                                                         "UPDATE"]),
        ("mc1241a", "w 1 80, r 0 00, r 0 00", ["illegal command 80H",
                                                 "checksum 0000H: 80H is illegal"]),
        ("mc1241a", "w 1 25", ["illegal command 25H (SET_KP of the servo chips)"]),
        ("mc1241a", "w 1 49, r 0 00, r 0 49", ["reserved command 49H", "checksum 0049H right"]),
        ("mc1241a", "w 1 1A, r 0 00, r 0 1A, r 0 00, r 0 1B",
         ["UPDATE", "checksum 001AH right", "checksum 001BH wrong, 001AH belongs to UPDATE"]),
        ("mc1241a", "w 1 1A, w 0 12", ["UPDATE", "data write of 12H after UPDATE"]),
        ("mc1241a", "r 1 C0, w 2 00, r 0 12", ["adapter status C0H ready", "adapter reset",
                                                 "first byte of a word, 12H"]),
        ("mc1241a", "r 1 00", ["adapter status 00H busy interrupt"]),
        ("mcp1200", "r 1E 00", ["read 1EH, which is no register 00H"]),
        ("mcp1200", "w C 12, w C 13", [
            "write COMMAND_POSITION 0CH=12H, 2 of 3 bytes not touched",
            "write COMMAND_POSITION 0CH=13H, 2 of 3 bytes not touched"]),
    ],
)  # fmt: skip
def test_cut_unknown_and_unexpected_input_is_named_as_such(
    family: str, text: str, expected: list[str]
) -> None:
    packets = decoded(family, text)
    assert [packet.text for packet in packets] == expected
    assert all(packet.clause for packet in packets)


def test_a_checksum_is_the_code_and_all_words() -> None:
    packets = decoded("mc1241a", "w 1 11, w 0 00, w 0 01, w 0 80, w 0 00, r 0 80, r 0 12")
    assert packets[1].text == "checksum 8012H right"


def test_bytes_of_a_register_may_be_spread_among_other_accesses() -> None:
    packets = decoded("mcp1200", "w C 01, r 7 F8, w D 02, w E 03")
    assert [packet.text for packet in packets] == [
        "read STATUS F8H LIMIT_OK STOP_OK BREAKPOINT_OK ERROR_OK TIMER_OK",
        "write COMMAND_POSITION +66051",
    ]


def test_addresses_have_six_bits_until_the_configuration_says_seven() -> None:
    low, config, high = decoded("mcp1200", "w 44 01, w 2 01, w 44 01")
    assert low.name == "write EXCEPTION"
    assert config.text == "write CONFIG 01H EXTENDED"
    assert high.name == "write BACKLASH"


def test_a_cycle_the_chip_did_not_take_is_shown_and_changes_nothing() -> None:
    seen: list[str] = []
    taker = PacketTaker(lambda _, packet: seen.append(packet.text))
    watch = PacketStream({"x": "lm628"}, readers=(taker,))
    watch.bus_cycle(0, "h", "x", True, 0, 0x0A)
    watch.violation(Violation(5, "x", "lm628.busy-read", "LM-BUS-10", "error", 0, 0, ""))
    watch.bus_cycle(5, "h", "x", False, 1, 0x00)
    for when, data in enumerate((0, 0, 0, 7), 10):
        watch.bus_cycle(when, "h", "x", False, 1, data)
    assert seen == ["read of 00H at address 1H not taken: lm628.busy-read", "RDRP +7 cnt"]


def test_chips_written_together_are_decoded_each_by_itself() -> None:
    seen: list[tuple[str, str]] = []
    taker = PacketTaker(lambda chip, packet: seen.append((chip, packet.text)))
    watch = PacketStream({"x": "lm628", "y": "lm628"}, readers=(taker,))
    watch.bus_cycle(0, "h", "x+y", True, 0, 0x1D)
    watch.bus_cycle(1, "h", "x", True, 1, 0x00)
    watch.finish()
    assert seen == [
        ("x", "RSTI cut after 0 of 1 words, byte 00H dropped"),
        ("y", "RSTI cut after 0 of 1 words"),
    ]


def test_a_chip_without_decoder_is_shown_cycle_by_cycle() -> None:
    (packet,) = decoded("acme", "w 3 12")
    assert (packet.kind, packet.text) == ("unknown", "write 3H 12H")


@pytest.mark.parametrize(
    ("family", "table"), [("lm628", lm628.COMMANDS), ("mc1241a", mc1241a.COMMANDS)]
)
def test_every_command_of_the_tables_is_decoded_by_its_name(family: str, table: object) -> None:
    for row in table:  # type: ignore[attr-defined]
        (packet,) = typed(family, f"{row.code:02X}" + " 00" * 2 * (row.write or row.read))
        assert (packet.kind, packet.name, packet.clause) == ("packet", row.name, row.clause)


@given(
    st.sampled_from(["lm628", "mc1241a", "mcp1200"]),
    st.lists(st.tuples(st.booleans(), st.integers(0, 127), st.integers(0, 255)), max_size=60),
)
def test_every_cycle_is_in_exactly_one_packet(
    family: str, raw: list[tuple[bool, int, int]]
) -> None:
    decoder = decoder_of(family)
    fed = [Cycle(when, *item) for when, item in enumerate(raw)]
    packets = [packet for cycle in fed for packet in decoder.feed(cycle)] + decoder.finish()
    shown = sorted((c for packet in packets for c in packet.cycles), key=lambda c: c.when)
    assert shown == fed


def test_a_word_by_name_is_explained_and_a_wrong_name_lists_the_known() -> None:
    decoder = decoder_of("lm628")
    assert decoder.word("status", 0x84) == "84H MOTOR_OFF TRAJECTORY_COMPLETE"
    with pytest.raises(ValueError, match="lm628 has no 'mode'; it has status, signals"):
        decoder.word("mode", 0)
    with pytest.raises(ValueError, match="184H does not fit into the 8 bits of status"):
        decoder.word("status", 0x184)


def test_a_board_decodes_a_cycle_once_for_all_who_read() -> None:
    board = load_board_text(LM629)
    seen: list[list[Packet]] = [[], []]
    readers = [PacketTaker(lambda _, packet, into=into: into.append(packet)) for into in seen]
    port = board.open_port("h")
    port.read(0)
    for reader in readers:
        board.observe(reader)
    assert board.observers == [board.stream]
    port.write(0, 0x02)
    assert [one.text for one in seen[0]] == ["DFH"]
    assert seen[0][0] is seen[1][0]
    for reader in readers:
        board.unobserve(reader)
    assert board.stream is None
    assert not board.observers
    port.write(0, 0x02)
    assert [len(packets) for packets in seen] == [1, 1]


def test_what_is_open_is_given_to_who_leaves_and_stays_open_for_the_others() -> None:
    board = load_board_text(LM629)
    seen: list[list[str]] = [[], []]
    leaving, staying = (
        PacketTaker(lambda _, packet, into=into: into.append(packet.text)) for into in seen
    )
    port = board.open_port("h")
    for reader in (leaving, staying):
        board.observe(reader)
    port.write(0, 0x1D)
    port.delay(MS)
    assert board.stream is not None
    board.stream.finish(leaving)
    board.unobserve(leaving)
    port.write(1, 0)
    port.write(1, 0)
    assert seen[0] == ["RSTI cut after 0 of 1 words"]
    assert [text.partition(" ")[0] for text in seen[1]] == ["RSTI"]
    assert "cut" not in seen[1][0]


@pytest.mark.parametrize(("condition", "decodes"), [("x.HI == 1", False), ("command STT", True)])
def test_a_watch_has_cycles_decoded_only_for_commands(condition: str, decodes: bool) -> None:
    board = load_board_text(LM629)
    watch = Watch(condition, board)
    watch.begin()
    assert (board.stream is not None) is decodes
    watch.end()
    assert board.stream is None
