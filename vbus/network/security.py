"""Who may do what on the network: TLS with certificates on both sides, and rights by name."""

from __future__ import annotations

import errno
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from msgspec import Struct

from vbus.core.errors import TransportError
from vbus.network.keys import ACCESS, ROOT

DIAGNOSE_SECONDS: Final = 2.0
"""How long a connection made only to find what is wrong may take; not measured."""

_MESSAGES: Final = (
    "put",
    "delete",
    "declare_subscriber",
    "query",
    "reply",
    "declare_queryable",
    "liveliness_token",
    "liveliness_query",
    "declare_liveliness_subscriber",
)
_ASKED: Final = (
    "declare_subscriber",
    "query",
    "liveliness_query",
    "declare_liveliness_subscriber",
)
"""The messages of a client of a key: queries and subscriptions."""

SERVE: Final = "serve "
"""Stands before a right whose holder answers and publishes under the key, as a board does."""


class Security(Struct, frozen=True):
    """Certificates of this session and rights of others.

    Attributes:
        certificate: PEM file of this session's own certificate.
        key: PEM file of its private key.
        authority: PEM file of the authority whose certificates are accepted. Both sides of a
            link show theirs.
        allow: what the holder of a certificate may use, by its common name: keys below
            ``vbus/``, such as ``"bench/x/bus"``, ``"bench/**"`` or ``"**"``. Others may use
            nothing. To use is to ask and to hear; with ``"serve "`` before it, a key is also
            answered and published at, as by a board behind a router. ``"**"`` and the keys of
            nodes are both. None: every accepted certificate may use everything.
    """

    certificate: str
    key: str
    authority: str
    allow: Mapping[str, tuple[str, ...]] | None = None

    def settings(self, listens: bool) -> dict[str, Any]:
        """Return Zenoh's settings by path.

        Args:
            listens: others connect to this session, and have the rights given; where it connects
                itself, it is the other side that gives rights.

        Raises:
            TransportError: a file cannot be read, or a certificate and a key do not belong
                together; names it.
        """
        self.check()
        settings: dict[str, Any] = {
            "transport/link/tls": {
                "root_ca_certificate": self.authority,
                "listen_certificate": self.certificate,
                "listen_private_key": self.key,
                "connect_certificate": self.certificate,
                "connect_private_key": self.key,
                "enable_mtls": True,
                "verify_name_on_connect": True,
                "close_link_on_expiration": True,
            }
        }
        if self.allow is not None and listens:
            settings["access_control"] = access_control(self.allow)
        return settings

    def check(self) -> None:
        """Refuse files that cannot be used.

        Raises:
            TransportError: names the file and says what is wrong.
        """
        import ssl

        for name in (self.authority, self.certificate, self.key):
            try:
                Path(name).read_bytes()
            except OSError as error:
                raise TransportError(f"{name} cannot be read: {error.strerror}") from error
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        try:
            context.load_verify_locations(self.authority)
        except ssl.SSLError as error:
            raise TransportError(f"{self.authority} is no PEM file with a certificate") from error
        try:
            context.load_cert_chain(self.certificate, self.key)
        except ssl.SSLError as error:
            raise TransportError(
                f"{self.certificate} and {self.key} are no certificate and its private key in"
                f" PEM ({error.reason or error})"
            ) from error

    def diagnose(self, endpoint: str) -> str:
        """Return why certificates keep a link to ``endpoint`` from being made.

        Empty if they do not: it can be made, or no process listens there.
        """
        import socket
        import ssl

        host, _, port = endpoint.partition("/")[2].rpartition(":")
        host = host.strip("[]")
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.load_verify_locations(self.authority)
        context.load_cert_chain(self.certificate, self.key)
        try:
            with (
                socket.create_connection((host, int(port)), DIAGNOSE_SECONDS) as link,
                context.wrap_socket(link, server_hostname=host) as secured,
            ):
                # Whether our own certificate was accepted shows after the handshake.
                secured.settimeout(0.3)
                secured.recv(1)
        except ssl.SSLCertVerificationError as error:
            return (
                f"the certificate shown there is not accepted: {error.verify_message}; it must be"
                f" signed by {self.authority} and name the host {host}"
            )
        except ssl.SSLError as error:
            return (
                f"the certificate {self.certificate} was refused there"
                f" ({(error.reason or str(error)).lower().replace('_', ' ')}); it must be signed"
                " by the authority the other side trusts"
            )
        except (ConnectionRefusedError, TimeoutError):
            return ""
        except OSError as error:
            unreachable = error.errno in (errno.EHOSTUNREACH, errno.ENETUNREACH)
            return "" if unreachable else f"{error.strerror or error}"
        return ""


def serves(right: str) -> bool:
    """Whether the holder of a right answers and publishes, as a board does."""
    return right.startswith(SERVE) or right == "**" or "/@nodes/" in f"{right}/"


def rights_in_words(allow: Mapping[str, tuple[str, ...]]) -> list[str]:
    """Return in words what each name may do, and in which direction."""
    lines = []
    for name, rights in allow.items():
        uses = ", ".join(right for right in rights if not serves(right))
        both = ", ".join(right.removeprefix(SERVE) for right in rights if serves(right))
        parts = [f"asks and hears {uses}"] * bool(uses)
        parts += [f"asks, hears, answers and publishes {both}"] * bool(both)
        lines.append(f"{name}: {'; '.join(parts) or 'nothing'}")
    return lines


def access_control(allow: Mapping[str, tuple[str, ...]]) -> dict[str, Any]:
    """Return Zenoh's access control for rights by certificate name."""
    rules: list[dict[str, Any]] = []
    subjects: list[dict[str, Any]] = []
    policies: list[dict[str, Any]] = []
    everything = list(_MESSAGES)
    for number, (name, rights) in enumerate(allow.items()):
        used = tuple(right for right in rights if not serves(right))
        served = tuple(right for right in rights if serves(right))
        mine = []
        for what, keys, flows, messages in (
            ("hears", expand(used), ["egress"], everything),
            ("asks", expand(used), ["ingress"], list(_ASKED)),
            ("is there", tokens(used), ["ingress"], ["liveliness_token"]),
            ("serves", expand(served), ["ingress", "egress"], everything),
        ):
            if keys:
                mine.append(f"{number} {what}")
                rules.append(
                    {
                        "id": mine[-1],
                        "permission": "allow",
                        "flows": flows,
                        "messages": messages,
                        "key_exprs": [f"{ROOT}/{key}" for key in keys],
                    }
                )
        subjects.append({"id": f"subject {number}", "cert_common_names": [name]})
        if mine:
            policies.append({"rules": mine, "subjects": [f"subject {number}"]})
    rules.append(
        {
            "id": "access",
            "permission": "allow",
            "flows": ["ingress", "egress"],
            "messages": ["query", "reply", "declare_queryable"],
            "key_exprs": [ACCESS],
        }
    )
    subjects.append({"id": "everybody"})
    policies.append({"rules": ["access"], "subjects": ["everybody"]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def expand(rights: tuple[str, ...]) -> list[str]:
    """Return the keys with what lies below a bus: its hosts and their events belong to it."""
    expanded: list[str] = []
    for right in rights:
        key = right.removeprefix(SERVE)
        expanded.append(key)
        if key == "bus" or key.endswith("/bus"):
            expanded.append(f"{key}/**")
    return expanded


def tokens(rights: tuple[str, ...]) -> list[str]:
    """Return the keys at which hosts with these rights say that they are there."""
    below = {"bus": "hosts/*", "**": "bus/hosts/*"}
    return [
        f"{right}/{below[last]}" for right in rights if (last := right.rpartition("/")[2]) in below
    ]
