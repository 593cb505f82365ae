"""What a chip tells, as ``vbus monitor`` shows it: rounded, with units, bits as lamps."""

from typing import Any

import pytest

from vbus import plugins
from vbus.circuit.stream import decoder_of
from vbus.cli.telemetry_text import TelemetryValue, rounded, words_and_numbers


def told(
    family: str, **values: Any
) -> tuple[list[TelemetryValue], dict[str, tuple[str, dict[str, bool]]]]:
    named = {key.replace("_1", " 1").replace("_2", " 2"): value for key, value in values.items()}
    numbers, words = words_and_numbers(plugins.family(family), decoder_of(family), named)
    return numbers, {word.name: (word.text, dict(word.bits)) for word in words}


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0, "0"), (-12, "-12"), (0.0, "0"), (-0.0, "0"), (1.0, "1"), (2.345678, "2.35"),
        (-0.123456, "-0.1235"), (123456.789, "123456.79"), (0.000012, "1.2e-05"), (100.0, "100"),
    ],
)  # fmt: skip
def test_numbers_have_the_digits_people_read(value: float, text: str) -> None:
    assert rounded(value) == text


def test_values_have_units_and_texts_that_repeat_bits_are_left_out() -> None:
    numbers, words = told(
        "lm628", real=7, velocity=1.23456, output=-0.5, integral=3, signals=0x8004,
        signal_names="HOST_INTERRUPT TRAJECTORY_COMPLETE",
    )  # fmt: skip
    assert numbers == [
        TelemetryValue("real", "7", "counts"),
        TelemetryValue("velocity", "1.23", "counts/sample"),
        TelemetryValue("output", "-50", "%"),
        TelemetryValue("integral", "3", ""),
    ]
    text, bits = words["signals"]
    assert text == "8004H"
    assert [name for name, lit in bits.items() if lit] == ["HOST_INTERRUPT", "TRAJECTORY_COMPLETE"]
    assert len(bits) == 16


def test_codes_are_named_and_each_axis_has_its_own() -> None:
    numbers, words = told("mc1241a", actual_2=5, mode_2=0x1080, status_1=0x0301)
    assert numbers == [TelemetryValue("actual 2", "5", "counts")]
    assert words["mode 2"] == (
        "1080H S-curve phase 0", {"auto update off": False, "auto stop": True},
    )  # fmt: skip
    text, bits = words["status 1"]
    assert text == "0301H axis 1"
    assert bits["motor on"]
    assert bits["motion complete"]
    assert not bits["wrap"]


def test_a_chip_nobody_knows_tells_its_values_as_they_are() -> None:
    numbers, words = words_and_numbers(plugins.family("nothing"), None, {"load": 3, "mode": "run"})
    assert numbers == [TelemetryValue("load", "3", ""), TelemetryValue("mode", "run", "")]
    assert words == []
