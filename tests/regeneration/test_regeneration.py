"""Regeneration: dependencies of each model, models that a change regenerates, and messages."""

from __future__ import annotations

import json
import multiprocessing
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from shared.full import full
from shared.timing import holds

import symgen
from symgen.codegen import chain_kernels, emit
from symgen.elements import ELEMENTS
from symgen.errors import GenerationError
from symgen.models import RECURSIONS, SHIPPED_BLOCKS, SHIPPED_SCENES
from symgen.regeneration import generate as regeneration
from symgen.regeneration.generate import answer
from symgen.regeneration.shipped import UNITS, generated_folder, names, record_name
from symgen.symbolic.record import EntryValues, read_record
from symgen.toolchain import dependencies as graph

PACKAGE = Path(symgen.__file__).parent
OF_ELEMENTS = {f"element_{name}{ending}" for name in ELEMENTS for ending in ("", "_tangents")}
OF_PLACES = {"elastic_place", "elastic_place_tangents"}
DIRECTORS = {"director_beam", "director_beam_tangents"}
#: Elements in large rotation have the masses of the cubic one.
ROTATING = {"corotational_beam", "corotational_node"} | DIRECTORS
OF_LINKS = OF_ELEMENTS | OF_PLACES | ROTATING
#: Files of derivations, and the models that are regenerated when they change: those and no others.
DEPENDENTS = {
    "models/rod.py": set(),
    "models/elastic/rigid_element.py": {"rigid_element"},
    "mechanics/elastic/rigid_elements.py": {"rigid_element"},
    "mechanics/rods/recursion.py": {"chain", "chain_spatial"},
    "mechanics/rods/particles.py": {
        "chain", "chain_spatial", "rigid_element", "peaucellier",
    },
    "mechanics/rods/topology.py": {"peaucellier"},
    **{f"elements/{name}.py": {f"element_{name}", f"element_{name}_tangents"} for name in ELEMENTS},
    "elements/cubic.py": {"element_cubic", "element_cubic_tangents"} | ROTATING,
    "elements/beam8.py": {"element_beam8", "element_beam8_tangents"},
    "elements/element.py": OF_LINKS,
    "elements/__init__.py": set(),
    "mechanics/elastic/hamilton.py": OF_LINKS,
    "mechanics/elastic/beam_matrices.py": OF_ELEMENTS | ROTATING,
    "mechanics/elastic/corotational.py": {"corotational_beam", "corotational_node"},
    "mechanics/elastic/nodes.py": {"corotational_node"},
    "models/elastic/corotational.py": {"corotational_beam", "corotational_node"},
    "mechanics/directors/beam.py": DIRECTORS,
    "models/directors.py": DIRECTORS,
    "mechanics/directors/directions.py": {"direction", "direction_tangents"},
    "models/directions.py": {"direction", "direction_tangents"},
    "mechanics/elastic/weights.py": OF_LINKS,
    "mechanics/elastic/places.py": OF_LINKS,
    "mechanics/elastic/moving_frame.py": set(),
    "mechanics/elastic/shaft.py": set(),
    "models/elastic/place.py": OF_PLACES,
    "models/elastic/element.py": OF_ELEMENTS,
    "mechanics/elastic/turning_axes.py": {"element_beam8", "element_beam8_tangents", "corotational_node"},
    "models/elastic/fixed_axes.py": {"element_beam8", "element_beam8_tangents"},
    "mechanics/loop/dual_rows.py": {"slider_crank", "loop_row"},
    "models/loop/blocks.py": {"loop_row"},
    "models/loop/system.py": {"slider_crank"},
    "scenes/slider_crank.toml": {"slider_crank"},
    "scenes/peaucellier.toml": {"peaucellier"},
    "joints/ball.py": {"peaucellier", "slider_crank"},
    "lowering/expressions.py": set(names()),
    "symbolic/system.py": set(names()),
    "models/forward_mode.py": {name for name in names() if name.endswith("_tangents")},
    "codegen/printers.py": set(names()),
    "codegen/chain_kernels.py": {"chain", "chain_spatial"},
    "runtime/model/model.py": set(),
    "cli/build.py": set(),
}  # fmt: skip


def test_every_shipped_model_has_a_name():
    assert set(names()) == {*SHIPPED_BLOCKS, *RECURSIONS, *SHIPPED_SCENES}
    assert len(set(names())) == len(names())


def test_a_change_concerns_only_its_own_kernels(made):
    assert all((PACKAGE / file).is_file() for file in DEPENDENTS)
    found = {file: {n for n in names() if f"symgen:{file}" in made[n].needs} for file in DEPENDENTS}
    assert found == DEPENDENTS


@pytest.mark.parametrize(
    ("scene", "decides"), [("four_bar", "integrate/redundancy"), full("rssr", "closure/closed_form")]
)
def test_what_a_description_is_made_by_counts(scene, decides, tmp_path):
    """Modules that describe a scene count, and no others of the runtime, whatever else is loaded."""
    program = (
        "import json, sys\n"
        "from symgen.toolchain import dependencies as graph\nfrom symgen.pipeline import build as pipeline\n"
        "pipeline.build(sys.argv[1])\n"
        "own = sorted(graph.needs())\n"
        "import symgen.runtime.chain.chain, symgen.study.speed.reference\n"
        "print(json.dumps([own, sorted(graph.needs())]))\n"
    )
    environment = {**os.environ, "SYMGEN_CACHE": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", program, scene], capture_output=True, text=True, check=True, env=environment
    )
    own, later = ({n for n in needs if "symgen:runtime/" in n} for needs in json.loads(done.stdout))
    assert f"symgen:runtime/{decides}.py" in own
    others = {f"symgen:runtime/{name}.py" for name in ("chain/chain", "chain/inputs", "result/result")}
    assert not others & later
    assert own <= later


def test_what_changed_after_it_was_loaded_is_never_current(monkeypatch):
    assert not graph.changed(graph.needs())
    monkeypatch.setattr(graph, "BEGUN", 0.0)
    found = graph.needs()
    files = {name for name in found if not name.startswith(("version:", "registered:"))}
    assert set(graph.changed(found)) == files


def test_templates_and_what_symgen_derives_with_concern_all(made):
    printed = {
        t for files in (*emit.TEMPLATES.values(), emit.LANES, chain_kernels.TEMPLATES) for t, _ in files
    }
    for name in names():
        read = {n.partition(":")[2] for n in made[name].needs if n.startswith("symgen.templates:")}
        assert read == printed | {
            emit.ROLLED,
            emit.SERIES_TEMPLATE,
            *emit.ITERATED.values(),
            *emit.INCLUDED,
        }, "all that code is printed with, and nothing else"
        assert {"version:sympy", "version:jinja2", "version:mpmath"} <= set(made[name].needs)
    assert "version:pint" in made[UNITS].needs
    assert "symgen.scene:units.txt" in made[UNITS].needs


def test_needs_hold_all_that_is_read():
    """Every file of symgen that a derivation opens, as Python itself reports it, is among its needs."""
    seen = (
        "import json, sys\n"
        "opened = set()\n"
        "sys.addaudithook(lambda event, a: opened.add(str(a[0])) if event == 'open' else None)\n"
        "from symgen.toolchain import dependencies as graph\n"
        "from symgen.scene.loading import scene_path\n"
        "from symgen.codegen.emit import emit\n"
        "from symgen.codegen.target import Target\n"
        "from symgen.lowering.program import lower_system\n"
        "from symgen.pipeline.systems import derive\n"
        "emit(lower_system(derive('four_bar')), Target(), 'x')\n"
        "needs = graph.needs(graph.of_file(scene_path('four_bar')))\n"
        "print(json.dumps([sorted(opened), sorted(needs)]))\n"
    )
    done = subprocess.run([sys.executable, "-c", seen], capture_output=True, text=True, check=True)
    opened, needs = json.loads(done.stdout)
    known = {name.partition(":")[2].rpartition("/")[2] for name in needs}
    folders = (PACKAGE, graph.package_folder("symgen.templates"))
    data = [Path(p) for p in opened if any(Path(p).is_relative_to(f) for f in folders)]
    data = [p for p in data if p.is_file() and p.suffix not in (".py", ".pyc", ".so")]
    assert {p.name for p in data} >= {"four_bar.toml", "units.json", "kernel.c.j2"}
    assert {p.name for p in data} <= known


@pytest.fixture
def checkout(tmp_path, made, made_in, monkeypatch):
    """A checkout of its own, with the cache as it is after its kernels were made."""
    monkeypatch.setenv("SYMGEN_CACHE", str(made_in))
    root = tmp_path / "checkout"
    left_out = shutil.ignore_patterns("*.so", "__pycache__")
    shutil.copytree(PACKAGE, root / "symgen", ignore=left_out)
    shutil.copytree(generated_folder(), root / "symgen" / "generated", ignore=left_out)
    shutil.copytree(graph.package_folder("symgen.templates"), root / "symgen" / "templates", ignore=left_out)
    (root / "symgen" / "pyproject.toml").write_text("")
    return root


def generate(root):
    done = subprocess.run(
        [sys.executable, "-P", "-m", "symgen", "generate"],
        env={**os.environ, "PYTHONPATH": str(root)},
        cwd=root,
        capture_output=True,
        text=True,
    )
    return done.returncode, done.stdout.splitlines(), done.stderr


def test_nothing_to_do_takes_no_longer_than_importing_sympy(checkout):
    """Half a second on a machine that imports SymPy in half a second: it is not imported."""
    environment = {**os.environ, "PYTHONPATH": str(checkout)}
    assert holds(["-P", "-m", "symgen", "generate"], environment, 0.5 / 0.5)


def content(root):
    files = (p for p in (root / "symgen" / "generated").rglob("*") if p.is_file() and p.suffix != ".pyc")
    return {p.name: p.read_bytes() for p in files}


def test_what_changed_is_derived_anew_and_said(checkout):
    """Nothing, a change of an equation, its reversal, a comment, an error: in a checkout of its own."""
    before = content(checkout)
    assert generate(checkout) == (0, ["generated/ is current"], "")
    file = checkout / "symgen" / "mechanics" / "elastic" / "rigid_elements.py"
    original = file.read_text()

    file.write_text(original.replace("moment = first[2] - second[2]", "moment = first[2] - 2 * second[2]"))
    code, said, _ = generate(checkout)
    assert code == 0
    assert [line for line in said if line.startswith("derived")] == [
        f"derived {name}: mechanics/elastic/rigid_elements.py changed"
        for name in ("rigid_element", "citations")
    ]
    start = said.index("rigid_element:")
    assert said[start + 1 : start + 5] == [
        "  nodal_matrix (3 x 6): 1 changed (times 2)",
        "    changed [moment, M at k]",
        "      - -1",
        "      + -2",
    ]
    after = content(checkout)
    assert {name for name in before if before[name] != after[name]} == {
        "manifest.json",
        "rigid_element_equations.json",
        "rigid_element_kernel.c",
    }

    file.write_text(original)
    code, said, _ = generate(checkout)
    assert code == 0 and content(checkout) == before
    assert not [line for line in said if line.startswith("derived")], "it is in the cache"
    assert "      + -1" in said

    file.write_text(original + "# nothing\n")
    code, said, _ = generate(checkout)
    assert said == [
        "derived rigid_element: mechanics/elastic/rigid_elements.py changed",
        "derived citations: mechanics/elastic/rigid_elements.py changed",
        "generated/ is current",
    ]

    file.write_text(original + "raise ValueError('out of reach')\n")
    code, said, error = generate(checkout)
    assert code == 1 and said == []
    assert error.startswith("symgen: rigid_element cannot be derived, and nothing was written:")
    assert "ValueError: out of reach" in error
    assert content(checkout) == before


def test_a_new_term_of_the_energy_is_one_line(checkout):
    """An elastic foundation adds k L/420 times the consistent matrix of the cubic beam to its stiffness."""
    file = checkout / "symgen" / "mechanics" / "elastic" / "hamilton.py"
    original, of = file.read_text(), "        strain=sp.Add(*("
    program = (
        "import symgen; from symgen.symbolic.exact import Exact; system = symgen.derive('element_cubic');"
        "given = {'L': 1.5, 'a0': 2.0, 'b0': 3.0};"
        "values = {g.name: [given.get(x.name, 0.0) for x in g.quantities] for g in system.groups};"
        "print([float(x) for x in Exact(system).matrix('stiffness', values)])"
    )

    def stiffness():
        done = subprocess.run(
            [sys.executable, "-P", "-c", program],
            env={**os.environ, "PYTHONPATH": str(checkout)},
            capture_output=True,
            text=True,
            check=True,
        )
        return np.array(json.loads(done.stdout)).reshape(6, 6)

    before = stiffness()
    assert original.count(of) == 1
    try:
        file.write_text(original.replace(of, "        strain=sp.Add(500 * AXIAL.symbol * _F['w'] ** 2, *("))
        added = stiffness() - before
    finally:
        file.write_text(original)
    length, foundation = 1.5, 500 * 2.0
    consistent = [
        [156, 22 * length, 54, -13 * length],
        [22 * length, 4 * length**2, 13 * length, -3 * length**2],
        [54, 13 * length, 156, -22 * length],
        [-13 * length, -3 * length**2, -22 * length, 4 * length**2],
    ]
    across = np.ix_([1, 2, 4, 5], [1, 2, 4, 5])
    assert np.allclose(added[across], foundation * length / 420 * np.array(consistent), rtol=1e-12)
    assert not np.any(added[[0, 3]]) and before[0, 0] > 0


def test_changed_kernels_can_be_compiled_with_their_generation(monkeypatch):
    commands = []
    monkeypatch.setattr(
        regeneration.subprocess,
        "run",
        lambda command, **options: (
            commands.append((command[1:], options["cwd"]))
            or subprocess.CompletedProcess(command, len(commands) - 1, "", "one\ntwo\nno compiler\n")
        ),
    )
    regeneration.compile_again()
    assert commands == [(["setup.py", "-q", "build_ext", "--inplace"], PACKAGE.parent)]
    with pytest.raises(GenerationError, match="no compiler"):
        regeneration.compile_again()


def test_a_new_element_is_a_file_and_a_name(checkout):
    """It gets a model of its own beside those that read the element that changed; no other is derived."""
    before = content(checkout)
    elements = checkout / "symgen" / "elements"
    cubic = (elements / "cubic.py").read_text()
    (elements / "hermite.py").write_text(cubic.replace('"cubic"', '"hermite"'))
    other = elements / "timoshenko.py"  # which, other than the cubic one, only its own two models read
    other.write_text(other.read_text() + "# nothing\n")
    registry = (elements / "__init__.py").read_text()
    (elements / "__init__.py").write_text(registry.replace('"cubic", ', '"cubic", "hermite", '))
    code, said, _ = generate(checkout)
    assert code == 0
    assert sorted(line for line in said if line.startswith("derived")) == [
        "derived element_hermite: not in the cache",
        "derived element_hermite_tangents: not in the cache",
        "derived element_timoshenko: elements/timoshenko.py changed",
        "derived element_timoshenko_tangents: elements/timoshenko.py changed",
    ]
    after = content(checkout)
    changed = {name for name in after if after[name] != before.get(name)}
    made = ("element_hermite", "element_hermite_tangents")
    assert {f"{name}{ending}" for name in made for ending in (".pyx", "_kernel.c")} < changed
    unrecorded = [line for line in said if line.endswith("no record of its mathematics before")]
    assert unrecorded == ["element_hermite: no record of its mathematics before"]
    assert {name for name in changed if name.endswith("_equations.json")} == {
        "element_hermite_equations.json"
    }
    assert all(name == "manifest.json" or name.startswith("element_hermite") for name in changed)


def test_an_elastic_scene_loads_its_own_element_alone(tmp_path):
    """Its derivation and its kernels."""
    run = (
        "import sys, symgen\n"
        "symgen.build('rotating_cantilever').quasi_static(samples=3).statistics\n"
        "parts = 'symgen.elements', 'symgen.generated.'\n"
        "print(*sorted(m for m in sys.modules if m.startswith(parts)))\n"
    )
    environment = {**os.environ, "SYMGEN_CACHE": str(tmp_path)}
    derived, again = (
        subprocess.run(
            [sys.executable, "-c", run], env=environment, capture_output=True, text=True, check=True
        ).stdout.split()
        for _ in range(2)
    )
    kernels = ["symgen.generated.element_beam8"]
    assert derived == ["symgen.elements", "symgen.elements.beam8", "symgen.elements.element", *kernels]
    assert again == kernels


def test_records_say_what_the_kernels_cost(made):
    """The committed record holds the operations that the C file tells, and no entry without a value."""
    for name in filter(record_name, names()):
        record = read_record((generated_folder() / record_name(name)).read_text())
        sources = [f.text for f in made[name].shipped.files if f.name.endswith(".c")]
        for kernel, flops in record.operations.items():
            assert any(f"{kernel}" in text and f"{flops} operations" in text for text in sources)
        values = EntryValues(record)
        assert all(m.entries.keys() == values.of(k).keys() for k, m in record.matrices.items())


def test_errors_of_derivations_are_reported(monkeypatch, tmp_path):
    """Where a process is killed, and where the process that starts them ends."""
    (tmp_path / "dying.py").write_text("import os\n\ndef die(folder, name):\n    os.kill(os.getpid(), 9)\n")
    dying = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import dying; "
    dying += "import symgen.regeneration.generate as r; r.answer_in = dying.die; "
    monkeypatch.setattr(regeneration, "PARENT", dying + regeneration.PARENT)
    with pytest.raises(
        GenerationError, match=r"^loop_row cannot be derived, and nothing was written:\n.*terminated"
    ):
        regeneration.derive_all(["loop_row"])
    assert not multiprocessing.active_children()
    monkeypatch.setattr(regeneration, "PARENT", "raise SystemExit('out of memory')")
    with pytest.raises(GenerationError, match="^the remaining models cannot be derived.*:\nout of memory$"):
        regeneration.derive_all(["loop_row"])


def test_many_failing_derivations_end(tmp_path):
    """More than the processes that derive at the same time; the first failure cancels those not begun."""
    names = [f"unknown_{k}" for k in range(8)]
    ended = subprocess.run(
        [sys.executable, "-c", regeneration.PARENT, str(tmp_path), *names],
        capture_output=True,
        text=True,
        timeout=100,
    )
    assert ended.returncode == 0 and ended.stdout.splitlines()[0].endswith(" 1")


def test_a_process_of_its_own_answers_with_what_this_one_makes(made):
    here = json.loads(answer("rigid_element"))
    there = made["rigid_element"]
    assert here["shipped"]["files"] == [{"name": f.name, "text": f.text} for f in there.shipped.files]
    assert set(there.needs) <= set(here["needs"]), "what else was derived here counts too"
