"""Trapped instructions do what the processor does, form by form; others are refused."""

import subprocess
from pathlib import Path

import pytest

from tests.exec.conftest import compile_c
from tests.exec.forms import forms, processor, source
from vbus.native import include_dir

HERE = Path(__file__).parent
EXEC = Path(include_dir()) / "exec"

FLAGS = [
    "-std=gnu99", "-O1", "-g", "-no-pie", "-mno-red-zone", f"-I{EXEC}",
    "-Wl,--defsym=plain_base=0x20000000,--defsym=window_base=0x30000000",
]  # fmt: skip


def build(folder: Path, bits: int, decoder: Path = EXEC) -> Path:
    (folder / "forms.S").write_text(source(bits))
    return compile_c(
        folder / "fuzz", f"-m{bits}", *FLAGS, HERE / "fuzz.c", HERE / "run_form.S",
        folder / "forms.S", *sorted(decoder.glob("x86*.c")),
    )  # fmt: skip


def test_every_form_gives_what_native_memory_gives(bits: int, tmp_path: Path) -> None:
    fuzz = build(tmp_path, bits)
    refused = sum(form.refused for form in forms(bits))
    assert len(forms(bits)) - refused > 500
    for seed in ("1", "2"):
        done = subprocess.run([fuzz, "60", seed], capture_output=True, text=True, timeout=120)
        assert done.stderr == ""
        assert done.stdout == f"{len(forms(bits))} forms, {refused} refused, 0 wrong\n", seed


@pytest.mark.parametrize(
    ("file", "code", "broken", "form"),
    [
        (
            "x86_two.c",
            "op & 8 ? sign_extend(value, from) : value",
            "value",
            "movsbl 32(%rbx), %eax",
        ),
        ("x86_wide.c", "memset(reg + size, 0, HALF - size);", "{}", "movss 32(%rbx), %xmm2"),
        ("x86_wide.c", "    else if (d->vex)\n", "    else if (0)\n", "vmovsd 32(%rbx), %xmm1"),
        ("x86_follow.c", "op == 0x98", "op == 0x99", "cbtw; cwtd"),
        ("x86_wide.c", "2, -2, -2, -2, 10,", "2, -2, -2, -4, 10,", "fistps"),
    ],
)
def test_the_comparison_notices_a_mistake(
    tmp_path: Path, file: str, code: str, broken: str, form: str
) -> None:
    if form.startswith("v") and "avx" not in processor():
        pytest.skip("the processor has no AVX")
    for source_file in EXEC.glob("x86*.c"):
        text = source_file.read_text()
        if source_file.name == file:
            assert code in text
            text = text.replace(code, broken)
        (tmp_path / source_file.name).write_text(text)
    fuzz = build(tmp_path, 64, tmp_path)
    done = subprocess.run([str(fuzz), "20", "1"], capture_output=True, text=True, timeout=120)
    wrong = [line for line in done.stdout.splitlines() if line.startswith("wrong: ")]
    assert any(form in line for line in wrong)
