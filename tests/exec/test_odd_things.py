"""Twenty-seven odd things programs do: each does under ``vbus exec`` what it does elsewhere."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.exec.test_programs import PORTS, REGISTERS, execute

# The lines, and the exit code if it is not 0. The register holds 41h before.
ODD: dict[str, tuple[list[str], int]] = {
    "threads": (["wrong 0"], 0),
    "detached thread": (["42"], 0),
    "thread with the smallest stack": (["42"], 0),
    "cancelled thread": (["cancelled 1, 42"], 0),
    "asynchronous cancel": (["cancelled 1, 42"], 0),
    "main thread leaves first": (["42"], 0),
    "fork": (["child 42, parent 43"], 0),
    "fork in a thread": (["child 42, parent 43"], 0),
    "vfork and exec": (["42", "parent 43"], 0),
    "posix_spawn": (["42", "parent 43"], 0),
    "exec": (["42"], 0),
    "popen": (["shell 42, parent 43"], 0),
    "few descriptors": (["42"], 0),
    "atexit": (["42"], 0),
    "signal handler": (["42"], 0),
    "alternate stack": (["42"], 0),
    "stack overflow": (["deep 1, 42"], 0),
    "deep recursion": (["41"], 0),
    "longjmp out of an access": (["42"], 0),
    "own fault handler": (["own fault, 43"], 0),
    "faults blocked": (["42"], 0),
    "faults ignored": (["42"], 0),
    "SIGSEGV by kill": (["42"], 0),
    "sleep by system call": (["slept 1, 42"], 0),
    "seccomp": (["refused 1, 42"], 0),
    "trap blocked by system call": (["blocked 1"], 139),
    "coroutine": (["42, 43"], 0),
}


@pytest.mark.parametrize(
    ("policy", "bits"),
    [("lockstep", 64), ("lockstep", 32), ("slaved", 64), ("realtime", 64)],
    indirect=["bits"],
)
def test_each_odd_thing_comes_out_as_it_does_elsewhere(
    programs: Callable[[str, int], Path], bits: int, tmp_path: Path, policy: str
) -> None:
    names = " ".join(f"'{name}'" for name in ODD)
    script = (
        f'for name in {names}; do echo "$name:"; {programs("odd", bits)} "$name"; echo $?; done'
    )
    board = REGISTERS.format(time=policy, card=PORTS)
    done = execute(tmp_path, board, "bash", "-c", script, options=("--no-summary",))
    expected = [
        line for name, (lines, code) in ODD.items() for line in (f"{name}:", *lines, str(code))
    ]
    assert done.stdout.splitlines() == expected


def test_the_page_has_every_odd_thing() -> None:
    page = Path("docs/bring-your-driver.md").read_text()
    table = page[page.index("### Odd things") : page.index("### The end")]
    rows = [line.split(" | ")[0].lstrip("| ") for line in table.splitlines() if " | " in line]
    assert rows[1:] == list(ODD)
    assert len(ODD) == 27
