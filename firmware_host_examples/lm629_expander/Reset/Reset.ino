// Resets an LM629 by a port expander, and waits for its interrupt there.
#include <Wire.h>

#define EXPANDER 0x20
#define RESET 0x01
#define HI 0x80
#define INT_PIN 10

static void expander(uint8_t value)
{
    Wire.beginTransmission(EXPANDER);
    Wire.write(value);
    if (Wire.endTransmission() != 0)
        Serial.println("no expander");
}

static uint8_t inputs()
{
    Wire.requestFrom(EXPANDER, 1);
    return Wire.read();
}

static uint8_t status()
{
    uint8_t value;

    digitalWrite(A1, LOW); // /PS
    digitalWrite(A0, LOW); // /CS
    digitalWrite(A2, LOW); // /RD
    value = (PIND & 0xFC) | (PINB & 0x03);
    digitalWrite(A2, HIGH);
    digitalWrite(A0, HIGH);
    return value;
}

void setup()
{
    uint8_t after;

    Serial.begin(115200);
    for (uint8_t pin = A0; pin <= A3; pin++) {
        digitalWrite(pin, HIGH);
        pinMode(pin, OUTPUT);
    }
    Wire.begin();
    expander(0xFF & ~RESET);
    delayMicroseconds(50);
    inputs(); // /INT is high from here on, until a pin moves
    expander(0xFF);
    while (digitalRead(INT_PIN)) {
    }
    delay(2);
    Serial.print("HI ");
    Serial.print(inputs() & HI ? "high" : "low");
    after = status();
    Serial.println(after == 0x84 || after == 0xC4 ? ", reset" : ", failed");
    Serial.println("done");
}

void loop() {}
