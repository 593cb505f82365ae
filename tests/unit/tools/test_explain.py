"""``vbus explain`` in process: bytes, words, rules, clauses, and what it refuses."""

import pytest
from click.testing import CliRunner

from vbus.tools.explain import command


def explain(*arguments: str) -> list[str]:
    done = CliRunner().invoke(command, arguments, standalone_mode=False)
    assert done.exception is None, done.exception
    return done.output.splitlines()


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
    assert explain("lm628", "--status", "84") == ["status 84H MOTOR_OFF TRAJECTORY_COMPLETE"]
    assert explain("mcp1200", "flag=07H") == ["flag 07H F2 F1 F0"]
    assert explain("mc1241a", "--mode", "0400")[0].endswith("auto_update_off")


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
    assert lines[1:] == [
        "  AC row tSDR at 5 V: at least 2.1 ns",
        "  AC row tSDR at 3.3 V: at least 3.1 ns",
    ]
    assert explain("mc1241a.T6")[1] == "  AC row T6: at least 15 ns, at most 2000 ns"


def test_a_clause_names_its_rules_and_commands() -> None:
    assert [line.split(" ")[0] for line in explain("LM-BUS-10")] == [
        "lm628.busy-read", "lm628.busy-write",
    ]  # fmt: skip
    assert explain("LM-CMD-20") == ["lm628: LTRJ (1FH): Load Trajectory"]
    assert explain("MCP-REG-6") == ["mcp1200: MODE (05H): Mode Brancher"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["lm628"], "say what to explain: bytes, or --status HEX"),
        (["lm628", "zz"], '"zz" is no byte; write two hexadecimal digits'),
        (["lm628", "--status", "zz"], 'status: "zz" is no hexadecimal number, such as status=84'),
        (["lm628.T41"], 'there is no rule "lm628.T41"; did you mean "lm628.T'),
        (["lm628", "status", "84"], "for a status value write --status HEX"),
        (["lm628", "mode=12"], "lm628 has no 'mode'; it has status, signals"),
        (["lm628", "--status", "123"], "123H does not fit into the 8 bits of status"),
        (["mcp1200", "05"], "write pairs of address and data byte"),
        (["nothing"], '"nothing" is neither a chip (lm628, mc1241a, mcp1200), nor a rule'),
        (["nothing", "12"], '"nothing" is no chip; bytes and words belong to lm628'),
    ],
)
def test_what_cannot_be_explained_is_refused_with_what_can(
    arguments: list[str], message: str
) -> None:
    assert message in " ".join(refused(*arguments).split())
