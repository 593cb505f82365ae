"""The page in one file: its modules, its policy, its recording, and nothing from elsewhere."""

import base64
import hashlib
import re
from pathlib import Path

import pytest

from tests.unit.views.scope.decoded import of_page
from vbus.core.errors import VbusError
from vbus.views.scope import page_file
from vbus.views.scope.frames import NOW, frame

TOLD = {"format": 1, "board": "</script><b>", "lanes": [], "now": "5"}


def hash_of(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def test_the_file_holds_description_and_frames() -> None:
    page = page_file.one_file(TOLD, [frame(NOW, 0xFFFF, 0, 5)])
    found = of_page(page)
    assert found.description == TOLD
    assert found.now == 5
    assert page == page_file.one_file(TOLD, [frame(NOW, 0xFFFF, 0, 5)])


def test_only_what_has_its_hash_in_the_policy_runs_and_nothing_is_fetched() -> None:
    page = page_file.one_file(TOLD, []).decode()
    (allowed,) = re.findall(r'<meta http-equiv="Content-Security-Policy" content="([^"]*)">', page)
    (style,) = re.findall(r"<style>(.*?)</style>", page, re.DOTALL)
    (script,) = re.findall(r'<script type="module">(.*?)</script>', page, re.DOTALL)
    rules = dict(rule.strip().split(" ", 1) for rule in allowed.split(";"))
    assert rules["default-src"] == rules["connect-src"] == rules["base-uri"] == "'none'"
    assert rules["script-src"] == f"'sha256-{hash_of(script)}'"
    assert rules["style-src"] == f"'sha256-{hash_of(style)}'"
    assert page.index("Content-Security-Policy") < page.index("<style>") < page.index("<script")
    assert not re.search(r"\b(?:src|href)=", page)
    assert not re.search(r"^(?:import|export)\b", script, re.MULTILINE)


@pytest.fixture
def page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(page_file, "PAGE", tmp_path)
    return tmp_path


def test_modules_stand_after_those_they_import_each_once(page: Path) -> None:
    (page / "main.js").write_text(
        'import {\n  b,\n} from "./b.js";\nimport { a } from "./a.js";\nrun(a, b, "</script>");\n'
    )
    (page / "b.js").write_text('import { a } from "./a.js";\nexport const b = a;\n')
    (page / "a.js").write_text("// export this\nexport async function a() {}\n")
    assert page_file.joined("main.js") == (
        "const { a } = (() => {\n// export this\nasync function a() {}\nreturn { a };\n})();\n"
        "const { b } = (() => {\nconst b = a;\nreturn { b };\n})();\n"
        'const {  } = (() => {\nrun(a, b, "<\\/script>");\nreturn {  };\n})();'
    )  # fmt: skip


def test_modules_in_a_circle_are_refused(page: Path) -> None:
    (page / "a.js").write_text('import { b } from "./b.js";\n')
    (page / "b.js").write_text('import { a } from "./a.js";\n')
    with pytest.raises(VbusError, match=r"import each other: a\.js -> b\.js -> a\.js"):
        page_file.joined("a.js")


@pytest.mark.parametrize("name", ["none.js", "../page_file.py", "a.py", "", "main.js\n"])
def test_there_are_no_other_files(name: str) -> None:
    with pytest.raises(VbusError, match="the page has no file"):
        page_file.page_file(name)
