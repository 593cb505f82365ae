"""Who may do what on the network: TLS with certificates on both sides, and rights by name."""

from __future__ import annotations

import errno
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from vbus.errors import TransportError
from vbus.network.keys import ACCESS, ROOT

DIAGNOSE_SECONDS: Final = 2.0

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


@dataclass(frozen=True, slots=True)
class Security:
    """Certificates of this session and rights of others.

    Attributes:
        certificate: PEM file of this session's own certificate.
        key: PEM file of its private key.
        authority: PEM file of the authority whose certificates are accepted. Both sides of a
            link show theirs.
        allow: what the holder of a certificate may use, by its common name: keys below
            ``vbus/``, such as ``"bench/x/bus"``, ``"bench/**"`` or ``"**"``. Others may use
            nothing. None: every accepted certificate may use everything.
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

        Empty if they do not: it can be made, or nobody listens there.
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
                # Whether our own certificate was accepted is told after the handshake.
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


def access_control(allow: Mapping[str, tuple[str, ...]]) -> dict[str, Any]:
    """Return Zenoh's access control for rights by certificate name."""
    rules = [
        {
            "id": f"rule {number}",
            "permission": "allow",
            "flows": ["ingress", "egress"],
            "messages": list(_MESSAGES),
            "key_exprs": [ROOT + "/" + key for key in expand(keys)],
        }
        for number, keys in enumerate(allow.values())
    ]
    subjects: list[dict[str, Any]] = [
        {"id": f"subject {number}", "cert_common_names": [name]}
        for number, name in enumerate(allow)
    ]
    policies = [
        {"rules": [f"rule {number}"], "subjects": [f"subject {number}"]}
        for number in range(len(rules))
        if rules[number]["key_exprs"]
    ]
    rules = [rule for rule in rules if rule["key_exprs"]]
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


def expand(keys: tuple[str, ...]) -> list[str]:
    """Return the keys with what lies below a bus: its hosts and their events belong to it."""
    expanded: list[str] = []
    for key in keys:
        expanded.append(key)
        if key == "bus" or key.endswith("/bus"):
            expanded.append(f"{key}/**")
    return expanded
