"""Wire.h of the Arduino shim: I2C by two port bits, and a port expander on them."""

from collections.abc import Callable
from pathlib import Path

from tests.avr.test_twi import BOARD
from tests.shims.conftest import EXAMPLES, Run, compile_for

SKETCH = """
#include <Arduino.h>
#include <Wire.h>
static void say(unsigned value) { Serial.print(value, HEX); Serial.print(' '); }
static void put(uint8_t command, uint8_t value)
{
    Wire.beginTransmission(0x21);
    Wire.write(command);
    Wire.write(value);
    say(Wire.endTransmission());
}
static uint8_t get(uint8_t command)
{
    Wire.beginTransmission(0x21);
    Wire.write(command);
    Wire.endTransmission(false);
    if (Wire.requestFrom(0x21, 1) != 1)
        return 0xEE;
    return Wire.read();
}
void setup()
{
    Wire.begin();
    Wire.setClock(400000);
    put(1, 0x00);
    put(3, 0xFE);
    say(get(0) & 1);
    delayMicroseconds(50);
    put(1, 0x01);
    delay(2);
    say(get(0) & 0x81);
    say(get(3));
    say(Wire.available() + Wire.read());
    Wire.beginTransmission(0x44);
    say(Wire.endTransmission());
    say(Wire.requestFrom(0x44, 2));
    for (int turn = 0; turn < 33; turn++)
        Wire.write(turn);
    say(Wire.endTransmission());
    Serial.println("done");
}
void loop() {}
"""


def test_a_sketch_drives_an_expander(driver: Callable[..., Path], run: Run) -> None:
    ran = run(driver("arduino", SKETCH), BOARD.replace("PART", "PCA9554"), VBUS_UNTIL="done")
    assert ran.said == "0 0 0 0 81 FE FFFFFFFF 2 0 1 done\n"
    assert ran.bus == []


def test_the_example_resets_its_chip_by_an_expander(tmp_path: Path, run: Run) -> None:
    folder = EXAMPLES / "lm629_expander"
    program = compile_for(
        "arduino", tmp_path / "reset", "-x", "c++", "-include", "Arduino.h",
        folder / "Reset" / "Reset.ino",
    )  # fmt: skip
    ran = run(program, (folder / "board.toml").read_text(), VBUS_UNTIL="done")
    assert ran.said == (folder / "expected.txt").read_text()
    assert ran.bus == ["x r 0 84"]
