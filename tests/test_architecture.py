"""The house: imports point one way, files stay small, light things stay light."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import symgen

ROOT = Path(symgen.__file__).parent
FILES = sorted(p for p in ROOT.rglob("*.py"))

#: What each part may import of symgen, besides itself and ``errors``.
ALLOWED = {
    "errors": set(),
    "atomic": set(),
    "symbolic": set(),
    "joints": {"symbolic"},
    "elements": {"symbolic"},
    "scene": {"symbolic", "joints", "elements"},
    "scenes": set(),
    "mechanics": {"symbolic", "elements"},
    "models": {"scene", "mechanics", "joints", "elements", "symbolic"},
    "lowering": {"symbolic"},
    "codegen": {"lowering", "atomic", "precision"},
    "compiler": set(),
    "tuning": {"runtime", "scene"},
    "graph": {"cache"},
    "making": {
        "cache", "codegen", "compiler", "graph", "lowering", "precision", "runtime", "scene", "symbolic",
    },
    "own": {"graph", "symbolic"},
    "own_model": {"own", "making", "lowering", "runtime", "scene"},
    "precision": set(),
    "cache": set(),
    "runtime": {"atomic", "precision", "report"},
    "report": {
        "runtime", "symbolic", "lowering", "codegen", "atomic", "precision", "regeneration", "sources",
    },
    "describe": {"scene", "elements", "models", "lowering", "runtime", "symbolic"},
    "export": {
        "pipeline", "making", "codegen", "lowering", "models", "elements", "runtime", "scene", "symbolic", "atomic",
    },
    "runs": {"runtime", "scene"},
    "pipeline": {
        "describe", "own", "own_model", "tuning",
        "scene", "symbolic", "mechanics", "models", "making", "compiler", "precision", "runtime", "atomic",
    },
    "study": {
        "pipeline", "precision", "runtime", "report", "scene", "atomic",
        "symbolic", "models", "lowering", "codegen",
    },
    "inspection": {
        "runs", "own",
        "pipeline", "study", "scene", "models", "mechanics", "lowering", "codegen", "report", "runtime", "symbolic",
    },
    "sources": {"cache", "graph", "lowering", "models", "own", "pipeline", "scene", "symbolic"},
    "shipped": {"graph", "pipeline", "codegen", "lowering", "models", "scene", "symbolic"},
    "regeneration": {"cache", "codegen", "graph", "shipped", "symbolic"},
}  # fmt: skip
#: These may import anything; nobody imports them.
TOP = {"cli", "__main__", "__init__"}


def part(path: Path) -> str:
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


def imports(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        names = []
        if isinstance(node, ast.Import):
            names = [a.name for a in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [
                f"{node.module}.{a.name}" if node.module == "symgen" else node.module for a in node.names
            ]
        for name in names:
            words = name.split(".")
            if words[0] == "symgen" and len(words) > 1 and words[1] != "__version__":
                found.add(words[1])
    return found


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_point_one_way(path):
    own = part(path)
    if own in TOP:
        return
    outside = imports(path) - {own, "errors"}
    if own == "runtime":
        # Plots and what notebooks show are drawn by report/, which is loaded when asked to draw.
        assert "report" not in outside or path.name in ("result.py", "compiled.py")
    if own == "shipped":
        outside -= {"generated"}
    assert outside <= ALLOWED[own], f"{path.name} must not import {sorted(outside - ALLOWED[own])}"
    assert not outside & TOP


def test_every_part_is_ruled():
    assert {part(p) for p in FILES} <= {*ALLOWED, *TOP}


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(ROOT)))
def test_files_stay_small(path):
    assert len(path.read_text().splitlines()) <= 400


def loaded(code: str) -> set[str]:
    program = f"import sys\n{code}\nprint(*sorted(m for m in sys.modules if '.' not in m))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_importing_symgen_loads_nothing_heavy():
    heavy = {"sympy", "numpy", "scipy", "pydantic", "pint", "matplotlib", "xarray", "jinja2", "rich", "typer"}
    assert not loaded("import symgen") & heavy


def test_a_run_from_the_cache_loads_only_the_runtime():
    symgen.build("peaucellier")
    found = loaded(
        "import symgen; r = symgen.build('peaucellier').simulate(0.1); assert r.drift.constraint < 1e-13"
    )
    assert "numpy" in found
    assert not found & {
        "sympy",
        "scipy",
        "pydantic",
        "pint",
        "matplotlib",
        "xarray",
        "pandas",
        "jinja2",
        "rich",
    }


def test_the_public_names_are_there():
    for name in symgen.__all__:
        assert getattr(symgen, name) is not None
    assert set(symgen.__all__) <= set(dir(symgen))
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        symgen.nothing  # noqa: B018


def test_no_module_hides_a_public_name():
    """A module symgen/build.py would replace the function symgen.build as soon as it is imported."""
    assert not {p.stem for p in ROOT.iterdir()} & set(symgen.__all__)
