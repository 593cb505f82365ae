"""A run as an MCAP file, read again by the library of the format."""

import io
import pickle
import subprocess
import sys
from collections import defaultdict
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from tests.unit.views.conftest import board_of, read
from tests.unit.views.scope.decoded import Seen
from vbus.cli.look.foxglove_lanes import PACKET_KINDS, mcap_file
from vbus.core.kernel import NS
from vbus.views.scope.recording import Recorded, replayed


@pytest.fixture(scope="module")
def run(moved: bytes) -> Recorded:
    header, entries = read(moved)
    return replayed(board_of(header), entries, header.families, strobes=True)


@pytest.fixture(scope="module")
def file(run: Recorded) -> bytes:
    return mcap_file(run.description, run.frames)


@pytest.fixture(scope="module")
def told(file: bytes) -> dict[str, list[Any]]:
    """The messages of each lane, decoded by the schemas that the file has."""
    found: dict[str, list[Any]] = defaultdict(list)
    reader = make_reader(io.BytesIO(file), decoder_factories=[DecoderFactory()])
    last = 0
    for schema, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False):
        assert schema is not None
        assert schema.encoding == channel.message_encoding == "protobuf"
        assert message.log_time == message.publish_time == decoded.time_ps // NS
        assert decoded.time_ps >= last
        last = decoded.time_ps
        found[channel.metadata["lane"]].append(decoded)
    return found


def test_every_lane_is_told_with_its_picoseconds(run: Recorded, told: dict[str, list[Any]]) -> None:
    seen = Seen(run.description, b"".join(run.frames))
    assert set(told) == {name for name in seen.drawn if seen.rows[name]}
    for lane in run.description["lanes"]:
        name = f"{lane['axis']}.{lane['name']}" if lane["axis"] else lane["name"]
        rows, found = seen.rows[name], told[name]
        if lane["kind"] == "number":
            expected = [(when, value * lane["scale"]) for when, value in rows]
            assert [(each.time_ps, each.value) for each in found] == expected, name
        elif lane["kind"] == "line":
            assert [(each.time_ps, each.level) for each in found] == rows, name
    assert len(told["x.real"]) > 10
    assert len(told["x./RD"]) > 100


def test_packets_and_marks_are_in_the_manuals_words(
    run: Recorded, told: dict[str, list[Any]]
) -> None:
    seen = Seen(run.description, b"".join(run.frames))
    assert [(each.time_ps, each.length_ps, each.text, each.kind) for each in told["x bus"]] == [
        (at, span, text, PACKET_KINDS[kind]) for at, span, text, kind in seen.packets("x bus")
    ]
    ((when, mark),) = seen.rows["violations"]
    (found,) = told["violations"]
    assert (found.time_ps, found.text, found.kind, found.rule, found.clause) == (
        when, mark["text"], "violation", "lm628.busy-write", mark["clause"],
    )  # fmt: skip
    assert [(each.text, each.rule) for each in told["hosts"]] == [("host0", "")]


def test_topics_are_plain_and_say_what_they_are_of(file: bytes, run: Recorded) -> None:
    reader = make_reader(io.BytesIO(file))
    summary = reader.get_summary()
    assert summary is not None
    topics = {
        channel.metadata["lane"]: (channel.topic, channel.metadata["unit"])
        for channel in summary.channels.values()
    }
    assert topics["x.velocity"] == ("/x/velocity", "counts/sample")
    assert topics["x./RD"] == ("/x/RD", "")
    assert topics["x.D0-D7"] == ("/x/D0_D7", "")
    assert topics["x bus"] == ("/x/bus", "")
    assert topics["violations"] == ("/violations", "")
    assert {schema.name for schema in summary.schemas.values()} == {
        "vbus.Value", "vbus.Level", "vbus.Packet", "vbus.Mark",
    }  # fmt: skip
    (about,) = reader.iter_metadata()
    assert (about.name, about.metadata) == ("vbus", {
        "board": "bench", "version": run.description["vbus"], "end_ps": run.description["now"],
    })  # fmt: skip


def test_the_same_run_gives_the_same_bytes(file: bytes, run: Recorded) -> None:
    # Channels are numbered anew in each process.
    source = (
        "import pickle, sys\n"
        "from vbus.cli.look.foxglove_lanes import mcap_file\n"
        "sys.stdout.buffer.write(mcap_file(*pickle.load(sys.stdin.buffer)))\n"
    )
    data = pickle.dumps((run.description, run.frames))
    first, second = (
        subprocess.run(
            [sys.executable, "-c", source], input=data, capture_output=True, check=True
        ).stdout
        for _ in range(2)
    )
    assert first == second
    assert len(first) == len(file)
