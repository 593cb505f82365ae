"""Trapped instructions do what the processor does, form by form; others are refused."""

import subprocess
from pathlib import Path

import pytest

from tests.exec.conftest import compile_c
from tests.exec.forms import forms, source
from vbus.native import include_dir

HERE = Path(__file__).parent
EXEC = Path(include_dir()) / "exec"

FLAGS = [
    "-std=gnu99", "-O1", "-g", "-no-pie", "-mno-red-zone", f"-I{EXEC}",
    "-Wl,--defsym=plain_base=0x20000000,--defsym=window_base=0x30000000",
]  # fmt: skip


def build(folder: Path, bits: int, decoder: Path) -> Path:
    (folder / "forms.S").write_text(source(bits))
    return compile_c(
        folder / "fuzz", f"-m{bits}", *FLAGS, HERE / "fuzz.c", HERE / "run_form.S",
        folder / "forms.S", decoder,
    )  # fmt: skip


@pytest.mark.parametrize("seed", [1, 2])
def test_every_form_gives_what_native_memory_gives(seed: int, bits: int, tmp_path: Path) -> None:
    fuzz = build(tmp_path, bits, EXEC / "x86.c")
    done = subprocess.run([str(fuzz), "60", str(seed)], capture_output=True, text=True, timeout=120)
    assert done.stderr == ""
    refused = sum(form.refused for form in forms(bits))
    assert done.stdout == f"{len(forms(bits))} forms, {refused} refused, 0 wrong\n"
    assert len(forms(bits)) - refused > 500


def test_the_comparison_notices_a_mistake(tmp_path: Path) -> None:
    text = (EXEC / "x86.c").read_text()
    (tmp_path / "x86.c").write_text(
        text.replace("op & 8 ? sign_extend(value, from) : value", "value")
    )
    fuzz = build(tmp_path, 64, tmp_path / "x86.c")
    done = subprocess.run([str(fuzz), "20", "1"], capture_output=True, text=True, timeout=120)
    assert "wrong: movsbl 32(%rbx), %eax" in done.stdout
