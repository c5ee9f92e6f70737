"""The blocks of the pages of the documentation run as they stand, block after block."""

import re
import shlex
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
import typer
from shared.commands import runner

import symgen
from symgen.cli import app
from symgen.export import export_c

DOCS = Path(__file__).parent.parent / "docs"
BLOCK = re.compile(r"^```(python|toml|sh|c)\n(.*?)^```", re.DOTALL | re.MULTILINE)
NAMED = re.compile(r'\("(\w+\.(?:py|toml))"')
SAVED = re.compile(r"`(\w+\.(?:py|toml))`")
#: The tour is run with the README, and the page of sweeps where its results are compared.
PAGES = [
    p
    for p in sorted(DOCS.glob("*.md"))
    if "```python" in p.read_text("utf-8") and p.stem not in ("tour", "sweeps")
]
#: Options of commands that take minutes.
LONG = ("--random 100000", "--t-end 1000")


def blocks(page):
    """Yield the language and text of each block of a page, and the file as which the page saves it."""
    text = page.read_text("utf-8")
    for found in BLOCK.finditer(text):
        named = SAVED.findall(text[: found.start()].rpartition("\n\n## ")[2])
        yield *found.groups(), next((n for n in reversed(named) if n.endswith(found[1])), "")


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_the_python_of_a_page_runs(page, tmp_path, monkeypatch):
    """A file that a block builds is the last block of its language before."""
    monkeypatch.chdir(tmp_path)
    names, shown = {"__name__": page.stem}, {}
    for language, text, _ in blocks(page):
        if language == "python" and "__main__" in text:
            Path("program.py").write_text(text, "utf-8")
            subprocess.run([sys.executable, "program.py"], check=True)
        elif language == "python":
            for file in NAMED.findall(text):
                Path(file).write_text(shown[file.rpartition(".")[2]], "utf-8")
            exec(compile(text, str(page), "exec"), names)
        if language in ("python", "toml"):
            shown["toml" if language == "toml" else "py"] = text


def commands(page):
    """Return the lines of the blocks of a page that call symgen, as arguments."""
    text = "\n".join(text for language, text, _ in blocks(page) if language == "sh").replace("\\\n", " ")
    lines = (line.partition("symgen ")[2] for line in text.splitlines() if re.match(r"(.*&& )?symgen ", line))
    return [shlex.split(line, comments=True) for line in lines]


COMMANDS = [p for p in sorted(DOCS.glob("*.md")) if commands(p)]


@pytest.mark.parametrize("page", COMMANDS, ids=lambda p: p.stem)
def test_the_commands_of_a_page_have_the_options_that_it_shows(page):
    group = typer.main.get_command(app)
    with group.make_context("symgen", [], resilient_parsing=True) as context:
        for line in commands(page):
            name, command, rest = group.resolve_command(context, line)
            command.make_context(name, [*rest], parent=context).close()


@pytest.mark.full
@pytest.mark.parametrize("page", COMMANDS, ids=lambda p: p.stem)
def test_the_commands_of_a_page_run(page, tmp_path, monkeypatch):
    """Commands on files that a page does not show are left out, and those that take minutes."""
    monkeypatch.chdir(tmp_path)
    for _, text, name in blocks(page):
        if name and not Path(name).exists():
            Path(name).write_text(text, "utf-8")
    for line in commands(page):
        files = [word for word in line if re.search(r"^[^=]*\.(py|toml)$", word)]
        if line[0] == "live" and find_spec("ziglang") is None:
            continue
        if not all(Path(file).exists() for file in files) or any(x in " ".join(line) for x in LONG):
            continue
        done = runner.invoke(app, line)
        assert done.exit_code == 0, (line, done.output)


def test_the_scenes_of_the_pages_on_scenes_are_built(tmp_path):
    """Their blocks that are no whole scene show a table each."""
    whole = [
        text
        for page in sorted(DOCS.glob("scene*.md"))
        for language, text, _ in blocks(page)
        if language == "toml" and "symgen = 1" in text
    ]
    assert len(whole) >= 3
    for i, text in enumerate(whole):
        file = tmp_path / f"scene_{i}.toml"
        file.write_text(text, "utf-8")
        assert symgen.build(file).capabilities


@pytest.mark.parametrize("scene", ["four_bar", "crank_rocker", "rssr", "elastic_four_bar"])
def test_the_page_of_models_has_every_member(scene):
    page = (DOCS / "api_model.md").read_text("utf-8")
    listed = {
        name for line in page.splitlines() if line.startswith(".. auto") for name in line.split(".")[-1:]
    }
    assert not {name for name in dir(symgen.build(scene)) if not name.endswith("_many")} - listed


#: A scene of the page of machines, the command on it, and lines of its output.
MACHINE = re.compile(
    r"^```\{literalinclude\} \.\./(\S+)\n:language: toml\n```\n\n```sh\n([^\n]*)\n```\n\n```\n(.*?)\n```$",
    re.DOTALL | re.MULTILINE,
)
MACHINES = MACHINE.findall((DOCS / "machines.md").read_text("utf-8"))


def test_the_page_of_machines_runs_every_scene_that_it_shows():
    page = (DOCS / "machines.md").read_text("utf-8")
    assert len(MACHINES) == page.count("{literalinclude}") == page.count("```sh") >= 15
    cases = DOCS.parent / "symgen" / "scenes" / "machines"
    assert {DOCS.parent / scene for scene, *_ in MACHINES} == {*cases.glob("*.toml")}


@pytest.mark.parametrize("scene, command, shown", MACHINES, ids=[Path(m[0]).stem for m in MACHINES])
def test_the_results_of_a_machine_are_those_of_the_run(scene, command, shown, monkeypatch):
    """Every line that the page shows is one of the output, of which it may omit columns."""
    monkeypatch.setenv("COLUMNS", "160")  # tables that do not fit have their titles in several lines
    program, *arguments = shlex.split(command)
    assert program == "symgen" and Path(scene).stem in arguments
    done = runner.invoke(app, arguments)
    assert done.exit_code == 0, done.output
    printed = [line.split() for line in done.output.splitlines()]
    for line in shown.splitlines():
        rows = [iter(words) for words in printed]
        assert any(all(word in row for word in line.split()) for row in rows), (line, done.output)


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
@pytest.mark.parametrize(
    ("name", "before", "after"),
    [
        (
            "control",
            "double t = 0, y[scene_n_states]; int status = 0; void *memory = malloc(scene_bytes());",
            "",
        ),
        ("export", "", "free(model);"),
        ("solvers", "", ""),
    ],
    ids=["control", "export", "solvers"],
)
def test_the_c_of_a_page_compiles(name, before, after, tmp_path):
    page = DOCS / f"{name}.md"
    (text,) = (text for language, text, _ in blocks(page) if language == "c")
    scene = "four_bar"
    if name == "control":
        found = {}
        exec(next(text for language, text, _ in blocks(page) if language == "python"), found)
        scene = found["scene"]
    header = export_c(scene, tmp_path / "c") and next(
        f for f in (tmp_path / "c").glob("*.h") if "kernel" not in f.name
    )
    lines = [
        f'#include "{header.name}"',
        "#include <stdlib.h>",
        "#include <string.h>",
        "double force(const double *y);",
    ]
    body = (
        text if name == "solvers" else f"int main(void)\n{{\n{before}\n{text}\n{after}\nreturn status;\n}}\n"
    )
    (tmp_path / "c" / "page.c").write_text("\n".join([*lines, body]), "utf-8")
    subprocess.run(
        ["cc", "-std=c11", "-Wall", "-Werror", "-fsyntax-only", "page.c"], cwd=tmp_path / "c", check=True
    )
