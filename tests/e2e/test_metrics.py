"""Numbers of a running board, in vbus ls --json and for Prometheus."""

import contextlib
import json
import os
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest
from prometheus_client.openmetrics.parser import text_string_to_metric_families as open_metrics
from prometheus_client.parser import text_string_to_metric_families

from tests.e2e.command import vbus
from tests.waiting import PATIENCE
from vbus import connect
from vbus.board.build import load_board_text
from vbus.core import exit_codes
from vbus.serve.registry import running

BOARD = """
[board]
name = "counted"

[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "m"

[plants.m]
model = "ideal"

[[hosts]]
transport = "unix:$VBUS_RUNTIME/counted"
"""


def get(url: str, accept: str = "") -> tuple[str, str]:
    """Return body and content type."""
    request = urllib.request.Request(url, headers={"Accept": accept} if accept else {})
    with urllib.request.urlopen(request, timeout=PATIENCE) as answer:
        return answer.read().decode(), answer.headers["Content-Type"]


def samples(text: str) -> dict[tuple[str, ...], float]:
    """Return values by name and label values, without the board's name."""
    return {
        (sample.name, *(v for k, v in sorted(sample.labels.items()) if k != "board")): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


@pytest.fixture
def board_file(tmp_path: Path) -> Path:
    path = tmp_path / "counted.toml"
    path.write_text(BOARD)
    return path


@pytest.fixture
def url(board_file: Path, runtime: Path) -> Iterator[str]:
    """A board that runs and tells its numbers."""
    command = [sys.executable, "-m", "vbus", "run", "--metrics", "127.0.0.1:0", "--json"]
    with subprocess.Popen(
        [*command, str(board_file)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as board:
        assert board.stdout is not None
        line = board.stdout.readline()
        assert line, board.communicate()[1]
        try:
            yield json.loads(line)["metrics"]
        finally:
            board.terminate()


def drive(runtime: Path) -> None:
    """Two writes and five reads."""
    with connect(f"unix:{runtime}/counted") as bus:
        bus.write(0, 0x1D)
        bus.write(0, 0x1D)
        for _ in range(5):  # the answers come after the writes have been carried out
            bus.read(0)


def test_cycles_violations_sessions_bytes_and_times_are_told(url: str, runtime: Path) -> None:
    drive(runtime)

    text, content_type = get(url)

    found = samples(text)
    assert content_type.startswith("text/plain")
    assert found["vbus_bus_cycles_total", "x", "read"] == 5
    assert found["vbus_bus_cycles_total", "x", "write"] == 2
    link = f"0:unix:{runtime}/counted"
    assert found["vbus_sessions_served_total", link] == 1
    assert found["vbus_link_bytes_total", "received", link] > 0
    assert found["vbus_link_bytes_total", "sent", link] > 0
    assert found["vbus_round_trip_seconds_bucket", "+Inf"] > 0
    assert (
        found["vbus_round_trip_seconds_count",] == found["vbus_round_trip_seconds_bucket", "+Inf"]
    )
    assert found["vbus_chip_time_seconds_total",] > 0
    assert found["vbus_overload_ratio",] == 0


def test_what_prometheus_asks_for_is_valid_open_metrics(url: str, runtime: Path) -> None:
    drive(runtime)

    text, content_type = get(url, "application/openmetrics-text; version=1.0.0")

    assert content_type.startswith("application/openmetrics-text")
    families = {family.name: family for family in open_metrics(text)}
    assert families["vbus_lag_seconds"].type == "histogram"
    assert families["vbus_bus_cycles"].type == "counter"
    assert {sample.labels["board"] for f in families.values() for sample in f.samples} == {
        "counted"
    }


def test_counts_of_ended_sessions_stay_and_vbus_ls_tells_the_same(url: str, runtime: Path) -> None:
    drive(runtime)
    drive(runtime)

    (told,) = running()

    assert told["metrics"] == url
    assert (told["chips"][0]["reads"], told["chips"][0]["writes"]) == (10, 4)
    assert told["links"][0]["served"] == 2
    assert told["links"][0]["received"] > 0
    assert told["round_trips"]["count"] == sum(told["round_trips"]["buckets"]) > 0
    assert told["round_trips"]["p50_ns"] <= told["round_trips"]["p99_ns"]
    assert url in vbus("ls").stdout


def test_violations_are_counted_by_rule(url: str, runtime: Path) -> None:
    with connect(f"unix:{runtime}/counted") as bus:
        bus.write(0, 0x7F)  # no such command
        while bus.read(0) & 1:
            pass

    found = samples(get(url)[0])

    assert found["vbus_violations_total", "lm628.undefined-command"] == 1


@pytest.mark.parametrize(
    ("request_line", "status"),
    [
        (b"GET /else HTTP/1.1\r\n\r\n", b"404"),
        (b"POST /metrics HTTP/1.1\r\n\r\n", b"405"),
        (b"\x00\xff\xfe\r\n\r\n", b"405"),
        (b"GET /metrics HTTP/1.1\r\n" + b"A: b\r\n" * 200 + b"\r\n", b"431"),
    ],
)
def test_other_requests_are_refused_and_the_board_goes_on(
    url: str, runtime: Path, request_line: bytes, status: bytes
) -> None:
    host, port = url.removeprefix("http://").removesuffix("/metrics").split(":")
    with socket.create_connection((host, int(port)), timeout=PATIENCE) as link:
        link.sendall(request_line)
        assert link.recv(4096).split()[1] == status

    assert "vbus_bus_cycles_total" in get(url)[0]


def test_a_header_line_without_end_ends_that_request_alone(url: str) -> None:
    host, port = url.removeprefix("http://").removesuffix("/metrics").split(":")
    # The server may have ended the request before all of it was sent.
    link = socket.create_connection((host, int(port)), timeout=PATIENCE)
    with link, contextlib.suppress(OSError):
        link.sendall(b"GET " + b"x" * 200_000)
        link.shutdown(socket.SHUT_WR)

    assert "vbus_bus_cycles_total" in get(url)[0]


def test_head_gives_the_headers_alone(url: str) -> None:
    request = urllib.request.Request(url, method="HEAD")
    with urllib.request.urlopen(request, timeout=PATIENCE) as answer:
        assert answer.read() == b""
        assert int(answer.headers["Content-Length"]) > 0


def test_an_address_in_use_is_named_and_the_board_does_not_start(
    board_file: Path, runtime: Path
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        done = vbus("run", "--metrics", f"127.0.0.1:{port}", str(board_file))

    assert done.returncode == exit_codes.NO_LINK
    assert f"http://127.0.0.1:{port}/metrics: cannot listen" in done.stderr
    assert list(running()) == []


def test_other_computers_are_let_in_only_if_the_board_file_says_so(
    board_file: Path, runtime: Path
) -> None:
    done = vbus("run", "--metrics", "0.0.0.0:0", str(board_file))

    assert done.returncode == exit_codes.USAGE
    assert "lets other computers in" in done.stderr
    assert "remote = true in [metrics]" in done.stderr
    load_board_text(BOARD + '[metrics]\nlisten = "0.0.0.0:9100"\nremote = true\n')


@pytest.mark.parametrize("words", [("run",), ("exec", "--", "true")], ids=["run", "exec"])
def test_an_address_of_the_command_line_that_is_none_is_not_blamed_on_the_board_file(
    words: tuple[str, ...], board_file: Path, runtime: Path
) -> None:
    command, *program = words
    board = ["--board", str(board_file)] if program else [str(board_file)]
    done = vbus(command, "--metrics", "foo", *board, *program)

    assert done.returncode == exit_codes.USAGE
    assert 'found "foo"; write HOST:PORT with a port' in done.stderr
    assert str(board_file) not in done.stderr


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("9100", "write HOST:PORT with"),
        ("127.0.0.1:70000", "write HOST:PORT with"),
        ("here.example:9100", "is no address"),
        ("[::]:9100", '"[::1]:9100"'),
    ],
)
def test_a_wrong_address_in_the_board_file_is_a_mistake_of_its_line(
    tmp_path: Path, address: str, message: str
) -> None:
    path = tmp_path / "b.toml"
    path.write_text(BOARD + f'\n[metrics]\nlisten = "{address}"\n')

    done = vbus("check", str(path))

    assert done.returncode == exit_codes.BAD_BOARD
    assert f"{path}:17: " in done.stderr
    assert message in done.stderr


def test_without_the_extra_the_message_says_what_to_install(
    board_file: Path, runtime: Path, tmp_path: Path
) -> None:
    (tmp_path / "prometheus_client.py").write_text("raise ImportError('not there')\n")
    done = subprocess.run(
        [sys.executable, "-m", "vbus", "run", "--metrics", "127.0.0.1:0", str(board_file)],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=60,
    )

    assert done.returncode == exit_codes.NO_PLUGIN
    assert "pip install prometheus-client" in done.stderr
