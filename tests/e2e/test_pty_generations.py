"""The next host of a terminal is nobody's heir: a hundred pairs of a close and an open at once."""

import os
import select
import subprocess
import termios
import tty
from pathlib import Path

import pytest

from tests.e2e.serving import served
from tests.e2e.test_pty import PTY, open_raw, read_exactly, toy_board
from tests.e2e.test_pty_clients import wait_until_served
from tests.left_out import require
from vbus.serve.server import LinkSpec

PAIRS = 100
ECHO = b"\x02"
HALF = b"\x31\x01"
"""The first two of three bytes of LINES."""


def set_times(fd: int) -> list[object]:
    """Set what a program with read time-outs sets; return the settings."""
    settings = termios.tcgetattr(fd)
    settings[tty.CC][termios.VMIN] = 0
    settings[tty.CC][termios.VTIME] = 7
    termios.tcsetattr(fd, termios.TCSANOW, settings)
    return termios.tcgetattr(fd)


@pytest.mark.parametrize("policy", ["lockstep", "realtime"])
@pytest.mark.parametrize("last", [b"", ECHO + b"\x55", HALF, (ECHO + b"\x66") * 40 + HALF])
def test_the_next_host_finds_nothing_of_the_last_one(
    runtime: Path, policy: str, last: bytes
) -> None:
    """What the last one sent just before it closed is answered, or half, or nothing."""
    name = runtime / "x"
    with served(toy_board(policy=policy), PTY):
        for number in range(PAIRS):
            first = open_raw(name)
            os.write(first, ECHO + b"\x01")
            assert read_exactly(first, 2) == b"E\x01"
            os.write(first, last)
            os.close(first)
            second = open_raw(name)
            settings = set_times(second)
            os.write(second, ECHO + bytes((number,)))
            assert read_exactly(second, 2) == b"E" + bytes((number,))
            assert select.select([second], [], [], 0)[0] == [], "inherited"
            assert termios.tcgetattr(second) == settings
            os.close(second)


def test_a_host_that_came_and_went_before_it_was_noticed_swallows_no_later_one(
    runtime: Path,
) -> None:
    """The next has it open, and has written nothing: what is there is that of the one before."""
    name = runtime / "x"
    served_so_far = 0
    with served(toy_board(), PTY) as server:
        for number in range(PAIRS):
            for last in (HALF, ECHO + b"\x55"):
                first = open_raw(name)
                os.write(first, last)
                os.close(first)
                second = open_raw(name)
                settings = set_times(second)
                served_so_far += 2
                wait_until_served(server, served_so_far)  # an Arduino takes two seconds to reset
                os.write(second, ECHO + bytes((number,)))
                assert read_exactly(second, 2) == b"E" + bytes((number,))
                assert select.select([second], [], [], 0)[0] == [], "inherited"
                assert termios.tcgetattr(second) == settings
                os.close(second)


def test_settings_made_before_a_byte_was_sent_stay(runtime: Path) -> None:
    name = runtime / "x"
    with served(toy_board(), PTY):
        for number in range(PAIRS):
            os.close(open_raw(name))
            fd = open_raw(name)
            settings = set_times(fd)
            os.write(fd, ECHO + bytes((number,)))
            assert read_exactly(fd, 2) == b"E" + bytes((number,))
            assert termios.tcgetattr(fd) == settings
            os.close(fd)


HOST = """
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>
int main(int argc, char **argv)
{
    for (int pair = 0; pair < 100; pair++) {
        unsigned char answer[3] = {0}, ask[2] = {2, 1};
        struct termios set, found;
        int fd = open(argv[1], O_RDWR | O_NOCTTY), got = 0, looks = 6;
        if (fd < 0 || write(fd, ask, 2) != 2 || read(fd, answer, 2) < 1)
            return 1;
        if (write(fd, argc > 2 ? "\\x31\\x01" : "\\x02\\x55", 2) != 2)
            return 2;
        close(fd);
        fd = open(argv[1], O_RDWR | O_NOCTTY);
        tcgetattr(fd, &set);
        set.c_cc[VMIN] = 0, set.c_cc[VTIME] = 100; /* ten seconds */
        tcsetattr(fd, TCSANOW, &set);
        tcgetattr(fd, &set);
        ask[1] = (unsigned char)pair;
        if (write(fd, ask, 2) != 2)
            return 3;
        while (got < 2) {
            int more = read(fd, answer + got, 3 - got);
            if (more < 0 || (more == 0 && --looks == 0))
                return 4;
            got += more;
        }
        tcgetattr(fd, &found);
        if (got != 2 || answer[0] != 'E' || answer[1] != pair)
            return printf("%d: %d %02X %02X\\n", pair, got, answer[0], answer[1]), 5;
        if (memcmp(&set, &found, sizeof set) != 0)
            return 6;
        close(fd);
    }
    return 0;
}
"""


@pytest.mark.parametrize("half", [[], ["half"]])
def test_the_same_of_a_program_in_c(runtime: Path, tmp_path: Path, half: list[str]) -> None:
    gcc = require("gcc")
    (tmp_path / "host.c").write_text(HOST)
    subprocess.run([gcc, "-O2", "-o", tmp_path / "host", tmp_path / "host.c"], check=True)
    with served(toy_board(), PTY):
        done = subprocess.run([tmp_path / "host", runtime / "x", *half], capture_output=True)
    assert (done.returncode, done.stdout) == (0, b"")


def test_each_has_a_session_of_its_own_while_the_last_one_is_open(runtime: Path) -> None:
    """What it opens twice before it sends a byte is one; a program that comes later is another."""
    name = runtime / "x"
    with served(toy_board(), PTY, LinkSpec("unix:$VBUS_RUNTIME/y", "byte")) as server:
        reads, writes = open_raw(name), open_raw(name)
        os.write(writes, ECHO + b"\x01" + HALF)
        assert read_exactly(reads, 2) == b"E\x01"
        other = open_raw(name)
        os.write(other, ECHO + b"\x02")
        assert read_exactly(other, 2) == b"E\x02"
        os.write(writes, b"\x42\x11")
        assert read_exactly(reads, 2) == b"D\x42"
        assert len(server.hosts[0].sessions) == 2
        for fd in (reads, writes, other):
            os.close(fd)
