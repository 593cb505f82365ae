"""A cable is pulled for five seconds: what hosts see, and that nothing is carried out twice."""

import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.namespaces import Computers, computers
from tests.waiting import PATIENCE, until
from tests.zenoh.processes import BOARD, Process
from vbus.client import connect
from vbus.core.errors import TransportError
from vbus.serve.registry import ask

AWAY = 5.0
"""Seconds: longer than Zenoh's lease, a host's patience and a board's grace by default."""
PLACE = "tcp/10.77.0.1:7447"

HOST = """
import os, sys
from vbus.client import connect
from vbus.client import connect
from vbus.core.errors import TransportError

link, chip, stop = sys.argv[1:]
done, said = 0, ""
try:
    with connect(link) as bus, bus.claim():
        bus.write(0, 0x1F)  # LTRJ: a packet follows that does not end
        done += 1
        while not os.path.exists(stop):
            bus.write(1, done & 255)
            bus.delay("200ms")  # the reply is late: a cut finds it missing, and the cycle done
            bus.echo()
            done += 1
            print(done, flush=True)
except TransportError as error:
    said = str(error)
print("end", done, said, flush=True)
"""


@pytest.fixture
def place() -> Iterator[Computers]:
    with computers(1) as made:
        yield made


class Host:
    """A host program on another computer, in the middle of a packet all the time."""

    def __init__(self, folder: Path, inside: list[str], link: str, chip: str) -> None:
        script = folder / "host.py"
        script.write_text(HOST)
        self.stop_file = folder / f"stop-{chip}"
        self.output = folder / f"output-{chip}"
        with self.output.open("w") as output:
            self.popen = subprocess.Popen(
                [*inside, sys.executable, str(script), link, chip, str(self.stop_file)],
                stdout=output,
                stderr=subprocess.STDOUT,
            )

    def lines(self) -> list[str]:
        return self.output.read_text().splitlines()

    def ended(self) -> tuple[int, str]:
        """Return how many cycles the host knows of, and why it gave up, if it did."""
        self.popen.wait(PATIENCE)
        word, done, *said = self.lines()[-1].split(" ", 2)
        assert word == "end", self.lines()[-20:]
        return int(done), "".join(said)


def test_hosts_that_are_cut_off_go_on_or_are_told_and_nothing_is_done_twice(
    place: Computers, tmp_path: Path, runtime: Path
) -> None:
    """On chip x a host that is told to be patient, on chip y one that is not."""
    board = tmp_path / "bench.toml"
    more = f'[zenoh]\nlisten = ["{PLACE}"]\nremote = true\ngrace = "30 s"\n'
    board.write_text(BOARD.format(name="bench", time="realtime", more=more))
    served = Process(["run", str(board)], tmp_path, inside=place.hub.run, patient=False)
    [computer] = place.around
    hosts = {}
    try:
        assert served.ready, served.said
        for chip, patience in (("x", "&patience=60"), ("y", "")):
            link = f"zenoh:bench/{chip}?connect={PLACE}{patience}"
            hosts[chip] = Host(tmp_path, computer.run, link, chip)
        until(lambda: all(len(host.lines()) > 2 for host in hosts.values()), "hosts at work")
        computer.cut()
        began = time.monotonic()
        patient, impatient = hosts["x"], hosts["y"]
        done, said = impatient.ended()
        assert f"zenoh:bench/y: the link to {PLACE} is lost" in said
        time.sleep(max(0.0, AWAY - (time.monotonic() - began)))
        assert patient.popen.poll() is None
        before = len(patient.lines())
        computer.mend()
        until(lambda: len(patient.lines()) > before + 2, "the patient host goes on")
        patient.stop_file.touch()
        all_done, nothing = patient.ended()
        assert nothing == ""
        chips = {chip["name"]: chip for chip in state(runtime, "bench")["chips"]}
        assert chips["x"]["writes"] == all_done
        # The last message of the other host may have arrived; whether it did, it cannot know.
        assert done <= chips["y"]["writes"] <= done + 1
    finally:
        for host in hosts.values():
            if host.popen.poll() is None:
                host.popen.kill()
                host.popen.wait()
        served.stop()


def state(runtime: Path, board: str) -> dict[str, Any]:
    try:
        found: dict[str, Any] = ask(runtime / "boards" / f"{board}.sock")
    except TransportError:
        return {}
    return found


@pytest.mark.parametrize("text", ["", "soon", "-1", "nan", "1e9"])
def test_a_patience_that_is_no_time_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"patience=.* is no time; write seconds from 0 to 86400"):
        connect(f"zenoh:bench/x?patience={text}")
