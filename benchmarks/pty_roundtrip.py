"""PTY status reads through vbus against a bare C echo: the same C client, rounds in turn.

Absolute times mean little on a shared machine; the ratio within one run is the result.
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
ROUNDS = 15
MESSAGES = 3000
BATCH = 64

BOARD = """
[board]
name = "pty-roundtrip"
time = "realtime"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "motor"
[plants.motor]
model = "dc_motor"
[[hosts]]
transport = "pty:$VBUS_RUNTIME/x"
protocol = "byte"
chips = ["x"]
"""


def build(source: str, folder: Path) -> Path:
    program = folder / source
    subprocess.run(["gcc", "-O2", "-o", program, HERE / f"{source}.c"], check=True)
    return program


def measure(client: Path, terminal: str, messages: int, reads: int) -> tuple[float, float, float]:
    done = subprocess.run(
        [client, terminal, str(messages), str(reads)], check=True, capture_output=True, text=True
    )
    median, mean, late = (int(word) / 1000 for word in done.stdout.split())
    return median, mean, late


def cpu_seconds(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        client, echo = build("pty_client", folder), build("pty_echo", folder)
        board = folder / "board.toml"
        board.write_text(BOARD)
        environment = {**os.environ, "VBUS_RUNTIME": str(folder / "run")}
        bare = subprocess.Popen([echo], stdout=subprocess.PIPE, text=True)
        server = subprocess.Popen(
            [sys.executable, "-m", "vbus", "run", "--json", board],
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
        )
        try:
            assert bare.stdout is not None
            assert server.stdout is not None
            terminals = {"C echo": bare.stdout.readline().strip()}
            json.loads(server.stdout.readline())
            terminals["vbus"] = str(folder / "run" / "x")
            singles: dict[str, list[float]] = {who: [] for who in terminals}
            batches: dict[str, list[float]] = {who: [] for who in terminals}
            cpu = 0.0
            for _ in range(ROUNDS):
                for who, terminal in terminals.items():
                    before = cpu_seconds(server.pid)
                    singles[who].append(measure(client, terminal, MESSAGES, 1)[0])
                    if who == "vbus":
                        cpu += cpu_seconds(server.pid) - before
                    batches[who].append(measure(client, terminal, MESSAGES // 20, BATCH)[0])
        finally:
            for process in (bare, server):
                process.terminate()
                process.wait()
    ratios = [
        ours / theirs for ours, theirs in zip(singles["vbus"], singles["C echo"], strict=True)
    ]
    cycles = ROUNDS * (MESSAGES + MESSAGES // 10)
    print(f"PTY status read, round trip of a C client, median of {ROUNDS} interleaved rounds")
    print(f"  bare C echo (the limit)      {statistics.median(singles['C echo']):8.1f} us")
    print(f"  vbus, LM629 in real time     {statistics.median(singles['vbus']):8.1f} us")
    print(f"  ratio, round by round        {statistics.median(ratios):8.2f}      goal <= 1.25")
    print(f"  CPU of the server per cycle  {cpu / cycles * 1e6:8.1f} us")
    each = statistics.median(batches["vbus"]) / BATCH
    limit = statistics.median(batches["C echo"]) / BATCH
    print(f"  {BATCH} cycles in one message   {each:8.2f} us each   goal <= 3")
    print(f"  the same from the C echo     {limit:8.2f} us each")


if __name__ == "__main__":
    main()
