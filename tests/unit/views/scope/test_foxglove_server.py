"""A board live for Foxglove: what a client of its protocol is told."""

import ssl
from pathlib import Path

import pytest
import trustme

from tests.unit.views.conftest import board_of, read
from tests.unit.views.scope.decoded import Seen, frames
from tests.unit.views.scope.foxglove_client import connected
from vbus.cli.look.foxglove_lanes import FoxgloveServer
from vbus.cli.look.scope_page import PagePlace
from vbus.core.errors import TransportError
from vbus.core.kernel import NS
from vbus.views.scope.recording import Recorded, replayed


@pytest.fixture(scope="module")
def run(moved: bytes) -> Recorded:
    header, entries = read(moved)
    return replayed(board_of(header), entries, header.families)


async def started(run: Recorded) -> tuple[FoxgloveServer, str]:
    told: list[str] = []
    server = FoxgloveServer(run.description, "127.0.0.1", 0, told.append)
    await server.start()
    (url,) = told
    return server, url


@pytest.mark.asyncio
async def test_a_client_is_told_every_value_with_its_picoseconds(run: Recorded) -> None:
    seen = Seen(run.description, b"".join(run.frames))
    (number,) = (number for number, name in seen.names.items() if name == "x./RST")
    reset = next(data for data in run.frames for one in frames(data) if one.lane == number)
    server, url = await started(run)
    server.add(reset)
    try:
        async with connected(url, len(seen.drawn)) as client:
            assert client.name == "bench"
            assert client.channels["/x/velocity"]["metadata"]["unit"] == "counts/sample"
            # The latest of the last topic comes when all of them are subscribed to.
            await client.subscribe("/x/real", "/x/output", "/x/bus", "/violations", "/x/RST")
            await client.take(lambda: client.told["/x/RST"])
            server.add(b"".join(run.frames))
            names = ("x.real", "x.output", "x bus", "violations")
            count = sum(len(seen.rows[name]) for name in names)
            await client.take(lambda: sum(map(len, client.told.values())) == count + 2)
            await client.take(lambda: client.now == seen.now // NS)
    finally:
        await server.stop()
    real = [(when, told.time_ps, told.value) for when, told in client.told["/x/real"]]
    assert real == [(when // NS, when, value) for when, value in seen.rows["x.real"]]
    output = [(told.time_ps, told.value) for _, told in client.told["/x/output"]]
    assert output == [(when, value / 2048) for when, value in seen.rows["x.output"]]
    assert [(told.time_ps, told.text) for _, told in client.told["/x/bus"]] == [
        (when, text) for when, _, text, _ in seen.packets("x bus")
    ]
    ((_, mark),) = client.told["/violations"]
    assert (mark.rule, mark.clause) == ("lm628.busy-write", "LM-BUS-10")


@pytest.mark.asyncio
async def test_who_subscribes_later_is_told_the_latest(run: Recorded) -> None:
    seen = Seen(run.description, b"".join(run.frames))
    server, url = await started(run)
    server.add(b"".join(run.frames))
    try:
        async with connected(url, len(seen.drawn)) as client:
            await client.subscribe("/x/real", "/x/HI", "/faults", "/x/bus")
            await client.take(lambda: len(client.told) == 3)
    finally:
        await server.stop()
    ((_, real),) = client.told["/x/real"]
    assert (real.time_ps, real.value) == seen.rows["x.real"][-1]
    ((_, packet),) = client.told["/x/bus"]
    assert packet.text == seen.packets("x bus")[-1][2]
    assert "/faults" not in client.told


@pytest.mark.asyncio
async def test_an_address_that_is_taken_is_refused_in_words(run: Recorded) -> None:
    server, url = await started(run)
    port = int(url.rpartition(":")[2])
    try:
        other = FoxgloveServer(run.description, "127.0.0.1", port, print)
        with pytest.raises(TransportError, match=f"127.0.0.1:{port}: cannot listen: .*in use"):
            await other.start()
    finally:
        await server.stop()


@pytest.mark.asyncio
async def test_other_computers_are_served_with_tls(run: Recorded, tmp_path: Path) -> None:
    authority = trustme.CA()
    issued = authority.issue_cert("127.0.0.1")
    certificate, key = tmp_path / "cert.pem", tmp_path / "key.pem"
    issued.cert_chain_pems[0].write_to_path(certificate)
    issued.private_key_pem.write_to_path(key)
    place = PagePlace("127.0.0.1:0", certificate=certificate, key=key, option="--foxglove")
    server = place.foxglove_server(run.description)
    told: list[str] = []
    server.report = told.append
    await server.start()
    server.add(b"".join(run.frames))
    trusted = ssl.create_default_context()
    authority.configure_trust(trusted)
    try:
        async with connected(told[0], len(Seen(run.description, b"").drawn), trusted) as client:
            await client.subscribe("/x/HI")
            await client.take(lambda: client.told["/x/HI"])
    finally:
        await server.stop()
    assert told[0].startswith("wss://127.0.0.1:")
