"""The structure: imports point one way and in no circle, files stay small, light imports stay light."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from functools import cache
from importlib import import_module
from pathlib import Path

import pytest

import symgen

ROOT = Path(symgen.__file__).parent
TESTS = Path(__file__).parent
FILES = sorted(p for p in ROOT.rglob("*.py"))
FOLDERS = sorted({p.parent for p in FILES})

#: Modules that every part may import.
COMMON = {"errors", "calls", "display", "registry", "version"}
#: What each part may import of symgen, besides itself and ``COMMON``.
ALLOWED = {
    **{name: set() for name in COMMON},
    "atomic": set(),
    "precision": set(),
    "methods": set(),
    "symbolic": set(),
    "joints": {"symbolic"},
    "loads": {"symbolic", "scene"},
    "elements": {"symbolic"},
    "scene": {"methods", "symbolic", "joints", "elements", "loads"},
    "scenes": set(),
    "mechanics": {"symbolic", "elements"},
    "models": {"methods", "loads", "scene", "mechanics", "joints", "elements", "symbolic"},
    "lowering": {"symbolic"},
    "codegen": {"lowering", "atomic", "precision"},
    "toolchain": {"methods", "codegen", "lowering", "precision", "runtime", "scene", "symbolic"},
    "runtime": {"atomic", "precision"},
    "pipeline": {
        "methods", "scene", "symbolic", "elements", "mechanics", "models", "lowering", "toolchain", "precision", "runtime",
        "atomic",
    },
    "regeneration": {"methods", "toolchain", "pipeline", "codegen", "lowering", "models", "scene", "symbolic"},
    "report": {"runtime", "symbolic", "lowering", "codegen", "atomic", "precision", "regeneration"},
    "export": {
        "methods", "pipeline", "toolchain", "codegen", "lowering", "models", "elements", "runtime", "scene", "symbolic",
        "atomic",
    },
    "study": {
        "methods", "pipeline", "precision", "runtime", "report", "scene", "atomic", "symbolic", "models", "lowering", "codegen",
    },
    "synthesis": {"mechanics", "scene", "runtime", "pipeline"},
    "inspection": {
        "methods", "joints", "loads", "pipeline", "study", "scene", "models", "mechanics", "lowering", "codegen", "report", "runtime", "symbolic",
        "export",
    },
}  # fmt: skip
#: These may import anything; nobody imports them.
TOP = {"cli", "__main__", "__init__"}


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text())


def part(path: Path) -> str:
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


def imports(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(parsed(path)):
        names = []
        if isinstance(node, ast.Import):
            names = [a.name for a in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [
                f"{node.module}.{a.name}" if node.module == "symgen" else node.module for a in node.names
            ]
        for name in names:
            words = name.split(".")
            if words[0] == "symgen" and len(words) > 1:
                found.add(words[1])
    return found


def test_imports_point_one_way():
    wrong = []
    for path in FILES:
        own = part(path)
        if own in TOP:
            continue
        outside = imports(path) - {own} - COMMON
        if own == "regeneration":
            outside -= {"generated"}
        wrong += [f"{path.relative_to(ROOT)} imports {name}" for name in sorted(outside - ALLOWED[own])]
    assert not wrong


def module(path: Path) -> str:
    return ".".join(("symgen", *path.relative_to(ROOT).with_suffix("").parts)).removesuffix(".__init__")


def imported_modules(path: Path, known: set[str]) -> set[str]:
    """Return the modules that a file imports at its top, inside functions or for type checking alone."""
    found = set()
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Import):
            found |= {a.name for a in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            inner = {f"{node.module}.{a.name}" for a in node.names}
            found |= {name if name in known else node.module for name in inner}
    return found & known - {module(path)}


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Return the strongly connected components of more than one node, by Tarjan's algorithm."""
    order: dict[str, int] = {}
    lowest: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(node: str) -> None:
        order[node] = lowest[node] = len(order)
        stack.append(node)
        for other in sorted(graph[node]):
            if other not in order:
                visit(other)
                lowest[node] = min(lowest[node], lowest[other])
            elif other in stack:
                lowest[node] = min(lowest[node], order[other])
        if lowest[node] == order[node]:
            at = stack.index(node)
            found.append(sorted(stack[at:]))
            del stack[at:]

    for node in sorted(graph):
        if node not in order:
            visit(node)
    return [component for component in found if len(component) > 1]


def test_circles_are_found():
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}) == [["a", "b", "c"]]
    assert circles({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == []


def test_no_modules_import_each_other():
    """Imports inside functions and for type checking count: they only hide a circle."""
    known = {module(path) for path in FILES}
    graph = {module(path): imported_modules(path, known) for path in FILES}
    assert sum(map(len, graph.values())) > 1000
    assert (
        "symgen.runtime.elastic.steady.periodic" in graph["symgen.runtime.elastic.model"]
    )  # inside a function
    assert circles(graph) == []


#: Classes that tell one method from another, and where they still are tested for; nothing may be added.
OF_METHODS = {
    "Linkage", "Loop", "RodModel", "PlaneModel", "KinematicModel", "LoopModel", "ElasticModel", "SystemModel",
    "Description", "LoopDescription", "SystemDescription", "Motion", "Turn", "Forces", "ElasticResult", "SpeedResponse",
}  # fmt: skip
TESTED_FOR: dict[str, int] = {}


def method_tests(path: Path) -> int:
    """Return how many calls of isinstance in a file name a class of one method."""
    calls = [n for n in ast.walk(parsed(path)) if isinstance(n, ast.Call)]
    calls = [n for n in calls if isinstance(n.func, ast.Name) and n.func.id == "isinstance"]
    return sum(
        any(isinstance(n, ast.Name) and n.id in OF_METHODS for n in ast.walk(c.args[1])) for c in calls
    )


def test_methods_are_told_apart_in_their_registry_only():
    found = {str(p.relative_to(ROOT)): n for p in FILES if (n := method_tests(p))}
    assert found == TESTED_FOR


#: Rooms of the runtime that belong to one method, and its bindings to compiled code. All others are shared.
ROOMS_OF_METHODS = {"rods", "loop", "closure", "beams", "elastic", "chain"}
BINDINGS_OF_METHODS = {"_beams", "_constrained", "_kinematics", "_loop"}


def rooms_of_methods(path: Path) -> set[str]:
    """Return the rooms and bindings of methods that a file imports, in functions and for type checking too."""
    names = set()
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Import):
            names |= {a.name for a in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {f"{node.module}.{a.name}" for a in node.names}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            names.add(node.value.replace(":", "."))  # an entry that is imported by its name
    words = [name.split(".") for name in names if name.startswith("symgen.runtime.")]
    return {w[2] for w in words} & (ROOMS_OF_METHODS | BINDINGS_OF_METHODS)


def test_shared_rooms_of_the_runtime_import_no_room_of_a_method():
    runtime = ROOT / "runtime"
    files = [p for suffix in (".py", ".pyi") for p in runtime.rglob(f"*{suffix}")]
    parts = {p: p.relative_to(runtime).parts[0].removesuffix(p.suffix) for p in files}
    assert {*parts.values()} >= ROOMS_OF_METHODS | BINDINGS_OF_METHODS
    shared = [p for p in files if parts[p] not in ROOMS_OF_METHODS | BINDINGS_OF_METHODS]
    found = [f"{p.relative_to(ROOT)}: {', '.join(sorted(r))}" for p in shared if (r := rooms_of_methods(p))]
    assert len(shared) > 70 and not found, "\n".join(sorted(found))


def test_public_functions_of_bindings_tell_the_type_of_their_result():
    """The installation writes types for Python from what ``.pyx`` files declare, and leaves other functions out."""
    for path in (ROOT / "runtime").glob("*.pyx"):
        binding = import_module(f"symgen.runtime.{path.stem}")
        owners = [binding, *(x for x in vars(binding).values() if isinstance(x, type))]
        found = {
            f"{n} of {o.__name__}": x for o in owners for n, x in vars(o).items() if not n.startswith("_")
        }
        compiled = {n: x for n, x in found.items() if type(x).__name__ == "cython_function_or_method"}
        untyped = [n for n, x in compiled.items() if "return" not in x.__annotations__]
        assert not untyped, f"{path.name}: {', '.join(untyped)}"


def test_every_entry_of_the_registry_exists():
    from symgen.methods import METHODS, claiming, load

    for method in METHODS.values():
        others = ("name", "claims", "commands")
        entries = [f for f in type(method).__slots__ if f not in others and getattr(method, f)]
        assert all(callable(method.load(entry)) for entry in entries), method.name
        named = [name for command in method.commands.values() for name in command if name]
        assert all(callable(load(name)) for name in named), method.name
    assert claiming(["points", "loop"]).name == "loop" and claiming(["points", "crank"]).name == "elastic"
    assert claiming(["points", "links"]).name == claiming([]).name == "rods"


def test_every_part_is_ruled():
    assert {part(p) for p in FILES} <= {*ALLOWED, *TOP}


def test_every_public_class_has_a_name_of_its_own():
    """Readers and searches find one class by a name; scene tables end in Table where what they become has the name."""
    found: dict[str, list[str]] = {}
    for path in FILES:
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                found.setdefault(node.name, []).append(str(path.relative_to(ROOT)))
    for path in sorted((ROOT / "runtime").glob("*.pyx")):
        for name in re.findall(r"^cdef class (\w+)", path.read_text(encoding="utf-8"), re.MULTILINE):
            found.setdefault(name, []).append(path.name)
    assert {name: files for name, files in found.items() if len(files) > 1} == {}


def test_files_and_folders_stay_small():
    long = {str(p.relative_to(ROOT)): n for p in FILES if (n := len(p.read_text().splitlines())) > 400}
    assert not long
    full = {str(f.relative_to(ROOT)): n for f in FOLDERS if (n := len(list(f.glob("*.py")))) > 14}
    assert not full
    assert len(list(ROOT.glob("*.py"))) <= 10


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


def test_no_benchmark_has_the_name_of_a_test_module():
    """A script imports from tests/; a module of its own name there would be the script itself."""
    benchmarks = {p.stem for p in (TESTS.parent / "benchmarks").glob("*.py")}
    assert benchmarks
    assert not benchmarks & {"shared", *(p.stem for p in TESTS.rglob("test_*.py"))}


def test_no_test_imports_another():
    """What tests share is in tests/shared; every other module is a test or conftest.py."""
    files = [p for p in TESTS.rglob("*.py") if p.parent.name != "shared" and p.name != "conftest.py"]
    assert files
    assert not [str(p) for p in files if not p.name.startswith("test_")]
    modules = {p.stem for p in files} | {"conftest"}
    found = []
    for path in TESTS.rglob("*.py"):
        for node in ast.walk(parsed(path)):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module] if isinstance(node, ast.ImportFrom) and node.module else []
            found += [f"{path.relative_to(TESTS)} imports {n}" for n in names if n.split(".")[-1] in modules]
    assert not found


def is_private(name: str) -> bool:
    """Return whether the last part of a name begins with one underscore, unless it is a protocol or a compiled module."""
    last = name.rpartition(".")[2]
    return last.startswith("_") and not last.endswith("_") and not (ROOT / "runtime" / f"{last}.pyx").exists()


def private_names(tree: ast.Module) -> list[str]:
    """Return private names that a test imports, takes of an object other than ``self``, or replaces."""
    names: list[str] = []
    for node in ast.walk(tree):
        match node:
            case ast.Import(names=imported):
                names += (a.name for a in imported)
            case ast.ImportFrom(module=module, names=imported):
                names += (module or "", *(a.name for a in imported))
            case ast.Attribute(value=ast.Name(id="self" | "cls" | "os")):  # os._exit
                pass
            case ast.Attribute():
                names.append(ast.unparse(node))
            case ast.Call(
                func=ast.Attribute(attr="setattr" | "delattr")
                | ast.Name(id="getattr" | "setattr" | "hasattr")
            ):
                names += (
                    x.value for x in node.args[:2] if isinstance(x, ast.Constant) and isinstance(x.value, str)
                )
    return [name for name in names if is_private(name)]


def test_private_names_are_found():
    text = """from a._b import _core, c, _d
self._x, m._y, m._repr_html_, m.__dict__
patch.setattr(m, "_z", 1)
patch.setattr("a.b._w", 1)
"""
    assert private_names(ast.parse(text)) == ["a._b", "_d", "_z", "a.b._w", "m._y"]


def test_tests_use_no_private_names():
    """They pin what may change: a test calls what the package offers, or a public name of an internal module."""
    found = [f"{p.relative_to(TESTS)}: {n}" for p in TESTS.rglob("*.py") for n in private_names(parsed(p))]
    assert not found, "\n".join(sorted(found))


def test_tests_of_the_runtime_are_in_the_folders_of_its_rooms():
    runtime = Path(symgen.__file__).parent / "runtime"
    folders = {p.name for p in (TESTS / "runtime").iterdir() if any(p.glob("test_*.py"))}
    assert folders and not [name for name in folders if not (runtime / name).is_dir()]


def test_no_two_files_of_tests_have_one_name():
    """Pytest imports them by their name alone."""
    names = sorted(p.name for p in TESTS.rglob("test_*.py"))
    assert sorted(set(names)) == names


#: A file or folder in backquotes on the page of the architecture.
NAMED = re.compile(r"`([\w./-]+(?:\.(?:py|pyx|c|h|toml|json|txt|j2|md)|/))`")


def test_runs_in_time_have_one_step_loop():
    """That of ``run.h``; fixed steps in lanes have a text of their own."""
    core = Path(symgen.__file__).parent / "runtime" / "core"
    headers = (path.read_text() for path in sorted(core.glob("*.h")))
    steps = re.compile(r"^int (\w+_(?:advance|step|steps|part))\(", re.MULTILINE)
    loops = {name for text in headers for name in steps.findall(text)}
    # A part of the loop, and derivatives of steps that were taken.
    assert loops - {"try_step", "implicit_step"} == {"run_advance"}


def test_the_page_of_the_architecture_names_files_that_exist():
    """Names without a folder are in that of the path before, or below the folders of their row."""
    page, missing, count = (ROOT.parent / "docs" / "architecture.md").read_text(), [], 0
    for line in page.splitlines():
        folders: list[Path] = []
        for name in NAMED.findall(line):
            count += 1
            path = ROOT.parent / name
            if not path.exists():
                inside = [f for folder in reversed(folders) for f in sorted(folder.rglob(name.rstrip("/")))]
                path = inside[0] if inside else path
            if not path.exists():
                missing.append(f"{name} in: {line[:80]}")
            folders.append(path if path.is_dir() else path.parent)
    assert count > 100 and not missing, "\n".join(missing)
