"""Campaigns of the examples and of the clients, and the silent outcomes that are known of each.

``python -m tests.examples.campaigns 100 [NAME ...]`` runs so many worlds of each and writes its
baseline, ``baselines/NAME.json``: group and way of each silent outcome, with the first reason.
Which of them no host can notice, and why, is in docs/campaign.md.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Final, NamedTuple

from tests.examples.boards import EXAMPLES, as_installed, vbus

HERE: Final = Path(__file__).parent
BASELINES: Final = HERE / "baselines"


class Example(NamedTuple):
    """What a campaign runs.

    Attributes:
        place: the example's folder.
        compiling: what compiles it there, into ``$OUT``.
        options: of ``vbus campaign``.
        host: the program, for a shell, which has ``$OUT`` too.
        board: the board file.
        needs: programs without which it cannot be compiled.
    """

    place: str
    compiling: str
    options: tuple[str, ...] = ()
    host: str = "$OUT"
    board: str = "board.toml"
    needs: str = "g++"


SAYS_SO: Final = ("--failed", "failed")
"""Firmware without an exit code."""
LM629: Final = "../lm629_c/lm629_driver.c"
AVR: Final = "avr-gcc -mmcu={} -DF_CPU={}UL -Os -std=gnu99 -I../lm629_c -o $OUT main.c {} " + LM629
TWO_AXES: Final = "cc -O2 -I../lm629_c -o $OUT main.c {} " + LM629
PORTIO: Final = "cc -I../lm629_portio -o $OUT {} axis.c ../lm629_portio/lm629_card.c -lpthread"
LINK: Final = "$OUT $VBUS_LINK"
"""The C client's examples take the link as an argument."""
EXAMPLES_RUN: Final = {
    "lm629_c": Example("lm629_c", "cc -o $OUT $($VBUS cflags) main.c lm629_driver.c", host=LINK),
    "lm629_portio": Example("lm629_portio", "cc -O2 -o $OUT main.c lm629_card.c"),
    "lm629_interrupts": Example("lm629_interrupts", PORTIO.format("thread.c")),
    "lm629_signal": Example("lm629_interrupts", PORTIO.format("signal.c"), board="signal.toml"),
    "lm629_timer": Example("lm629_interrupts", PORTIO.format("timer.c")),
    "lm629_avr_bitbang": Example(
        "lm629_avr_bitbang",
        "g++ $($VBUS cflags --shim avr) -DF_CPU=16000000UL -I../lm629_c -o $OUT main.c lm629_bus.c "
        + LM629,
    ),
    "lm629_avr_elf": Example(
        "lm629_avr_bitbang", AVR.format("atmega328p", 16000000, "lm629_bus.c"),
        ("--avr", "mmcu=atmega328p,f=16000000"), needs="avr-gcc",
    ),
    "lm629_arduino": Example(
        "lm629_arduino", "sh build.sh $OUT",
        ("--avr", "mmcu=atmega328p,f=16000000,until=done", *SAYS_SO), needs="avr-g++",
    ),
    "lm629_expander": Example(
        "lm629_expander",
        "g++ -DVBUS_INT_IS_32_BITS $($VBUS cflags --shim arduino) -o $OUT"
        " -x c++ -include Arduino.h Reset/Reset.ino",
        SAYS_SO, "VBUS_UNTIL=done $OUT",
    ),
    "lm629_stm32": Example(
        "lm629_stm32",
        "g++ $($VBUS cflags --shim stm32) -I../lm629_c -o $OUT main.c stdperiph.c " + LM629,
    ),
    "lm629_pic": Example("lm629_pic", "g++ $($VBUS cflags --shim ccs) -o $OUT ccs.c", SAYS_SO),
    "lm629_pic_c18": Example(
        "lm629_pic", "g++ $($VBUS cflags --shim c18) -D_XTAL_FREQ=20000000UL -o $OUT c18.c",
        SAYS_SO,
    ),
    "two_axes_wired": Example(
        "lm629_two_axes", TWO_AXES.format("wired_card.c"), board="wired_card.toml"
    ),
    "two_axes_indexed": Example(
        "lm629_two_axes", TWO_AXES.format("indexed_card.c"), board="indexed_card.toml"
    ),
    "two_axes_ppi": Example("lm629_two_axes", TWO_AXES.format("ppi_card.c"), board="ppi_card.toml"),
    "two_axes_ports": Example(
        "lm629_two_axes", AVR.format("atmega328p", 16000000, "avr_ports.c"),
        ("--avr", "mmcu=atmega328p,f=16000000"), board="avr_ports.toml", needs="avr-gcc",
    ),
    "two_axes_xmem": Example(
        "lm629_two_axes", AVR.format("atmega2560", 14745600, "avr_xmem.c"),
        ("--avr", "mmcu=atmega2560,f=14745600"), board="avr_xmem.toml", needs="avr-gcc",
    ),
    "two_axes_gpio_xmem": Example(
        "lm629_two_axes", AVR.format("atmega2560", 14745600, "avr_gpio_xmem.c"),
        ("--avr", "mmcu=atmega2560,f=14745600"), board="avr_gpio_xmem.toml", needs="avr-gcc",
    ),
    "lm629_vme_68000": Example(
        "lm629_vme_68000",
        "m68k-linux-gnu-gcc -m68000 -Os -ffreestanding -nostdlib -static -fno-pic"
        " -fno-stack-protector -Wl,--build-id=none -T vme.ld -o $OUT start.S main.c",
        ("--cpu", "68000", *SAYS_SO), needs="m68k-linux-gnu-gcc",
    ),
    "stm32_lm629_mcp1200": Example(
        "stm32_lm629_mcp1200",
        "arm-none-eabi-gcc -mcpu=cortex-m3 -mthumb -Os -ffreestanding -nostdlib -T stm32f103.ld"
        " -I../lm629_c -I../mcp1200_c -o $OUT main.c startup.c " + LM629
        + " ../mcp1200_c/mcp1200_driver.c -lgcc",
        ("--cpu", "cortex-m3", *SAYS_SO), needs="arm-none-eabi-gcc",
    ),
    "mcp1200_c": Example(
        "mcp1200_c", "cc -o $OUT $($VBUS cflags) main.c mcp1200_driver.c", host=LINK
    ),
    "mcp1200_mmio": Example(
        "mcp1200_mmio", "cc -O2 -I../mcp1200_c -o $OUT main.c ../mcp1200_c/mcp1200_driver.c"
    ),
    "mcp1200_vme": Example(
        "mcp1200_mmio", "cc -O2 -I../mcp1200_c -o $OUT vme_card.c ../mcp1200_c/mcp1200_driver.c",
        board="vme_card.toml",
    ),
    "mc1241a_isa_c": Example(
        "mc1241a_isa_c", "cc -o $OUT $($VBUS cflags --shim linux-io) main.c mc1241a_driver.c"
    ),
    "mc1241a_isa_interrupt": Example(
        "mc1241a_isa_interrupt",
        "cc -O2 -I../mc1241a_isa_c -o $OUT main.c ../mc1241a_isa_c/mc1241a_driver.c",
    ),
    "mc1241a_wired": Example(
        "mc1241a_isa_interrupt",
        "cc -O2 -I../mc1241a_isa_c -o $OUT main.c ../mc1241a_isa_c/mc1241a_driver.c",
        board="stepper_card.toml",
    ),
    "mc1241a_dos": Example(
        "mc1241a_dos", "nasm -f bin -o $OUT move.asm", ("--cpu", "8086"), needs="nasm"
    ),
}  # fmt: skip
CLIENTS: Final = {
    "lm629": "LM629N-8", "lm629_asyncio": "LM629N-8", "mcp1200": "MCP-1200", "mc1241a": "MC1241A",
}  # fmt: skip
"""By function of campaign_hosts.py: the part that its client is for."""
NAMES: Final = (*EXAMPLES_RUN, *CLIENTS)
SLOW: Final = {
    "lm629_expander", "lm629_stm32", "two_axes_indexed", "two_axes_ppi",
    "two_axes_gpio_xmem", "mc1241a_isa_c", "mc1241a_wired", "stm32_lm629_mcp1200",
}  # fmt: skip
"""Some seconds for each world: most of their baselines are of twelve, and no test of CI."""
BOARD: Final = '[board]\ntime = "lockstep"\npower_on = "done"\n[chips.x]\npart = "{}"\n'
PLANTS: Final = {
    "MC1241A": 'clock = "25 MHz"\nplants = ["m", "n"]\n[plants.m]\nmodel = "stepper"\n'
    '[plants.n]\nmodel = "stepper"\n',
}
PLANT: Final = 'clock = "8 MHz"\nplant = "m"\n[plants.m]\nmodel = "dc_motor"\n'
EXPLAINED: Final = (
    (
        r"cycle \w+ (LFIL|LTRJ|MSKI) \d+ of \d+ \(write\).*",
        "No command of an LM629 reads coefficients, rates, targets not yet taken or masks.",
    ),
    (
        r"cycle \w+ UDF \(write\).*",
        "No command reads the coefficients in use; a RESET in its place is told by flags alone.",
    ),
    (r"cycle \w+ RSTI .* lost", "HI stands until the next RSTI: one more service, no harm."),
    (
        r"cycle \w+ write (MODE|FLAG) .*",
        "What acts when an MCP-1200 is written does not read back.",
    ),
    (
        r"cycle \w+ read (FLAG|PHASE|STATUS) .*",
        "A byte that is polled or shown is one read: only the next poll could tell.",
    ),
    (
        r"fault \w+ \S+( for a while| in move \d+)? (encoder|mechanics)",
        "The count, and an index that this host does not use, are all a chip has of the shaft.",
    ),
    (
        r"specimen \S+ specimen|phase .*|cycle .* busy|fault clock_off \S+ chip",
        "Right by the manual: it prints a byte of a reset, how long busy took, or where its motor"
        " has come to rest.",
    ),
)
"""By pattern of dimension, group and way: why a silent outcome of a baseline passes every host."""


def words_of(name: str, folder: Path) -> list[str]:
    """Return the words of ``vbus campaign`` for an example, compiled now, or for a client."""
    board, program = folder / "board.toml", folder / "program"
    if name in CLIENTS:
        board.write_text(BOARD.format(CLIENTS[name]) + PLANTS.get(CLIENTS[name], PLANT))
        return ["--board", str(board), "--host", f"{HERE / 'campaign_hosts.py'}:{name}"]
    example = EXAMPLES_RUN[name]
    place = EXAMPLES / example.place
    board.write_text((place / example.board).read_text().replace('"realtime"', '"lockstep"'))
    environment = as_installed() | {"OUT": str(program), "VBUS": f"{sys.executable} -m vbus"}
    subprocess.run(
        example.compiling, shell=True, cwd=place, env=environment, check=True, capture_output=True
    )
    host = example.host.replace("$OUT", str(program))
    words = [host] if host == str(program) else ["sh", "-c", host]
    return ["--board", str(board), *example.options, "--", *words]


def campaign(
    name: str, folder: Path, worlds: int, *options: str
) -> subprocess.CompletedProcess[str]:
    """Run a campaign of so many worlds; return what it printed."""
    command = vbus("campaign", "--worlds", str(worlds), "--all", *options, *words_of(name, folder))
    return subprocess.run(command, cwd=folder, env=as_installed(), capture_output=True, text=True)


def main(worlds: int, *names: str) -> None:
    """Write baselines anew."""
    for name in names or NAMES:
        with tempfile.TemporaryDirectory() as folder:
            found = Path(folder) / "found.json"
            done = campaign(name, Path(folder), worlds, "--json", str(found))
            print(f"# {name}\n{done.stdout}{done.stderr}", flush=True)
            keys = json.loads(found.read_text())["keys"]
        rows = ",\n".join(json.dumps(key) for key in keys)
        (BASELINES / f"{name}.json").write_text(f'{{"keys": [\n{rows}\n]}}\n')


if __name__ == "__main__":
    main(int(sys.argv[1]), *sys.argv[2:])
