"""Moves an axis of an LM629 over a serial port, with nothing but pyserial.

    python host.py LINK         LINK as vbus run prints it

The link carries the byte protocol: 1a asks for a read cycle at address a and is answered by
'D' and the byte; 2a and a byte make a write cycle. A real serial-to-bus bridge could be asked in
the same way.
"""

import sys
import time

import serial

COMMAND, DATA = 0, 1
BUSY, TRAJECTORY_COMPLETE, POSITION_ERROR = 0x01, 0x04, 0x20
RESET, STT, UDF, RDDP, RDRP, RSTI, LFIL, LTRJ = 0x00, 0x01, 0x04, 0x08, 0x0A, 0x1D, 0x1E, 0x1F


class Lm629:
    def __init__(self, port: serial.Serial) -> None:
        self.port = port

    def read(self, address: int) -> int:
        self.port.write(bytes([0x10 | address]))
        reply = self.port.read(2)
        if len(reply) != 2 or reply[:1] != b"D":
            raise SystemExit(f"no answer to a read cycle: {reply!r}")
        return reply[1]

    def write(self, address: int, data: int) -> None:
        self.port.write(bytes([0x20 | address, data]))

    def wait_ready(self) -> None:
        for _ in range(1000):
            if not self.read(COMMAND) & BUSY:
                return
        raise SystemExit("the chip stays busy")

    def command(self, code: int, *words: int) -> None:
        self.wait_ready()
        self.write(COMMAND, code)
        for word in words:
            self.wait_ready()
            self.write(DATA, word >> 8 & 0xFF)
            self.write(DATA, word & 0xFF)

    def read_long(self, code: int) -> int:
        self.command(code)
        data = bytearray()
        for _ in range(2):
            self.wait_ready()
            data += bytes([self.read(DATA), self.read(DATA)])
        return int.from_bytes(data, "big", signed=True)

    def reset(self) -> None:
        self.write(COMMAND, RESET)
        self.wait_ready()
        first = self.read(COMMAND)
        self.command(RSTI, 0x0000)
        self.wait_ready()
        cleared = self.read(COMMAND)
        print(f"reset: status {first:02X}h, after RSTI {cleared:02X}h")
        if first not in (0x84, 0xC4) or cleared not in (0x80, 0xC0):
            raise SystemExit("that is not what a healthy chip shows")

    def load_filter(self, kp: int, ki: int, kd: int, il: int) -> None:
        self.command(LFIL, 0x000F, kp, ki, kd, il)
        self.command(UDF)
        print("filter loaded")

    def move(self, position: int, velocity: int, acceleration: int) -> None:
        print(f"move to {position}")
        self.command(RSTI, 0xFFFF & ~TRAJECTORY_COMPLETE)
        longs = (acceleration, velocity, position)
        words = [word for value in longs for word in (value >> 16, value)]
        self.command(LTRJ, 0x002A, *words)
        self.command(STT)
        end = time.monotonic() + 10
        while not (status := self.read(COMMAND)) & (TRAJECTORY_COMPLETE | POSITION_ERROR):
            if time.monotonic() > end:
                raise SystemExit("the trajectory does not end")
            time.sleep(0.001)
        print(f"  status {status:02X}h")
        time.sleep(0.2)
        real = self.read_long(RDRP)
        if self.read_long(RDDP) != position or abs(real - position) > 4:
            raise SystemExit(f"  real position {real}: not there")
        print("  position reached")


def main() -> None:
    # Any baud rate will do on a PTY; a bridge on a real line has one of its own.
    with serial.Serial(sys.argv[1], 115200, timeout=5) as port:
        axis = Lm629(port)
        axis.reset()
        axis.load_filter(kp=200, ki=200, kd=2000, il=20000)
        for position in (4000, -1000, 0):
            # 500 lines, 8 MHz: 5 turns/s and 25 turns/s/s.
            axis.move(position, velocity=167772, acceleration=215)


main()
