"""Network namespaces joined by veth: several computers on one machine, and a cable to pull."""

import itertools
import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.left_out import require
from tests.waiting import PATIENCE

_numbers = itertools.count()


def _ip(*arguments: str) -> None:
    made = subprocess.run(["ip", *arguments], capture_output=True, text=True, timeout=PATIENCE)
    if made.returncode:
        raise OSError(f"ip {' '.join(arguments)}: {made.stderr.strip()}")


class Computer:
    """A network namespace with a loopback and one cable.

    Attributes:
        name: the namespace's, for ``ip netns``.
        address: its IPv4 address on the cable.
    """

    def __init__(self, name: str, address: str) -> None:
        self.name: str = name
        self.address: str = address
        self.run: list[str] = ["ip", "netns", "exec", name]
        """Put before a command: it runs there, under the process id that was started."""

    def cut(self) -> None:
        """Pull the cable: what is sent is lost, and nobody is told."""
        _ip("-n", self.name, "link", "set", "cable", "down")

    def mend(self) -> None:
        """Put the cable back."""
        _ip("-n", self.name, "link", "set", "cable", "up")
        _ip("-n", self.name, "route", "replace", "default", "via", _gateway(self.address))


class Computers:
    """A hub and computers around it, each joined to the hub by a cable of its own.

    The hub passes packets on, so all reach all; it is a computer like the others, and has no cable
    to pull.

    Attributes:
        hub: the one in the middle.
        around: the others.
    """

    def __init__(self, around: int) -> None:
        prefix = f"vbus{os.getpid()}x{next(_numbers)}"
        self.hub: Computer = Computer(f"{prefix}hub", "10.77.0.1")
        self.around: list[Computer] = [
            Computer(f"{prefix}n{n}", f"10.77.{n + 1}.2") for n in range(around)
        ]

    def make(self) -> None:
        """Make the namespaces and their cables.

        Raises:
            OSError: this is not allowed here, or ``ip`` fails; says which command.
        """
        for computer in (self.hub, *self.around):
            _ip("netns", "add", computer.name)
            _ip("-n", computer.name, "link", "set", "lo", "up")
        hub = self.hub.name
        _ip("-n", hub, "address", "add", f"{self.hub.address}/32", "dev", "lo")
        for number, computer in enumerate(self.around):
            _ip(
                *("-n", hub, "link", "add", f"to{number}", "type", "veth"),
                *("peer", "name", "cable", "netns", computer.name),
            )
            _ip(
                "-n",
                hub,
                "address",
                "add",
                f"{_gateway(computer.address)}/24",
                "dev",
                f"to{number}",
            )
            _ip("-n", hub, "link", "set", f"to{number}", "up")
            _ip("-n", computer.name, "address", "add", f"{computer.address}/24", "dev", "cable")
            computer.mend()
        forward = "/proc/sys/net/ipv4/ip_forward"
        subprocess.run(
            [*self.hub.run, "sh", "-c", f"echo 1 > {forward}"], check=True, capture_output=True
        )

    def remove(self) -> None:
        """Remove what was made; the cables go with the namespaces."""
        for computer in (self.hub, *self.around):
            if Path("/run/netns", computer.name).exists():
                _ip("netns", "delete", computer.name)


def _gateway(address: str) -> str:
    return address.rpartition(".")[0] + ".1"


@contextmanager
def computers(around: int) -> Iterator[Computers]:
    """Make a hub and computers around it, and remove them again.

    Skips the test, with the reason, where namespaces are not allowed. Stop the processes inside
    before leaving: a namespace with a process in it lives on without its name.
    """
    require("ip")
    made = Computers(around)
    try:
        try:
            made.make()
        except (OSError, subprocess.CalledProcessError) as error:
            pytest.skip(f"network namespaces are not allowed here: {error}")
        yield made
    finally:
        made.remove()
