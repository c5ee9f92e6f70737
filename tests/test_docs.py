"""The Python of the pages of the documentation runs as it stands, block after block."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parent.parent / "docs"
BLOCK = re.compile(r"^```(python|toml)\n(.*?)^```", re.DOTALL | re.MULTILINE)
NAMED = re.compile(r'\("(\w+\.(?:py|toml))"')
#: The tour is run with the README, and the page of sweeps where its results are compared.
PAGES = [
    p
    for p in sorted(DOCS.glob("*.md"))
    if "```python" in p.read_text("utf-8") and p.stem not in ("tour", "sweeps")
]


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_the_python_of_a_page_runs(page, tmp_path, monkeypatch):
    """A file that a block builds is the last block of its language before."""
    monkeypatch.chdir(tmp_path)
    names, shown = {"__name__": page.stem}, {}
    for language, text in BLOCK.findall(page.read_text("utf-8")):
        if language == "python" and "__main__" in text:
            Path("program.py").write_text(text, "utf-8")
            subprocess.run([sys.executable, "program.py"], check=True)
        elif language == "python":
            for file in NAMED.findall(text):
                Path(file).write_text(shown[file.rpartition(".")[2]], "utf-8")
            exec(compile(text, str(page), "exec"), names)
        shown["toml" if language == "toml" else "py"] = text
