"""The external memory interface of larger AVRs: chips at addresses behind the internal memory."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.avr.conftest import Compile
from tests.avr.test_firmware import CLOCK, Run, run, transcript
from tests.firmware import run_avr
from vbus.board.build import load_board_text
from vbus.core.errors import ConfigError

__all__ = ["run", "transcript"]

MEGA = f"mmcu=atmega2560,{CLOCK}"
BOARD = """\
[board]
time = "slaved"
power_on = "done"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"
[cards.bus]
base = 0x8000
memory = true
decode = "direct"
chips = ["x"]
interrupt = "x.HI"
acknowledge = "either"
acknowledge_at = 0x10
[pinmaps.mega.pins]
PD0 = "bus./INT"
PE2 = "/RST"
[[hosts]]
transport = "unix:$VBUS_RUNTIME/mega.sock"
card = "bus"
pinmap = "mega"
"""
CHIP = """
#define STATUS (*(volatile uint8_t *)0x8000)
#define DATA (*(volatile uint8_t *)0x8001)
#define ACKNOWLEDGE (*(volatile uint8_t *)0x8010)
#define NOBODY (*(volatile uint8_t *)0x9000)
static inline void ready(void) { while (STATUS & 1) ; }
"""
"""The chip as firmware for such a board has it."""


def test_firmware_reads_and_writes_a_chip_on_the_memory_bus(
    run: Run, firmware: Compile, transcript: Callable[[], list[str]]
) -> None:
    """By direct addresses, and by pointers that count up and down (LDS, STS, LD, ST, LDD, STD)."""
    elf = firmware(
        CHIP
        + """int main(void)
        {
            volatile uint8_t *chip = (volatile uint8_t *)0x8000;
            uint8_t bytes[2] = {0x12, 0x34};

            XMCRA = _BV(SRE);
            ready();
            STATUS = 0x1D; /* RSTI */
            ready();
            DATA = bytes[0];
            DATA = bytes[1];
            ready();
            chip[0] = 0x09; /* RDSIGS */
            while (chip[0] & 1)
                ;
            say_hex(chip[1]);
            asm volatile("ldi r26, 1\\n ldi r27, 0x80\\n ld %0, -X"
                         : "=r"(bytes[0]) : : "r26", "r27");
            say_hex(bytes[0]);
            return 0;
        }""",
        "atmega2560",
    )
    assert run(elf, spec=MEGA, board=BOARD) == (0, ["00", "84"])
    cycles = [line.partition(" x")[0] for line in transcript()]
    writes = [line for line in cycles if line.startswith("x w")]
    assert writes == ["x w 0 1D", "x w 1 12", "x w 1 34", "x w 0 09"]
    assert cycles[-2:] == ["x r 1 00", "x r 0 84"]


@pytest.mark.parametrize(
    ("control", "cycles"),
    [("0", 3), ("_BV(SRW10)", 4), ("_BV(SRW11)", 5), ("_BV(SRW11) | _BV(SRW10)", 6),
     ("_BV(SRW11) | _BV(SRL2)", 5), ("_BV(SRW11) | _BV(SRL2) | _BV(SRL0)", 3),
     ("_BV(SRW00) | _BV(SRL2) | _BV(SRL0)", 4)],
)  # fmt: skip
def test_an_access_takes_a_cycle_more_than_internal_memory_and_its_wait_states(
    run: Run, firmware: Compile, control: str, cycles: int
) -> None:
    """The lower sector has SRW0, the upper one, from SRL x 8 KB on, SRW1; 8000H is in either."""
    elf = firmware(
        CHIP
        + f"""int main(void)
        {{
            uint16_t begun, ended;

            XMCRA = _BV(SRE) | {control};
            TCCR1B = _BV(CS10);
            begun = TCNT1;
            (void)STATUS;
            ended = TCNT1;
            begun = ended - begun;
            TCNT1 = 0;
            ended = TCNT1;
            ended = TCNT1 - ended;
            say_hex((uint8_t)(begun - ended));
            return 0;
        }}""",
        "atmega2560",
    )
    assert run(elf, spec=MEGA, board=BOARD) == (0, [f"{cycles:02X}"])


def test_the_cards_interrupt_wakes_the_avr_and_is_acknowledged_on_the_bus(
    run: Run, firmware: Compile
) -> None:
    elf = firmware(
        CHIP
        + """static volatile uint8_t came;
        ISR(INT0_vect) { came++; ACKNOWLEDGE = 0; EIMSK = 0; }

        int main(void)
        {
            XMCRA = _BV(SRE);
            ready();
            STATUS = 0x1D;
            ready();
            DATA = 0;
            DATA = 0;
            ready();
            (void)ACKNOWLEDGE;
            say_hex(PIND & 1);
            EIMSK = _BV(INT0);
            sei();
            PORTE &= ~_BV(PE2);
            DDRE |= _BV(PE2); /* reset, which interrupts when it is over */
            _delay_us(100);
            PORTE |= _BV(PE2);
            _delay_ms(3);
            cli();
            say_hex(came);
            say_hex(PIND & 1); /* the chip's line stands */
            return 0;
        }""",
        "atmega2560",
    )
    assert run(elf, spec=MEGA, board=BOARD) == (0, ["01", "01", "00"])


def told(elf: Path, folder: Path, capfd: pytest.CaptureFixture[str]) -> tuple[int, list[str]]:
    """Run firmware; give its exit code and what stderr says."""
    file = folder / "board.toml"
    file.write_text(BOARD)
    code = run_avr(f"{CLOCK},cycles=32000000,mmcu=" + elf.stem, str(elf), str(file))
    return code, capfd.readouterr().err.splitlines()


def test_an_address_nobody_has_and_a_bus_that_is_off_read_ffh_and_are_named(
    firmware: Compile, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    elf = firmware(
        CHIP
        + """int main(void)
        {
            uint8_t off = STATUS, none;

            NOBODY = off;
            XMCRA = _BV(SRE);
            none = NOBODY;
            NOBODY = 1;
            return (none ^ 0xF0) + (off == 0xFF);
        }""",
        "atmega2560",
    ).rename(tmp_path / "atmega2560.elf")
    code, lines = told(elf, tmp_path, capfd)
    off, none, *_ = [line.rpartition(" ")[0] for line in lines]
    assert code == 0x10
    assert off == (
        "vbus-avr: the external memory interface is off (SRE): address 8000, by the instruction at"
    )
    assert none == (
        "vbus-avr: no chip answers on the external memory bus: address 9000, by the instruction at"
    )


def test_address_lines_given_back_are_those_of_port_c(
    run: Run, firmware: Compile, transcript: Callable[[], list[str]]
) -> None:
    """XMM2:0 = 1 gives A15 back: with PC7 low 8000H is 0000H, which internal memory hides."""
    elf = firmware(
        """int main(void)
        {
            DDRC = 0x80;
            XMCRB = _BV(XMM0);
            XMCRA = _BV(SRE);
            *(volatile uint8_t *)0x8000 = 0x1D;
            return *(volatile uint8_t *)0x8000 & 0x80;
        }""",
        "atmega2560",
    )
    low = BOARD.replace("base = 0x8000", "base = 0x0000")
    assert run(elf, spec=MEGA, board=low) == (0x80, [])
    assert transcript()[0].startswith("x w 0 1D")


def test_a_pin_map_may_wire_nothing_where_the_host_has_a_bus(run: Run, firmware: Compile) -> None:
    elf = firmware(CHIP + "int main(void) { XMCRA = _BV(SRE); return STATUS; }", "atmega1281")
    bare = BOARD.replace('.pins]\nPD0 = "bus./INT"\nPE2 = "/RST"', "]")
    assert run(elf, spec=f"mmcu=atmega1281,{CLOCK}", board=bare) == (0x84, [])


def test_a_part_without_the_interface_is_refused(
    firmware: Compile, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    elf = firmware("int main(void) { return 0; }").rename(tmp_path / "atmega328p.elf")
    code, lines = told(elf, tmp_path, capfd)
    assert (code, lines[0]) == (
        2,
        "vbus-avr: the host has a card, and an atmega328p has no external memory interface;"
        " atmega640, 1280, 1281, 2560 and 2561 have one",
    )


def test_a_card_of_ports_does_not_fit_a_pin_map(run: Run, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="both only if the card is the memory bus"):
        run(tmp_path / "none.elf", spec=MEGA, board=BOARD.replace("memory = true\n", ""))
    both = BOARD.replace('PE2 = "/RST"', 'PE2 = "/RD"')
    with pytest.raises(ConfigError, match="or leave out all of its bus: a card reaches it, too"):
        run(tmp_path / "none.elf", spec=MEGA, board=both)


BY_HAND = BOARD.replace(
    'PE2 = "/RST"\n',
    "".join(f'PA{bit} = "D{bit}"\n' for bit in range(8))
    + 'PC0 = "/PS"\nPC7 = "!/CS"\nPG0 = "/WR"\nPG1 = "/RD"\n',
)
"""The ports that are the memory interface are wired to the chip as port bits, too."""


def test_port_bits_are_the_bus_before_and_after_the_interface_is_on(
    run: Run, firmware: Compile, transcript: Callable[[], list[str]]
) -> None:
    """While SRE is set ports A, C and G are the interface: what is written to them waits."""
    elf = firmware(
        CHIP
        + """static uint8_t by_hand(void)
        {
            uint8_t data;

            PORTC = 0x80;
            PORTG = 0x01; /* /RD */
            data = PINA;
            PORTG = 0x03;
            PORTC = 0;
            return data;
        }
        int main(void)
        {
            PORTG = 0x03;
            DDRG = 0x03;
            DDRC = 0xFF;
            say_hex(by_hand());
            XMCRA = _BV(SRE);
            say_hex(STATUS);
            PORTC = 0x80;
            DDRA = 0xFF;
            PORTA = 0x1D;
            PORTG = 0x02; /* /WR: no cycle, the pins are not those of port G */
            PORTG = 0x03;
            say_hex(STATUS);
            DDRA = 0;
            PORTC = 0;
            XMCRA = 0;
            say_hex(by_hand());
            return 0;
        }""",
        "atmega2560",
    )
    assert run(elf, spec=MEGA, board=BY_HAND) == (0, ["84", "84", "84", "84"])
    assert [line.partition(" x")[0] for line in transcript()] in (["x r 0 84"], ["x r 0 84"] * 4)


def test_a_chip_on_the_card_is_wired_by_port_bits_wholly_or_not_at_all() -> None:
    text = BY_HAND.replace('PG0 = "/WR"\n', "")
    with pytest.raises(ConfigError) as told:
        load_board_text(text)
    assert (
        'pinmaps.mega: "x" cannot be reached: /WR is not wired; wire each to a port bit, or tie it'
        ' with "low" or "high", or leave out all of its bus: a card reaches it, too'
    ) in str(told.value)
