"""Campaigns of the examples and of the clients, and the silent outcomes that are known of each.

``python -m tests.examples.campaigns 100 [NAME ...]`` runs so many worlds of each and writes its
baseline, ``baselines/NAME.json``: group and way of each silent outcome. What is silent there, and
why no host can notice it, is in docs/campaign.md.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Final

from tests.examples.boards import EXAMPLES, vbus

HERE: Final = Path(__file__).parent
BASELINES: Final = HERE / "baselines"
COMPILED: Final = {
    "lm629_c": "cc -o $OUT $($VBUS cflags) main.c lm629_driver.c",
    "lm629_portio": "cc -O2 -o $OUT main.c lm629_card.c",
    "lm629_interrupts": "cc -I../lm629_portio -o $OUT thread.c axis.c"
    " ../lm629_portio/lm629_card.c -lpthread",
    "lm629_avr_bitbang": "g++ $($VBUS cflags --shim avr) -DF_CPU=16000000UL -I../lm629_c -o $OUT"
    " main.c lm629_bus.c ../lm629_c/lm629_driver.c",
    "lm629_pic": "g++ $($VBUS cflags --shim ccs) -o $OUT ccs.c",
    "lm629_vme_68000": "m68k-linux-gnu-gcc -m68000 -Os -ffreestanding -nostdlib -static -fno-pic"
    " -fno-stack-protector -Wl,--build-id=none -T vme.ld -o $OUT start.S main.c",
    "mcp1200_c": "cc -o $OUT $($VBUS cflags) main.c mcp1200_driver.c",
    "mcp1200_mmio": "cc -O2 -I../mcp1200_c -o $OUT main.c ../mcp1200_c/mcp1200_driver.c",
    "mc1241a_dos": "nasm -f bin -o $OUT move.asm",
}
"""By example: what compiles it in its folder."""
CPUS: Final = {"lm629_vme_68000": ("--cpu", "68000"), "mc1241a_dos": ("--cpu", "8086")}
CLIENTS: Final = {"lm629": "LM629N-8", "mcp1200": "MCP-1200", "mc1241a": "MC1241A"}
"""By function of campaign_hosts.py: the part that its client is for."""
NAMES: Final = (*COMPILED, *CLIENTS)
BOARD: Final = '[board]\ntime = "lockstep"\npower_on = "done"\n[chips.x]\npart = "{}"\n'


def words_of(name: str, folder: Path) -> list[str]:
    """Return the words of ``vbus campaign`` for an example, compiled now, or for a client."""
    board, program = folder / "board.toml", folder / "program"
    if name in CLIENTS:
        board.write_text(BOARD.format(CLIENTS[name]) + PLANTS[name])
        return ["--board", str(board), "--host", f"{HERE / 'campaign_hosts.py'}:{name}"]
    place = EXAMPLES / name
    board.write_text((place / "board.toml").read_text().replace('"realtime"', '"lockstep"'))
    environment = os.environ | {"OUT": str(program), "VBUS": f"{sys.executable} -m vbus"}
    subprocess.run(
        COMPILED[name], shell=True, cwd=place, env=environment, check=True, capture_output=True
    )
    # The C client's examples take the link as an argument.
    host = ["sh", "-c", f"{program} $VBUS_LINK"] if name.endswith("_c") else [str(program)]
    return ["--board", str(board), *CPUS.get(name, ()), "--", *host]


PLANTS: Final = {
    "lm629": 'clock = "8 MHz"\nplant = "m"\n[plants.m]\nmodel = "dc_motor"\n',
    "mcp1200": 'clock = "8 MHz"\nplant = "m"\n[plants.m]\nmodel = "dc_motor"\n',
    "mc1241a": 'clock = "25 MHz"\nplants = ["m", "n"]\n[plants.m]\nmodel = "stepper"\n'
    '[plants.n]\nmodel = "stepper"\n',
}


def campaign(
    name: str, folder: Path, worlds: int, *options: str
) -> subprocess.CompletedProcess[str]:
    """Run a campaign of so many worlds; return what it printed."""
    command = vbus("campaign", "--worlds", str(worlds), "--all", *options, *words_of(name, folder))
    return subprocess.run(command, capture_output=True, text=True)


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
