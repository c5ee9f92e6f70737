"""The Python of the pages passes a strict type checker as it stands: all methods, one run of mypy."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
#: Objects of the pages are those of three packages; all that these import takes as long again to read.
SETTINGS = """\
[mypy]
follow_imports = skip
[mypy-symgen.*,numpy.*,xarray.*]
follow_imports = normal
[mypy-sympy.*,scipy.*]
ignore_missing_imports = true
"""
#: What a type checker has to object to, with the name that it objects to.
WRONG = """\
import symgen

model = symgen.build("four_bar")
model.simulte(1.0)
model.simulate(1.0, rtoll=1e-10)
model.modes().frequency
symgen.build("four_bar", bakend="c")
"""


@pytest.mark.skipif(find_spec("mypy") is None, reason="mypy is not installed")
def test_the_python_of_the_pages_is_typed(tmp_path):
    """Blocks of a page follow one another; a module (with its docstring) stands alone."""
    files = {}
    for page in PAGES:
        blocks = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
        alone = [b for b in blocks if b.startswith('"""')]
        rest = [b for b in blocks if not b.startswith('"""')]
        files |= {f"{page.stem}_{i}.py": text for i, text in enumerate([*alone, "\n".join(rest)]) if text}
    text = "\n".join(files.values())
    for method in ('"four_bar"', '"slider_crank"', '"elastic_four_bar"', '"my_model.py"'):
        assert f"symgen.build({method}" in text
    for name, text in {**files, "wrong.py": WRONG}.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    (tmp_path / "mypy.ini").write_text(SETTINGS)
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--cache-dir", os.devnull, "--config-file", "mypy.ini"]
        + [*files, "wrong.py"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    errors = [line for line in done.stdout.splitlines() if ": error: " in line]
    assert [line for line in errors if not line.startswith("wrong.py")] == []
    for line, name in enumerate(["simulte", "rtoll", "frequency", "bakend"], 4):
        assert any(e.startswith(f"wrong.py:{line}: ") and f'"{name}"' in e for e in errors), done.stdout
