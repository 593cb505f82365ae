"""A session over Zenoh is its host's: another with the same right hears nothing of it."""

import multiprocessing
import time

import pytest
import zenoh

from tests.e2e.serving import served
from tests.waiting import until
from tests.zenoh.processes import session_at
from tests.zenoh.test_bus import board
from tests.zenoh.test_security import Files, files, link, secured
from vbus.client import connect
from vbus.client.zenoh_link import open_zenoh
from vbus.core.errors import TransportError
from vbus.network import envelope, keys
from vbus.network.session import FORKED, close_session
from vbus.serve.server import LinkSpec

__all__ = ["files"]
BUS = keys.bus("bench", "x")


def text(sample: zenoh.Sample) -> bytes:
    attachment = sample.attachment
    return sample.payload.to_bytes() + (attachment.to_bytes() if attachment is not None else b"")


@pytest.mark.parametrize("right", ["bench/x/bus", "bench/**"])
def test_who_has_the_same_right_can_neither_read_nor_send_nor_end_it(
    files: Files, right: str
) -> None:
    network, endpoint = secured(files, alice=(right,), mallory=(right,))
    alice, mallory = files.of("alice"), files.of("mallory")
    made = board()
    with served(made, LinkSpec("zenoh:", network=network)) as server:
        other = session_at(endpoint, mallory)
        heard: list[bytes] = []
        tokens: list[str] = []
        ears = session_at(endpoint, mallory)
        kept = [ears.declare_subscriber("vbus/**", lambda sample: heard.append(text(sample)))]
        seen = other.liveliness().declare_subscriber(
            f"{BUS}/hosts/*", lambda sample: tokens.append(str(sample.key_expr)), history=True
        )
        answered: list[object] = []
        catching = ears.declare_queryable(f"{BUS}", answered.append, complete=True)
        with connect(link("bench/x", endpoint, alice)) as bus:
            bus.events("x.HI")
            bus.posting()
            for number in range(20):
                bus.write(0, 0x17 if number % 2 else 0x00)
            bus.posting(False)
            bus.echo()
            secret = bus.link._name  # type: ignore[attr-defined]
            until(lambda: bool(tokens), "its token is public")
            public = tokens[0].rpartition("/")[2]
            assert public == envelope.public(secret)

            # In: with what is public, as queries and as samples.
            writes = made.chips[0].writes
            for kind in (envelope.REQUESTS, envelope.END, envelope.EVENTS):
                for name in (bytes.fromhex(public), bytes.fromhex(public)[:16], bytes(16)):
                    for number in (0, 30):
                        cover = envelope.Envelope(kind, name, number, number).pack()
                        payload = b"\x02\x07" if kind == envelope.REQUESTS else b""
                        list(other.get(BUS, payload=payload, attachment=cover, timeout=1.0))
                        other.put(keys.requests(tokens[0]), b"\x20\x00", attachment=cover)
            # The end: a token of the same name comes and goes.
            token = other.liveliness().declare_token(tokens[0])
            time.sleep(0.2)
            token.undeclare()
            time.sleep(network.grace_seconds + 1.0)
            assert made.chips[0].writes == writes
            bus.echo()  # the session goes on
            assert [one.link.peer for one in server.sessions() if public in one.link.peer]
        assert heard == answered == []
        for one in (*kept, seen, catching):
            one.undeclare()
        for session in (ears, other):
            close_session(session)


def _connects(url: str, result: "multiprocessing.SimpleQueue[str]") -> None:
    try:
        connect(url)
    except TransportError as error:
        result.put(str(error))


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_process_forked_after_a_link_is_refused_and_leaves_that_alone(files: Files) -> None:
    with served(board(), LinkSpec("zenoh:")) as server:
        url = server.urls[0].replace("bench?", "bench/x?")
        mine = open_zenoh(url.removeprefix("zenoh:"))
        with connect(url) as bus:
            forking = multiprocessing.get_context("fork")
            result = forking.SimpleQueue()
            child = forking.Process(target=_connects, args=(url, result))
            child.start()
            child.join(60)
            assert child.exitcode == 0
            assert result.get() == FORKED
            assert bus.read(0) == 0x84
        mine.close()
