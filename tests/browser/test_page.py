"""The page with a recording in it: what it draws, finds, measures and saves."""

import csv
import io
import math
import statistics
from functools import cache
from itertools import pairwise
from typing import Any

import pytest

from tests.browser.conftest import Open, keeps_out
from tests.browser.recordings import (
    COMMAND,
    MS,
    SAMPLE,
    SECOND,
    Recording,
    bench,
    samples,
)

NANOSECOND = 1000


@cache
def bench_page() -> str:
    return bench().page()


def state(page: Any) -> dict[str, Any]:
    found: dict[str, Any] = page.evaluate("scope.state")
    return found


def drawn(page: Any) -> None:
    """Wait until all that was asked for is drawn."""
    page.evaluate("new Promise((go) => requestAnimationFrame(() => requestAnimationFrame(go)))")


def colour(page: Any, name: str) -> list[int]:
    """Return a colour of the theme."""
    text = page.evaluate(
        "(name) => getComputedStyle(document.documentElement).getPropertyValue(name)", f"--{name}"
    ).strip()
    return [int(text[at : at + 2], 16) for at in (1, 3, 5)]


def column(page: Any, x: float, top: float, height: float) -> list[list[int]]:
    """Return the pixels of a column of the plot, from above."""
    flat = page.evaluate(
        "([x, top, height]) => [...document.getElementById('plot').getContext('2d')"
        ".getImageData(x, top, 1, height).data]",
        [round(x), round(top), round(height)],
    )
    return [flat[at : at + 3] for at in range(0, len(flat), 4)]


def track(page: Any, name: str) -> dict[str, Any]:
    return next(each for each in state(page)["tracks"] if each["name"] == name)


def x_of(page: Any, instant: int) -> float:
    seen = state(page)
    return (instant - seen["start"]) / seen["scale"]


def show(page: Any, begin: int, end: int) -> None:
    """Show a stretch of time, by the cursors and a key."""
    page.keyboard.press("Escape")
    for name, instant in (("a", begin), ("b", end)):
        page.mouse.move(0, 0)
        place(page, name, instant)
    page.keyboard.press("z")
    drawn(page)


def place(page: Any, key: str, instant: int) -> None:
    """Put a cursor as near to an instant as a pixel of this view is, by the pointer."""
    box = page.locator("#over").bounding_box()
    page.mouse.move(box["x"] + round(x_of(page, instant)), box["y"] + 10)
    page.keyboard.press(key)


def test_every_lane_has_the_values_of_its_rows(open_recording: Open) -> None:
    page = open_recording(bench_page())
    count = 4 * SECOND // SAMPLE
    error = [round(40 * math.sin(2 * math.pi * n / count * 5) * (n / count)) for n in range(count)]
    for n in (0, 1, 777, 4095, 4096, count - 1):
        at = page.evaluate(f"scope.lane('x.error').at({n * SAMPLE}n)")
        before = page.evaluate(f"scope.lane('x.error').at({n * SAMPLE - 1}n)")
        assert at == error[n]
        assert before == (error[n - 1] if n else None)
    assert page.evaluate("scope.lane('x.error').rows") == count
    assert page.evaluate(f"scope.lane('step').at({1000 * MS + MS // 2}n)") == pytest.approx(
        page.evaluate(
            f"(scope.lane('step').at({1000 * MS}n) + scope.lane('step').at({1001 * MS}n)) / 2"
        )
    ), "a point lies on the straight line between two"
    for begin, end in ((3, 9000), (4090, 4100), (0, count - 1), (15, 272)):
        pair = page.evaluate(f"scope.lane('x.error').extent({begin * SAMPLE}n, {end * SAMPLE}n)")
        part = error[begin : end + 1]
        assert pair == {"least": min(part), "most": max(part)}
    output = page.evaluate(f"scope.lane('x.output').at({SAMPLE * 40}n)")
    speed = round(6283 * math.cos(2 * math.pi * 40 / count * 2))
    assert output == pytest.approx(speed // 100 * 100 / 128)


def test_all_of_a_recording_is_seen_at_first(open_recording: Open) -> None:
    page = open_recording(bench_page())
    seen = state(page)
    end = 4 * SECOND // SAMPLE * SAMPLE
    assert seen["start"] <= 0 < end <= seen["end"] < end * 1.05
    assert not seen["follow"]
    names = [each["name"] for each in seen["tracks"] if each["kind"] == "number"]
    assert names[:2] == ["x.desired x.real", "x.error"]


def test_pixels_are_where_the_values_are(open_recording: Open) -> None:
    page = open_recording(bench_page())
    # A pin: high from 100 ms to 200 ms, low from there on.
    pin = track(page, "x./HI")
    line = colour(page, "lane-line")
    for instant, high in ((150 * MS, True), (250 * MS, False), (350 * MS, True)):
        pixels = column(page, x_of(page, instant), pin["top"], pin["height"])
        lit = [y for y, each in enumerate(pixels) if each == line]
        assert lit, f"nothing is drawn at {instant}"
        assert (max(lit) < pin["height"] / 2) is high
    # Numbers: a column has the colour where the value is, and not elsewhere.
    error = track(page, "x.error")
    want = colour(page, "lane-error")
    least, most = error["range"]["least"], error["range"]["most"]
    for instant in (SECOND // 2, 2 * SECOND, 3 * SECOND + 400 * MS):
        value = page.evaluate(f"scope.lane('x.error').at({instant}n)")
        y = 7 + (most - value) * (error["height"] - 14) / (most - least)
        pixels = column(page, x_of(page, instant), error["top"], error["height"])
        lit = [at for at, each in enumerate(pixels) if each == want]
        assert lit
        assert min(lit) - 1.5 <= y <= max(lit) + 2.5
        assert max(lit) - min(lit) < 6


def test_a_zoomed_out_column_shows_least_and_greatest(open_recording: Open) -> None:
    recording = Recording(end=SECOND)
    lane = recording.lane(None, "spikes", "number", tick=MS // 1000)
    values = [100 if n == 500_321 else 0 for n in range(1_000_000)]
    for at in range(0, len(values), 50_000):
        ticks = list(range(at, at + 50_000))
        recording.frames.append(samples(lane, ticks, values[at : at + 50_000]))
    page = open_recording(recording)
    row = track(page, "spikes")
    want = colour(page, "lane-other")
    spike = column(page, math.floor(x_of(page, 500_321 * (MS // 1000))), row["top"], row["height"])
    flat = column(page, x_of(page, 600 * MS), row["top"], row["height"])
    assert sum(each == want for each in spike) > row["height"] / 2, "one row of a million is seen"
    assert 1 <= sum(max(each) < 200 for each in flat[: row["height"] - 4]) <= 3


def test_packets_are_blocks_with_their_labels(open_recording: Open) -> None:
    recording = Recording(end=100 * MS)
    bus = recording.lane(None, "x bus", "packets", "x: packets")
    recording.packets(bus, [(10 * MS, 40 * MS, "LTRJ position 2000", COMMAND)])
    page = open_recording(recording)
    row = track(page, "x bus")
    inside, edge = colour(page, "packet-0"), colour(page, "edge-0")
    begin = x_of(page, 10 * MS)
    middle = column(page, x_of(page, 39 * MS), row["top"], row["height"])
    assert middle[15] == inside
    assert column(page, begin + 0.6, row["top"], row["height"])[15] == edge
    assert column(page, x_of(page, 41 * MS), row["top"], row["height"])[15] != inside
    assert "LTRJ position 2000" in page.evaluate("scope.svg()")


def test_wheel_and_drag_keep_the_instant_under_the_pointer(open_recording: Open) -> None:
    page = open_recording(bench_page())
    box = page.locator("#over").bounding_box()
    page.mouse.move(box["x"] + 300, box["y"] + 200)
    before = state(page)
    instant = before["start"] + 300 * before["scale"]
    page.mouse.wheel(0, -400)
    drawn(page)
    zoomed = state(page)
    assert zoomed["scale"] < before["scale"] * 0.6
    assert zoomed["start"] + 300 * zoomed["scale"] == instant, "exactly, to the picosecond"
    page.mouse.down()
    page.mouse.move(box["x"] + 400, box["y"] + 210, steps=3)
    page.mouse.up()
    drawn(page)
    moved = state(page)
    assert moved["start"] + 400 * moved["scale"] == instant
    assert moved["scale"] == zoomed["scale"]


def test_picoseconds_are_exact_months_after_the_begin(open_recording: Open) -> None:
    months = 123 * 86400 * SECOND + 456_789_012_345
    recording = Recording(origin=7, end=months + 2000 * NANOSECOND)
    lane = recording.lane(None, "x./CS", "line", "x./CS")
    edges = [months + 100 * n * NANOSECOND + n for n in range(10)]
    recording.frames.append(samples(lane, [5], [1]))
    recording.frames.append(samples(lane, edges, [n % 2 for n in range(10)]))
    page = open_recording(recording)
    found = page.evaluate(
        "((lane) => [...Array(10).keys()].map((n) => lane.instant(n + 1)).map((edge) =>"
        " [edge, lane.at(edge), lane.at(edge - 1n)]))(scope.lane('x./CS'))"
    )
    assert found == [[edge, n % 2, 1 - n % 2] for n, edge in enumerate(edges)]
    page.keyboard.press("End")
    box = page.locator("#over").bounding_box()
    page.mouse.move(box["x"] + box["width"] - 1, box["y"] + 10)
    for _ in range(100):
        page.keyboard.press("+")
        if state(page)["scale"] == 1:
            break
    drawn(page)
    assert state(page)["scale"] == 1, "a pixel is a picosecond"
    page.keyboard.press("End")
    page.keyboard.press("5")
    page.fill("#condition", "x./CS rises")
    page.click("#find-back")
    drawn(page)
    seen = state(page)
    rising = [edge for n, edge in enumerate(edges) if n % 2]
    assert seen["trigger"] == rising[-1]
    assert seen["start"] <= rising[-1] <= seen["end"]
    assert seen["end"] - seen["start"] < 2 * NANOSECOND
    line, row = colour(page, "lane-line"), track(page, "x./CS")
    x = x_of(page, rising[-1])
    left, right = (
        [y for y, each in enumerate(column(page, at, row["top"], row["height"])) if each == line]
        for at in (x - 3, x + 3)
    )
    assert min(left) > row["height"] / 2 > max(right), "the edge is where it is, to three pixels"
    ticks = page.evaluate("scope.ticks")
    assert ticks["base"].replace("\u2009", "").startswith("10627200.45678")
    page.keyboard.press("Escape")
    told = page.locator("#trigger-told").inner_text().replace("\u2009", "")
    at = rising[-1] + 7
    assert f"{at // SECOND}.{at % SECOND:012}".rstrip("0") in told


def test_cursors_tell_their_instants_and_their_difference(open_recording: Open) -> None:
    page = open_recording(bench_page())
    place(page, "a", SECOND)
    place(page, "b", 3 * SECOND)
    drawn(page)
    cursors = state(page)["cursors"]
    apart = cursors["B"] - cursors["A"]
    assert apart == pytest.approx(2 * SECOND, rel=0.01)
    text = page.locator("#apart").inner_text().replace("\u2009", "")
    assert text == f"{apart // SECOND}.{apart % SECOND:012}".rstrip("0") + " s"
    page.keyboard.press(">")
    drawn(page)
    assert state(page)["cursors"]["B"] == cursors["B"] + state(page)["scale"]
    page.mouse.move(0, 0)
    drawn(page)
    value = page.evaluate(f"scope.lane('x.real').at({cursors['A']}n)")
    head = page.locator("#heads li.number").first.locator("output").nth(1).inner_text()
    assert head.replace("\u2009", "").replace("\u2212", "-") == str(value)


def test_units_are_counts_turns_or_si(open_recording: Open) -> None:
    page = open_recording(bench_page())
    first = page.locator("#heads li.number").first
    for unit, text, factor in (
        ("rev", "rev", 1 / 2000),
        ("SI", "rad", 2 * math.pi / 2000),
        ("counts", "counts", 1),
    ):
        page.select_option("#units", unit)
        drawn(page)
        assert first.locator(".unit").inner_text() == text
        top = track(page, "x.desired x.real")["range"]["most"]
        assert top == pytest.approx(2000 * factor, rel=0.15)


def test_a_velocity_per_sample_is_one_per_second_in_turns(open_recording: Open) -> None:
    recording = Recording(end=SECOND)
    recording.axis("x")
    recording.axes[0]["sample"] = SAMPLE
    lane = recording.lane("x", "velocity", "number", unit="counts/sample", tick=MS)
    recording.frames.append(samples(lane, [0], [512]))
    page = open_recording(recording)
    page.select_option("#units", "rev")
    drawn(page)
    head = page.locator("#heads li.number")
    assert head.locator(".unit").inner_text() == "rev/s"
    # 512 counts in 256 us are 2,000,000 counts in a second, 2000 to a turn.
    assert head.locator("output").inner_text().replace("\u2009", "") == "1000"


def test_measurements_between_the_cursors(open_recording: Open) -> None:
    page = open_recording(bench_page())
    place(page, "a", 900 * MS)
    place(page, "b", 3900 * MS)
    page.keyboard.press("3")
    drawn(page)
    cursors = state(page)["cursors"]
    begin, end = cursors["A"], cursors["B"]
    count = 4 * SECOND // SAMPLE
    error = [round(40 * math.sin(2 * math.pi * n / count * 5) * (n / count)) for n in range(count)]
    rows = range(begin // SAMPLE, end // SAMPLE + 1)
    held = [
        (error[n], min((n + 1) * SAMPLE, end) - max(n * SAMPLE, begin))
        for n in rows
        if min((n + 1) * SAMPLE, end) > max(n * SAMPLE, begin)
    ]
    span = sum(time for _, time in held)
    assert span == end - begin
    mean = sum(value * time for value, time in held) / span
    rms = math.sqrt(sum(value * value * time for value, time in held) / span)
    told = table(page)["x: following error (counts)"]
    values = [value for value, _ in held]
    assert told["min, max"] == [min(values), max(values)]
    assert told["mean, RMS"] == [pytest.approx(mean, rel=1e-4), pytest.approx(rms, rel=1e-4)]
    assert told["peak, B \u2212 A"][0] == max(map(abs, values))
    begins, at = [], 10 * MS
    for n in range(1500):
        begins.append(at)
        at += 2_500_000_000 + (n % 7) * 1_000_000
    between = [one for one in begins if begin <= one <= end]
    gaps = [b - a for a, b in pairwise(between)]
    bus = table(page)["x: packets"]
    assert bus["packets, mean interval"] == [
        len(between), pytest.approx(statistics.mean(gaps) / MS, rel=1e-3),
    ]  # fmt: skip
    assert bus["jitter: width, deviation"][0] == pytest.approx((max(gaps) - min(gaps)) / 1e6)


def table(page: Any) -> dict[str, dict[str, list[float]]]:
    """Return the measurements as numbers, by lane and name."""
    found: dict[str, dict[str, list[float]]] = {}
    rows = page.evaluate(
        "[...document.querySelectorAll('#measure-table tr')].map((row) =>"
        " [...row.querySelectorAll('th, td')].map((cell) => cell.innerText))"
    )
    for head, *cells in rows:
        if not cells:
            here = found[head] = {}
            continue
        plain = [
            text.replace("\u2009", "").replace("\u2212", "-").split()[0] for text in cells if text
        ]
        here[head] = [math.nan if text == "\u2013" else float(text) for text in plain]
    return found


def test_a_step_has_rise_overshoot_and_settling(open_recording: Open) -> None:
    recording = Recording(end=400 * MS)
    recording.axis("x")
    lane = recording.lane("x", "real", "number", "real position", unit="counts", tick=MS,
                          shape="points")  # fmt: skip
    # From 0 to 1000 in 100 ms, on to 1200, back to 1000.
    ticks = [0, 100, 200, 220, 240, 400]
    recording.frames.append(samples(lane, ticks, [0, 0, 1000, 1200, 1000, 1000]))
    page = open_recording(recording)
    place(page, "a", 50 * MS)
    place(page, "b", 390 * MS)
    page.keyboard.press("3")
    drawn(page)
    begin = state(page)["cursors"]["A"] / MS
    told = table(page)["x: real position (counts)"]
    rise, settling = told["rise 10\u201390 %, settling 2 %"]
    assert rise == pytest.approx(80, rel=1e-3)
    assert settling == pytest.approx(240 - 2 - begin, rel=1e-3)
    assert told["overshoot"] == [pytest.approx(20, rel=1e-3)]


def test_packets_are_found_and_shown(open_recording: Open) -> None:
    page = open_recording(bench_page())
    assert page.locator("#packets-count").inner_text().replace("\u2009", "") == "1500 packets"
    page.keyboard.press("/")
    page.keyboard.type("ltrj 343597")
    drawn(page)
    count = page.locator("#packets-count").inner_text().replace("\u2009", "")
    assert count == "300 of 1500 packets"
    page.keyboard.press("Enter")
    page.keyboard.press("Enter")
    drawn(page)
    assert page.locator("#packets-detail").inner_text().startswith("LTRJ acceleration 17")
    chosen = page.locator('#packets-table [role="row"][aria-selected="true"]')
    assert chosen.locator("span").first.inner_text() == "0.022510000"
    page.keyboard.press("Escape")
    page.locator('#packets-table [role="grid"]').focus()
    page.keyboard.press("End")
    drawn(page)
    seen = state(page)
    assert seen["start"] < 3_700 * MS < seen["end"]
    assert page.locator("#packets-table .body .row").count() < 60, "only what is seen is there"


def test_a_violation_is_a_key_away_from_its_clause(open_recording: Open) -> None:
    page = open_recording(bench_page())
    for _ in range(8):
        page.keyboard.press("+")
    page.keyboard.press("Home")
    page.keyboard.press("v")
    drawn(page)
    told = page.locator("#marks-detail").inner_text()
    assert "rule lm628.busy-write" in told
    assert "clause LM-BUS-7" in told
    at = page.evaluate("scope.lane('violations').instant(0)")
    assert state(page)["start"] < at < state(page)["end"]
    page.keyboard.press("v")
    assert "LM-RST-2" in page.locator("#marks-detail").inner_text()
    page.keyboard.press("V")
    assert "LM-BUS-7" in page.locator("#marks-detail").inner_text()


def test_a_click_on_a_packet_chooses_it(open_recording: Open) -> None:
    recording = Recording(end=100 * MS)
    bus = recording.lane(None, "x bus", "packets", "x: packets")
    rows = [(n * 10 * MS, n * 10 * MS + 5 * MS, f"RDRP {n}", COMMAND) for n in range(1, 9)]
    recording.packets(bus, rows)
    page = open_recording(recording)
    box = page.locator("#over").bounding_box()
    row = track(page, "x bus")
    page.mouse.click(box["x"] + x_of(page, 42 * MS), box["y"] + row["top"] + row["height"] / 2)
    assert page.locator("#packets-detail").inner_text().startswith("RDRP 4 (command")


def saved(page: Any, act: Any) -> str:
    with page.expect_download() as waiting:
        act()
    return str(waiting.value.path().read_text(encoding="utf-8"))


def test_packets_and_values_as_csv(open_recording: Open) -> None:
    recording = Recording(origin=5 * SECOND, end=100 * MS)
    bus = recording.lane(None, "x bus", "packets", "x: packets")
    recording.packets(bus, [(1, 4 * MS, 'say "a, b"', COMMAND), (9 * MS, 10 * MS, "STT", COMMAND)])
    lane = recording.lane(None, "volts", "number", unit="V", tick=MS, scale=0.5)
    recording.frames.append(samples(lane, [0, 20, 60], [1, 4, -3]))
    page = open_recording(recording)
    rows = list(csv.reader(io.StringIO(saved(page, lambda: page.click("#packets-csv")))))
    assert rows == [
        ["seconds", "length", "chip", "kind", "packet"],
        ["5.000000000001", "0.003999999999", "x", "command", 'say "a, b"'],
        ["5.009000000000", "0.001000000000", "x", "command", "STT"],
    ]
    rows = list(csv.reader(io.StringIO(saved(page, lambda: page.select_option("#save", "csv")))))
    assert rows == [
        ["seconds", "lane", "value", "unit"],
        ["5.000000000000", "volts", "0.5", "V"],
        ["5.020000000000", "volts", "2", "V"],
        ["5.060000000000", "volts", "-1.5", "V"],
    ]
    text = saved(page, lambda: page.select_option("#save", "vcd"))
    assert "#5020000000000\nr2 !" in text


def test_pictures_have_what_is_seen(open_recording: Open) -> None:
    page = open_recording(bench_page())
    text = saved(page, lambda: page.select_option("#save", "svg"))
    for word in ("following error", "x: packets", "data written while busy", "<path"):
        assert word in text
    assert page.evaluate(
        "(text) => new DOMParser().parseFromString(text, 'image/svg+xml')"
        ".querySelector('parsererror') === null",
        text,
    )
    with page.expect_download() as waiting:
        page.select_option("#save", "png")
    assert waiting.value.path().read_bytes().startswith(b"\x89PNG")


def test_two_axes_as_a_path(open_recording: Open) -> None:
    page = open_recording(bench_page())
    page.keyboard.press("4")
    drawn(page)
    path = page.evaluate(
        "({ points: [...scope.path.points], desired: [...scope.path.desired],"
        " error: [...scope.path.error], most: scope.path.most,"
        " at: scope.path.instants.map(String) })"
    )
    count = 4 * SECOND // SAMPLE
    for n in range(0, len(path["at"]), 701):
        k = min(int(path["at"][n]) // SAMPLE, count - 1)
        error = round(40 * math.sin(2 * math.pi * k / count * 5) * (k / count))
        x = round(2000 * math.sin(4 * math.pi * k / count))
        y = round(2000 * math.sin(4 * math.pi * k / count + math.pi / 2))
        assert path["desired"][2 * n : 2 * n + 2] == [x, y]
        assert path["points"][2 * n : 2 * n + 2] == [x - error, y - error]
        assert path["error"][n] == pytest.approx(math.hypot(error, error))
    assert path["most"] == pytest.approx(math.hypot(38, 38), rel=0.02)
    assert "skew" not in page.inner_text("#xy-told")


def test_beside_a_path_stands_how_far_apart_nodes_were(open_recording: Open) -> None:
    recording = bench()
    for name, skews in (("left.skew", [90, 250_000]), ("right.skew", [40, 230_000])):
        lane = recording.lane(None, name, "number", unit="s", scale=1e-9)
        recording.frames.append(samples(lane, [0, SECOND], skews))
    page = open_recording(recording)
    page.keyboard.press("4")
    drawn(page)
    assert "Wall skew between nodes 250 us." in page.inner_text("#xy-told").replace("µ", "u")


def test_a_condition_is_found_before_and_after(open_recording: Open) -> None:
    page = open_recording(bench_page())
    page.keyboard.press("5")
    page.fill("#condition", "x.error > 30")
    page.click("#find-next")
    drawn(page)
    count = 4 * SECOND // SAMPLE
    error = [round(40 * math.sin(2 * math.pi * n / count * 5) * (n / count)) for n in range(count)]
    true = [n for n in range(1, count) if error[n] > 30 >= error[n - 1]]
    assert state(page)["trigger"] == true[0] * SAMPLE
    page.fill("#condition", "command STT")
    page.click("#find-back")
    drawn(page)
    at, begins = 10 * MS, []
    for n in range(1500):
        if n % 5 == 1:
            begins.append(at)
        at += 2_500_000_000 + (n % 7) * 1_000_000
    assert state(page)["trigger"] == max(one for one in begins if one < true[0] * SAMPLE)
    page.fill("#condition", "lm628.reset-width")
    page.click("#find-back")
    drawn(page)
    assert state(page)["trigger"] == 3 * SECOND
    page.fill("#condition", "x.nothing > 3")
    page.click("#find-next")
    assert "no lane \u201cx.nothing\u201d" in page.locator("#trigger-told").inner_text()


def test_a_condition_becomes_true_at_its_instant(open_recording: Open) -> None:
    page = open_recording(conditions())
    expected = {
        "x.real >= 40 and not x.HI == 1": 40 * MS,
        "x.real > 150 and x.HI rises": 300 * MS,
        "rising(x.HI)": 100 * MS,
        "falling(x.HI) or command STT": 55 * MS,
        "abs(x.real - 50) <= 2 counts": 48 * MS,
        "x.HI == 0 stable for 60 ms": 60 * MS,
        "x.real - previous(x.real) > 1": 121 * MS,
        "x.command == RDRP": 155 * MS,
        "command STT and x.HI == 1": 155 * MS + 5,
        "violation": 77 * MS,
        "violation lm629": None,
        "lm628.busy-write": 77 * MS,
        "time >= 80.5 ms": 80 * MS + MS // 2,
        "time >= 3 ms and x.real == 0x64": 100 * MS,
        "(x.real > 5 and x.real < 7) or x.real == 3": 3 * MS,
    }
    found = page.evaluate("(texts) => texts.map((text) => scope.when(text))", list(expected))
    assert dict(zip(expected, found, strict=True)) == expected
    page.keyboard.press("5")
    for text, problem in (
        ("x.real >", "a name or a number is expected at character 9"),
        ("x.real > 3 volts", "counts and volts cannot be compared at character 1"),
        ("(x.HI == 1", "\u201c)\u201d is expected"),
        ("x.HI == 1 $", "has no meaning"),
    ):
        page.fill("#condition", text)
        page.click("#find-next")
        assert problem in page.locator("#trigger-told").inner_text()


@cache
def conditions() -> str:
    """Return 400 ms: a count of milliseconds that jumps once, a pin, three packets, a violation."""
    recording = Recording(end=400 * MS)
    recording.axis("x")
    real = recording.lane("x", "real", "number", unit="counts", tick=MS)
    recording.frames.append(
        samples(real, list(range(400)), [n + 5 * (n > 120) for n in range(400)])
    )
    pin = recording.lane(None, "x.HI", "line", tick=100 * MS)
    recording.frames.append(samples(pin, [0, 1, 2, 3], [0, 1, 0, 1]))
    bus = recording.lane(None, "x bus", "packets")
    recording.packets(bus, [
        (55 * MS, 56 * MS, "STT", COMMAND), (155 * MS, 155 * MS + 2, "RDRP 3", COMMAND),
        (155 * MS + 5, 156 * MS, "STT", COMMAND),
    ])  # fmt: skip
    marks = recording.lane(None, "violations", "marks")
    told = {"text": "busy", "kind": "violation", "rule": "lm628.busy-write"}
    recording.marks(marks, [(77 * MS, told)])
    return recording.page()


def test_light_and_dark_follow_the_system_and_the_choice(open_recording: Open) -> None:
    page = open_recording(bench_page(), color_scheme="dark")
    corner = "document.getElementById('plot').getContext('2d').getImageData(3, 40, 1, 1).data"
    dark = colour(page, "surface")
    assert max(dark) < 64
    assert list(page.evaluate(f"[...{corner}]"))[:3] == dark
    page.emulate_media(color_scheme="light")
    drawn(page)
    assert list(page.evaluate(f"[...{corner}]"))[:3] == [255, 255, 255]
    page.keyboard.press("t")
    drawn(page)
    assert list(page.evaluate(f"[...{corner}]"))[:3] == dark
    assert page.locator("#theme").input_value() == "dark"


def test_keys_work_without_a_pointer(open_recording: Open) -> None:
    page = open_recording(bench_page())
    before = state(page)
    page.keyboard.press("+")
    page.keyboard.press("ArrowRight")
    drawn(page)
    after = state(page)
    assert after["scale"] == round(before["scale"] / 1.5)
    page.keyboard.press("Home")
    assert state(page)["start"] == 0
    page.keyboard.press("p")
    assert page.locator("#side").is_hidden()
    page.keyboard.press("p")
    page.keyboard.press("?")
    assert page.locator("#keys").is_visible()
    assert page.locator("#keys-list dt").count() >= 15
    page.keyboard.press("Escape")
    assert page.locator("#keys").is_hidden()
    page.locator("#tab-packets").focus()
    page.keyboard.press("ArrowRight")
    assert page.locator("#marks").is_visible()
    assert page.locator("#tab-marks").get_attribute("aria-selected") == "true"
    page.locator("#heads button").first.press("Enter")
    drawn(page)
    assert all(not each["name"].startswith("x.e") for each in state(page)["tracks"])


def test_nothing_keeps_people_out(open_recording: Open) -> None:
    page = open_recording(bench_page(), color_scheme="light")
    for key in ("1", "2", "3", "4", "5", "6"):
        page.keyboard.press(key)
        drawn(page)
        assert keeps_out(page) == [], f"panel {key}"


def test_dark_colours_keep_nobody_out(open_recording: Open) -> None:
    page = open_recording(bench_page(), color_scheme="dark")
    assert max(colour(page, "surface")) < 64
    assert keeps_out(page, "color-contrast") == []
    for key in ("2", "3", "4", "5", "6"):
        page.keyboard.press(key)
        drawn(page)
        assert keeps_out(page, "color-contrast", part="#side") == [], f"panel {key}"


def test_a_recording_that_is_damaged_is_told(new_page: Open) -> None:
    from tests.browser.conftest import ADDRESS, serve

    recording = bench()
    recording.frames = [b"\x01\x01\x00\x00\x01\x00\x00\x00" + bytes(8) + b"\x09" + bytes(7)]
    page = new_page()
    serve(page, recording.page())
    page.goto(ADDRESS)
    page.wait_for_function("document.getElementById('state').classList.contains('lost')")
    assert "a column of type 9" in page.locator("#state").inner_text()
