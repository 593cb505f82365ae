"""Hosts side by side on terminals, against a C echo with epoll: trips, and who waits for whom.

The same C client drives both. The ratio within one run is the result.
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
HOSTS = 16
FLOODS = 4
SECONDS = "0.4"
ROUNDS = 7


def board() -> str:
    """Return a board of one chip for each host."""
    text = '[board]\nname = "fair-links"\ntime = "realtime"\n'
    for number in range(HOSTS):
        text += f'[chips.c{number}]\npart = "LM629N-8"\nclock = "8 MHz"\nplant = "none"\n'
        text += f'[[hosts]]\ntransport = "pty:$VBUS_RUNTIME/c{number}"\nprotocol = "byte"\n'
        text += f'chips = ["c{number}"]\n'
    return text


def measure(client: Path, what: str, terminals: list[str]) -> tuple[float, float, float]:
    """Return trips per second, median and 99th percentile (us)."""
    done = subprocess.run(
        [client, what, SECONDS, *terminals], check=True, capture_output=True, text=True
    )
    trips, median, late = (float(word) for word in done.stdout.split())
    return trips, median / 1000, late / 1000


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        program = folder / "fair_links"
        subprocess.run(["gcc", "-O2", "-o", program, HERE / "fair_links.c"], check=True)
        (folder / "board.toml").write_text(board())
        echo = subprocess.Popen([program, "serve", str(HOSTS)], stdout=subprocess.PIPE, text=True)
        server = subprocess.Popen(
            [sys.executable, "-m", "vbus", "run", "--json", folder / "board.toml"],
            stdout=subprocess.PIPE, text=True,
            env={**os.environ, "VBUS_RUNTIME": str(folder / "run")},
        )  # fmt: skip
        try:
            assert echo.stdout is not None
            assert server.stdout is not None
            terminals = {
                "C echo": [echo.stdout.readline().strip() for _ in range(HOSTS)],
                "vbus": [str(folder / "run" / f"c{number}") for number in range(HOSTS)],
            }
            json.loads(server.stdout.readline())
            found: dict[tuple[str, str], list[tuple[float, float, float]]] = {}
            for _ in range(ROUNDS):
                for who, paths in terminals.items():
                    for what, mode, chosen in (
                        (f"{HOSTS} hosts", "trips", paths),
                        ("one host", "trips", paths[:1]),
                        ("1 kHz alone", "steady", paths[:1]),
                        (f"1 kHz beside {FLOODS} floods", "steady", paths[: 1 + FLOODS]),
                    ):
                        row = measure(program, mode, chosen)
                        found.setdefault((what, who), []).append(row)
        finally:
            for process in (echo, server):
                process.terminate()
                process.wait()
    print(f"status reads over terminals, medians of {ROUNDS} rounds in turn")
    print(f"{'':24}{'':10}{'trips/s':>10}{'p50, us':>10}{'p99, us':>10}")
    middle = {
        key: tuple(statistics.median(column) for column in zip(*rows, strict=True))
        for key, rows in found.items()
    }
    for (what, who), (trips, median, late) in middle.items():
        print(f"{what:24}{who:10}{trips:10.0f}{median:10.1f}{late:10.1f}")
    many = [middle[f"{HOSTS} hosts", who] for who in ("vbus", "C echo")]
    print(f"{HOSTS} hosts: {many[0][0] / many[1][0]:.2f} of the C echo's trips   goal >= 0.65")
    print(f"{HOSTS} hosts: {many[0][2] / many[1][2]:.2f} times its p99          goal <= 2")
    alone = middle["1 kHz alone", "vbus"][1]
    beside = middle[f"1 kHz beside {FLOODS} floods", "vbus"][1]
    print(f"1 kHz beside floods: {beside / alone:.2f} times alone     goal <= 2")


if __name__ == "__main__":
    main()
