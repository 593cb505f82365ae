"""Certificates and rights between nodes: whoever is not meant to keep time with them is told so."""

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
import trustme

from tests.nodes.processes import Bench, ended
from tests.ports import free_endpoint

BOARD = """\
[board]
name = "four"
time = "lockstep"
power_on = "done"

[nodes.a]
[nodes.b]

[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "m"
node = "a"
[chips.y]
part = "LM629N-8"
clock = "8 MHz"
plant = "n"
node = "b"
[plants.m]
model = "ideal"
[plants.n]
model = "ideal"

[nets]
"STOP" = { pins = ["x.HI", "y./IN"], delay = "500 us" }

[zenoh]
certificate = "own.pem"
key = "own.key"
authority = "authority.pem"
[zenoh.allow]
right = ["four/@nodes/**"]
visitor = ["four.a/x/bus"]
all = ["**"]
"""
SCRIPT = "1ms y r 0\nend 5ms\n"


class Computers:
    """A folder for each computer: the same board file, and certificates of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder: Path = folder
        self.authority: trustme.CA = trustme.CA()
        self.endpoint: str = free_endpoint("tls")
        self.benches: list[Bench] = []

    def bench(
        self, name: str, issued_by: trustme.CA | None = None, trusts: trustme.CA | None = None
    ) -> Bench:
        """Return the computer whose certificate bears ``name``."""
        folder = self.folder / f"{name}{len(self.benches)}"
        made = Bench(folder, BOARD, SCRIPT, make=True, endpoint=self.endpoint)
        issued = (issued_by or self.authority).issue_cert("127.0.0.1", common_name=name)
        (folder / "own.pem").write_bytes(b"".join(pem.bytes() for pem in issued.cert_chain_pems))
        (folder / "own.key").write_bytes(issued.private_key_pem.bytes())
        (trusts or self.authority).cert_pem.write_to_path(str(folder / "authority.pem"))
        self.benches.append(made)
        return made


@pytest.fixture
def computers(tmp_path: Path) -> Iterator[Computers]:
    made = Computers(tmp_path)
    yield made
    for bench in made.benches:
        bench.close()


def begun(bench: Bench) -> subprocess.Popen[str]:
    """Start the node that listens; return when it waits for the other."""
    process = bench.start("a")
    bench.until(lambda: bench.node("a") != {})
    return process


def test_nodes_with_rights_keep_one_time_whichever_comes_first(computers: Computers) -> None:
    left, right = computers.bench("left"), computers.bench("right")
    second = right.start("b")
    right.until(lambda: right.node("b") != {})
    first = left.start("a")
    for process in (first, second):
        code, out = ended(process)
        assert code == 0, out
        assert "the scenario is over at 5.000000 ms" in out
    traces = [left.trace("a"), right.trace("b")]
    assert left.vbus("trace", *map(str, traces)).stdout.split()[0]


def test_a_node_without_rights_is_told_and_the_right_one_still_waited_for(
    computers: Computers,
) -> None:
    left = computers.bench("left")
    first = begun(left)
    for name, may in (("visitor", "may use four.a/x/bus here"), ("stranger", "may use nothing")):
        code, out = ended(computers.bench(name).start("b"))
        assert code == 4, out
        assert f'node b is not let in: the holder of the certificate "{name}" {may}' in out
        assert "vbus/four/@nodes/**; see [zenoh.allow] of the process that listens there" in out
    for process in (computers.bench("right").start("b"), first):
        code, out = ended(process)
        assert code == 0, out


def test_a_node_with_a_wrong_certificate_is_told_which_and_why(computers: Computers) -> None:
    left = computers.bench("left")
    first = begun(left)
    other = trustme.CA()
    forged = computers.bench("right", issued_by=other)
    code, out = ended(forged.start("b"))
    assert code == 4, out
    assert f"{computers.endpoint} cannot be reached: the certificate own.pem was refused" in out
    doubting = computers.bench("right", trusts=other)
    code, out = ended(doubting.start("b"))
    assert code == 4, out
    assert "the certificate shown there is not accepted" in out
    assert left.node("a")["others"] == {"b": "not here yet"}
    for process in (computers.bench("right").start("b"), first):
        code, out = ended(process)
        assert code == 0, out
