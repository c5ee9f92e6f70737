"""Per-run precomputation is in the kernel 'setup', once, and nowhere else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from shared.full import full_unless
from shared.shipped import ELASTIC, IN_SPACE, LINKAGES, LOOPS, derived, lowered

from symgen.codegen.emit import emit
from symgen.codegen.printers import Printer
from symgen.codegen.target import Target
from symgen.errors import DerivationError
from symgen.lowering.expressions import Constant, Negative, Product, Quotient, Reference, Sum, children, count
from symgen.lowering.program import lower_system
from symgen.models import BLOCKS
from symgen.models.analyses import ANALYSES, analysis_system
from symgen.models.general_linkage import general
from symgen.models.loop.structure import general as general_loop
from symgen.pipeline.systems import system_of
from symgen.scene.loading import load_scene
from symgen.scene.resolve import resolve
from symgen.symbolic.quantity import quantity
from symgen.symbolic.system import LIMITS, Export, Group, NamedMatrix, System


def left_over(kernel):
    """Operations of parameters alone, in whatever order the operands of a sum or product are taken."""
    fixed = set()
    found = []

    def is_fixed(node):
        if isinstance(node, Reference):
            return node.name in fixed or node.name.startswith("p[")
        return isinstance(node, Constant) or all(map(is_fixed, children(node)))

    def look(node, place):
        parts = children(node)
        alone = [x for x in parts if is_fixed(x)]
        several = isinstance(node, Sum | Product) and len(alone) > 1
        whole = parts and len(alone) == len(parts) and not isinstance(node, Negative)
        if several or whole or (isinstance(node, Quotient) and is_fixed(parts[1])):
            found.append((kernel.name, place, node))
        for part in parts:
            look(part, place)

    for assignment in kernel.assignments:
        look(assignment.value, assignment.target)
        if is_fixed(assignment.value):
            fixed.add(assignment.target)
    for store in kernel.stores:
        look(store.value, f"{store.array}[{store.index}]")
    return found


def loosened(name):
    """The scene with every number in it a parameter."""
    resolved = resolve(load_scene(name))
    return system_of((general if name in LINKAGES else general_loop)(resolved))


def programs(name):
    yield derived(name), lowered(name)
    for system in (loosened(name), *analyses(name)):
        yield system, lower_system(system)


def analyses(name):
    if name in LINKAGES:
        linkage = resolve(load_scene(name))
        for kind in ANALYSES:
            if kind.startswith("elastic_motion"):  # of links in the plane; joints are those of both
                there = name in ELASTIC and name not in IN_SPACE
            elif kind.startswith("elastic"):
                there = name in ELASTIC
            else:
                there = linkage.dimension == 2 or kind != "forces"
            if there:
                yield analysis_system(linkage, kind)


#: Scenes of each kind; the others under the marker "full".
SOME = (
    "peaucellier",
    "tumbling_body",
    "car_axis",
    "elastic_slider_crank",
    "cssp",
    "screw_jack",
    "slider_crank",
)


@pytest.mark.parametrize("name", full_unless(lambda name: name in SOME, [*LINKAGES, *LOOPS]))
def test_nothing_of_parameters_alone_is_left_in_any_other_kernel(name):
    with_setup = 0
    for system, program in programs(name):
        others = [k for k in program.kernels if k is not program.setup and k.name != LIMITS]
        others += program.series
        assert [x for k in others for x in left_over(k)] == []
        if program.setup is None:
            continue
        with_setup += 1
        given = len(system.group("p").quantities)
        values = [s.value for s in program.setup.stores]
        assert program.setup.inputs == (("p", given),)
        assert len(set(values)) == len(values), "a term has two places"
        references = [_references(k) for k in others]
        read = set().union(*references) & {f"p[{given + i}]" for i in range(program.setup.out_size)}
        assert len(read) == len(values), "a term that no kernel reads"
        for k, names in zip(others, references, strict=True):
            reads_tolerance = f"p[{program.tolerance_place}]" in names
            assert program.tolerance_place in (-1, given + len(values))
            assert dict(k.inputs).get("p") in (None, given + len(values) + reads_tolerance)
    assert with_setup


def _references(kernel):
    found, waiting = set(), [a.value for a in kernel.assignments] + [s.value for s in kernel.stores]
    while waiting:
        node = waiting.pop()
        waiting += children(node)
        if isinstance(node, Reference):
            found.add(node.name)
    return found


@pytest.mark.parametrize("name", ["peaucellier", "double_four_bar", "slider_crank"])
def test_it_can_be_seen_where_all_is_computed_at_every_call(name):
    """The same scene, told that its parameters differ from call to call, as those of blocks do."""
    system = derived(name)
    groups = tuple(replace(g, per_run=False) for g in system.groups)
    program = lower_system(replace(system, groups=groups))
    assert program.setup is None
    assert sum(len(left_over(k)) for k in program.kernels) >= 5
    own = {k.name: k.counts.flops for k in lowered(name).kernels}
    for kernel in program.kernels:
        assert own[kernel.name] <= kernel.counts.flops
    assert sum(own.values()) < sum(k.counts.flops for k in program.kernels)


def test_blocks_have_none():
    assert all(lowered(name).setup is None for name in BLOCKS)


P = [quantity(name, "m", "a parameter") for name in ("a", "b", "c")]
X, Y = (quantity(name, "m", "a coordinate") for name in ("x", "y"))
a, b, c, x, y = (q.symbol for q in (*P, X, Y))


def system(*entries, kernel="made", per_run=True):
    matrix = NamedMatrix("m", sp.ImmutableMatrix(entries), "m", "entries")
    groups = (Group("q", "coordinates", (X, Y)), Group("p", "parameters", tuple(P), per_run=per_run))
    return System("small", "Small", groups, (matrix,), (Export(kernel, "entries", ("m",)),))


@pytest.mark.parametrize(
    ("entry", "moved", "kept"),
    [
        (a * b * x, ["p[0]*p[1]"], "p[3]*q[0]"),
        (2 * a * x * y, ["2.0*p[0]"], "p[3]*q[0]*q[1]"),
        (x / a, ["1.0/p[0]"], "p[3]*q[0]"),
        (b * x / (a * y), ["p[1]/p[0]"], "p[3]*q[0]/q[1]"),
        (x / (a * b * y), ["p[0]*p[1]"], "q[0]/(p[3]*q[1])"),
        (x / (a * y), [], "q[0]/(p[0]*q[1])"),
        (a + x + b - y, ["p[0] + p[1]"], "p[3] + q[0] - q[1]"),
        (x - a - b, ["p[0] + p[1]"], "q[0] - p[3]"),
        (1 - a + x, ["1.0 - p[0]"], "p[3] + q[0]"),
        (sp.sin(a) * sp.cos(a * x), ["sin(p[0])"], "cos(p[0]*q[0])*p[3]"),
        (sp.sqrt(a) + b**2 * c, ["sqrt(p[0]) + p[2]*p[1]*p[1]"], "p[3]"),
        (x * (a - b) ** 2, ["(p[0] - p[1])*(p[0] - p[1])"], "q[0]*p[3]"),
        (-a * x, [], "-p[0]*q[0]"),
        (a, [], "p[0]"),
        (-a, [], "-p[0]"),
        (3, [], "3.0"),
    ],
)
def test_what_is_moved(entry, moved, kept):
    program = lower_system(system(entry))
    kernel = program.kernel("made")
    assert kernel.assignments == ()
    assert [Printer({})(s.value) for s in kernel.stores] == [kept]
    values = {f"p[{i}]": 1.7 - 0.4 * i for i in range(3)}
    assert bool(program.setup) == bool(moved)
    for store, text in zip(program.setup.stores if moved else (), moved, strict=True):
        assert _value(program.setup, store, values) == pytest.approx(
            eval(text, {"sin": np.sin, "sqrt": np.sqrt, "p": [*values.values()]}), rel=1e-15
        )
    if moved:
        assert program.setup.counts == count([a.value for a in program.setup.assignments])


def _value(kernel, store, values):
    known = {"sin": np.sin, "sqrt": np.sqrt, "p": [*values.values()]}
    for assignment in kernel.assignments:
        known[assignment.target] = eval(Printer({})(assignment.value), known)
    return eval(Printer({})(store.value), known)


def test_terms_are_shared_between_entries_and_kernels():
    one = system(a * b * x + y, a * b * y, (a * b + 1) * x, -a * b)
    program = lower_system(replace(one, exports=(*one.exports, Export("again", "entries", ("m",)))))
    assert program.setup.counts.flops == 2  # a b, and one more
    assert program.setup.out_size == 3  # and - a b
    made, again = program.kernel("made"), program.kernel("again")
    assert made.stores == again.stores and made.inputs == again.inputs == (("q", 2), ("p", 6))


def test_its_name_is_taken():
    with pytest.raises(DerivationError, match="a kernel is called 'setup'"):
        lower_system(system(a * b * x, kernel="setup"))
    assert len(lower_system(system(a * b * x, kernel="setup", per_run=False)).kernels) == 1


@pytest.mark.parametrize("language", ["c", "cython", "numpy", "mpmath"])
def test_every_language_says_or_does_it(language):
    files = emit(lowered("cardan"), Target(language), "x" * 64)
    text = "\n".join(f.text for f in files)
    assert ("def setup(" in text) == (language in ("numpy", "mpmath"))
    if language == "c":
        (header,) = (f.text for f in files if f.name.endswith(".h"))
        assert "cardan_setup(NULL, NULL, NULL, p, NULL, p + 3);" in header
        for kernel in ("motion", "energy"):
            comment = header.partition(f"void cardan_{kernel}(")[0].rpartition("/*")[2]
            assert "; after cardan_setup\n" in comment
    if language == "cython":
        assert "\nsetup = function(" in text
        assert "setup(p=p, out=p[3:])" in text
