"""A running board's pins over the network, in libsigrok's own driver and our decoders."""

import os
import re
import socket
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from tests.e2e.command import running, start, vbus
from tests.e2e.test_scope import folder
from tests.sigrok.test_sigrok import sigrok
from tests.waiting import PATIENCE, until
from vbus import connect
from vbus.chips.packets import STATUS, Packet
from vbus.circuit.stream import PacketTaker
from vbus.cli.look.sigrok_server import CHANNELS
from vbus.client.lm628 import Lm628
from vbus.core import exit_codes
from vbus.record.format import JournalReader
from vbus.record.view import play

__all__ = ["folder", "sigrok"]

PINS = ("cs", "ps", "rd", "wr", *(f"d{bit}" for bit in range(8)))


@contextmanager
def served(count: int, *options: str) -> Iterator[tuple[str, list[str]]]:
    """Serve the pins of a board; give where, and what is at so many channels."""
    process = start("scope", "bench", "--sigrok", "127.0.0.1:0", *options)
    try:
        assert process.stdout is not None
        found = re.fullmatch(r"sigrok: (beaglelogic:conn=tcp/127\.0\.0\.1/\d+)\n",
                             process.stdout.readline())  # fmt: skip
        assert found is not None
        yield found[1], [process.stdout.readline() for _ in range(count)]
    finally:
        process.terminate()
        out, err = process.communicate(timeout=60)
    assert (process.returncode, out, err) == (0, "", "")


@pytest.mark.slow
def test_sigrok_cli_decodes_a_running_board_as_its_journal_says(
    sigrok: str, sigrok_decoders: Path, folder: Path
) -> None:
    log = folder / "log"
    count = len(CHANNELS)
    with running(folder / "bench.toml"), served(count) as (driver, channels), log.open("w") as told:
        assert channels[:5] == [
            "sigrok: P8_45 x./CS\n", "sigrok: P8_46 x./PS\n", "sigrok: P8_43 x./RD\n",
            "sigrok: P8_44 x./WR\n", "sigrok: P8_41 x.D0-D7:0\n",
        ]  # fmt: skip
        wiring = [f"{pin}={channel}" for pin, channel in zip(PINS, CHANNELS, strict=False)]
        client = subprocess.Popen(
            [sigrok, "-l", "3", "-d", driver, "-c", "samplerate=20m", "--samples", "2000000",
             "-P", ":".join(["vbus_lm628", *wiring]), "-A", "vbus_lm628=packets"],
            env={**os.environ, "SIGROKDECODE_DIR": str(sigrok_decoders)},
            stdout=subprocess.PIPE, stderr=told, text=True,
        )  # fmt: skip
        with client, connect(f"unix:{folder}/run/x") as bus:

            def samples_flow() -> bool:
                bus.read(0)
                return "Received SR_DF_LOGIC" in log.read_text()

            until(samples_flow, "samples at sigrok-cli")
            axis = Lm628(bus)
            axis.load_filter(kp=300, kd=2000)
            axis.move(500, acc=40, vel=2 << 16)
            out, _ = client.communicate(timeout=120)
    assert client.returncode == 0, log.read_text()
    printed = [line.partition(": ")[2].strip('"') for line in out.splitlines()]
    expected: list[str] = []

    def take(chip: str, packet: Packet) -> None:
        if packet.kind != STATUS:
            expected.append(packet.text)

    with (folder / "run.vbj").open("rb") as file:
        reader = JournalReader(file)
        play(reader.header, reader, PacketTaker(take))
    assert printed == expected[: len(printed)]
    assert [text.partition(" ")[0] for text in printed] == [
        "LFIL", "UDF", "RSTI", "LTRJ", "LTRJ", "STT",
    ]  # fmt: skip


@pytest.mark.parametrize("option", ["--sigrok", "--foxglove", "--listen"])
def test_a_port_in_use_is_named_with_what_to_do(option: str, folder: Path) -> None:
    with running(folder / "bench.toml"), socket.create_server(("127.0.0.1", 0)) as taken:
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        done = vbus("scope", "bench", option, address)
    assert done.returncode == exit_codes.NO_LINK
    assert f"{address}: cannot listen: " in done.stderr
    assert "address already in use" in done.stderr.lower()
    assert "; free the address, or give another" in done.stderr
    assert "(port 0 is any free one)" in done.stderr


@pytest.mark.slow
def test_the_servers_answers_are_those_the_driver_expects(folder: Path) -> None:
    served_pins = served(2, "--pin", "/RST", "--pin", "/CS")
    with running(folder / "bench.toml"), served_pins as (driver, channels):
        assert channels == ["sigrok: P8_45 x./RST\n", "sigrok: P8_46 x./CS\n"]
        port = int(driver.rpartition("/")[2])
        with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as client:

            def said(line: str) -> str:
                client.sendall(f"{line}\n".encode())
                return client.recv(100).decode()

            assert said("version") == "BeagleLogic 1.0\n"
            assert said("samplerate") == "20000000\n"
            assert said("samplerate 1000000") == "ok\n"
            assert said("samplerate") == "1000000\n"
            assert said("sampleunit 1") == "ok\n"
            assert int(said("memalloc")) == 1 << 30
            client.sendall(b"get\n")
            client.setblocking(False)
            seen = bytearray()
            with connect(f"unix:{folder}/run/x") as bus:

                def time_passes_until(enough: Callable[[], bool]) -> None:
                    def passed() -> bool:
                        bus.delay("1 ms")
                        with suppress(BlockingIOError):
                            seen.extend(client.recv(1 << 16))
                        return enough()

                    until(passed, "samples")

                time_passes_until(lambda: len(seen) > 3000)
                assert seen == b"\x03" * len(seen)
                bus.pin("/RST", 0)
                time_passes_until(lambda: seen.endswith(b"\x02"))
                assert seen == seen.count(3) * b"\x03" + seen.count(2) * b"\x02"
                client.sendall(b"close\nversion\n")
                time_passes_until(lambda: seen.endswith(b"BeagleLogic 1.0\n"))
        with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as client:
            client.sendall(b"x" * 1000 + b"\n")
            assert client.recv(100) == b""


def test_what_makes_no_sense_is_refused(folder: Path) -> None:
    done = vbus("scope", "nobody", "--sigrok", "127.0.0.1:0")
    assert done.returncode == 4
    done = vbus("scope", "nobody", "--sigrok", "0.0.0.0:1")
    assert done.returncode == 2
    assert (
        '--sigrok: "0.0.0.0:1" lets other computers in; write "127.0.0.1:1", or say' in done.stderr
    )
    done = vbus("scope", folder / "bench.toml", "--sigrok")
    assert done.returncode == 2
    with running(folder / "bench.toml"):
        done = vbus("scope", "bench", "--sigrok", "127.0.0.1:0", "--chip", "y")
        assert (done.returncode, done.stdout) == (1, "")
        assert 'no chip is called "y"; there are x' in done.stderr
