"""Output files: one writer each, results whole or not at all."""

import os
import resource
import signal
import stat
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path

import pytest

from vbus.core.errors import VbusError
from vbus.serve.output_file import OutputFile, output, write_file

HOLDER = (
    "import sys; from vbus.serve.output_file import OutputFile;"
    " file = OutputFile(sys.argv[1], whole=sys.argv[2] == 'result');"
    " file.begin().write(b'theirs'); print('held', flush=True); sys.stdin.read()"
)
KINDS = ("stream", "result")


@contextmanager
def held(path: Path, kind: str) -> Iterator[subprocess.Popen[str]]:
    """Let another process write a file while the block runs."""
    with subprocess.Popen(
        [sys.executable, "-c", HOLDER, path, kind], text=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        yield process
        process.kill()


@pytest.mark.parametrize("theirs", KINDS)
@pytest.mark.parametrize("ours", KINDS)
def test_a_file_that_another_process_writes_is_refused_until_that_dies(
    tmp_path: Path, theirs: str, ours: str
) -> None:
    path = tmp_path / "r.txt"
    link = tmp_path / "link"
    link.symlink_to("r.txt")
    with held(path, theirs) as process:
        there = sorted(tmp_path.iterdir())
        descriptors = len(os.listdir("/proc/self/fd"))
        for name in (path, link):
            with pytest.raises(VbusError) as refused:
                OutputFile(name, whole=ours == "result")
            told, command = str(refused.value), f"{sys.executable} -c import sys; from vbus"
            assert told.startswith(f"{name}: process {process.pid} ({command}")
            assert told.endswith(") writes this file; stop it, or give another file")
        assert sorted(tmp_path.iterdir()) == there
        assert len(os.listdir("/proc/self/fd")) == descriptors
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        with closing(OutputFile(path, whole=ours == "result")) as file:
            file.begin().write(b"ours")
            file.keep()
    assert path.read_bytes() == b"ours"
    assert [one.name for one in tmp_path.iterdir() if one.name.endswith(".part")] == (
        [".r.txt.part"] if (theirs, ours) == ("result", "stream") else []
    )


@pytest.mark.parametrize("first", KINDS)
@pytest.mark.parametrize("second", KINDS)
def test_two_outputs_of_one_run_into_one_file_are_refused(
    tmp_path: Path, first: str, second: str
) -> None:
    path = tmp_path / "r.txt"
    path.write_text("old")
    refusal = pytest.raises(VbusError, match=r"r\.txt: two outputs of this run are to go into")
    with closing(OutputFile(path, whole=first == "result")), refusal:
        OutputFile(path, whole=second == "result")
    assert path.read_text() == "old"
    assert [one.name for one in tmp_path.iterdir()] == ["r.txt"]


def test_a_stream_is_changed_only_when_it_begins(tmp_path: Path) -> None:
    path, new = tmp_path / "old.vbj", tmp_path / "new.vbj"
    path.write_text("old")
    for one in (path, new):
        OutputFile(one, whole=False).close()
    assert path.read_text() == "old"
    assert not new.exists()
    with closing(OutputFile(path, whole=False)) as file:
        file.begin_text().write("new")
        file.keep()
        assert path.read_text() == "new"


MARKS = {
    "journal": b"vbus journal 1\n", "snapshot": b"vbus snapshot\n",
    "board": b'[board]\nname = "a"\n', "program": b"\x7fELF\x02",
    "accepted": b'[[suppress]]\nrule = "lm628.T4"\n',
}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("there", MARKS)
@pytest.mark.parametrize("begins", [b"", b"lm628: 3 of 69", MARKS["journal"], MARKS["snapshot"]])
def test_a_name_given_by_mistake_costs_no_board_file_journal_or_program(
    tmp_path: Path, kind: str, there: str, begins: bytes
) -> None:
    path = tmp_path / "a"
    path.write_bytes(MARKS[there])
    if begins == MARKS[there]:
        OutputFile(path, kind == "result", begins).close()
    else:
        with pytest.raises(VbusError, match=r"a: it looks like a .*, and is not replaced; give an"):
            OutputFile(path, kind == "result", begins)
    assert path.read_bytes() == MARKS[there]
    assert [one.name for one in tmp_path.iterdir()] == ["a"]


@pytest.mark.parametrize("there", [b"import os\n", b"$date today $end", b"{}", b""])
def test_a_journal_replaces_journals_alone_and_a_text_any_text(
    tmp_path: Path, there: bytes
) -> None:
    path = tmp_path / "a"
    path.write_bytes(there)
    if there:
        with pytest.raises(VbusError, match="and is not replaced"):
            write_file(path, MARKS["journal"])
        assert path.read_bytes() == there
    write_file(path, b"a report")
    assert path.read_bytes() == b"a report"


def test_a_result_that_is_not_kept_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "r.txt"
    path.write_text("old")
    path.chmod(0o640)
    with suppress(ZeroDivisionError), output(path) as file:
        file.begin().write(b"half")
        raise ZeroDivisionError
    assert path.read_text() == "old"
    assert [one.name for one in tmp_path.iterdir()] == ["r.txt"]
    with output(path) as file:
        file.begin_text().write("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


def test_a_result_may_be_written_again_and_stays_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "s.snap"
    with closing(OutputFile(path)) as file:
        for number in range(3):
            file.write(b"%d" % number, sync=False)
            assert path.read_bytes() == b"%d" % number
            for whole in (False, True):
                with pytest.raises(VbusError, match="two outputs of this run"):
                    OutputFile(path, whole)
    assert [one.name for one in tmp_path.iterdir()] == ["s.snap"]
    write_file(path, b"next")


def test_a_full_disk_leaves_no_half_result(tmp_path: Path) -> None:
    path = tmp_path / "r.txt"
    path.write_text("old")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10, before[1]))
    try:
        with pytest.raises(VbusError, match=r"r\.txt: cannot be written: File too large"):
            write_file(path, b"more than ten bytes")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert path.read_text() == "old"
    assert [one.name for one in tmp_path.iterdir()] == ["r.txt"]


def test_what_cannot_be_a_file_is_refused_in_words(tmp_path: Path) -> None:
    for whole in (False, True):
        with pytest.raises(VbusError, match="cannot be written: Is a directory"):
            OutputFile(tmp_path, whole)
        with pytest.raises(VbusError, match="cannot be written: No such file or directory"):
            OutputFile(tmp_path / "none" / "r.txt", whole)
    (tmp_path / ".planted.part").symlink_to("/etc/hostname")
    with pytest.raises(VbusError, match="cannot be written: Too many levels of symbolic links"):
        OutputFile(tmp_path / "planted")


def test_pipes_and_devices_belong_to_nobody(tmp_path: Path) -> None:
    files = [OutputFile(os.devnull, whole) for whole in (False, True)]
    for file in files:
        file.begin().write(b"x")
        file.keep()
        file.close()
    os.mkfifo(tmp_path / "pipe")
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    write_file(tmp_path / "pipe", b"through")
    assert os.read(reader, 100) == b"through"
    os.close(reader)
