"""Certificates and rights: who may use one chip's bus may use nothing else."""

from dataclasses import dataclass
from pathlib import Path

import pytest
import trustme

from tests.e2e.serving import served
from tests.ports import free_endpoint
from tests.waiting import PATIENCE, until
from tests.zenoh.processes import Processes, connected_to
from tests.zenoh.test_bus import board
from vbus.client import connect
from vbus.core.errors import TransportError
from vbus.network.security import Security, rights_in_words, tokens
from vbus.network.session import Network, boards_on, close_session, open_session
from vbus.serve.server import LinkSpec
from vbus.transports.zenoh import ZenohTransport


@dataclass
class Files:
    """PEM files made on the spot."""

    folder: Path
    authority: trustme.CA
    pem: str

    def of(self, name: str, authority: trustme.CA | None = None, trusted: str = "") -> Security:
        """Return the files of somebody whose certificate bears ``name``."""
        issued = (authority or self.authority).issue_cert("127.0.0.1", common_name=name)
        certificate, key = self.folder / f"{name}.pem", self.folder / f"{name}.key"
        certificate.write_bytes(b"".join(blob.bytes() for blob in issued.cert_chain_pems))
        key.write_bytes(issued.private_key_pem.bytes())
        return Security(str(certificate), str(key), trusted or self.pem)


@pytest.fixture
def short_patience(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vbus.network.session.OPEN_SECONDS", 1.0)


@pytest.fixture
def files(tmp_path: Path) -> Files:
    authority = trustme.CA()
    pem = tmp_path / "authority.pem"
    authority.cert_pem.write_to_path(str(pem))
    return Files(tmp_path, authority, str(pem))


def link(target: str, endpoint: str, who: Security) -> str:
    return (
        f"zenoh:{target}?connect={endpoint}&certificate={who.certificate}&key={who.key}"
        f"&authority={who.authority}"
    )


def secured(files: Files, **allow: tuple[str, ...]) -> tuple[Network, str]:
    endpoint = free_endpoint("tls")
    own = files.of("board")
    security = Security(own.certificate, own.key, own.authority, allow)
    return Network(listen=(endpoint,), security=security), endpoint


def test_a_host_may_use_the_bus_it_is_allowed_and_nothing_else(files: Files) -> None:
    network, endpoint = secured(files, alice=("bench/x/bus",), bob=("bench/*/telemetry",))
    alice, bob, carol = files.of("alice"), files.of("bob"), files.of("carol")
    with served(board(), LinkSpec("zenoh:", network=network)) as server:
        with connect(link("bench/x", endpoint, alice)) as bus:
            assert bus.read(0) == 0x84
            with bus.claim():
                bus.events("x.HI")
                bus.echo()
            # The token and the events of a host lie below the bus.
            transport = server.hosts[0].transport
            assert isinstance(transport, ZenohTransport)
            until(lambda: any(link.token_seen for link in transport._links.values()), "the token")
        for target, who, said in (
            ("bench/y", alice, r'"alice" may use bench/x/bus here, but not vbus/bench/y/bus'),
            ("bench", alice, r'"alice" may use bench/x/bus here, but not vbus/bench/bus'),
            ("bench/x", bob, r'"bob" may use bench/\*/telemetry here, but not vbus/bench/x/bus'),
            ("bench/x", carol, r'"carol" may use nothing here, and so not vbus/bench/x/bus'),
        ):
            with pytest.raises(TransportError, match=f"forbidden: the holder .*{said}"):
                connect(link(target, endpoint, who))

        asked = {}
        for who in (alice, bob):
            session = open_session(connect=[endpoint], mode="client", security=who)
            asked[who.certificate] = [
                len(list(session.get(key, timeout=PATIENCE)))
                for key in ("vbus/bench/x/telemetry", "vbus/bench/status", "vbus/bench/x/pins/~RST")
            ]
            close_session(session)
        assert asked == {alice.certificate: [0, 0, 0], bob.certificate: [1, 0, 0]}
        assert boards_on([endpoint], alice) == []


@pytest.mark.usefixtures("short_patience")
def test_a_certificate_of_another_authority_is_refused_and_named(files: Files) -> None:
    network, endpoint = secured(files, alice=("**",))
    stranger = trustme.CA()
    alice = files.of("alice", stranger)
    with (
        served(board(), LinkSpec("zenoh:", network=network)),
        pytest.raises(TransportError) as caught,
    ):
        connect(link("bench/x", endpoint, alice))
    assert f"{endpoint} cannot be reached: the certificate {alice.certificate} was refused" in str(
        caught.value
    )


@pytest.mark.usefixtures("short_patience")
def test_a_board_whose_certificate_is_not_trusted_is_refused_by_the_host(files: Files) -> None:
    network, endpoint = secured(files, alice=("**",))
    other = files.folder / "other.pem"
    trustme.CA().cert_pem.write_to_path(str(other))
    with served(board(), LinkSpec("zenoh:", network=network)):
        alice = files.of("alice", trusted=str(other))
        with pytest.raises(
            TransportError, match=r"the certificate shown there is not accepted"
        ) as caught:
            connect(link("bench/x", endpoint, alice))
        assert str(other) in str(caught.value)


def test_a_host_without_a_certificate_does_not_get_in(files: Files) -> None:
    network, endpoint = secured(files, alice=("**",))
    with (
        served(board(), LinkSpec("zenoh:", network=network)),
        pytest.raises(TransportError, match=r"cannot be reached"),
    ):
        open_session(connect=[endpoint.replace("tls", "tcp")], mode="client", wait=0.5)


@pytest.mark.parametrize(
    ("broken", "said"),
    [
        ("missing.pem", "missing.pem cannot be read: No such file or directory"),
        ("text.pem", "text.pem and .*board.key are no certificate and its private key in PEM"),
    ],
)
def test_files_that_are_no_certificates_are_named(files: Files, broken: str, said: str) -> None:
    (files.folder / "text.pem").write_text("no PEM\n")
    own = files.of("board")
    bad = Security(str(files.folder / broken), own.key, own.authority)
    with (
        pytest.raises(TransportError, match=said),
        served(board(), LinkSpec("zenoh:", network=Network(("tls/127.0.0.1:1",), (), bad))),
    ):
        pass


def behind_a_router(files: Files, processes: Processes, right: str) -> str:
    """Start a board behind a router where it has one right; return the router's endpoint."""
    endpoint = free_endpoint("tls")
    own, behind = files.of("router"), files.of("board")
    (files.folder / "router.toml").write_text(
        f'[zenoh]\nlisten = ["{endpoint}"]\ncertificate = "{own.certificate}"\nkey = "{own.key}"\n'
        f'authority = "{own.authority}"\n[zenoh.allow]\nboard = ["{right}"]\n'
        'alice = ["bench/x/bus"]\n'
    )
    router = processes.start("router", "router.toml")
    assert router.ready, router.said
    processes.board(
        "bench",
        connected_to(
            endpoint,
            f'certificate = "{behind.certificate}"\nkey = "{behind.key}"\n'
            f'authority = "{behind.authority}"\n',
        ),
    )
    return endpoint


def test_a_router_keeps_the_rights_for_the_boards_behind_it(
    files: Files, processes: Processes
) -> None:
    endpoint = behind_a_router(files, processes, "**")
    with connect(link("bench/x", endpoint, files.of("alice"))) as bus:
        assert bus.read(0) == 0x84
    with pytest.raises(TransportError, match=r'forbidden: .*"alice".*not vbus/bench/y/bus'):
        connect(link("bench/y", endpoint, files.of("alice")))
    assert [found["board"] for found in boards_on([endpoint], files.of("board"))] == ["bench"]


def test_a_right_has_a_direction_nobody_publishes_or_answers_for_the_board(files: Files) -> None:
    network, endpoint = secured(
        files, alice=("bench/x/bus",), display=("bench/*/telemetry",), forger=("bench/**",)
    )
    alice, display, forger = files.of("alice"), files.of("display"), files.of("forger")
    heard: list[bytes] = []
    asked: list[str] = []
    with served(board(), LinkSpec("zenoh:", network=network)):
        hears = open_session(connect=[endpoint], mode="client", security=display)
        forges = [
            open_session(connect=[endpoint], mode="client", security=who)
            for who in (alice, display, forger)
        ]
        key = "vbus/bench/x/telemetry"
        hears.declare_subscriber(key, lambda sample: heard.append(sample.payload.to_bytes()))
        for session in forges:
            session.put(key, b"forged")
            session.delete(key)
            session.declare_queryable(
                "vbus/bench/x/bus", lambda query: asked.append("stolen"), complete=True
            )
        with connect(link("bench/x", endpoint, files.of("alice"))) as bus:
            assert [bus.read(0) for _ in range(20)] == [0x84] * 20
        # What the board publishes after the forged ones is heard, so they would have been.
        until(lambda: bool(heard), "the board's own telemetry")
        for session in (hears, *forges):
            close_session(session)
    assert b"forged" not in heard
    assert not asked


def test_a_board_behind_a_router_serves_what_it_may_and_nothing_else(
    files: Files, processes: Processes
) -> None:
    endpoint = behind_a_router(files, processes, "serve bench/**")
    with connect(link("bench/x", endpoint, files.of("alice"))) as bus:
        assert bus.read(0) == 0x84


def test_what_each_name_may_do_is_told_with_its_direction() -> None:
    rights = {
        "alice": ("bench/x/bus",), "far": ("serve far/**", "bench/status"), "all": ("**",),
        "node": ("two/@nodes/**",), "nobody": (),
    }  # fmt: skip
    assert rights_in_words(rights) == [
        "alice: asks and hears bench/x/bus",
        "far: asks and hears bench/status; asks, hears, answers and publishes far/**",
        "all: asks, hears, answers and publishes **",
        "node: asks, hears, answers and publishes two/@nodes/**",
        "nobody: nothing",
    ]
    assert tokens(("bench/x/bus", "bus", "bench/**", "bench/status")) == [
        "bench/x/bus/hosts/*", "bus/hosts/*", "bench/**/bus/hosts/*",
    ]  # fmt: skip
