"""What each module of the compiled core earns: how much longer work takes when it is interpreted.

    python benchmarks/compiled_modules.py          the modules that vbus/compiled/hook.py lists
    python benchmarks/compiled_modules.py --all    every other module that such work runs, too
    python benchmarks/compiled_modules.py --check  exit code 1 if a listed one earns too little

A module's gain is ``(C + s * I) / C``, all from one run: ``C`` and ``I`` are processor seconds of
the work on the compiled and on the interpreted core, ``s`` is the module's own share of the latter,
which a profile counts. The table names the work in which a module gains most. A module that gains
less than 1.3 times stays only for a reason in `REASONS`. Wants the compiled core.
"""

import argparse
import cProfile
import importlib.util
import io
import json
import os
import pstats
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).resolve().parents[1]))

import core
import in_process
import journal
import snapshots
from many_axes import cpu_seconds, hosts, moving, start_axes, text, told
from scope_samples import Watched

import vbus
from vbus.board.board import Board
from vbus.compiled import is_compiled
from vbus.core.kernel import MS
from vbus.protocols.byte import ByteProtocol
from vbus.protocols.framed import FramedProtocol
from vbus.protocols.frames import frame
from vbus.protocols.text import TextProtocol

ROOT = Path(__file__).resolve().parents[1]
LEAST = 1.3
SECONDS = 0.25
"""Least processor time of one measurement."""
VBUS = Path(next(iter(vbus.__path__)))

BASE = "compiled classes inherit from it"
HELD = "what a sample or a bus cycle reads is in its objects"
ROUND = "called in each round of the server, beside system calls"
COMMANDS = "with it interpreted, commands take 1.6 times as long"
REASONS: dict[str, str] = {
    "vbus/board/board.py": "a circuit, and circuits take no interpreted heirs",
    "vbus/board/card/card_bus.py": HELD,
    "vbus/board/host_polls.py": HELD,
    "vbus/board/host_selection.py": HELD,
    "vbus/chips/lm628/commands.py": COMMANDS,
    "vbus/chips/mc1241a/chipset.py": BASE,
    "vbus/chips/mc1241a/commands.py": COMMANDS,
    "vbus/chips/mc1241a/output.py": COMMANDS,
    "vbus/chips/motion/quadrature.py": HELD,
    "vbus/plant/response.py": HELD,
    "vbus/protocols/base.py": BASE,
    "vbus/protocols/codes.py": HELD,
    "vbus/protocols/port.py": BASE,
    "vbus/views/scope/lane.py": HELD,
    "vbus/serve/fast_path.py": ROUND,
    "vbus/serve/session.py": ROUND,
    "vbus/serve/time/statistics.py": "a session's histogram takes each message",
    "vbus/serve/time/pacer.py": ROUND,
    "vbus/core/signals/axis.py": BASE,
    "vbus/core/signals/observer.py": BASE,
    "vbus/core/signals/wire.py": "a net, and nets take no interpreted heirs",
    "vbus/views/wave/changes.py": "a waveform takes 1.27 times as long without",
    "vbus/views/wave/vcd_file.py": "a waveform takes 1.27 times as long without",
}
"""Modules of the list that gain less by themselves, and why they stay."""


# -- work: each makes what it needs, and returns what is measured -----------------------------


def sampled(make: Callable[[], Board], period_ps: int) -> Callable[[], None]:
    """Samples of a moving axis."""
    made = make()
    made.run_for(10**12)

    def work() -> None:
        made.run_for(100 * period_ps)
        made.catch_up()

    return work


def fed(protocol: Any, chip: str, request: bytes) -> Callable[[], None]:
    """Bytes of a host, in messages."""
    wire = protocol(in_process.board(chip).open_port("bench"))

    def work() -> None:
        wire.receive(request)
        wire.take()

    return work


def read_by_strobes(chip: str) -> Callable[[], None]:
    """A status read by strobes: every line a message of its own."""
    port = in_process.board(chip).open_port("bench")
    if chip == "LM629":
        wire, request = in_process.strobed_reads(port, core.BATCH)
    else:
        wire, request = strobed_packets(port)

    def work() -> None:
        wire.receive(request)
        wire.take()

    return work


def strobed_packets(port: Any) -> tuple[ByteProtocol, bytes]:
    """Cycles of a chip whose lines a host moves: each line of it falls and rises, as it may."""
    from vbus.protocols.requests import REQUESTS

    count = len(port.info().lines)
    out = b""
    for place in range(count):
        for level in (0, 1 << place):
            out += REQUESTS["DELAY"].pack(500_000) + REQUESTS["LINES"].pack(1 << place, level)
    return ByteProtocol(port), out


def through_a_card(played: bool) -> Callable[[], None]:
    """A status read through a decoder on a card."""
    made = core.load_board_text(core.DECODED + core.WIRED_CARD)
    port = made.open_port("host")
    port.select(1 << len(made.chips) - 1)
    if played:
        made.watch("x./CS", core.Observer())
    port.read(0)
    return partial(port.read, 0)


def recorded(strobes: bool) -> Callable[[], None]:
    """Bus cycles of a host, with a journal."""
    if strobes:
        return lambda: consume(journal.strobed(io.BytesIO()))  # type: ignore[arg-type]
    return lambda: consume(journal.run("LM629", journal.moves, io.BytesIO()))


def consume(_: object) -> None:
    """Return nothing."""


def played_again(waved: bool) -> Callable[[], None]:
    """A journal played again, and made a waveform of."""
    file = io.BytesIO()
    made = in_process.board("LM629")
    written = journal.Journal(made, file)
    journal.moves(made.open_port("bench"), 0)
    written.close()

    def work() -> None:
        file.seek(0)
        reader = journal.JournalReader(file)
        again = in_process.board("LM629")
        wave = journal.Wave(again, io.StringIO()) if waved else None
        if wave is not None:
            wave.start()
        journal.Replay(again, reader, reader.header.families).run()
        if wave is not None:
            wave.stop()

    return work


def saved() -> Callable[[], None]:
    """The state of a board with three chips, saved and loaded."""
    made = snapshots.made(10**12)
    return lambda: made.load(made.save())


def many() -> Callable[[], None]:
    """64 moving axes on a board."""
    made = moving(64)

    def work() -> None:
        made.run_for(20 * MS)
        made.catch_up()

    return work


def scope() -> Callable[[], None]:
    """16 moving axes with the scope's recording."""
    watched = Watched("recorded")
    return lambda: consume(watched.share(0.05))


def moved(chip: str) -> Callable[[], None]:
    """A board is built, and its axis begins to move: commands rather than samples."""
    make = {"LM629": in_process.moving_lm629, "MCP-1200": in_process.moving_mcp1200,
            "MC1241A": in_process.moving_mc1241a}[chip]  # fmt: skip
    return lambda: consume(make())


def far(chip: str, curve: bool) -> Board:
    """A board whose axis is on its way to a far place, by the profile that ends there."""
    made = in_process.board(chip)
    port = made.open_port("bench")
    if chip == "LM629":
        in_process.command(port, 0x1E, 0x000A, 300, 2000)
        in_process.command(port, 0x04)
        in_process.command(port, 0x1F, 0x002A, 0, 1, 0, 20_000, 0x3FFF, 0)
        in_process.command(port, 0x01)
    elif chip == "MCP-1200":
        for register, value in (
            (0x02, 0x01), (0x01, 0x18 if curve else 0x08), (0x05, 3), (0x28, 1), (0x27, 0),
            (0x26, 1), (0x55, 0), (0x54, 1), (0x2B, 0x70), (0x2A, 0), (0x29, 0), (0x00, 0x08),
        ):  # fmt: skip
            port.write(register, value)
            port.delay(1_000_000_000)
    else:
        say(port, 0x74)
        say(port, 0x77, 24000)
        say(port, 0x0B if curve else 0x09)
        say(port, 0x10, 0x1FFF, 0)
        say(port, 0x11, 1, 0)
        if curve:
            say(port, 0x15, 1)
            say(port, 0x13, 0, 1)
        else:
            say(port, 0x12, 0, 10)
        say(port, 0x1A)
    return made


def say(port: Any, code: int, *words: int) -> None:
    """Give an MC1241A one command."""
    port.wait(10_000_000_000)
    port.write(1, code)
    for word in words:
        port.wait(10_000_000_000)
        port.write(0, word >> 8)
        port.write(0, word & 0xFF)


def commanded(chip: str) -> Callable[[], None]:
    """Commands of a chip at rest, with what they take and give."""
    port = in_process.board(chip).open_port("bench")

    def lm629() -> None:
        for _ in range(20):
            in_process.command(port, 0x1E, 0x000A, 300, 2000)
            in_process.command(port, 0x1F, 0x002A, 0, 1, 0, 20_000, 0x3FFF, 0)

    def mcp1200() -> None:
        for register in (0x26, 0x27, 0x28, 0x29, 0x2A, 0x2B, 0x3C) * 20:
            port.write(register, 3)
        for register in journal.ORDER[:200]:
            port.read(register)

    def mc1241a() -> None:
        for _ in range(20):
            say(port, 0x11, 1, 0)
            say(port, 0x37)
            port.wait(10_000_000_000)
            for _ in range(4):
                port.read(0)

    return {"LM629": lm629, "MCP-1200": mcp1200, "MC1241A": mc1241a}[chip]


def hashed() -> Callable[[], None]:
    """Status reads by strobes, with the trace hash."""
    made = in_process.board("LM629")
    made.start_trace()
    wire, request = in_process.strobed_reads(made.open_port("bench"), core.BATCH)

    def work() -> None:
        wire.receive(request)
        wire.take()

    return work


def turning_round() -> Callable[[], None]:
    """A motor whose command turns round every other period."""
    return lambda: consume(core.motor_period([0.5, -0.5], 200))


def ideal() -> Board:
    """An LM629 that moves an ideal axis."""
    made = core.load_board_text(
        '[board]\nname = "ideal"\ntime = "lockstep"\npower_on = "done"\n'
        '[chips.x]\npart = "LM629N-8"\nclock = "8 MHz"\nplant = "m"\n[plants.m]\nmodel = "ideal"\n'
    )
    in_process.start_lm629(made.open_port("bench"), kp=300, kd=2000, acc=1000, vel=1)
    return made


IN_PROCESS: dict[str, Callable[[], Callable[[], None]]] = {
    "LM629 samples": lambda: sampled(in_process.moving_lm629, 256_000_000),
    "MCP-1200 samples": lambda: sampled(in_process.moving_mcp1200, 520_000_000),
    "MC1241A samples": lambda: sampled(in_process.moving_mc1241a, 542_720_000),
    "LM629 samples, trapezoid": lambda: sampled(partial(far, "LM629", False), 256_000_000),
    "LM629 samples, ideal axis": lambda: sampled(ideal, 256_000_000),
    "MCP-1200 samples, trapezoid": lambda: sampled(partial(far, "MCP-1200", False), 520_000_000),
    "MCP-1200 samples, S-curve": lambda: sampled(partial(far, "MCP-1200", True), 520_000_000),
    "MC1241A samples, trapezoid": lambda: sampled(partial(far, "MC1241A", False), 542_720_000),
    "MC1241A samples, S-curve": lambda: sampled(partial(far, "MC1241A", True), 542_720_000),
    "motor that turns round": turning_round,
    "LM629 commands": lambda: commanded("LM629"),
    "MCP-1200 commands": lambda: commanded("MCP-1200"),
    "MC1241A commands": lambda: commanded("MC1241A"),
    "strobes with the trace hash": hashed,
    "LM629 byte protocol": lambda: fed(ByteProtocol, "LM629", b"\x10" * 64),
    "LM629 byte protocol, polled by count": lambda: fed(ByteProtocol, "LM629", b"\x30\x00" * 64),
    "MCP-1200 byte protocol": lambda: fed(ByteProtocol, "MCP-1200", b"\x17" * 64),
    "MC1241A byte protocol": lambda: fed(ByteProtocol, "MC1241A", b"\x11" * 64),
    "text protocol": lambda: fed(TextProtocol, "LM629", b"r 0\n" * 64),
    "framed protocol": lambda: fed(
        FramedProtocol, "LM629", b"".join(frame(number, b"\x10") for number in range(64))
    ),
    "LM629 strobes": lambda: read_by_strobes("LM629"),
    "MCP-1200 strobes": lambda: read_by_strobes("MCP-1200"),
    "MC1241A strobes": lambda: read_by_strobes("MC1241A"),
    "card": lambda: through_a_card(False),
    "card, as strobes": lambda: through_a_card(True),
    "journal": lambda: recorded(False),
    "journal of strobes": lambda: recorded(True),
    "replay": lambda: played_again(False),
    "waveform": lambda: played_again(True),
    "snapshot": saved,
    "64 axes": many,
    "scope": scope,
    "LM629 made and moved": lambda: moved("LM629"),
    "MCP-1200 made and moved": lambda: moved("MCP-1200"),
    "MC1241A made and moved": lambda: moved("MC1241A"),
}


def measure(name: str, profiled: bool) -> dict[str, Any]:
    """Return processor seconds of one turn of a work, and the shares of modules if profiled."""
    work = IN_PROCESS[name]()
    work()
    begun = time.process_time()
    turns = 0
    while (took := time.process_time() - begun) < SECONDS:
        work()
        turns += 1
    if not profiled:
        return {"seconds": took / turns}
    profile = cProfile.Profile(builtins=False)
    profile.enable()
    for _ in range(max(turns // 3, 1)):
        work()
    profile.disable()
    return {"seconds": took / turns, "shares": shares(pstats.Stats(profile))}


def shares(stats: pstats.Stats) -> dict[str, float]:
    """Return what part of the time each file of vbus takes by itself."""
    took: dict[str, float] = {}
    for (file, _, _), (_, _, own, _, _) in stats.stats.items():  # type: ignore[attr-defined]
        path = Path(file)
        name = f"vbus/{path.relative_to(VBUS)}" if path.is_relative_to(VBUS) else "other"
        took[name] = took.get(name, 0.0) + own
    whole = sum(took.values()) or 1.0
    return {name: own / whole for name, own in took.items()}


# -- work of a server ------------------------------------------------------------------------

PROFILED = """
import cProfile, sys
from vbus.__main__ import main
profile = cProfile.Profile(builtins=False)
try:
    profile.runcall(main)
finally:
    profile.dump_stats({0!r})
"""


def trips(folder: Path) -> int:
    """Status reads of a host, one at a time; return how many."""
    with socket.socket(socket.AF_UNIX) as host:
        host.connect(str(folder / "0.sock"))
        for _ in range(4000):
            host.sendall(b"\x10")
            host.recv(2)
    return 4000


def at_full_rate(folder: Path) -> int:
    """An axis that moves as fast as the machine can; return chip time (ps)."""
    start_axes(folder, 1)
    environment = {**os.environ, "VBUS_RUNTIME": str(folder)}
    begun = told(environment)["time_ps"]
    time.sleep(3.0)
    return int(told(environment)["time_ps"] - begun)


SERVED: dict[str, tuple[Callable[[Path], int], str]] = {
    "served: one read at a time": (trips, "1"),
    "served: a moving axis, rate max": (at_full_rate, "max"),
}


def served(name: str, pure: bool, profile: str = "") -> float:
    """Return processor seconds of a server for each unit of a work.

    Server and host share a processor: a server that waits for its host does not spin there.
    """
    function, rate = SERVED[name]
    every = os.sched_getaffinity(0)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "b.toml").write_text(text(1, "realtime") + hosts(1))
        environment = {**os.environ, "VBUS_RUNTIME": place, "VBUS_PURE": str(int(pure)),
                       "PYTHONPATH": os.pathsep.join(sys.path)}  # fmt: skip
        start = ["-c", PROFILED.format(profile)] if profile else ["-m", "vbus"]
        os.sched_setaffinity(0, {min(every)})
        try:
            server = subprocess.Popen(
                [sys.executable, *start, "run", "--json", "--rate", rate, str(folder / "b.toml")],
                stdout=subprocess.PIPE, env=environment, cwd=place,
            )  # fmt: skip
            assert server.stdout is not None
            server.stdout.readline()
            begun = cpu_seconds(server.pid)
            units = function(folder)
            took = cpu_seconds(server.pid) - begun
            server.terminate()
            server.wait()
            server.stdout.close()
        finally:
            os.sched_setaffinity(0, every)
    return max(took, 0.01) / units


# -- the list --------------------------------------------------------------------------------


def compiled_list() -> list[str]:
    """Return the modules that are compiled, as vbus/compiled/hook.py says."""
    spec = importlib.util.spec_from_file_location("hook", ROOT / "vbus/compiled/hook.py")
    assert spec is not None
    assert spec.loader is not None
    hook = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(hook)
    names: list[str] = hook.core_files(ROOT)
    return names


def interpreted(*arguments: str) -> Any:
    """Return what this script measures on the interpreted core, in a process of its own."""
    done = subprocess.run(
        [sys.executable, __file__, *arguments], stdout=subprocess.PIPE, text=True, check=True,
        env={**os.environ, "VBUS_PURE": "1", "PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    return json.loads(done.stdout)


def gains(only: str) -> dict[str, tuple[float, str]]:
    """Return for each module its largest gain, and the work in which it is."""
    best: dict[str, tuple[float, str]] = {}

    def note(name: str, fast: float, slow: float, parts: dict[str, float]) -> None:
        print(f"{name:38} {slow / fast:6.1f} times slower interpreted", file=sys.stderr, flush=True)
        for module, share in parts.items():
            best[module] = max(best.get(module, (0.0, "")), (1 + share * slow / fast, name))

    for name in IN_PROCESS:
        if only not in name:
            continue
        fast = measure(name, profiled=False)["seconds"]
        slow = interpreted("--one", name)
        note(name, fast, slow["seconds"], slow["shares"])
    for name in SERVED:
        if only not in name:
            continue
        with tempfile.NamedTemporaryFile() as file:
            served(name, True, file.name)
            parts = shares(pstats.Stats(file.name))
        note(name, served(name, False), served(name, True), parts)
    return best


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--all", action="store_true", help="modules that are not compiled, too")
    parser.add_argument("--check", action="store_true", help="fail if one earns too little")
    parser.add_argument("--only", default="", metavar="WORK", help="work whose name has this in it")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(measure(options.one, profiled=True)))
        return 0
    if not is_compiled():
        parser.error("the core is interpreted; this wants the compiled one")
    listed = compiled_list()
    found = gains(options.only)
    poor = []
    names = sorted({*listed, *(found if options.all else ())} - {"other"})
    for name in sorted(names, key=lambda name: -found.get(name, (0.0, ""))[0]):
        gain, work = found.get(name, (1.0, "-"))
        said = "" if name in listed else "not compiled"
        if name in listed and gain < LEAST:
            said = REASONS.get(name, "earns too little")
            if name not in REASONS:
                poor.append(name)
        print(f"{name:44} {gain:7.2f}  {work:38} {said}".rstrip())
    print(f"{len(listed)} modules are compiled; {len(poor)} of them earn too little")
    return 1 if options.check and poor else 0


if __name__ == "__main__":
    sys.exit(main())
