"""Generated text: deterministic, guarded, clean under strict compilers."""

from __future__ import annotations

import json
import os
import platform
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from shared.full import full, full_unless
from shared.shipped import lowered

import symgen
from symgen.cli.common import FAULT
from symgen.codegen.emit import emit, equations_hash, unit_view
from symgen.codegen.manifest import differences, listed, write
from symgen.codegen.target import Target
from symgen.errors import StaleBinaryError
from symgen.models import BLOCKS, RECURSIONS, SHIPPED_BLOCKS, SHIPPED_SCENES
from symgen.precision import PRECISIONS
from symgen.regeneration.shipped import generated_folder, names
from symgen.regeneration.shipped import sources as sources_of
from symgen.runtime.kernels.library import shipped_module
from symgen.toolchain.compiler import find_compiler

#: Size of the C files of every model, and the statements of its largest function.
SIZES = Path(__file__).with_name("sizes.json")
NAMES = (*BLOCKS, *symgen.shipped_scenes())
#: Models whose C is compiled with warnings as errors unless all are.
COMPILED = (*BLOCKS, "four_bar", "peaucellier", "mass_ratios", "slider_crank", "rssr", "elastic_slider_crank")
#: Those that the optimiser looks at too, for its warnings.
OPTIMISED = ("element_beam8", "corotational_beam", "four_bar", "slider_crank", "elastic_slider_crank")


@pytest.fixture(scope="module")
def sources(made):
    return sources_of({name: made[name].shipped for name in names()})


def test_committed_files_are_current(sources):
    assert differences(generated_folder(), sources) == []


def test_every_shipped_model_is_committed_and_importable(sources):
    models = json.loads(next(f.text for f in sources if f.name == "manifest.json"))["models"]
    assert set(models) == {*SHIPPED_BLOCKS, *RECURSIONS, *SHIPPED_SCENES}
    for name in models:
        module = shipped_module(name)
        assert models[name]["equations"] == module.EQUATIONS
        if name not in RECURSIONS:
            series = {"series"} if lowered(name).series else set()
            assert set(module.ADDRESSES) == {k.name for k in lowered(name).kernels} | series


#: The digest of everything under generated/, as `files`, and of the kernels of scenes.
#: A scene, a block and a recursion.
ONE_OF_EACH = ("slider_crank", "element_cubic", "chain")
DIGEST = (
    "import hashlib, symgen\n"
    "from symgen.codegen.emit import emit\nfrom symgen.codegen.target import Target\n"
    "from symgen.lowering.program import lower_system\n"
    "for s in ('peaucellier_perturbed', 'triple_pendulum', 'four_bar'):\n"
    "    files += emit(lower_system(symgen.derive(s)), Target(), 'x')\n"
    "print(hashlib.sha256(repr([(f.name, f.text) for f in files]).encode()).hexdigest())\n"
)


@pytest.mark.parametrize(
    ("seeds", "models"), [(("42",), ONE_OF_EACH), full(("0", "1", "42", "4294967295"), names())]
)
def test_same_bytes_whatever_the_hash_seed(seeds, models, made, capsys):
    """In processes of their own, and in those of this session, whose seeds are random."""
    own = (
        "from symgen.regeneration.shipped import make, sources\n"
        f"files = sources({{name: make(name).shipped for name in {models}}})\n"
    )
    running = [
        subprocess.Popen(
            [sys.executable, "-c", own + DIGEST],
            env={**os.environ, "PYTHONHASHSEED": seed},
            stdout=subprocess.PIPE,
            text=True,
        )
        for seed in seeds
    ]
    exec(DIGEST, {"files": sources_of({name: made[name].shipped for name in models})})
    found = {capsys.readouterr().out.strip(), *(process.communicate()[0].strip() for process in running)}
    assert len(found) == 1
    assert len(found.pop()) == 64


def test_one_changed_byte_fails_the_check_with_a_readable_diff(tmp_path, sources):
    write(tmp_path, sources)
    assert differences(tmp_path, sources) == []
    victim = tmp_path / "loops" / "loop_row_kernel.c"
    changed = victim.read_text().replace("cos_eta1*cos_theta1", "cos_eta1*sin_theta1", 1)
    assert changed != victim.read_text()
    victim.write_text(changed)
    (found,) = differences(tmp_path, sources)
    lines = found.splitlines()
    assert lines[0] == "--- generated/loops/loop_row_kernel.c (there)"
    assert sum(line.startswith("-") for line in lines) == 2
    assert sum(line.startswith("+") for line in lines) == 2
    assert any("cos_eta1*sin_theta1" in line for line in lines)


def test_write_touches_only_what_differs_and_removes_what_is_no_longer_listed(tmp_path, sources):
    assert sorted(write(tmp_path, sources)) == sorted(f.name for f in sources)
    mine = tmp_path / "notes.txt"
    mine.write_text("not generated")
    assert write(tmp_path, sources) == []
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    manifest["models"]["gone"] = {"equations": "x", "sources": {"gone.pyx": "x"}}
    (tmp_path / "manifest.json").write_text(json.dumps(manifest))
    (tmp_path / "gone.pyx").write_text("old")
    assert "gone.pyx" in listed(tmp_path)
    assert any("gone.pyx is no longer generated" in d for d in differences(tmp_path, sources))
    assert sorted(write(tmp_path, sources)) == ["gone.pyx", "manifest.json"]
    assert mine.exists()


def test_a_module_of_other_equations_is_refused(monkeypatch):
    monkeypatch.setattr(shipped_module("loop_row"), "EQUATIONS", "0" * 64)
    with pytest.raises(StaleBinaryError, match=r"compiled from the equations 0000.*\n.*pip install"):
        shipped_module("loop_row")


@pytest.mark.parametrize("module", ["symgen.generated.elastic_place", "symgen.runtime._beams"])
def test_a_module_that_was_not_compiled_is_named_with_the_remedy(module):
    """As after an update without a new installation."""
    command = "quasi-static", "elastic_slider_crank", "--samples", "3"
    program = (
        f"import sys; sys.modules[{module!r}] = None; sys.argv[1:] = {command}; "
        "from symgen.cli import main; main()"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == FAULT and "Traceback" not in done.stderr
    first, second = done.stderr.strip().splitlines()
    assert module.rpartition(".")[2] in first and "pip install -e ." in second


def test_a_module_of_no_model_is_refused(monkeypatch):
    """An update leaves modules of models that there are no longer."""
    module = SimpleNamespace(EQUATIONS="0" * 64, __name__="symgen.generated.gone")
    monkeypatch.setitem(sys.modules, "symgen.generated.gone", module)
    with pytest.raises(StaleBinaryError, match=r"gone was compiled from .*\n.*pip install"):
        shipped_module("gone")


@pytest.mark.parametrize("name", NAMES)
def test_c_is_no_larger_than_stored(name):
    program = lowered(name)
    files = emit(program, Target(), "x" * 64)
    kernels = unit_view(program, Target(), "x" * 64).kernels
    found = {
        "bytes": sum(len(f.text) for f in files if f.name.endswith(".c")),
        "statements": max(len(k.assignments) + len(k.stores) for k in kernels),
    }
    stored = json.loads(SIZES.read_text())[name]
    assert all(found[k] <= stored[k] for k in found), f"if this is meant, store {found} for {name}"


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
@pytest.mark.parametrize("name", full_unless(lambda name: name in COMPILED, NAMES))
def test_c_compiles_without_a_warning(name, tmp_path):
    for file in emit(lowered(name), Target(), "x" * 64):
        (tmp_path / file.name).write_text(file.text)
    subprocess.run(
        ["cc", "-std=c11", "-Wall", "-Wextra", "-Werror", "-Wpedantic", "-Wdouble-promotion", "-O1", "-c"]
        + ([] if name in OPTIMISED else ["-fsyntax-only"])
        + [source.name for source in sorted(tmp_path.glob("*.c"))],
        check=True,
        cwd=tmp_path,
    )


def test_zeros_in_a_row_are_a_loop():
    """Of the Jacobian of a chain, whose zeros grow as the square of its rods; every entry is still written."""
    kernels = unit_view(lowered("whip"), Target(), "x" * 64).kernels
    jacobian = next(k for k in kernels if k.name == "constraint_jacobian")
    written = []
    for store in jacobian.stores:
        places = [int(x) for x in re.findall(r"\d+", store.target)]
        if store.target.startswith("for (int i = "):
            assert store.value == "0.0"
            written += range(places[0], places[1] + 1)
        else:
            written += places
    assert written == list(range(jacobian.sizes[-1]))
    assert len(jacobian.stores) < jacobian.sizes[-1] / 8


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
@pytest.mark.parametrize("lanes", [False, True])
@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("name", ["four_bar", full("peaucellier")])
def test_every_type_compiles_without_a_warning(name, precision, lanes, tmp_path):
    for file in emit(lowered(name), Target("c", PRECISIONS[precision], lanes), "x" * 64):
        (tmp_path / file.name).write_text(file.text)
    # __float128 and its literals are no part of C.
    pedantic = [] if precision == "float128" else ["-Wpedantic"]
    for source in sorted(tmp_path.glob("*.c")):
        subprocess.run(
            ["cc", "-std=c11", "-Wall", "-Wextra", "-Werror", *pedantic, "-Wdouble-promotion", "-O1"]
            + ["-c", str(source), "-o", str(tmp_path / "x.o")],
            check=True,
        )


def test_constants_have_the_digits_of_their_type():
    """Nothing on the way from the scene rounds them: no sign, sum or product of constants."""
    program = lowered("four_bar")
    literals = {}
    for name, precision in PRECISIONS.items():
        sources = [f.text for f in emit(program, Target("c", precision), "x") if f.name.endswith(".c")]
        literals[name] = set(re.findall(r"\d+\.\d+(?:e[-+]?\d+)?[fLQ]?", "".join(sources)))
    assert "1.066666666666666666666666666666666666667Q" in literals["float128"]
    assert "1.0666666666666667" in literals["float64"] and "1.0666666666666667f" in literals["float32"]
    long = [x for x in literals["float128"] if len(x) > 24]
    assert len(long) > 5 and min(map(len, long)) > 38


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
@pytest.mark.parametrize("name", RECURSIONS)
def test_loops_compile_without_a_warning_and_with_lanes_in_vector_registers(name, tmp_path, sources):
    write(tmp_path, [file for file in sources if f"/{name}_kernel" in file.name])
    done = subprocess.run(
        ["cc", "-std=c11", "-Wall", "-Wextra", "-Werror", "-Wpedantic", "-Wdouble-promotion", "-O3"]
        + ["-ffp-contract=off", "-S", f"{name}_kernel.c", "-o", "x.s"],
        check=False,
        capture_output=True,
        text=True,
        cwd=tmp_path / "chains",
    )
    assert done.returncode == 0, done.stderr
    assembly = (tmp_path / "chains" / "x.s").read_text()
    assert "fmadd" not in assembly, "contraction would make results depend on the processor"
    if platform.machine() == "x86_64":
        assert "divpd" in assembly


@pytest.mark.skipif(shutil.which("c++") is None, reason="no C++ compiler")
def test_header_serves_cplusplus(tmp_path):
    for file in emit(lowered("rod"), Target(), "x" * 64):
        (tmp_path / file.name).write_text(file.text)
    (tmp_path / "main.cpp").write_text(
        '#include "rod_kernel.h"\nint main() { return rod_equations[0] == 0; }\n'
    )
    subprocess.run(["c++", "-Wall", "-Werror", "-c", "main.cpp", "-o", "main.o"], cwd=tmp_path, check=True)


@pytest.mark.parametrize("name, flops", [("chain", 87), ("chain_spatial", 173)])
def test_operations_of_a_rod_do_not_grow(name, flops, sources):
    (source,) = (f.text for f in sources if f.name == f"chains/{name}_kernel.c")
    assert f"One rod in one evaluation of all accelerations: {flops} operations (" in source
    assert "1.0/(det*pivot)" in source and source.count(" = 1.0/") == 3, (
        "one for the end masses, one a rod, one at a free base"
    )


def test_nothing_is_left_unrendered_and_nothing_of_the_machine_is_in_it(sources):
    for file in sources:
        assert "{{" not in file.text and "{%" not in file.text
        assert str(Path.home()) not in file.text
        assert "\r" not in file.text


def test_a_title_cannot_break_out_of_its_comment():
    scene = symgen.Scene(
        title='*/ #error "out" """ \\',
        points={"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["1 m", "0 m"]}},
        links={"OA": {"points": ["O", "A"], "mass": "1 kg"}},
    )
    assert symgen.build(scene).accelerations()["A"].tolist() == [0.0, 0.0]
    assert symgen.build(scene, backend="numpy").accelerations()["A"].tolist() == [0.0, 0.0]


def test_equations_hash_covers_program_and_templates():
    rod, spatial = lowered("rod"), lowered("rod_spatial")
    assert equations_hash(rod, Target()) != equations_hash(spatial, Target())
    assert equations_hash(rod, Target("c")) == equations_hash(rod, Target("numpy"))
    hashes = {
        equations_hash(rod, Target("c", p, lanes)) for p in PRECISIONS.values() for lanes in (False, True)
    }
    assert len(hashes) == 2 * len(PRECISIONS)


def test_header_says_what_every_entry_means():
    (header,) = (f.text for f in emit(lowered("peaucellier"), Target(), "x") if f.name.endswith(".h"))
    for line in ("q[0]  A_x  [m]", "p[0]  rho  [kg/m]  mass per length of the rods", "work[14]  AD_lambda"):
        assert line in header
    assert "accelerations (8 x 1)" in header


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
def test_large_models_are_split_over_files():
    files = [f.name for f in emit(lowered("peaucellier"), Target(), "x")]
    assert "peaucellier_kernel_2.c" in files


@pytest.mark.parametrize("name", ["four_bar", "rssr", "element_beam8"])
def test_no_entry_is_read_after_it_is_stored(name):
    """Stores follow the values that they need, in kernels that work in place too."""
    program = replace(lowered(name), series=())  # which has loops
    source = "".join(f.text for f in emit(program, Target(), "x") if f.name.endswith("kernel.c"))
    bodies = re.findall(r"^void \w+\(.*?\n{\n(.*?)\n}\n", source, re.S | re.M)
    early = 0
    for body in bodies:
        statements = [line.strip().split(" = ", 1) for line in body.splitlines() if " = " in line]
        stored, known = set(), set()
        for k, (target, value) in enumerate(statements):
            names = set(re.findall(r"(?<![\w.])[A-Za-z_]\w*(?:\[\d+\])?", value))
            assert not names & stored, (target, value)
            if target.startswith("const double "):
                known.add(target.split()[-1])
            elif not target.startswith("for "):
                assert {x for x in names if "[" not in x} <= known, (target, value)
                stored.add(target)
                early += any(later.startswith("const double ") for later, _ in statements[k:])
    assert early > 10
