"""What a host has exercised of a chip: counted from packets, merged, compared, kept in files."""

import json
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.chips.lm628 import datasheet as lm628
from vbus.chips.mc1241a import datasheet as mc1241a
from vbus.chips.mcp1200 import datasheet as mcp1200
from vbus.core.errors import VbusError
from vbus.core.kernel import MS
from vbus.views.coverage.coverage import Coverage, CoverageObserver, from_json, merged
from vbus.views.coverage.formats import as_cobertura, as_html, as_text, difference
from vbus.views.coverage.tables import (
    ANSWERS,
    BITS,
    COMMANDS,
    COUNTED,
    FLAGS,
    LIMITS,
    MODES,
    READS,
    RULES,
    WRITES,
    exercises_of,
    items,
)

FAMILIES = {"LM629N-8": "lm628", "MCP-1200": "mcp1200", "MC1241A": "mc1241a"}
CLOCKS = {"LM629N-8": "8 MHz", "MCP-1200": "2 MHz", "MC1241A": "25 MHz"}
AXES = {"LM629N-8": '"none"', "MCP-1200": '"none"', "MC1241A": '["none", "none"]'}


def bench(part: str) -> tuple[Board, CoverageObserver]:
    """A board with one chip, its reset over, watched from the start."""
    plant = "plants" if part == "MC1241A" else "plant"
    text = f'[board]\nname = "b"\n[chips.x]\npart = "{part}"\nclock = "{CLOCKS[part]}"\n'
    board = load_board_text(text + f"{plant} = {AXES[part]}\n")
    observer = CoverageObserver({"x": FAMILIES[part]}, "run")
    board.observe(observer)
    board.run_for(5 * MS)
    return board, observer


def word(port, value: int, address: int = 0) -> None:
    for byte in (value >> 8, value & 0xFF):
        port.write(address, byte)
        port.delay(200_000_000)


def command(port, address: int, code: int, *words: int, data: int) -> None:
    port.write(address, code)
    port.delay(200_000_000)
    for value in words:
        word(port, value, data)


def counts(observer: CoverageObserver, family: str, group: str) -> dict[str, int]:
    found = observer.coverage.groups(family)[group]
    return {item.name: count for item, count in found if count}


def test_lm628_commands_control_bits_modes_and_flags_are_counted() -> None:
    board, observer = bench("LM629N-8")
    port = board.open_port("h")
    assert port.read(0) & 0x80
    command(port, 0, lm628.COMMANDS["RSTI"].code, 0xFFFA, data=1)
    command(port, 0, lm628.COMMANDS["MSKI"].code, 0x0020, data=1)
    command(port, 0, lm628.COMMANDS["LTRJ"].code, 0x1808, 0x0001, 0x0000, data=1)
    for _ in range(2):
        command(port, 0, lm628.COMMANDS["LTRJ"].code, 0x0002, 0x0000, 0x0100, data=1)
    command(port, 0, lm628.COMMANDS["STT"].code, data=1)
    assert counts(observer, "lm628", COMMANDS) == {
        "RSTI": 1, "MSKI": 1, "LTRJ": 3, "STT": 1, "RDSTAT": 1,
    }  # fmt: skip
    assert counts(observer, "lm628", MODES) == {"velocity mode": 1, "position mode": 2}
    assert counts(observer, "lm628", BITS) == {
        "LTRJ FORWARD": 1,
        "LTRJ VELOCITY_MODE": 1,
        "LTRJ LOAD_VELOCITY": 1,
        "LTRJ LOAD_POSITION": 2,
        "RSTI TRAJECTORY_COMPLETE": 1,
        "MSKI POSITION_ERROR": 1,
    }
    assert counts(observer, "lm628", FLAGS) == {
        "status MOTOR_OFF": 1,
        "status TRAJECTORY_COMPLETE": 1,
    }


def test_a_command_cut_short_is_not_exercised_but_its_rule_is_broken() -> None:
    board, observer = bench("LM629N-8")
    port = board.open_port("h")
    command(port, 0, lm628.COMMANDS["LTRJ"].code, 0x0002, data=1)
    command(port, 0, lm628.COMMANDS["UDF"].code, data=1)
    assert counts(observer, "lm628", COMMANDS) == {"UDF": 1}
    assert counts(observer, "lm628", RULES) == {"lm628.cut-packet": 1}


def test_mcp1200_registers_count_by_direction_once_all_their_bytes_have_moved() -> None:
    board, observer = bench("MCP-1200")
    port = board.open_port("h")
    registers = mcp1200.REGISTERS
    for address in registers["COMMAND_POSITION"].addresses:
        port.write(address, 0)
    port.write(registers["MODE"].addresses[0], 3)
    port.write(registers["FLAG"].addresses[0], 0x08)
    port.write(registers["EXCEPTION"].addresses[0], 0x01)
    port.read(registers["STATUS"].addresses[0])
    written = counts(observer, "mcp1200", WRITES)
    assert written == {"COMMAND_POSITION": 1, "MODE": 1, "FLAG": 1, "EXCEPTION": 1}
    assert counts(observer, "mcp1200", READS) == {"STATUS": 1}
    assert counts(observer, "mcp1200", MODES) == {"control": 1}
    assert counts(observer, "mcp1200", BITS) == {
        "FLAG sets F0": 1,
        "EXCEPTION error=report": 1,
        "EXCEPTION breakpoint=report": 1,
        "EXCEPTION stop=report": 1,
        "EXCEPTION limit=idle": 1,
    }


@pytest.mark.parametrize(
    ("family", "word", "bits"),
    [
        ("mc1241a", "SET_INTRPT_MASK", ["motion complete", "wrap", "breakpoint", "capture",
          "motion error", "positive limit", "negative limit", "command error"]),
        ("mcp1200", "FLAG", [f"{verb} F{n}" for n in range(6) for verb in ("sets", "clears")]),
    ],
)  # fmt: skip
def test_bits_that_can_be_exercised(family: str, word: str, bits: list[str]) -> None:
    names = [item.name for item in exercises_of(family).items() if item.group == BITS]
    assert [name for name in names if name.startswith(word)] == [f"{word} {bit}" for bit in bits]


def test_an_active_low_flag_counts_when_it_is_seen_low() -> None:
    names = {item.name for item in items("mcp1200") if item.group == FLAGS}
    assert {"STATUS LIMIT_OK=0", "STATUS IN_POSITION"} <= names
    assert "STATUS LIMIT_OK" not in names


def test_mc1241a_status_words_and_checksums_are_counted() -> None:
    board, observer = bench("MC1241A")
    port = board.open_port("h")

    def send(code: int, read: int) -> list[int]:
        port.write(1, code)
        port.delay(200_000_000)
        got = []
        for _ in range(read):
            got.append(port.read(0))
            port.delay(200_000_000)
        return got

    send(mc1241a.COMMANDS["SET_1"].code, 4)
    send(mc1241a.COMMANDS["GET_MODE"].code, 4)
    send(0xF3, 2)
    named = counts(observer, "mc1241a", COMMANDS)
    assert named == {"SET_1": 1, "GET_MODE": 1}
    assert counts(observer, "mc1241a", ANSWERS) == {"checksum right": 2, "checksum 0": 1}
    assert counts(observer, "mc1241a", MODES) == {"trapezoidal": 1}
    assert "status axis on" in counts(observer, "mc1241a", FLAGS)
    command(port, 1, mc1241a.COMMANDS["SET_ACTL_POS"].code, 0xFFFF, 0xFFFF, data=0)
    command(port, 1, mc1241a.COMMANDS["SET_INTRPT_MASK"].code, 0x0006, data=0)
    assert {
        name: n for (group, name), n in observer.coverage.counts["mc1241a"].items() if group == BITS
    } == {"SET_INTRPT_MASK wrap": 1, "SET_INTRPT_MASK breakpoint": 1}


@pytest.mark.spec("PMD-CMD-4", "PMD-CMD-5", "PMD-CMD-6", "PMD-CMD-7")
@pytest.mark.parametrize(
    ("name", "mode"),
    [
        ("SET_PRFL_TRAP", "trapezoidal"),
        ("SET_PRFL_VEL", "velocity"),
        ("SET_PRFL_S_CRV", "S-curve"),
        ("SET_PRFL_GEAR", "gear"),
    ],
)
def test_a_profile_mode_that_was_set_counts_as_used(name: str, mode: str) -> None:
    board, observer = bench("MC1241A")
    board.open_port("h").write(1, mc1241a.COMMANDS[name].code)
    assert counts(observer, "mc1241a", MODES) == {mode: 1}


def test_the_text_has_what_was_never_exercised() -> None:
    text = as_text(Coverage(["a"], {"lm628": {(COMMANDS, "STT"): 2}}))
    assert "      never RESET  Reset LM628  [LM-CMD-1]\n" in text
    assert "never STT" not in text
    assert "no chip took part" not in text
    assert as_text(Coverage([], {})) == "nothing was exercised: no chip took part\n"


def test_a_broken_ac_limit_is_shown_and_does_not_raise_the_percentage() -> None:
    coverage = Coverage(["a"], {"lm628": {}})
    before = coverage.percent()
    coverage.add("lm628", (LIMITS, "lm628.T14"))
    assert coverage.percent() == before
    assert "1 x lm628.T14" in as_text(coverage)


def test_a_share_is_rounded_down_so_that_what_falls_short_shows() -> None:
    counted = [item.key for item in items("lm628") if item.group in COUNTED]
    assert len(counted) == 69
    coverage = Coverage(["a"], {"lm628": dict.fromkeys(counted[:4], 1)})
    assert coverage.percent() > 5.75
    assert coverage.shown() == "5.7%"
    assert as_text(coverage).startswith("lm628: 4 of 69 exercised, 5.7%\n")
    assert Coverage(["a"], {"none": {}}).shown() == "-"


def test_everything_a_table_has_can_be_exercised_and_stands_there_once() -> None:
    for family in FAMILIES.values():
        keys = [item.key for item in items(family)]
        assert len(keys) == len(set(keys))
        assert all(item.clause for item in items(family))
        full = Coverage(["all"], {family: dict.fromkeys(keys, 1)})
        assert full.percent() == 100.0
    assert {i.name for i in items("lm628") if i.group == COMMANDS} >= {"RESET", "RDSTAT", "LFIL"}
    assert len([i for i in items("mc1241a") if i.group == COMMANDS]) == len(mc1241a.COMMANDS)


keys = st.sampled_from([(f, item.key) for f in FAMILIES.values() for item in items(f)])


@st.composite
def coverages(draw: st.DrawFn) -> Coverage:
    made = Coverage([draw(st.text(max_size=5))])
    for family, key in draw(st.lists(keys, max_size=20)):
        made.add(family, key, draw(st.integers(1, 9)))
    return made


@given(coverages())
def test_a_file_gives_back_what_was_written(coverage: Coverage) -> None:
    again = from_json(coverage.to_json(), "a")
    assert (again.runs, again.counts) == (coverage.runs, coverage.counts)


@given(coverages(), coverages())
def test_merging_adds_counts_and_never_loses_what_one_had(a: Coverage, b: Coverage) -> None:
    both = merged([a, b])
    assert both.runs == a.runs + b.runs
    for family, key in ((f, k) for part in (a, b) for f, c in part.counts.items() for k in c):
        want = a.counts.get(family, {}).get(key, 0) + b.counts.get(family, {}).get(key, 0)
        assert both.counts[family][key] == want
    assert both.missing_from(a) == b.missing_from(a)


def test_the_difference_names_what_only_one_run_has() -> None:
    old, new = Coverage(["a"], {"lm628": {}}), Coverage(["b"], {"lm628": {}})
    old.add("lm628", (COMMANDS, "STT"))
    new.add("lm628", (COMMANDS, "UDF"))
    new.add("lm628", (COMMANDS, "LFIL"))
    lines = difference(old, new).splitlines()
    assert {line.split("  ")[0] for line in lines[:3]} == {
        "+ lm628 commands: UDF",
        "+ lm628 commands: LFIL",
        "- lm628 commands: STT",
    }
    assert "% before" in lines[-1]


def test_the_page_shows_every_counted_item_and_quotes_what_could_be_markup() -> None:
    coverage = Coverage(["<run>"], {"lm628": {}})
    coverage.add("lm628", (COMMANDS, "STT"))
    page = as_html(coverage)
    assert "&lt;run&gt;" in page
    assert "<run>" not in page
    assert page.count("<tr") == sum(item.group in COUNTED for item in items("lm628"))
    assert page.count("never<td>") == page.count("<tr") - 1


def test_cobertura_has_the_rate_of_all_of_each_group_and_of_each_item() -> None:
    coverage = Coverage(["run"], {"lm628": {}})
    coverage.add("lm628", (COMMANDS, "STT"), 3)
    coverage.add("lm628", (COMMANDS, "UDF"))
    root = ElementTree.fromstring(as_cobertura(coverage))
    total = sum(item.group in COUNTED for item in items("lm628"))
    assert (root.get("lines-covered"), root.get("lines-valid")) == ("2", str(total))
    assert root.get("line-rate") == f"{2 / total:.4f}"
    rates = {it.get("name"): it.get("line-rate") for it in root.iter("class")}
    commands = sum(item.group == COMMANDS for item in items("lm628"))
    assert rates.pop(COMMANDS) == f"{2 / commands:.4f}"
    assert set(rates.values()) == {"0.0000"}
    items_of = {it.get("name"): it.get("line-rate") for it in root.iter("method")}
    assert (items_of["STT"], items_of["UDF"], items_of["LFIL"]) == ("1.0000", "1.0000", "0.0000")


def test_cobertura_takes_nothing_to_exercise_for_exercised() -> None:
    root = ElementTree.fromstring(as_cobertura(Coverage(["run"], {"acme": {}})))
    [package] = root.iter("package")
    assert (root.get("line-rate"), package.get("line-rate")) == ("1", "1")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (b"{", "neither a journal nor a coverage file"),
        (b'{"format":"x","version":1,"runs":[],"families":{}}', 'its format is "x"'),
        (b'{"format":"vbus coverage","version":9,"runs":[],"families":{}}', "reads up to 1"),
    ],
)
def test_what_is_no_coverage_file_is_refused_with_its_name(text: bytes, says: str) -> None:
    with pytest.raises(VbusError, match=r"^f\.json: .*") as caught:
        from_json(text, "f.json")
    assert says in str(caught.value)


def test_what_the_tables_do_not_have_is_left_out_of_an_old_file() -> None:
    document = json.loads(Coverage(["a"], {"lm628": {(COMMANDS, "STT"): 2}}).to_json())
    document["families"]["lm628"]["groups"]["commands"]["GONE"] = 3
    again = from_json(json.dumps(document).encode(), "f")
    assert again.counts == {"lm628": {(COMMANDS, "STT"): 2}}


def test_a_family_without_tables_counts_nothing_and_says_so() -> None:
    coverage = Coverage(["a"], {"acme": {}})
    assert coverage.percent() == 100.0
    assert "no tables of this family" in as_text(coverage)
