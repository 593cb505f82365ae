"""AVR firmware against chips: what real firmware does, and how a run ends."""

import os
import socket
import subprocess
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.avr.conftest import EXAMPLES, Compile, compile_avr
from tests.e2e.command import start
from tests.firmware import run_avr
from tests.shims.conftest import compile_for
from tests.waiting import until
from vbus.cli.run import exec as exec_module
from vbus.cli.run.firmware import parse, simulator
from vbus.core.errors import ConfigError, ProgramError
from vbus.serve.registry import running

BOARD = EXAMPLES / "lm629_avr_bitbang" / "board.toml"
CLOCK = "f=16000000"
UNO = f"mmcu=atmega328p,{CLOCK}"

Run = Callable[..., tuple[int, list[str]]]


@pytest.fixture
def run(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> Run:
    """Run firmware; gives its exit code and the words it has sent."""

    def run(
        elf: Path, more: str = "", board: str | None = None, spec: str = UNO
    ) -> tuple[int, list[str]]:
        file = tmp_path / "board.toml"
        file.write_text(BOARD.read_text() if board is None else board)
        if "cycles" not in more:
            more += ",cycles=32000000"  # two seconds: nothing here takes longer
        code = run_avr(f"{spec},{more}", str(elf), str(file), transcript=str(tmp_path / "bus.txt"))
        return code, capfd.readouterr().out.split()

    return run


def board(*changes: tuple[str, str]) -> str:
    text = BOARD.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return text


@pytest.fixture
def transcript(tmp_path: Path) -> Callable[[], list[str]]:
    return lambda: (tmp_path / "bus.txt").read_text().splitlines()


def test_a_port_for_gdb_that_cannot_be_had_is_named(
    run: Run, firmware: Compile, capfd: pytest.CaptureFixture[str]
) -> None:
    elf = firmware("int main(void) { return 0; }")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        code = run_avr(f"{UNO},gdb={port}", str(elf), str(BOARD))
        told = capfd.readouterr().err
    assert code == 2
    assert f"gdb cannot be waited for at port {port}: Address already in use; end the" in told
    assert run(elf, "gdb=70000")[0] == 2


# -- what firmware does ----------------------------------------------------------------------------


def test_endless_status_polling_sees_busy_fall_after_its_time(
    run: Run, firmware: Compile, transcript: Callable[[], list[str]]
) -> None:
    code, _ = run(
        firmware(
            """int main(void)
            {
                lm629_bus_init();
                lm629_bus_write_command(0x1D);
                while (lm629_bus_read_status() & LM629_BUSY)
                    ;
                lm629_bus_write_data(0);
                while (lm629_bus_read_status() & LM629_BUSY) /* between the bytes of a word */
                    ;
                lm629_bus_write_data(0);
                while (lm629_bus_read_status() & LM629_BUSY)
                    ;
                return 7;
            }"""
        )
    )
    assert code == 7
    # 120 clock periods of 125 ns are 15 us; a poll takes about 2 us. Within a word busy is low.
    lines = transcript()
    polls = [int(line.partition(" x")[2][-1]) for line in lines if " x" in line]
    assert [line.partition(" x")[0] for line in lines] == [
        "x w 0 1D", "x r 0 85", "x r 0 84", "x w 1 00", "x r 0 84", "x w 1 00", "x r 0 85",
        "x r 0 80",
    ]  # fmt: skip
    assert len(polls) == 2
    assert all(5 <= count <= 9 for count in polls)


@pytest.mark.parametrize(("microseconds", "status"), [(30, "84"), (5, "85")])
def test_a_calibrated_delay_takes_the_chips_time_too(
    run: Run, firmware: Compile, microseconds: int, status: str
) -> None:
    code, said = run(
        firmware(
            f"""int main(void)
            {{
                lm629_bus_init();
                lm629_bus_write_command(0x1D);
                _delay_us({microseconds});
                say_hex(lm629_bus_read_status());
                return 0;
            }}"""
        )
    )
    assert (code, said) == (0, [status])


def test_a_reset_loop_retries_until_the_chip_comes_up(run: Run, firmware: Compile) -> None:
    elf = firmware(
        """int main(void)
        {
            uint8_t tries = 0, status;
            do {
                lm629_bus_init();
                status = lm629_bus_read_status();
                tries++;
            } while (status != 0x84 && status != 0xC4);
            say_hex(tries);
            return 0;
        }"""
    )
    assert run(elf) == (0, ["01"])
    failing = board(('clock = "8 MHz"', 'clock = "8 MHz"\nreset_fail = 3'))
    # The reset at power-on is the first that fails.
    assert run(elf, board=failing) == (0, ["03"])


def test_a_strobe_that_floats_at_reset_is_no_cycle(
    run: Run, firmware: Compile, transcript: Callable[[], list[str]]
) -> None:
    run(
        firmware(
            """int main(void)
            {
                DDRC = _BV(PC0);      /* /CS driven low, strobes still inputs */
                _delay_us(10);
                PORTC = 0x1F;
                DDRC = 0x1F;
                return 0;
            }"""
        )
    )
    assert transcript() == []


def test_one_bit_toggled_through_pin_is_one_bit(
    run: Run, firmware: Compile, transcript: Callable[[], list[str]]
) -> None:
    run(
        firmware(
            """int main(void)
            {
                lm629_bus_init();
                PORTC &= (uint8_t)~(_BV(PC0) | _BV(PC1));
                PINC |= _BV(PC2);     /* SBI: /RD falls */
                PINC = _BV(PC2);      /* OUT: /RD rises */
                return 0;
            }"""
        )
    )
    assert transcript() == ["x r 0 84"]


TWO = (
    ("[plants.motor]", '[chips.y]\npart = "LM629N-8"\nclock = "8 MHz"\nplant = "none"\n'
     '[buses.main]\nchips = ["x", "y"]\n[plants.motor]'),
    ('PC0 = "/CS"', 'PC0 = "x./CS"\nPC5 = "y./CS"'),
)  # fmt: skip


def test_two_chips_are_written_by_one_strobe(
    run: Run, firmware: Compile, transcript: Callable[[], list[str]]
) -> None:
    _, said = run(
        firmware(
            """int main(void)
            {
                PORTC |= _BV(PC5);
                DDRC |= _BV(PC5);
                lm629_bus_init();
                PORTC &= (uint8_t)~_BV(PC5);
                lm629_bus_write_command(0x1D);
                PORTC |= _BV(PC5);
                _delay_us(30);
                PORTC &= (uint8_t)~_BV(PC5);
                lm629_bus_write_data(0);
                lm629_bus_write_data(0);
                PORTC |= _BV(PC5);
                _delay_us(30);
                say_hex(lm629_bus_read_status());
                return 0;
            }"""
        ),
        board=board(*TWO),
    )
    assert said == ["80"]
    assert transcript()[0] == "x+y w 0 1D"


INTERRUPT = ('PC4 = "/RST"', 'PC4 = "/RST"\nPB2 = "HI"')
SLEEPER = """
static volatile uint8_t seen;
ISR(PCINT0_vect)
{
    seen = PINB & _BV(PB2) ? 1 : seen;
}

int main(void)
{
    struct lm629_filter filter = { 200, 200, 2000, 20000, 0 };
    struct lm629_move move = { 400, 167772, 2150 };
    uint8_t first, cleared;

    lm629_bus_init();
    PCMSK0 = _BV(PCINT2);
    PCICR = _BV(PCIE0);
    lm629_check_reset(&first, &cleared);
    lm629_load_filter(&filter);
    while (lm629_bus_read_status() & LM629_BUSY)
        ;
    lm629_bus_write_command(0x1C);          /* MSKI: trajectory complete */
    while (lm629_bus_read_status() & LM629_BUSY)
        ;
    lm629_bus_write_data(0);
    lm629_bus_write_data(0x04);
    lm629_clear_flags(0x7E);
    lm629_start(&move);
    set_sleep_mode(SLEEP_MODE_IDLE);
    sei();
    while (!seen)
        sleep_mode();
    cli();
    say_hex(lm629_bus_read_status());
    return 0;
}
"""


def test_an_interrupt_line_wakes_the_avr_and_polls_nothing(
    run: Run, firmware: Compile, transcript: Callable[[], list[str]]
) -> None:
    code, said = run(firmware(SLEEPER), board=board(INTERRUPT))

    assert (code, said) == (0, ["04"])
    started = transcript().index("x w 0 01")
    assert transcript()[started + 1 :] == ["x r 0 04"]


def test_every_run_is_the_same(
    run: Run, firmware: Compile, transcript: Callable[[], list[str]]
) -> None:
    elf = firmware(SLEEPER)
    run(elf, board=board(INTERRUPT))
    first = transcript()
    run(elf, board=board(INTERRUPT))

    assert transcript() == first
    assert len(first) > 60


@pytest.mark.parametrize("changes", [(), INTERRUPT], ids=["plain", "interrupt"])
def test_read_leases_change_nothing_but_the_speed(
    run: Run,
    firmware: Compile,
    transcript: Callable[[], list[str]],
    monkeypatch: pytest.MonkeyPatch,
    changes: tuple[str, str],
) -> None:
    body = SLEEPER if changes else SLEEPER.replace("while (!seen)\n        sleep_mode();", "")
    elf = firmware(body.replace("while (lm629", "for (uint8_t n = 0; n < 99; n++) ; while (lm629"))
    text = board(changes) if changes else None
    with_leases = run(elf, board=text), transcript()
    monkeypatch.setenv("VBUS_LEASES", "0")

    assert (run(elf, board=text), transcript()) == with_leases
    assert len(with_leases[1]) > 60


@pytest.mark.parametrize("enabled", ["before", "while"])
def test_an_interrupt_of_a_low_level_comes_as_long_as_its_pin_is_low(
    run: Run, firmware: Compile, enabled: str
) -> None:
    source = """
    static volatile uint8_t came;
    ISR(INT0_vect)
    {
        if (++came % 3 == 0)
            PORTD |= _BV(PD2);
    }

    int main(void)
    {
        PORTD = _BV(PD2);
        DDRD = _BV(PD2);
        sei();
        EIMSK = before;
        PORTD = 0;
        _delay_us(10);
        EIMSK = _BV(INT0);
        _delay_us(10);
        PORTD = 0;
        _delay_us(10);
        EIMSK = 0;
        PORTD = _BV(PD2);
        PORTD = 0;
        _delay_us(10);
        cli();
        return came;
    }"""
    source = source.replace("before", "_BV(INT0)" if enabled == "before" else "0")

    assert run(firmware(source)) == (6, [])


@pytest.mark.parametrize("mmcu", ["atmega1281", "atmega2560"])
def test_other_parts_and_other_ports(
    run: Run, firmware: Compile, transcript: Callable[[], list[str]], mmcu: str
) -> None:
    data = "\n".join(f'PF{bit} = "D{bit}"' for bit in range(8))
    if mmcu == "atmega2560":
        data = data.replace("PF", "PL")  # beyond the reach of IN and OUT
    text = BOARD.read_text()
    head, tail = text[: text.index("PB0 =")], text[text.index("PC0 =") :]
    port = "L" if mmcu == "atmega2560" else "F"
    code, said = run(
        firmware(
            f"""int main(void)
            {{
                uint8_t status;
                PORTC = 0x1F;
                DDRC = 0x1F;
                _delay_ms(2);
                PORTC &= ~0x07;
                status = PIN{port};
                PORTC |= 0x07;
                say_hex(status);
                return 0;
            }}""",
            mmcu,
        ),
        board=head + data + "\n" + tail,
        spec=f"mmcu={mmcu},{CLOCK}",
    )
    assert (code, said) == (0, ["84"])
    assert transcript() == ["x r 0 84"]


def test_violations_are_told_at_the_end(
    firmware: Compile, capfd: pytest.CaptureFixture[str]
) -> None:
    elf = firmware(
        """int main(void)
        {
            lm629_bus_init();
            lm629_bus_write_command(0x1D);
            lm629_bus_write_data(0);        /* busy */
            return 0;
        }"""
    )
    assert run_avr(UNO, str(elf), str(BOARD)) == 0
    assert "error: x: lm628.busy-write" in capfd.readouterr().err


# -- how a run ends --------------------------------------------------------------------------------

COUNTING = """int main(void)
{
    uint8_t count;
    DDRB |= _BV(PB5);
    for (count = 0;; count++) {
        say("count ");
        say_hex(count);
        if (count == 5)
            PORTB |= _BV(PB5);
    }
}"""


def test_it_ends_at_a_cycle_limit(run: Run, firmware: Compile) -> None:
    code, said = run(firmware(COUNTING), "cycles=160000")
    assert code == 0
    assert 4 < len(said) <= 20


@pytest.mark.parametrize("wait", ["", "sleep_mode();"], ids=["spins", "sleeps"])
def test_a_limit_ends_firmware_that_waits_without_a_bus_cycle(
    firmware: Compile, tmp_path: Path, capfd: pytest.CaptureFixture[str], wait: str
) -> None:
    elf = firmware(
        """#include <avr/interrupt.h>
        #include <avr/sleep.h>
        int main(void)
        {
            volatile unsigned char arrived = 0;

            lm629_bus_init();
            sei();
            while (!arrived) {
                WAIT
            }
            return 0;
        }""".replace("WAIT", wait)
    )
    (tmp_path / "board.toml").write_text(BOARD.read_text())
    line = ["--board", str(tmp_path / "board.toml"), "--limit", "300 ms", "--avr", UNO, str(elf)]
    assert exec_command(line) == 137
    sentence = "vbus: the program hangs: it was not done after 0.3 s of chip time\n"
    assert capfd.readouterr().err.startswith(sentence)


def test_it_ends_at_words_on_the_uart(run: Run, firmware: Compile) -> None:
    code, said = run(firmware(COUNTING), "until=count 03")
    assert (code, said[-2:]) == (0, ["count", "03"])


def test_words_that_do_not_come_are_a_failure(
    firmware: Compile, capfd: pytest.CaptureFixture[str]
) -> None:
    elf = firmware(COUNTING)
    assert run_avr(f"{UNO},cycles=160000,until=hello", str(elf), str(BOARD)) == 1
    assert "vbus-avr: hello did not come within 160000 cycles\n" in capfd.readouterr().err


def test_it_ends_when_a_pin_is_driven(run: Run, firmware: Compile) -> None:
    code, said = run(firmware(COUNTING), "pin=PB5=1")
    assert code == 0
    assert "05" in said
    assert "07" not in said


def test_firmware_that_ends_before_its_words_is_a_failure(
    firmware: Compile, capfd: pytest.CaptureFixture[str]
) -> None:
    elf = firmware("int main(void) { return 0; }")
    assert run_avr(f"{UNO},until=hello", str(elf), str(BOARD)) == 1
    assert "the firmware has ended before hello came" in capfd.readouterr().err


def test_the_uart_is_a_terminal_if_asked_for(firmware: Compile, tmp_path: Path) -> None:
    elf = firmware(
        """int main(void)
        {
            uint8_t byte;
            UCSR0B = _BV(TXEN0) | _BV(RXEN0);
            do {
                while (!(UCSR0A & _BV(RXC0)))
                    ;
                byte = UDR0;
                while (!(UCSR0A & _BV(UDRE0)))
                    ;
                UDR0 = byte + 1;
            } while (byte != 'x');
            _delay_ms(5);
            return 0;
        }"""
    )
    link = tmp_path / "uart"
    got: list[bytes] = []

    def talk() -> None:
        while not link.exists():
            time.sleep(0.01)
        terminal = os.open(link, os.O_RDWR | os.O_NOCTTY)
        os.write(terminal, b"HAL")
        while len(b"".join(got)) < 3:
            got.append(os.read(terminal, 10))
        os.write(terminal, b"x")
        os.close(terminal)

    talker = threading.Thread(target=talk)
    talker.start()
    assert run_avr(f"{UNO},pty={link},pace", str(elf), str(BOARD)) == 0
    talker.join()
    assert b"".join(got) == b"IBM"
    assert not link.is_symlink()


def test_a_board_that_dies_ends_the_run(
    firmware: Compile,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    elf = firmware(
        """int main(void)
        {
            lm629_bus_init();
            say("up\\n");
            for (;;) {
                lm629_bus_read_status();
                lm629_bus_write_data(0);
            }
        }"""
    )
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path / "run"))
    board = start("run", BOARD)
    assert board.stdout is not None
    while not board.stdout.readline().startswith("ready"):
        pass

    def kill() -> None:
        try:
            until(lambda: any(one["chips"][0]["writes"] for one in running()), "a write")
        finally:
            board.kill()

    killer = threading.Thread(target=kill)
    killer.start()
    assert run_avr(UNO, str(elf), link=f"unix:{tmp_path}/run/lm629_avr_bitbang.sock") == 4
    killer.join()
    board.communicate()
    assert "vbus-avr: the board is lost: the board has closed the link" in capfd.readouterr().err


def test_firmware_killed_in_the_middle_of_a_packet_leaves_a_board_for_the_next(
    firmware: Compile,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    half = firmware(
        """int main(void)
        {
            lm629_bus_init();
            _delay_ms(300);
            lm629_bus_write_command(0x1E);          /* LFIL, and half a word */
            while (lm629_bus_read_status() & LM629_BUSY)
                ;
            PORTB = 0;
            DDRB = 3;
            PORTC &= (uint8_t)~(_BV(PC0) | _BV(PC3)); /* /CS and /WR are low, and stay so */
            say("half\\n");
            for (;;)
                lm629_bus_read_status();
        }"""
    ).rename(tmp_path / "half.elf")
    # What the pins last said as they were let go may be half a packet: drivers reset the chip.
    reset = "lm629_bus_write_command(0); _delay_ms(3);"
    whole = firmware(SETTLES.replace("_delay_ms(3);", f"_delay_ms(3); {reset} {reset}", 1))
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path / "run"))
    where = f"unix:{tmp_path}/run/lm629_avr_bitbang.sock"
    board = start("run", BOARD)
    try:
        assert board.stdout is not None
        while not board.stdout.readline().startswith("ready"):
            pass
        command = [str(simulator()), "--link", where, "--mmcu", "atmega328p"]
        first = subprocess.Popen(
            [*command, "--frequency", "16000000", str(half)], stdout=subprocess.PIPE, text=True
        )
        assert first.stdout is not None
        assert first.stdout.readline() == "half\n"
        first.kill()
        first.communicate()

        for _ in range(2):
            assert run_avr(f"{UNO},cycles=32000000", str(whole), link=where) == 0
            assert capfd.readouterr().out.split() == ["84", "85", "84"]
    finally:
        board.kill()
        board.communicate()


SETTLES = """int main(void)
{
    lm629_bus_init();
    _delay_ms(3);
    say_hex(lm629_bus_read_status());
    lm629_bus_write_command(0x1D);
    _delay_us(5);
    say_hex(lm629_bus_read_status());
    _delay_us(30);                          /* on the firmware's own clock */
    say_hex(lm629_bus_read_status());
    return 0;
}
"""


def test_a_part_without_a_port_of_the_pin_map_is_refused(
    tmp_path: Path, firmware: Compile, capfd: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "board.toml"
    file.write_text(board(("PC4 =", "PL4 =")))
    elf = firmware("int main(void) { return 0; }")
    assert run_avr(UNO, str(elf), str(file)) == 2
    assert "the pin map uses port L, and an atmega328p has none" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"slaved"', '"lockstep"', r'chip time must follow the AVR, and this board is lockstep;'
         r' write time = "slaved" in \[board\]'),
        ("[[hosts]]", "[pinmaps.b.pins]\n[[hosts]]", "it wires nothing"),
    ],
)  # fmt: skip
def test_a_board_that_does_not_fit_is_refused(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    file = tmp_path / "board.toml"
    file.write_text(board((old, new)))
    with pytest.raises(ConfigError, match=message):
        run_avr(UNO, "none.elf", str(file))


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        (
            "mcu=atmega328p",
            'unknown key "mcu"; did you mean "mmcu"\\? allowed are mmcu, f, cycles,',
        ),
        ("mmcu", 'mmcu" needs a value: mmcu=...'),
        ("stats=1", '"stats" has no value'),
    ],
)
def test_a_wrong_specification_is_refused(spec: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        parse(spec)


def test_a_comma_in_a_value_has_a_backslash() -> None:
    assert parse(r"until=one\, two,stats") == ["--until", "one, two", "--stats"]


def test_something_else_than_firmware_is_refused(tmp_path: Path) -> None:
    (tmp_path / "main.elf").write_text("no program")
    with pytest.raises(ProgramError, match="is no AVR firmware"):
        run_avr(UNO, str(tmp_path / "main.elf"), str(BOARD))


def test_the_example_gives_what_it_says(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    folder = EXAMPLES / "lm629_avr_bitbang"
    sources = [folder / "main.c", folder / "lm629_bus.c", EXAMPLES / "lm629_c" / "lm629_driver.c"]
    elf = compile_avr(tmp_path / "move.elf", *sources)

    assert run_avr(UNO, str(elf), str(BOARD)) == 0
    assert capfd.readouterr().out == (folder / "expected.txt").read_text()


def bus_of(path: Path) -> list[str]:
    """Return a transcript without how often an unchanged status was polled."""
    return [line.partition(" x")[0] for line in path.read_text().splitlines()]


def test_the_example_runs_the_same_bus_cycles_in_simavr_and_through_the_shim(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    folder = EXAMPLES / "lm629_avr_bitbang"
    sources = [folder / "main.c", folder / "lm629_bus.c", EXAMPLES / "lm629_c" / "lm629_driver.c"]
    elf = compile_avr(tmp_path / "move.elf", *sources)
    program = compile_for(
        "avr", tmp_path / "move", "-DF_CPU=16000000UL", f"-I{EXAMPLES / 'lm629_c'}", *sources
    )
    avr, shim = tmp_path / "avr.txt", tmp_path / "shim.txt"

    assert run_avr(UNO, str(elf), str(BOARD), transcript=str(avr)) == 0
    said = capfd.readouterr().out
    assert exec_command(["--board", str(BOARD), "--transcript", str(shim), str(program)]) == 0

    assert capfd.readouterr().out == said
    assert bus_of(shim) == bus_of(avr)
    assert len(bus_of(avr)) > 150


def exec_command(arguments: list[str]) -> int:
    code: int = exec_module.command.main(arguments, standalone_mode=False)
    return code
