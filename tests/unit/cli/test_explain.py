"""``vbus explain`` in process: bytes, words, rules, clauses, and what it refuses."""

import json
from itertools import groupby
from pathlib import Path
from random import Random
from typing import Any

import pytest
from click.testing import CliRunner

from vbus.board.build import load_board_text
from vbus.chips.clauses import proofs_of
from vbus.chips.lm628.packets import Lm628Decoder
from vbus.chips.mcp1200.packets import Mcp1200Decoder
from vbus.chips.packets import CUT, Cycle, Packet
from vbus.circuit.stream import PacketStream, PacketTaker
from vbus.cli.journal_lines import instant
from vbus.cli.look.explain import command
from vbus.core.kernel import MS, US
from vbus.record.format import JournalReader
from vbus.record.journal import Journal
from vbus.record.view import Sessions, show, violation_of


def explain(*arguments: str) -> list[str]:
    done = CliRunner().invoke(command, arguments, standalone_mode=False)
    assert done.exception is None, done.exception
    return done.output.splitlines()


def data(*arguments: str) -> list[dict[str, Any]]:
    """Return what --json prints: an object for each line."""
    return [json.loads(line) for line in explain(*arguments, "--json")]


def refused(*arguments: str) -> str:
    done = CliRunner().invoke(command, arguments)
    assert done.exit_code == 2
    return done.output


def test_bytes_are_shown_with_their_packets_and_clauses() -> None:
    assert explain("lm628", "1D", "00", "3B", "01", "1E", "00") == [
        "1D 00 3B: RSTI resets BREAKPOINT TRAJECTORY_COMPLETE  [LM-CMD-18]",
        "01: STT  [LM-CMD-2]",
        "1E 00: LFIL cut after 0 of 1 words, byte 00H dropped  [LM-BUS-11]",
    ]


def test_a_part_number_does_as_well_as_a_family() -> None:
    assert explain("LM629N-8", "0x02") == ["02: DFH  [LM-CMD-3]"]
    assert explain("MC1141A", "1A") == ["1A: UPDATE  [PMD-CMD-36]"]


def test_words_are_explained_by_name() -> None:
    assert explain("lm628", "status=84") == ["status 84H MOTOR_OFF TRAJECTORY_COMPLETE"]
    assert explain("mcp1200", "flag=07H") == ["flag 07H F2 F1 F0"]
    assert explain("mc1241a", "mode=0400")[0].endswith("auto_update_off")


def test_lines_of_a_transcript_are_read() -> None:
    assert explain("lm628", "x w 0 1D", "x r 0 80 x2", "x w 1 00", "x w 1 00") == [
        "80: RDSTAT 80H MOTOR_OFF  [LM-CMD-23]",
        "80: RDSTAT 80H MOTOR_OFF  [LM-CMD-23]",
        "1D 00 00: RSTI resets BREAKPOINT POSITION_ERROR WRAPAROUND INDEX TRAJECTORY_COMPLETE"
        " COMMAND_ERROR  [LM-CMD-18]",
    ]


def test_a_rule_is_explained_with_its_row_of_the_ac_table() -> None:
    lines = explain("mcp1200.tSDR")
    assert lines[0].startswith("mcp1200.tSDR (error, MCP-TIM-15): Write Data Setup Time")
    assert lines[1:3] == [
        "  AC row tSDR at 5 V: at least 2.1 ns",
        "  AC row tSDR at 3.3 V: at least 3.1 ns",
    ]
    assert lines[3] == "  MCP-TIM-15: Write data before /CS rise"
    assert explain("mc1241a.T6")[1] == "  AC row T6: at least 15 ns, at most 2000 ns"


def test_a_rule_is_explained_with_the_text_of_its_clause() -> None:
    assert explain("lm628.T18") == [
        "lm628.T18 (error, LM-TIM-18): Write recovery at least 120 ns (data port)",
        "  AC row T18: at least 120 ns",
        "  LM-TIM-18: T18: write recovery",
        "    T18: from the end of a write to the data port to the beginning of the next",
        "    write to that port pass at least 120 ns. Commands have no such limit.",
    ]


def test_a_rule_without_its_family_is_that_of_every_chip() -> None:
    def heads(name: str) -> list[str]:
        return [line.split(":")[0] for line in explain(name) if line[:1] not in ("", " ")]

    assert heads("T5") == ["lm628.T5 (error, LM-TIM-5)", "mc1241a.T5 (error, PMD-TIM-7)"]
    assert heads("t5") == heads("T5")
    assert heads("tSDR") == ["mcp1200.tSDR (error, MCP-TIM-15)"]
    assert heads("range") == [
        "lm628.range (warning, LM-TRJ-2)", "mc1241a.range (warning, PMD-CMD-82)",
        "mcp1200.range (warning, MCP-REG-26)",
    ]  # fmt: skip


def test_a_clause_is_told_with_its_source_its_rules_and_its_tests() -> None:
    lines = explain("LM-BUS-11")
    assert lines == [
        "LM-BUS-11: A command cuts an unfinished packet short",
        "  manual: Typical Applications, Programming LM628 Host Handshaking",
        "",
        "  A command byte written while an earlier command still has data to come, in",
        "  either direction, ends that command and begins its own. Words that were",
        "  complete keep their effect: they stay in the buffers they were meant for. A",
        "  single byte of a word is dropped.",
        "",
        "  Ruled here: this sets no command error, but is reported (`lm628.cut-packet`).",
        "  A long value of which only one word arrived keeps the other half of the value",
        "  before it (NOTES 7).",
        "",
        "lm628.cut-packet (warning, LM-BUS-11): A command is written only after the data of the one"
        " before it is complete.",
        "",
        "Tests:",
        *(f"  {test}" for test in proofs_of("vbus.chips.lm628")["LM-BUS-11"]),
    ]
    assert (
        "  tests/conformance/lm628/test_bus.py::"
        "test_a_command_ends_a_report_that_was_not_read_to_its_end" in lines
    )
    assert explain("lm-bus-11") == lines


def test_a_clause_names_the_rows_and_settings_it_is_of() -> None:
    assert "lm628: LTRJ (1FH): Load Trajectory" in explain("LM-CMD-20")
    assert "mcp1200: MODE (05H): Mode Brancher" in explain("MCP-REG-6")
    assert (
        "lm628: setting reset_status: status after reset (hexadecimal)" in explain("LM-RST-5")
    )  # fmt: skip
    timing = explain("LM-TIM-5")
    assert "  AC row T5: at least 125 ns, at most 1000 ns" in timing
    assert any(line.endswith("[T5 longest]") for line in timing)


def test_an_open_clause_says_why_it_has_no_test() -> None:
    assert explain("LM-TIM-13")[-1] == (
        "No test: The manual itself calls it untestable; busy is visible at the next status read"
        " (LM-BUS-7)."
    )


def test_steps_that_comments_name_are_numbered_in_the_clause() -> None:
    """In core.py: "steps 1 and 3 of MCP-SMP-5", "steps 8 and 9"."""
    lines = explain("MCP-SMP-5")
    assert [line for line in lines if line[2:4] in ("1.", "3.", "8.", "9.")] == [
        "  1. exceptions: limit, stop, forced, maximum error, breakpoint;",
        "  3. mode and profile give the command position;",
        "  8. filter, or number of steps;",
        "  9. outputs.",
    ]


def test_items_of_a_list_keep_their_indent() -> None:
    lines = explain("LM-TRJ-12")
    at = lines.index("  1. If A = 0 the velocity stays u.")
    assert lines[at + 1].startswith("  2. If u < 0 the axis moves away")
    assert lines[at + 2].startswith("     ")
    assert max(map(len, lines[: at + 20])) <= 80


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["lm628"], "say what to explain: bytes, or status=HEX"),
        (["lm628", "zz"], '"zz" is no byte; write two hexadecimal digits'),
        (["lm628", "status=zz"], 'status: "zz" is no hexadecimal number, such as status=84'),
        (["lm628.T41"], 'there is no rule "lm628.T41"; did you mean "lm628.T'),
        (["lm628", "status", "84"], "for a status value write status=HEX"),
        (["lm628", "mode=12"], "lm628 has no 'mode'; it has status, signals"),
        (["lm628", "status=123"], "123H does not fit into the 8 bits of status"),
        (["mcp1200", "05"], "write pairs of address and data byte"),
        (["nothing"], '"nothing" is neither a chip (lm628, mc1241a, mcp1200), nor a rule'),
        (["lm-bus-77"], 'there is no clause "lm-bus-77"; did you mean "LM-BUS-7"?'),
        (["LM-BUS-7", "12"], '"LM-BUS-7" is no chip; bytes and words belong to lm628'),
        (["nothing", "12"], '"nothing" is no chip; bytes and words belong to lm628'),
    ],
)
def test_what_cannot_be_explained_is_refused_with_what_can(
    arguments: list[str], message: str
) -> None:
    assert message in " ".join(refused(*arguments).split())


BOARD = """
[board]
power_on = "done"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"
[chips.m]
part = "MCP-1200"
clock = "8 MHz"
plant = "none"
"""


def journal(
    path: Path, *cycles: tuple[str, str, int, int], text: str = BOARD, apart: int = 20 * US
) -> str:
    """Record bus cycles: chip, way, address, byte."""
    board = load_board_text(text)
    with path.open("wb") as file:
        recorder = Journal(board, file)
        ports = {chip.name: board.open_port(chip.name, [chip.name]) for chip in board.chips}
        for chip, way, address, data in cycles:
            board.run_until(board.now + apart)
            if way == "w":
                ports[chip].write(address, data)
            else:
                ports[chip].read(address)
        recorder.close()
    return str(path)


def test_a_journal_is_told_in_the_order_of_time(tmp_path: Path) -> None:
    """What was cut short stands where it ended, not where that became clear."""
    lines = explain(
        journal(
            tmp_path / "a.vbj",
            ("m", "r", 0x14, 0), ("x", "w", 0, 0x1F), ("x", "r", 0, 0), ("x", "w", 1, 0),
            ("x", "r", 0, 0), ("m", "w", 0x0C, 1), ("x", "w", 0, 0x02), ("x", "w", 1, 7),
            ("m", "w", 0x0E, 2), ("x", "r", 0, 0),
        )
    )[1:]  # fmt: skip
    shown = [line.split(" ", 2)[1:] for line in lines]
    assert [float(line.partition("us")[0]) for line in lines] == sorted(
        float(line.partition("us")[0]) for line in lines
    )
    packets = [f"{chip} {text.split('  ')[0]}" for chip, text in shown if text[0] != "!"]
    assert len(packets) < len(lines)
    assert packets == [
        "m read ACTUAL_POSITION 14H=00H, 2 of 3 bytes not touched",
        "x RDSTAT 84H MOTOR_OFF TRAJECTORY_COMPLETE",
        "x LTRJ cut after 0 of 1 words, byte 00H dropped",
        "x RDSTAT 84H MOTOR_OFF TRAJECTORY_COMPLETE",
        "x DFH",
        "x data write of 07H after the end of DFH",
        "m write COMMAND_POSITION 0CH=01H 0EH=02H, 1 of 3 bytes not touched",
        "x RDSTAT 86H MOTOR_OFF TRAJECTORY_COMPLETE COMMAND_ERROR",
    ]


def test_equal_polls_are_gone_through_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also those in the middle of a packet."""
    taken: list[Cycle] = []
    take = Lm628Decoder.take

    def count(self: Lm628Decoder, cycle: Cycle) -> list[Packet]:
        taken.append(cycle)
        return take(self, cycle)

    monkeypatch.setattr(Lm628Decoder, "take", count)
    board = load_board_text(BOARD)
    with (tmp_path / "a.vbj").open("wb") as file:
        recorder = Journal(board, file)
        port = board.open_port("host", ["x"], 1 * US)
        for _ in range(5000):
            port.read(0)
        port.write(0, 0x0A)
        for _ in range(5000):
            port.read(0)
        port.read(1)
        port.write(1, 0)
        recorder.close()
    lines = explain(str(tmp_path / "a.vbj"))[1:]
    assert len(taken) <= 10
    assert (
        lines[0] == "1us x RDSTAT 84H MOTOR_OFF TRAJECTORY_COMPLETE  [LM-CMD-23]  x 5000, 4.999 ms"
    )
    assert lines[1].endswith(" BUSY  [LM-CMD-23]  x 14, 0.013 ms")
    assert lines[2].endswith(" TRAJECTORY_COMPLETE  [LM-CMD-23]  x 4986, 4.985 ms")


@pytest.mark.parametrize("seed", range(5))
def test_lines_are_those_of_one_cycle_after_the_other(tmp_path: Path, seed: int) -> None:
    """Drivers that poll, cut packets short, and write to two chips at once."""
    random = Random(seed)
    board = load_board_text(BOARD.replace("MCP-1200", "LM629N-8") if seed % 2 else BOARD)
    path = tmp_path / "a.vbj"
    with path.open("wb") as file:
        recorder = Journal(board, file)
        ports = [board.open_port("one", ["x"]), board.open_port("two", ["x", "m"])]
        for _ in range(300):
            port = random.choice(ports)
            if random.random() < 0.2:
                port.select(random.choice([1, 2, 3]) if port is ports[1] else 1)
            address = random.choice([0, 0, 0, 1, 1, 7, 0x14, 0x15])
            code = random.choice([0x0A, 0x1F, 0x00, 0x02, 0x1E])
            write = random.random() < 0.5
            for _ in range(random.choice([1, 1, 1, 2, 3, 40])):
                if write:
                    port.write(address, code)
                else:
                    port.read(address)
        recorder.close()
    with path.open("rb") as file:
        reader, sessions = JournalReader(file), Sessions()
        found: list[tuple[int, str]] = []
        taker = PacketTaker(
            lambda chip, packet: found.append(
                (packet.end, f"{chip} {packet.text}" + f"  [{packet.clause}]" * bool(packet.clause))
            )
        )
        watch = PacketStream(reader.header.families, reader.header.settings, (taker,))
        for entry in reader:
            show(entry, sessions, watch)
            if entry.op == "violation":
                v = violation_of(entry)
                found.append((v.when, f"{v.chip} ! {v.rule}: {v.detail}  [{v.clause}]"))
        watch.finish()
    expected: list[str] = []
    for text, times in groupby(sorted(found, key=lambda one: one[0]), key=lambda one: one[1]):
        whens = [when for when, _ in times]
        folded = f"  x {len(whens)}, {(whens[-1] - whens[0]) / MS:.6g} ms" if whens[1:] else ""
        expected.append(f"{instant(whens[0])} {text}{folded}")
    assert explain(str(path))[1:] == expected


def test_a_register_whose_other_bytes_do_not_move_is_not_waited_for_for_ever() -> None:
    decoder = Mcp1200Decoder()
    assert decoder.feed(Cycle(0, False, 0x14, 0)) == []
    found = [packet for n in range(1, 1100) for packet in decoder.feed(Cycle(n, False, 7, 0))]
    cut = [(n, packet.text) for n, packet in enumerate(found) if packet.kind == CUT]
    assert cut == [(999, "read ACTUAL_POSITION 14H=00H, 2 of 3 bytes not touched")]
    assert decoder.finish() == []


@pytest.mark.spec("PMD-PKT-6")
@pytest.mark.parametrize(
    ("codes", "told"),
    [
        ("noop", ["SET_KP 100", "checksum 0089H right"]),
        ("illegal", ["illegal command 25H (SET_KP of the servo chips)",
                     "data write of 00H after 25H", "data write of 64H after 25H",
                     "checksum 0000H: 25H is illegal"]),
    ],
)  # fmt: skip
def test_codes_of_the_servo_chips_are_read_as_the_board_sets_them(
    tmp_path: Path, codes: str, told: list[str]
) -> None:
    text = f"""
[board]
power_on = "done"
[chips.x]
part = "MC1241A"
clock = "25 MHz"
plants = ["none", "none"]
family_codes = "{codes}"
"""
    cycles = [("x", "w", 1, 0x25), ("x", "w", 0, 0), ("x", "w", 0, 100), ("x", "r", 0, 0),
              ("x", "r", 0, 0)]  # fmt: skip
    lines = explain(journal(tmp_path / "a.vbj", *cycles, text=text, apart=100 * US))[1:]
    texts = [line.split(" x ")[1].split("  [")[0] for line in lines]
    assert [text for text in texts if not text.startswith("!")] == told


# -- the same as data ------------------------------------------------------------------------------


def test_packets_and_words_as_json() -> None:
    assert data("lm628", "1D", "00", "3B", "signals=8544") == [
        {"word": "signals", "text": explain("lm628", "signals=8544")[0].removeprefix("signals ")},
        {"bytes": [0x1D, 0, 0x3B], "kind": "packet", "clause": "LM-CMD-18",
         "text": "RSTI resets BREAKPOINT TRAJECTORY_COMPLETE"},
    ]  # fmt: skip


def test_a_clause_and_a_rule_as_json() -> None:
    (clause,) = data("LM-BUS-7")
    (rule,) = data("lm628.T14")

    assert (clause["clause"], clause["kind"]) == ("LM-BUS-7", "manual")
    assert set(clause) == {
        "clause", "title", "kind", "section", "evidence", "text", "named_by", "tests",
    }  # fmt: skip
    assert clause["tests"] == list(proofs_of("vbus.chips.lm628")["LM-BUS-7"])
    assert (rule["rule"], rule["severity"]) == ("lm628.T14", "error")
    assert rule["limits"]


def test_a_rule_of_every_chip_is_an_object_for_each() -> None:
    assert [one["rule"] for one in data("T5")] == [
        line.split(" ")[0] for line in explain("T5") if line.partition(" ")[0].endswith(".T5")
    ]


def test_a_journal_as_json(tmp_path: Path) -> None:
    file = journal(tmp_path / "a.vbj", *[("x", "r", 0, 0)] * 3, apart=MS)
    header, polls = data(file)
    call, packet = data(f"{file}:2")

    assert header["journal"] == file
    # In real time a cycle of this chip takes 360 ns.
    assert (polls["times"], polls["until_ps"] - polls["when_ps"]) == (3, 2 * MS + 720_000)
    assert (call["entry"], call["call"]) == (2, "read")
    assert packet["entry"] == 2
    assert polls["text"].startswith(packet["packet"])
