/* Lm629.h - an Arduino library for LM628 and LM629 motion controllers that share a bus.
 *
 * All chips have D0-D7, /PS, /RD, /WR and /RST in common; each has a /CS of its own.
 */
#ifndef LM629_H
#define LM629_H

#include <Arduino.h>

/* The common lines. `data` is the pin of D0; D1 to D7 follow it. */
class Lm629Bus {
public:
  Lm629Bus(uint8_t data, uint8_t ps, uint8_t rd, uint8_t wr, uint8_t rst);

  void begin();   /* directions */
  void reset();   /* pulses /RST and waits until the chips must be up */
  uint8_t read(bool command);
  void write(bool command, uint8_t value);

private:
  void direction(uint8_t mode);

  uint8_t data_, ps_, rd_, wr_, rst_;
  uint8_t mode_;
};

class Lm629 {
public:
  static const uint8_t BUSY = 0x01;
  static const uint8_t COMMAND_ERROR = 0x02;
  static const uint8_t TRAJECTORY_COMPLETE = 0x04;
  static const uint8_t POSITION_ERROR = 0x20;

  Lm629(Lm629Bus &bus, uint8_t cs);

  void begin();
  uint8_t status();
  bool checkReset();                                     /* 84h or C4h, then 80h or C0h */
  bool filter(uint16_t kp, uint16_t ki, uint16_t kd, uint16_t il);
  bool load(int32_t position, uint32_t velocity, uint32_t acceleration);
  bool interruptOn(uint8_t flags);                       /* MSKI */
  bool clear(uint8_t flags);                             /* RSTI */
  bool position(int32_t &counts);                        /* RDRP */
  bool waitReady();

  /* STT to two chips in one strobe, so that both begin in step. */
  static bool startTogether(Lm629 &one, Lm629 &other);

private:
  bool command(uint8_t code);
  bool word(uint16_t value);
  bool wordIn(uint16_t &value);

  Lm629Bus &bus_;
  uint8_t cs_;
};

#endif
