"""What a page of the documentation runs in a browser: a driver, on a board in the same process.

It is plain vbus, so the same call gives the same hash wherever Python runs.
"""

import contextlib
import io
import traceback

import vbus
from vbus.board.board import Board
from vbus.board.build import build
from vbus.client.bus import Bus
from vbus.core.errors import VbusError
from vbus.testing import connect_in_process
from vbus.testing.boards import for_test
from vbus.testing.limits import BUDGET, HostWatch
from vbus.views.clauses import clause_frame
from vbus.views.scope.page_file import one_file
from vbus.views.scope.recording import Recorder

DRIVER = "driver.py"


def run(board_text: str, driver: str) -> dict[str, str]:
    """Run a driver to its end, on a board whose time moves by bus cycles alone.

    Args:
        board_text: a board file.
        driver: a program in Python; ``vbus.connect`` leads it to the board, whatever it names.

    Returns:
        ``printed``: what the driver printed, and the error that ended it; ``hash``: the trace hash
        of all that happened; ``page``: the scope's page with every sample. The last two are empty
        if the board file has mistakes.
    """
    printed = io.StringIO()
    try:
        board = build(*for_test(board_text, "board.toml"))
    except VbusError as error:
        return {"printed": f"{error}\n", "hash": "", "page": ""}
    board.start_trace()
    HostWatch(board, BUDGET)
    recorder = Recorder(board, edges=True)
    recorder.start()
    with contextlib.redirect_stdout(printed):
        _drive(board, driver)
    recorder.stop()
    frames = [clause_frame(chip.FAMILY for chip in board.chips), *recorder.take()]
    page = one_file(recorder.lanes.described(live=False), frames)
    return {"printed": printed.getvalue(), "hash": board.trace_hash(), "page": page.decode()}


def _drive(board: Board, driver: str) -> None:
    """Run a driver; print the error that ends it, without what is not the driver's."""
    hosts: list[Bus] = []

    def connect(where: str, timeout: float = 0, wait: str | None = None) -> Bus:
        hosts.append(connect_in_process(board, f"host{len(hosts) + 1}"))
        return hosts[-1]

    vbus.connect = connect
    try:
        exec(compile(driver, DRIVER, "exec"), {"__name__": "__main__"})
    except BaseException as error:
        lines = [each for each in traceback.extract_tb(error.__traceback__)
                 if each.filename == DRIVER]  # fmt: skip
        print("".join(f"{DRIVER}, line {each.lineno}: " for each in lines[-1:]), end="")
        print("".join(traceback.format_exception_only(error)), end="")
    finally:
        del vbus.connect
        for bus in hosts:
            bus.close()
