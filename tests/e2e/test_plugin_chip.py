"""A chip of a package of its own, installed as anybody's: every tool takes it as it takes ours."""

import json
import os
import re
import shutil
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from tests.e2e.command import running, start
from tests.left_out import require

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "docs" / "examples" / "down_counter"
pytestmark = pytest.mark.slow


def typed(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    """Run a command where the package is installed, and nothing of its sources is in reach."""
    path = f"{folder / 'site'}:{os.environ.get('PYTHONPATH', ROOT)}"
    return subprocess.run(
        [sys.executable, *command],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": path, "VBUS_RUNTIME": str(folder / "run")},
        capture_output=True,
        text=True,
        timeout=100,
    )


def vbus(folder: Path, *arguments: str) -> str:
    done = typed(folder, "-m", "vbus", *arguments)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the package installed below it, its generated files included."""
    folder = tmp_path_factory.mktemp("plugin")
    shutil.copytree(EXAMPLE, folder / "source")
    shutil.copy(EXAMPLE / "counter.toml", folder)
    pip = ("-m", "pip", "install", "-q", "--no-deps", "--no-build-isolation", "--upgrade",
           "--target", "site", "./source")  # fmt: skip
    for command in (pip, ("-m", "vbus.cli.generate", "--family", "dc8")):
        done = typed(folder, *command)
        assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.fixture(scope="module")
def played(place: Path) -> dict[str, object]:
    """What became of a host that moves the lines itself."""
    done = typed(place, str(Path(__file__).with_name("plugin_host.py")))
    assert done.returncode == 0, done.stderr
    told: dict[str, object] = json.loads(done.stdout)
    return told


def test_bit_banged_cycles_are_seen_once_by_everybody(played: dict[str, object]) -> None:
    assert played["seen"] == [[True, 0, 7], [False, 1, 7], [True, 0, 7]]
    assert played["journal"] == played["seen"]
    first, other = played["hashes"]
    assert first != other


def test_the_monitor_shows_a_bit_banged_write_once(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = f"{place / 'site'}:{os.environ.get('PYTHONPATH', ROOT)}"
    monkeypatch.setenv("PYTHONPATH", path)
    monkeypatch.setenv("VBUS_RUNTIME", str(place / "run"))
    monkeypatch.chdir(place)
    requests = b"lines A0=0 /CS=0\ndrive 07\nlines /WR=0\nlines /WR=1\nlines /CS=1\nw 0 09\n"
    with running("counter.toml"):
        process = start("monitor", "counter", "--count", "2")
        assert process.stdout is not None
        assert process.stdout.readline() == "watching counter\n"
        with socket.socket(socket.AF_UNIX) as host:
            host.connect(str(place / "run" / "counter.sock"))
            host.sendall(requests)
            answers = host.makefile()
            assert [answers.readline() for _ in range(6)] == ["ok\n"] * 6
            out, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (0, "")
    assert [line.split(" ", 1)[1] for line in out.splitlines()] == [
        "x write LOAD 07H (7)  [DC-REG-1]",
        "x ! dc8.running: LOAD is written only while the count is 0.",
        "x write LOAD 09H (9)  [DC-REG-1]",
    ]


def test_what_a_host_breaks_and_exercises_is_counted(played: dict[str, object]) -> None:
    assert played["rules"] == ["dc8.running"]
    assert played["covered"] == [
        ["registers written", "LOAD", 2],
        ["registers read", "COUNT", 1],
        ["rules broken", "dc8.running", 1],
    ]
    assert played["share"] == [2, 3]


def test_its_bus_is_explained_in_words(place: Path, played: dict[str, object]) -> None:
    assert vbus(place, "explain", "dc8", "00", "05") == "05: write LOAD 05H (5)  [DC-REG-1]\n"
    assert "One count takes 16 cycles of CLK" in vbus(place, "explain", "DC-CNT-1")
    assert "dc8.running (error, DC-REG-1)" in vbus(place, "explain", "running")
    lines = vbus(place, "explain", "run.vbj", "--no-progress")
    assert "write LOAD 09H (9)" in lines
    assert "read COUNT" in lines


def test_waveforms_have_lanes_with_its_packets(place: Path, played: dict[str, object]) -> None:
    wave = (place / "full.vcd").read_text()
    assert wave.count("swrite\\x20LOAD\\x2009H") == 2
    assert "$var real 64 ( count $end" in wave


def test_a_capture_of_its_bus_is_compared_with_the_model(
    place: Path, played: dict[str, object]
) -> None:
    done = vbus(place, "conform", "DC-8", "run.vcd", "--clock", "1 MHz", "--no-progress")
    assert "no difference in 3 bus cycles, 1 of them reads, and DONE" in done
    assert typed(place, "-m", "vbus", "conform", "DC-8", "run.vcd", "--clock", "1 MHz", "--plant",
                 "ideal").stderr.endswith("DC-8 has no axis; --plant is given once\n")  # fmt: skip


def test_sigrok_decodes_its_bus(place: Path, played: dict[str, object]) -> None:
    sigrok = require("sigrok-cli")
    wiring = ["cs=x_CS", "a0=x_A0", "rd=x_RD", "wr=x_WR", *(f"d{n}=x_D{n}" for n in range(8))]
    made = place / "site" / "dc8" / "generated" / "sigrok"
    done = subprocess.run(
        [sigrok, "-I", "vcd:compress=1000", "-i", "run.vcd", "-P", ":".join(["vbus_dc8", *wiring]),
         "-A", "vbus_dc8=packets"],
        cwd=place, env={**os.environ, "SIGROKDECODE_DIR": str(made)},
        capture_output=True, text=True, timeout=100,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert [line.partition(": ")[2] for line in done.stdout.splitlines()] == [
        "write LOAD 09H (9)", "read COUNT 09H (9)", "write LOAD 09H (9)",
    ]  # fmt: skip


def test_its_files_are_made_and_up_to_date(place: Path) -> None:
    made = place / "site" / "dc8" / "generated"
    assert "| `COUNT` | 01H | 8 bits unsigned | read |" in (made / "dc8.md").read_text()
    assert "\n## DC-CNT-1\n" in (made / "dc8-clauses.md").read_text()
    done = typed(place, "-m", "vbus.cli.generate", "--check", "--family", "dc8")
    assert (done.returncode, done.stdout) == (0, "")


def test_what_is_out_of_date_is_named_and_made_again(place: Path) -> None:
    page = place / "site" / "dc8" / "generated" / "dc8.md"
    text = page.read_text()
    page.write_text("old")
    done = typed(place, "-m", "vbus.cli.generate", "--check", "--family", "dc8")
    assert (done.returncode, done.stdout, page.read_text()) == (1, f"out of date: {page}\n", "old")
    done = typed(place, "-m", "vbus.cli.generate", "--family", "dc8")
    assert (done.returncode, done.stdout, page.read_text()) == (0, f"written: {page}\n", text)


def test_decoders_of_all_families_are_made_in_a_folder_and_need_no_vbus(place: Path) -> None:
    made = place / "decoders"
    done = typed(place, "-m", "vbus.cli.generate", "--sigrok", "decoders")
    files = sorted(path for path in made.rglob("*") if path.is_file())
    assert sorted(done.stdout.splitlines()) == [f"written: {file}" for file in files]
    assert {path.name for path in made.iterdir()} > {"vbus_dc8", "vbus_lm628", "vbus_mcp1200"}
    mine = place / "site" / "dc8" / "generated" / "sigrok" / "vbus_dc8"
    for file in files:
        text = file.read_text()
        assert not re.search(r"^\s*(from|import) vbus\b", text, re.MULTILINE), file
        compile(text, str(file), "exec")
        if file.parent.name == "vbus_dc8":
            assert text == (mine / file.name).read_text()
    done = typed(place, "-m", "vbus.cli.generate", "--check", "--sigrok", "decoders")
    assert (done.returncode, done.stdout) == (0, "")


def test_files_are_made_of_a_family_that_is_named(place: Path) -> None:
    for words, said in (
        ((), "name a chip family with --family, or a folder with --sigrok"),
        (("--family", "dc9"), 'there is no family "dc9"; there are '),
    ):
        done = typed(place, "-m", "vbus.cli.generate", *words)
        assert done.returncode == 2
        assert said in " ".join(done.stderr.split())


def test_its_board_file_is_checked_in_words_that_make_sense(place: Path) -> None:
    vbus(place, "check", "counter.toml")
    text = (place / "counter.toml").read_text()
    wrong = text.replace("[[hosts]]", 'plant = "m"\n\n[plants.m]\nmodel = "ideal"\n\n[[hosts]]')
    (place / "wrong.toml").write_text(wrong)
    done = typed(place, "-m", "vbus", "check", "wrong.toml")
    assert done.returncode != 0
    assert "chips.x.plant: DC-8 has no axis; leave the plant out" in done.stdout + done.stderr


def test_its_own_tests_pass_with_its_fixture_and_its_client(place: Path) -> None:
    shutil.copy(EXAMPLE / "test_dc8.py", place)
    done = typed(place, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_dc8.py")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "6 passed" in done.stdout
