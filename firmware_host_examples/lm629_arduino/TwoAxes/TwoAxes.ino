// TwoAxes: two LM629 on one bus of an Uno begin in step and report by interrupt when they are there.
//
//   D0-D7  4 to 11     /PS  A0     /RST  A3     x: /CS A4, HI 2
//                      /RD  A1                  y: /CS A5, HI 3
//                      /WR  A2
#include <Lm629.h>

const uint8_t X_HI = 2, Y_HI = 3;
const int32_t NEAR = 6;  // counts

Lm629Bus bus(4, A0, A1, A2, A3);
Lm629 x(bus, A4), y(bus, A5);

volatile unsigned long xThere, yThere;

void onX() { xThere = millis(); }
void onY() { yThere = millis(); }

void fail(const __FlashStringHelper *what) {
  Serial.print(what);
  Serial.println(F(": failed"));
  for (;;) {
  }
}

bool there(Lm629 &axis, int32_t counts, int32_t target) {
  const uint8_t errors = Lm629::COMMAND_ERROR | Lm629::POSITION_ERROR;
  return labs(counts - target) <= NEAR && !(axis.status() & errors);
}

void moveTo(int32_t xTarget, int32_t yTarget) {
  int32_t xCounts, yCounts;
  unsigned long began;

  if (!x.clear(Lm629::TRAJECTORY_COMPLETE) || !y.clear(Lm629::TRAJECTORY_COMPLETE)) fail(F("RSTI"));
  if (!x.load(xTarget, 167772, 2150) || !y.load(yTarget, 167772, 2150)) fail(F("LTRJ"));
  xThere = yThere = 0;
  if (!Lm629::startTogether(x, y)) fail(F("STT"));
  began = millis();
  while (!xThere || !yThere) {
    if (millis() - began > 5000) fail(F("move"));
  }
  delay(50);  // until the motors are at rest
  if (!x.position(xCounts) || !y.position(yCounts)) fail(F("RDRP"));
  if (!there(x, xCounts, xTarget) || !there(y, yCounts, yTarget)) fail(F("move"));
  Serial.print(F("x "));
  Serial.print(xCounts);
  Serial.print(F(", y "));
  Serial.print(yCounts);
  Serial.println(xThere == yThere ? F(": together") : xThere < yThere ? F(": x first") : F(": y first"));
}

void setup() {
  Serial.begin(115200);
  bus.begin();
  x.begin();
  y.begin();
  bus.reset();
  if (!x.checkReset()) fail(F("reset of x"));
  if (!y.checkReset()) fail(F("reset of y"));
  if (!x.filter(200, 200, 2000, 20000) || !y.filter(200, 200, 2000, 20000)) fail(F("LFIL"));
  attachInterrupt(digitalPinToInterrupt(X_HI), onX, RISING);
  attachInterrupt(digitalPinToInterrupt(Y_HI), onY, RISING);
  if (!x.interruptOn(Lm629::TRAJECTORY_COMPLETE) || !y.interruptOn(Lm629::TRAJECTORY_COMPLETE))
    fail(F("MSKI"));
  Serial.println(F("two axes are up"));
  moveTo(1000, 1000);
  moveTo(-500, 2000);
  moveTo(0, 0);
  Serial.println(F("done"));
}

void loop() {}
