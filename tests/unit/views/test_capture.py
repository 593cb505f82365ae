"""Captures of all three formats, what their channels are called, and files that are none."""

import io
import zipfile
from contextlib import suppress

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.unit.views.captures import BOARDS, Shot, board_of, vcd
from vbus.core.errors import CaptureError
from vbus.core.kernel import MS, NS, SECOND, US
from vbus.views.silicon.capture import UNKNOWN, Capture, frequency, unit_of
from vbus.views.silicon.capture_csv import read_csv
from vbus.views.silicon.capture_sr import read_sr
from vbus.views.silicon.capture_vcd import read_vcd
from vbus.views.silicon.channel_map import Wiring, wiring_of
from vbus.views.silicon.start import watch_of

HEAD = "$timescale 1 ns $end\n$scope module top $end\n{}$upscope $end\n$enddefinitions $end\n"


def samples(capture: Capture) -> list[tuple[int, int]]:
    return list(capture.samples)


def from_vcd(variables: str, body: str) -> Capture:
    return read_vcd(io.BytesIO((HEAD.format(variables) + body).encode()), "a.vcd")


def from_csv(text: str, hertz: int = 0) -> Capture:
    return read_csv(io.BytesIO(text.encode()), "a.csv", hertz)


def session(
    data: bytes, *, unit: int = 1, rate: str = "100 MHz", probes: int = 2, parts: int = 1,
    version: str = "2",
) -> bytes:  # fmt: skip
    """Make a sigrok session file."""
    file = io.BytesIO()
    names = "".join(f"probe{n + 1}=c{n}\n" for n in range(probes))
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("version", version)
        archive.writestr(
            "metadata",
            "[global]\nsigrok version=0.5.2\n\n[device 1]\ncapturefile=logic-1\n"
            f"total probes={probes}\nunits7=V\nsamplerate={rate}\n{names}unitsize={unit}\n",
        )
        size = -(-len(data) // parts)
        for part in range(parts):
            archive.writestr(f"logic-1-{part + 1}", data[part * size : (part + 1) * size])
    return file.getvalue()


def from_sr(data: bytes) -> Capture:
    return read_sr(io.BytesIO(data), "a.sr")


# -- VCD ----------------------------------------------------------------------------------------


def test_a_vcd_file_gives_its_wires_and_levels() -> None:
    capture = from_vcd(
        "$var wire 1 ! clk $end\n$var wire 3 % D0-D2 $end\n$var real 64 r x $end\n",
        "#0\n0!\nb101 %\nr1.5 r\n#10\n1!\n#12\nbz %\nx!\n#20\nb11 %\n",
    )
    assert capture.channels == ["clk", "D0", "D1", "D2"]
    assert capture.period == 1000
    assert samples(capture) == [
        (0, 0b1010), (10_000, 0b1011), (12_000, 0b1011 | 0b1111 << UNKNOWN),
        (20_000, 0b0111 | 1 << UNKNOWN),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("value", "high", "unknown"),
    [
        ("b1", 0b0001, 0), ("bx01", 0b0001, 0b1100), ("b1x0z", 0b1000, 0b0101),
        ("bz", 0, 0b1111), ("bHL1-", 0b1010, 0b0001), ("bH0x", 0b0100, 0b0001),
        ("b111110101", 0b0101, 0), ("bzzzzz0101", 0b0101, 0), ("bU", 0, 0b1111),
    ],
)  # fmt: skip
def test_a_vector_may_be_known_in_part(value: str, high: int, unknown: int) -> None:
    capture = from_vcd("$var wire 4 % D [3:0] $end\n", f"#0\n{value} %\n")
    assert samples(capture) == [(0, high | unknown << UNKNOWN)]


@pytest.mark.parametrize(
    ("scale", "when"),
    [("0.1ns", 2000), ("0.5 ps", 10), ("2.5 us", 50 * US), ("0.001 ps", 0)],
)
def test_a_timescale_may_be_a_fraction(scale: str, when: int) -> None:
    text = HEAD.replace("1 ns", scale).format("$var wire 1 ! a $end\n") + "#20\n1!\n"
    assert samples(read_vcd(io.BytesIO(text.encode()), "a.vcd")) == [(when, 1)]


@pytest.mark.parametrize("scale", ["0.0001 ps", "0.5 fs", "0.0 ns"])
def test_a_timescale_that_is_too_fine_is_refused(scale: str) -> None:
    text = HEAD.replace("1 ns", scale).format("$var wire 1 ! a $end\n")
    with pytest.raises(CaptureError, match=rf"its \$timescale, {scale}, is no whole femto"):
        read_vcd(io.BytesIO(text.encode()), "a.vcd")


def test_names_of_bits_of_one_vector_and_of_equal_wires_in_two_scopes() -> None:
    capture = from_vcd(
        "$var wire 1 ! D [3] $end\n$var wire 2 % Q [5:4] $end\n$scope module a $end\n"
        "$var wire 1 & CS $end\n$upscope $end\n$scope module b $end\n$var wire 1 ' CS $end\n"
        "$var wire 1 & other $end\n$upscope $end\n",
        "#0\n0!\n",
    )
    assert capture.channels == ["D3", "Q4", "Q5", "top.a.CS", "top.b.CS"]


@pytest.mark.parametrize(
    ("scale", "when"),
    [("1 s", 20 * SECOND), ("10 ms", 200 * MS), ("1 us", 20 * US), ("1 ns", 20 * NS),
     ("10 ps", 200), ("100 fs", 2)],
)  # fmt: skip
def test_instants_are_counted_in_the_timescale(scale: str, when: int) -> None:
    text = HEAD.replace("1 ns", scale).format("$var wire 1 ! a $end\n") + "#20\n1!\n"
    assert samples(read_vcd(io.BytesIO(text.encode()), "a.vcd")) == [(when, 1)]


def test_the_sample_rate_libsigrok_leaves_in_a_comment_is_the_period() -> None:
    comment = "$comment\n  Acquisition with 2/2 channels at 24 MHz\n$end\n"
    file = comment + HEAD.format("$var wire 1 ! a $end\n") + "#0\n1!\n"
    assert read_vcd(io.BytesIO(file.encode()), "a.vcd").period == 41_667


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"", "a.vcd: there are no wires in it"),
        (b"PK\x03\x04 something else", "this is no VCD file"),
        (b"\x00\xff" * 200, "this is no VCD file"),
        (HEAD.format("$var real 1 ! a $end\n").encode(), "there are no wires"),
        (HEAD.format("$var wire 1 ! a $end\n").encode(), "there are no samples"),
        (HEAD.format("$var wire 999999999 ! a $end\n").encode(), "more than 4096 wires"),
        (HEAD.format("$var wire 1 ! a $end\n").encode() + b"#5\n1!\n#3\n0!\n", "runs backwards"),
        (
            HEAD.format("$var wire 1 ! a $end\n").encode() + b"#5\n1!\nhello ! 3\n",
            "damaged after 5000",
        ),
        (HEAD.format("$var wire 1 ! a $end\n").encode()[21:] + b"#5\n1!\n", "no $timescale"),
        (
            HEAD.format("$var wire 1 ! a $end\n").encode() + b"#92300000000000000\n1!\n",
            "92300000000000000000 ps is beyond the end of time, 9151314 s after",
        ),
        (b"$comment " + b"x" * 2_000_000, "a comment or word in it is longer than 1048576 bytes"),
        (
            HEAD.format("$var wire 1 ! a $end\n").encode() + b"#5\n1" + b"!" * 2_000_000,
            "a comment or word in it is longer than 1048576 bytes",
        ),
        (b"$timescale 1 zs $end\n", "this is no VCD file: 'zs'"),
    ],
)
def test_what_is_no_vcd_file_is_refused_by_name(text: bytes, message: str) -> None:
    with pytest.raises(CaptureError) as caught:
        samples(read_vcd(io.BytesIO(text), "a.vcd"))
    assert str(caught.value).startswith("a.vcd: ")
    assert message in str(caught.value)


# -- sigrok sessions ----------------------------------------------------------------------------


def test_a_session_gives_its_changes_at_their_instants() -> None:
    capture = from_sr(session(b"\x01\x01\x03\x03\x00"))
    assert capture.channels == ["c0", "c1"]
    assert capture.period == 10_000
    assert samples(capture) == [(0, 1), (20_000, 3), (40_000, 0)]


@example([(0x001, 2), (0x101, 1)], 1)
@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 511), st.integers(1, 9000)), min_size=1, max_size=12),
    st.integers(1, 5),
)
def test_runs_of_any_length_in_any_number_of_parts(runs: list[tuple[int, int]], parts: int) -> None:
    data = b"".join(value.to_bytes(2, "little") * length for value, length in runs)
    expected = []
    place = 0
    last = -1
    for value, length in runs:
        if value != last:
            expected.append((place * 10_000, value))
        last = value
        place += length
    assert samples(from_sr(session(data, unit=2, probes=9, parts=parts))) == expected


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "no sigrok session file"),
        (b"PK\x05\x06" + bytes(18), "no sigrok session file"),
        (session(b"\x01", version="1"), "of version 1; version 2 can be read"),
        (session(b"\x01", rate="fast"), "lack samplerate"),
        (session(b"\x01", rate="1" + 400 * "0"), f"a sample rate of 1{39 * '0'} is above 1 THz"),
        (session(b"\x01", rate=5000 * "9" + " GHz"), f"a sample rate of {40 * '9'} is above 1 THz"),
        (session(b"\x01", rate="1001 GHz"), "a sample rate of 1001 GHz is above 1 THz"),
        (session(b"\x01", rate="nan"), "lack samplerate"),
        (session(b"\x01").replace(b"unitsize=1", "unitsize=²".encode()[:-1]), "no sigrok session"),
        (session(b"\x01")[10:], "no sigrok session"),
        (session(b"\x01", probes=0), "lack samplerate, unitsize or the probes"),
        (session(b"\x01", probes=9), "9 probes do not fit into 1 bytes"),
        (session(b"\x01", unit=65, probes=1), "samples of 65 bytes; there are at most 64"),
        (
            session(b"\x01", version="2" * (1 << 20) + "x"),
            "its version unpacks to more than 1048576",
        ),
        (session(b""), "there are no samples"),
    ],
)
def test_what_is_no_session_is_refused(data: bytes, message: str) -> None:
    with pytest.raises(CaptureError) as caught:
        samples(from_sr(data))
    assert message in str(caught.value)


def test_a_session_whose_samples_are_damaged_says_how_far_it_was_good() -> None:
    data = bytearray(session(bytes(range(4)) * 1000))
    place = data.find(b"logic-1-1") + 9
    data[place + 3000] ^= 0xFF
    with pytest.raises(CaptureError, match="damaged after "):
        samples(from_sr(bytes(data)))


# -- tables -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    [
        "Time [s],a,b\n0.000000,1,0\n0.000001,1,1\n0.000002,0,0\n",
        'Time(us);a;b\n"0";"1";"0"\n"1";"1";"1"\n2;0;0\n',
        "Time [\u00b5s]\ta\tb\n0\t1\t0\n1\t1\t1\n2\t0\t0\n",
        "\ufefftime [ns],a,b\r\n0,1,0\r\n\r\n1000,1,1\r\n2000,0,0\r\n",
        "Time [s],a,b\n-0.000004,1,0\n-0.000003,1,1\n-0.000002,0,0\n",
        "; Channels (2/2): a, b\n; Samplerate: 1 MHz\nlogic,logic\n1,0\n1,1\n0,0\n",
        "; Channels (2/2): a, b\n; Samplerate: 1 MHz\n1,0\n1,1\n0,0\n",
        "; Channels (2/2): a, b\n; Samplerate: 1 MHz\nmicroseconds,logic,logic\n"
        "0,1,0\n1,1,1\n2,0,0\n",
        "; Samplerate: 10 MHz\nTime,a,b\n0,1,0\n1000,1,1\n2000,0,0\n",
        "Time,a,b\n0,1,0\n1e-6,1,1\n2e-6,0,0\n",
        "META samplerate: 1000000\na,b\n1,0\n1,1\n0,0\n",
        "META samplerate: 1000000\nFRAME-BEGIN\na,b\n1,0\nMETA samplerate: 1 MHz\n1,1\n0,0\n"
        "FRAME-END\n",
    ],
)  # fmt: skip
def test_tables_as_they_are_exported(text: str) -> None:
    capture = from_csv(text)
    assert capture.channels == ["a", "b"]
    assert samples(capture) == [(0, 1), (1_000_000, 3), (2_000_000, 0)]


def test_x_and_z_in_a_table_are_unknown() -> None:
    capture = from_csv("Time [s],a,b,spare\n0,1,0,X\n1e-6,z,1,X\n2e-6,0,1,X\n")
    assert samples(capture) == [
        (0, 1 | 4 << UNKNOWN), (1_000_000, 3 | 5 << UNKNOWN), (2_000_000, 2 | 4 << UNKNOWN),
    ]  # fmt: skip


def test_a_capture_has_only_so_many_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vbus.views.silicon.capture.MOST_LINES", 2)
    assert len(samples(from_csv("Time [s],a\n0,1\n1,0\n"))) == 2
    with pytest.raises(CaptureError, match="more than 2 samples; cut the capture"):
        samples(from_csv("Time [s],a\n0,1\n1,0\n2,1\n"))


def test_a_table_without_time_needs_a_rate() -> None:
    with pytest.raises(CaptureError, match="give it with --samplerate"):
        from_csv("a,b\n1,0\n")
    sampled = from_csv("a,b\n1,0\n0,1\n", 2_000_000)
    assert (sampled.period, samples(sampled)) == (500_000, [(0, 1), (500_000, 2)])
    assert from_csv("Time [s],a,b\n0,1,0\n0.5,0,1\n").period == 0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "there are no samples in it"),
        ("; nothing but a comment\n", "there are no samples in it"),
        ("Time [s],a\n", "there are no samples in it"),
        ("Time [s],a\n0,1\n1,2\n", 'line 3: "2" in column "a" is none of 0, 1, X and Z'),
        ("Time [s],a,b\n0,0,3.31\n", '"3.31" in column "b" is none of 0, 1, X and Z; export logic'),
        ("Time [s],a\n9e6,1\n9.3e6,0\n", "9300000000000000000 ps is beyond the end of time"),
        ("Time [s],a\n0,1\n1e200,0\n", "an instant is beyond the end of time"),
        ("\n" * 2000, "no table begins in the first 1000 lines"),
        ("a" * 1_100_000, "line 1 is longer than 1048576 bytes"),
        (",".join("a" * 5000), "line 1: 5000 columns; a capture has at most 4096"),
        ("META samplerate: 1000000\na\n1\nMETA samplerate: 5\n0\n", "line 4: the sample rate ch"),
        ("Time [s],a\n0,1,1\n", "line 2: 2 values for 1 channels"),
        ("Time [s],a\nsoon,1\n", 'line 2: "soon" is no time'),
        ("Time [s],a\ninf,1\n", 'line 2: "inf" is no time'),
        (f"Time [s],a\n{'x' * 41},1\n", f'line 2: "{"x" * 40}" is no time'),
        ("Time [s],a\n1,1\n0,0\n", "time runs backwards"),
        ("1,0\n1,0\n", "line 1: the names of the channels are missing"),
        ("; Channels (1/1): a\n; Samplerate: 1 MHz\nlogic,logic\n", "2 columns, 1 channels"),
    ],
)
def test_what_is_no_table_is_refused_with_its_line(text: str, message: str) -> None:
    with pytest.raises(CaptureError) as caught:
        samples(from_csv(text))
    assert str(caught.value).startswith("a.csv: ")
    assert message in str(caught.value)


def test_bytes_that_are_no_text_are_refused() -> None:
    with pytest.raises(CaptureError, match=r"a\.csv: line 1: this is no text"):
        read_csv(io.BytesIO(b"\xff\xfe\x00"), "a.csv")


def test_samples_may_have_64_bytes() -> None:
    capture = from_sr(session(b"\x01" + bytes(127), unit=64, probes=1))
    assert [value for _, value in samples(capture)] == [1, 0]


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=300), st.sampled_from([read_vcd, read_csv, read_sr]))
def test_no_rubbish_gives_anything_but_an_error_or_samples(data: bytes, read: object) -> None:
    with suppress(CaptureError):
        samples(read(io.BytesIO(data), "a"))  # type: ignore[operator]


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 3000), st.binary(min_size=1, max_size=4))
def test_a_damaged_vcd_file_gives_an_error_or_samples(place: int, junk: bytes) -> None:
    text = _whole().encode()
    with suppress(CaptureError):
        samples(read_vcd(io.BytesIO(text[:place] + junk + text[place + len(junk) :]), "a"))


_TEXT: list[str] = []


def _whole() -> str:
    if not _TEXT:
        _TEXT.append(vcd("mcp1200"))
    return _TEXT[0]


@pytest.mark.parametrize("family", sorted(BOARDS))
def test_a_table_of_a_capture_is_the_capture(family: str) -> None:
    shot = Shot(family)
    assert samples(from_csv(shot.table())) == shot.samples


def test_frequencies_and_the_units_of_sigrok() -> None:
    assert frequency("24 MHz", "here") == 24_000_000
    assert frequency("12500000", "here") == 12_500_000
    assert frequency("1.5 kHz", "here") == 1500
    assert frequency("2 GHz", "here") == 2_000_000_000
    assert frequency("fast", "here") == 0
    with pytest.raises(CaptureError, match="above 1 THz"):
        frequency("1" + "0" * 400, "here")
    assert [unit_of(rate) for rate in (1000, 1001, 10**6, 10**9, 10**10)] == [
        10**9, 10**6, 10**6, 1000, 1,
    ]  # fmt: skip


# -- which channel is which pin -----------------------------------------------------------------

DATA = [f"D{n}" for n in range(8)]


def wired(channels: list[str], family: str = "lm628", **wanted: str) -> Wiring:
    chip = board_of(family).chips[0]
    return wiring_of(channels, "x", chip.pin_rows, watch_of(chip), wanted)


@pytest.mark.parametrize(
    "names",
    [
        ["/CS", "/PS", "/RD", "/WR", *DATA],
        ["cs", "ps", "rd", "wr", *(name.lower() for name in DATA)],
        ["x_CS", "x_PS", "x_RD", "x_WR", *(f"x_{name}" for name in DATA)],
        ["vbus.x_CS", "vbus.x_PS", "vbus.x_RD", "vbus.x_WR", *(f"vbus.x_{name}" for name in DATA)],
        ["x./CS", "x./PS", "x./RD", "x./WR", *(f"x.{name}" for name in DATA)],
        ["a.C_S", "a.P_S", "a.R_D", "a.W_R", *(f"a.D_{n}" for n in range(8))],
    ],
)
def test_channels_are_found_by_the_names_of_the_pins(names: list[str]) -> None:
    wiring = wired(["HI", *names])
    assert wiring.data == [5, 6, 7, 8, 9, 10, 11, 12]
    assert wiring.bits == {"HI": 0, "/CS": 1, "/PS": 2, "/RD": 3, "/WR": 4}


def test_of_several_chips_on_a_bus_the_one_asked_for_counts() -> None:
    wiring = wired(["y_CS", "x_CS", "PS", "RD", "WR", *DATA])
    assert wiring.bits["/CS"] == 1


def test_a_map_goes_before_names() -> None:
    names = [f"CH{n}" for n in range(11)]
    wanted = {f"D{n}": f"CH{n}" for n in range(8)}
    wiring = wired(names, **wanted, **{"/PS": "CH8", "rd": "CH9", "WR": "CH10", "/CS": "low"})
    assert wiring.data == list(range(8))
    assert wiring.tied == {"/CS": 0}
    assert (wiring.level("/CS", 0xFFFF), wiring.level("/WR", 1 << 10)) == (0, 1)
    assert wiring.byte(0x7A5) == 0xA5


def test_the_other_chips_have_their_own_names() -> None:
    mcp = wired(["ALE", "CS", "OE", "RW", *(f"DB{n}" for n in range(8))], "mcp1200")
    assert mcp.bits == {"/ALE": 0, "/CS": 1, "/OE": 2, "R/W": 3}
    plain = wired(["ALE", "CS", "OE", "R/W", *DATA], "mcp1200")
    assert plain.data == mcp.data
    pmd = wired(["HostSlct", "~HostWrite", "hostread", "HostCmd", *DATA], "mc1241a")
    assert len(pmd.bits) == 4


@pytest.mark.parametrize(
    ("channels", "wanted", "message"),
    [
        (["CS", *DATA], {}, "no channel for /PS, /RD, /WR; it has CS, D0"),
        (["CS", "a_CS", "b_PS", "c_PS", "RD", "WR", *DATA], {}, "several channels may be /PS"),
        (["CS", "PS", "RD", "WR", *DATA], {"CE": "CS"}, 'no pin "CE"; it has D0'),
        (["CS", "PS", "RD", "WR", *DATA], {"CS": "CH9"}, 'no channel "CH9"; there are CS'),
    ],
)
def test_a_bus_that_cannot_be_found_is_said_to_be_so(
    channels: list[str], wanted: dict[str, str], message: str
) -> None:
    with pytest.raises(CaptureError) as caught:
        wired(channels, **wanted)
    assert message in str(caught.value)
