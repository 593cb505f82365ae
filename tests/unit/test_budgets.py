"""What each reader takes at most, as ``docs/security.md`` says it and as the code has it."""

import re
from pathlib import Path
from pkgutil import resolve_name

ROOT = Path(__file__).parents[2]
ROW = re.compile(r"^\| ([^|]+) \| (\d+)[^|]* \| [^|]+ \| `(vbus[\w.]+)` \|$", re.MULTILINE)


def test_the_page_says_what_each_reader_takes() -> None:
    text = (ROOT / "docs" / "security.md").read_text()
    rows = ROW.findall(text.partition("## What each reader takes")[2])
    assert len(rows) == text.count("| `vbus.") > 20
    for what, number, constant in rows:
        module, _, name = constant.rpartition(".")
        if "." in module and module.rpartition(".")[2][0].isupper():
            module, name = module.rpartition(".")[0], f"{module.rpartition('.')[2]}.{name}"
        assert resolve_name(f"{module}:{name}") == int(number), what
