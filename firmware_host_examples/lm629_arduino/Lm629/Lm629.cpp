/* Lm629.cpp - see Lm629.h. */
#include "Lm629.h"

enum { STT = 0x01, UDF = 0x04, RDRP = 0x0A, MSKI = 0x1C, RSTI = 0x1D, LFIL = 0x1E, LTRJ = 0x1F };

/* --- the bus -------------------------------------------------------------------------------- */

Lm629Bus::Lm629Bus(uint8_t data, uint8_t ps, uint8_t rd, uint8_t wr, uint8_t rst)
    : data_(data), ps_(ps), rd_(rd), wr_(wr), rst_(rst), mode_(INPUT) {}

void Lm629Bus::begin() {
  const uint8_t control[] = {ps_, rd_, wr_, rst_};
  for (uint8_t i = 0; i < sizeof control; i++) {
    digitalWrite(control[i], HIGH);
    pinMode(control[i], OUTPUT);
  }
  for (uint8_t bit = 0; bit < 8; bit++) pinMode(data_ + bit, INPUT);
}

void Lm629Bus::reset() {
  digitalWrite(rst_, LOW);
  delayMicroseconds(20);
  digitalWrite(rst_, HIGH);
  delay(2);
}

void Lm629Bus::direction(uint8_t mode) {
  if (mode == mode_) return;
  mode_ = mode;
  for (uint8_t bit = 0; bit < 8; bit++) pinMode(data_ + bit, mode);
}

uint8_t Lm629Bus::read(bool command) {
  uint8_t value = 0;

  direction(INPUT);
  digitalWrite(ps_, command ? LOW : HIGH);
  digitalWrite(rd_, LOW);
  for (uint8_t bit = 0; bit < 8; bit++)
    if (digitalRead(data_ + bit)) value |= 1 << bit;
  digitalWrite(rd_, HIGH);
  return value;
}

void Lm629Bus::write(bool command, uint8_t value) {
  digitalWrite(ps_, command ? LOW : HIGH);
  digitalWrite(wr_, LOW);
  direction(OUTPUT);
  for (uint8_t bit = 0; bit < 8; bit++) digitalWrite(data_ + bit, value >> bit & 1);
  digitalWrite(wr_, HIGH);
}

/* --- one chip ------------------------------------------------------------------------------- */

Lm629::Lm629(Lm629Bus &bus, uint8_t cs) : bus_(bus), cs_(cs) {}

void Lm629::begin() {
  digitalWrite(cs_, HIGH);
  pinMode(cs_, OUTPUT);
}

uint8_t Lm629::status() {
  digitalWrite(cs_, LOW);
  uint8_t value = bus_.read(true);
  digitalWrite(cs_, HIGH);
  return value;
}

bool Lm629::waitReady() {
  for (uint8_t polls = 0; polls < 30; polls++)
    if (!(status() & BUSY)) return true;
  return false;
}

bool Lm629::command(uint8_t code) {
  if (!waitReady()) return false;
  digitalWrite(cs_, LOW);
  bus_.write(true, code);
  digitalWrite(cs_, HIGH);
  return true;
}

bool Lm629::word(uint16_t value) {
  if (!waitReady()) return false;
  digitalWrite(cs_, LOW);
  bus_.write(false, value >> 8);
  bus_.write(false, value & 0xFF);
  digitalWrite(cs_, HIGH);
  return true;
}

bool Lm629::wordIn(uint16_t &value) {
  if (!waitReady()) return false;
  digitalWrite(cs_, LOW);
  value = (uint16_t)bus_.read(false) << 8;
  value |= bus_.read(false);
  digitalWrite(cs_, HIGH);
  return true;
}

bool Lm629::checkReset() {
  uint8_t now = status();

  if (now != 0x84 && now != 0xC4) return false;
  if (!clear(0x7E) || !waitReady()) return false;
  now = status();
  return now == 0x80 || now == 0xC0;
}

bool Lm629::filter(uint16_t kp, uint16_t ki, uint16_t kd, uint16_t il) {
  return command(LFIL) && word(0x000F) && word(kp) && word(ki) && word(kd) && word(il)
         && command(UDF);
}

bool Lm629::load(int32_t position, uint32_t velocity, uint32_t acceleration) {
  const uint32_t parts[] = {acceleration, velocity, (uint32_t)position};

  if (!command(LTRJ) || !word(0x002A)) return false;
  for (uint8_t i = 0; i < 3; i++)
    if (!word(parts[i] >> 16) || !word(parts[i] & 0xFFFF)) return false;
  return true;
}

bool Lm629::interruptOn(uint8_t flags) { return command(MSKI) && word(flags); }

bool Lm629::clear(uint8_t flags) { return command(RSTI) && word(~flags & 0x7E); }

bool Lm629::position(int32_t &counts) {
  uint16_t high, low;

  if (!command(RDRP) || !wordIn(high) || !wordIn(low)) return false;
  counts = (int32_t)((uint32_t)high << 16 | low);
  return true;
}

bool Lm629::startTogether(Lm629 &one, Lm629 &other) {
  if (!one.waitReady() || !other.waitReady()) return false;
  digitalWrite(one.cs_, LOW);
  digitalWrite(other.cs_, LOW);
  one.bus_.write(true, STT);
  digitalWrite(one.cs_, HIGH);
  digitalWrite(other.cs_, HIGH);
  return true;
}
