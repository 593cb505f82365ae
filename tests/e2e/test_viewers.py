"""Runs in viewers of others: pictures, MCAP files, Foxglove, sigrok."""

import asyncio
import re
from itertools import groupby
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from tests.e2e.command import running, start, vbus
from tests.e2e.test_scope import drive, folder
from tests.unit.views.scope.decoded import of_page
from tests.unit.views.scope.foxglove_client import FoxgloveClient, connected

__all__ = ["folder"]


@pytest.mark.slow
def test_a_journal_is_a_picture(folder: Path) -> None:
    with running(folder / "bench.toml"):
        drive(folder)
    picture = folder / "run.svg"
    done = vbus("plot", folder / "run.vbj", "-o", picture, "--from", "1ms", "--units", "rev")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert "bench: x" in picture.read_text()
    done = vbus("plot", folder / "run.vbj", "-o", folder / "run.bmp")
    assert (done.returncode, done.stdout) == (2, "")
    assert "run.bmp: a picture's name ends in .svg, .png, .pdf" in done.stderr


@pytest.mark.slow
def test_a_journal_is_an_mcap_file(folder: Path) -> None:
    with running(folder / "bench.toml"):
        reached = drive(folder)
    done = vbus("scope", folder / "run.vbj", "-o", folder / "run.mcap")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    with (folder / "run.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        values = [told.value for *_, told in reader.iter_decoded_messages(topics=["/x/real"])]
    assert values[-1] == reached


@pytest.mark.slow
def test_foxglove_sees_a_running_board_as_its_journal_has_it(folder: Path) -> None:
    with running(folder / "bench.toml"):
        process = start("scope", "bench", "--foxglove", "127.0.0.1:0")
        assert process.stdout is not None
        found = re.fullmatch(r"foxglove: (ws://127\.0\.0\.1:\d+)\n", process.stdout.readline())
        assert found is not None

        async def look(url: str) -> FoxgloveClient:
            async with connected(url, 18) as client:
                await client.subscribe("/x/real", "/x/bus", "/x/RST")
                await client.take(lambda: client.told["/x/RST"])
                reached = await asyncio.to_thread(drive, folder)
                real = client.told["/x/real"]
                await client.take(lambda: real and real[-1][1].value == reached)
                return client

        client = asyncio.run(look(found[1]))
    # It ends with the board.
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out, err) == (0, "", "")
    vbus("scope", folder / "run.vbj", "-o", folder / "run.html")
    whole = of_page((folder / "run.html").read_bytes())
    # Who subscribes is told the latest row once more; it may have come already.
    real = [
        row for row, _ in groupby((told.time_ps, told.value) for _, told in client.told["/x/real"])
    ]
    assert real == whole.rows["x.real"][: len(real)]
    assert len(real) > 400
    packets = {(told.time_ps, told.length_ps, told.text) for _, told in client.told["/x/bus"]}
    assert packets <= {row[:3] for row in whole.packets("x bus")}
    assert len(packets) > 100


def test_what_makes_no_sense_is_refused(folder: Path) -> None:
    done = vbus("scope", "nobody", "--foxglove")
    assert done.returncode == 4
    assert 'no board called "nobody" can be watched' in done.stderr
    done = vbus("scope", "nobody", "--foxglove", "0.0.0.0:1")
    assert done.returncode == 2
    assert '--foxglove: "0.0.0.0:1" lets other computers in; write "127.0.0.1:1"' in done.stderr
    done = vbus("scope", folder / "bench.toml", "--foxglove")
    assert done.returncode == 2
    assert "--foxglove is for boards that run" in done.stderr
