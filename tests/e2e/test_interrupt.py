"""Ctrl-C while a board computes for months of its own time."""

import signal
import subprocess
import sys

MONTHS = """
from vbus.board.build import load_board_text
board = load_board_text('''
[board]
name = "long"
time = "lockstep"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "motor"
[plants.motor]
model = "dc_motor"
''')
from vbus.client.lm628 import Lm628
from vbus.serve.in_process import connect_in_process
axis = Lm628(connect_in_process(board))
axis.check_reset()
axis.load_filter(kp=300, kd=2000)
axis.load_trajectory(acc=400, vel=4 << 16, velocity_mode=True, start=True)
try:
    print("begun", flush=True)
    board.run_until(100 * 24 * 3600 * 10**12)
except KeyboardInterrupt:
    pass
when = board.now
board.run_for(10**12)
print("interrupted", when < 100 * 24 * 3600 * 10**12, board.now - when, flush=True)
"""


def test_ctrl_c_ends_a_run_of_months_and_the_board_goes_on_from_there() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", MONTHS], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        try:
            assert process.stdout.readline() == "begun\n"
            process.send_signal(signal.SIGINT)
            told, _ = process.communicate(timeout=60)
        finally:
            process.kill()
    assert told == "interrupted True 1000000000000\n"
