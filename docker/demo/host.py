"""Moves three axes on three nodes: one start for all, ordered for one instant of chip time."""

import json
import subprocess
import sys
from pathlib import Path

from vbus.board.config import read_board_file
from vbus.client import Bus, connect
from vbus.client.lm628 import Lm628
from vbus.core.kernel import MS, SECOND
from vbus.serve.nodes.ordering import order

BOARD = Path(__file__).with_name("three_axes.toml")
TARGETS = {"x": 4000, "y": -2500, "z": 1200}
NEAR = 3
"""Counts from its target at which an axis is there."""


def prepared(bus: Bus, target: int) -> Lm628:
    """Load a move, so that it lacks its start alone."""
    axis = Lm628(bus)
    axis.load_filter(kp=300, kd=2000)
    axis.load_trajectory(acc=40, vel=2 << 16, pos=target)
    axis.rsti(0)  # no trajectory is complete from here on
    bus.echo()  # all of it has arrived
    return axis


def main() -> int:
    """Move; return 0 if all axes have arrived."""
    router = sys.argv[1]
    buses = {name: connect(f"zenoh:machine.{name}/{name}?connect={router}") for name in TARGETS}
    axes = {name: prepared(bus, TARGETS[name]) for name, bus in buses.items()}
    file, _ = read_board_file(str(BOARD))
    at, answers = order(file, "0us x+y+z w 0 1  # STT", "start", 2 * SECOND, (router,))
    for answer in answers:
        print(f"node {answer.node}: {answer.taken} requests, {(at - answer.now) / MS:.3f} ms ahead")
    print(f"ordered for chip time {at / MS:.6f} ms")
    for bus in buses.values():
        bus.delay("2200ms")  # until the start is over
    arrived = True
    for name, axis in axes.items():
        axis.wait_status(longest="20s")
        axis.bus.delay("200ms")
        position = axis.rdrp()
        arrived = arrived and abs(position - TARGETS[name]) <= NEAR
        print(f"{name} is at {position:5d} counts, asked for {TARGETS[name]:5d}")
    for bus in buses.values():
        bus.close()
    listed = subprocess.run(
        ["vbus", "ls", "--json", "--zenoh", router], stdout=subprocess.PIPE, check=True
    )
    for board in json.loads(listed.stdout):
        if board.get("node", {}).get("keeps_epoch"):
            skew = board["node"]["skew"]
            shown = ", ".join(
                f"{key} {skew[key + '_ns'] / 1e6:.3f} ms" for key in ("p50", "p99", "max")
            )
            print(f"nodes were apart in wall time by {shown}")
    print("all axes have arrived" if arrived else "an axis has not arrived")
    return 0 if arrived else 1


if __name__ == "__main__":
    sys.exit(main())
