"""A host over Zenoh that sends many messages, and reads no reply before it is told to.

``deaf_host.py ENDPOINT posts|queries COUNT``: one line of its input opens its ears; then it asks
the last message again, and prints how long the reply is.
"""

import sys
import threading
from typing import Any

import zenoh

from vbus.network import envelope, keys
from vbus.network.session import close_session, open_session

BUS = keys.bus("bench", "x")
REQUESTS = b"\x52" * 16384  # NOW: nine bytes for each


def main() -> None:
    endpoint, how, count = sys.argv[1], sys.argv[2], int(sys.argv[3])
    session = open_session(connect=[endpoint], mode="client")
    name = envelope.new_session()
    token = keys.host(BUS, envelope.public(name))
    hears = threading.Event()

    def take(_: Any) -> None:
        hears.wait()

    def cover(number: int) -> bytes:
        return envelope.Envelope(envelope.REQUESTS, name, number, 1 if number else 0).pack()

    def ask(number: int, data: bytes) -> bytes:
        while True:  # a link that has stood still for a lease is given up, with what was under way
            for reply in session.get(BUS, payload=data, attachment=cover(number), timeout=5.0):
                if reply.ok is not None:
                    return reply.ok.payload.to_bytes()
                assert reply.err is not None
                if reply.err.payload.to_bytes().startswith(envelope.GONE.encode()):
                    sys.exit(reply.err.payload.to_bytes().decode())

    kept: list[Any] = [
        session.liveliness().declare_token(token),
        session.declare_subscriber(
            keys.replies(token), zenoh.handlers.Callback(take, indirect=False)
        ),
    ]
    assert ask(0, b"\x02\x01") == b"E\x01"
    posts = session.declare_publisher(
        keys.requests(token), congestion_control=zenoh.CongestionControl.BLOCK
    )
    for number in range(1, count + 1):
        if how == "posts":
            posts.put(REQUESTS, attachment=cover(number))
        else:
            kept.append(
                session.get(
                    BUS, zenoh.handlers.Callback(take, indirect=False), payload=REQUESTS,
                    attachment=cover(number), timeout=130.0,
                    congestion_control=zenoh.CongestionControl.BLOCK,
                )
            )  # fmt: skip
    print("sent", flush=True)
    sys.stdin.readline()
    hears.set()
    print(len(ask(count, REQUESTS)), flush=True)
    close_session(session)


main()
