"""Source files from a Program, through templates."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import lru_cache
from itertools import groupby
from typing import Any

from symgen.codegen.calls import calls_of, calls_of_series
from symgen.codegen.printers import Printer, printer
from symgen.codegen.rolled import ROLLED, large, rolled
from symgen.codegen.series import order_view
from symgen.codegen.source import LOOPS, SourceFile
from symgen.codegen.target import Target
from symgen.codegen.views import (
    BlockView,
    GroupView,
    KernelView,
    SeriesView,
    TextAssignment,
    UnitView,
)
from symgen.lowering.expressions import Constant, references
from symgen.lowering.kernel import ARRAYS, Block, IteratedKernel, Kernel, Program, Slot, Store


@lru_cache(maxsize=1)
def environment() -> Any:
    """Return the Jinja environment shared by all templates."""
    import jinja2

    return jinja2.Environment(
        loader=jinja2.PackageLoader("symgen.templates", ""),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # noqa: S701 - the output is C, Cython and Python, not HTML
    )


#: Templates by language, with the file name they produce from a model's name. Those in ``SPLIT`` produce
#: one file per group of kernels: ``{}_kernel.c``, ``{}_kernel_2.c``, ...
TEMPLATES = {
    "c": (("c/kernel.h.j2", "{}_kernel.h"), ("c/kernel.c.j2", "{}_kernel{}.c")),
    "numpy": (("numpy/kernel.py.j2", "{}_numpy.py"),),
    "mpmath": (("mpmath/kernel.py.j2", "{}_mpmath.py"),),
    "cython": (("cython/module.pyx.j2", "{}.pyx"),),
}
SPLIT = "c/kernel.c.j2"
#: Template of kernels of power series, which models of motions have.
SERIES_TEMPLATE = "c/series.c.j2"
#: Templates of kernels that repeat another one, by language; in C they are a file of their own.
ITERATED = {"c": "c/iterated.c.j2", "numpy": "numpy/iterated.py.j2", "mpmath": "numpy/iterated.py.j2"}
#: Additional C templates for kernels that evaluate batches of states.
LANES = (("c/batch.c.j2", "{}_batch.c"),)
#: Templates included by other templates.
INCLUDED = ("numpy/functions.py.j2", "c/body.c.j2")

#: Number of statements per C file; further kernels go to the next file. The files of a scene are compiled
#: in parallel.
STATEMENTS = 400
#: Maximum number of statements of the solution that is repeated in the loop over the orders of power series:
#: numbers are in registers there. Larger ones are called.
INLINED = 40
#: Minimum number of consecutive zeros that are stored by a loop.
ZEROS = 32
_ZERO = Constant("0")
#: Languages with a header of all kernels.
_DECLARED = ("c", "cython")


def equations_hash(program: Program, target: Target) -> str:
    """Return the hash of everything that determines the generated code: program, target and templates."""
    digest = hashlib.sha256()
    digest.update(repr((program, target.precision, target.lanes, STATEMENTS, INLINED)).encode())
    for template in sorted({*INCLUDED, *(n for files in (*TEMPLATES.values(), LANES) for n, _ in files)}):
        digest.update(_source(template))
    if large(program, target):
        digest.update(_source(ROLLED))
    if program.series:
        digest.update(_source(SERIES_TEMPLATE))
    if any(isinstance(k, IteratedKernel) for k in program.kernels):
        for template in sorted({*ITERATED.values()}):
            digest.update(_source(template))
    return digest.hexdigest()


def _source(template: str) -> bytes:
    return str(environment().loader.get_source(environment(), template)[0]).encode()


def emit(program: Program, target: Target, equations: str) -> tuple[SourceFile, ...]:
    """Return the source files of a program in one language, in the order of the templates.

    Parameters
    ----------
    program
        The lowered system.
    target
        Language, precision, and scalar or batched evaluation.
    equations
        The program's :func:`equations_hash`, written into the code.
    """
    whole = unit_view(program, target, equations)
    iterated = tuple(kernel for kernel in whole.kernels if kernel.iterated)
    plain = replace(whole, kernels=tuple(kernel for kernel in whole.kernels if not kernel.iterated))
    files = []
    for template, file in TEMPLATES[target.language] + (LANES if target.lanes else ()):
        parts = _parts(whole) if template == SPLIT else [whole if target.language in _DECLARED else plain]
        for i, part in enumerate(parts):
            text = environment().get_template(template).render(unit=part)
            files.append(SourceFile(file.format(program.name, f"_{i + 1}" if i else ""), text))
    if iterated and target.language in ITERATED:
        template = environment().get_template(ITERATED[target.language])
        text = template.render(unit=replace(whole, kernels=iterated))
        if target.language == "c":
            files.append(SourceFile(f"{program.name}_iterated.c", text))
        else:
            files[-1] = SourceFile(files[-1].name, files[-1].text + text)
    loops = tuple(kernel for kernel in whole.kernels if kernel.rolled)
    if loops:
        text = environment().get_template(ROLLED).render(unit=replace(whole, kernels=loops))
        files.append(SourceFile(f"{program.name}{LOOPS}", text))
    return tuple(files)


def _parts(whole: UnitView) -> list[UnitView]:
    parts: list[list[KernelView]] = [[]]
    statements = 0
    for kernel in whole.kernels:
        if kernel.rolled or kernel.iterated:
            continue
        size = len(kernel.assignments) + len(kernel.stores)
        if parts[-1] and statements + size > STATEMENTS:
            parts.append([])
            statements = 0
        parts[-1].append(kernel)
        statements += size
    last = len(parts) - 1
    return [
        replace(whole, kernels=tuple(part), first=i == 0, series=whole.series if i == last else None)
        for i, part in enumerate(parts)
    ]


def unit_view(program: Program, target: Target, equations: str) -> UnitView:
    """Return the template data of a program: names, sizes and final text of every kernel."""
    setup, loops = program.setup, large(program, target)
    kernels = tuple(_kernel(program, k, target, k.name in loops) for k in program.kernels)
    behind = {array: setup.out_size for array, _ in setup.inputs} if setup else {}
    return UnitView(
        name=program.name,
        title=_comment(program.title),
        guard=f"SYMGEN_{program.name.upper()}_KERNEL_H",
        type=_type(target),
        precision=target.precision,
        lanes=target.lanes,
        equations=equations,
        groups=tuple(
            GroupView(
                name,
                text + _on_tolerance(program, name),
                plain(slots),
                behind.get(name, 0),
                bool(_on_tolerance(program, name)),
            )
            for name, text, slots in program.groups
            if slots or _on_tolerance(program, name)
        ),
        references=program.references,
        kernels=kernels,
        # Only compiled runs have power series.
        series=_series(program, kernels, target)
        if program.series and target.language in ("c", "cython")
        else None,
    )


def _on_tolerance(program: Program, group: str) -> str:
    """Return the header's description of the rank tolerance, which follows the parameters."""
    if group != "p" or program.tolerance_place < 0:
        return ""
    return (
        f"; behind all of them, in p[{program.tolerance_place}], the rank tolerance, "
        f"{program.rank_tolerance} unless constraints are redundant"
    )


def _type(target: Target) -> str:
    return "symgen_lanes" if target.lanes else target.precision.c_type


def _comment(text: str) -> str:
    """Remove character sequences that would close the surrounding comment or docstring."""
    return " ".join(
        text.replace("*/", "* /").replace("/*", "/ *").replace('"""', "'''").replace("\\", "/").split()
    )


def plain(slots: tuple[Slot, ...]) -> tuple[Slot, ...]:
    """Return the slots with descriptions that are safe in a comment."""
    return tuple(Slot(s.name, s.unit, _comment(s.description)) for s in slots)


def _kernel(program: Program, kernel: Kernel, target: Target, rolls: bool) -> KernelView:
    prints = printer(target)
    arguments = dict(kernel.inputs)
    written = {s.array for s in kernel.stores}
    sizes = kernel.reads
    kernel = kernel if rolls else kernel.with_zeros
    early, late = _scheduled(kernel)
    loops = rolled(kernel, early, late, prints) if rolls else None
    assigned = () if loops else kernel.assignments
    if loops:
        early, late = [], []
    return KernelView(
        name=kernel.name,
        description=kernel.description,
        counts=str(kernel.counts),
        prototype=_prototype(program.name, kernel.name, _type(target)),
        unused=() if kernel.first else tuple(a for a in ARRAYS if a not in arguments and a not in written),
        first=tuple(k.name for k in kernel.first),
        then=tuple(k.name for k in kernel.then),
        assignments=tuple(TextAssignment(a.target, prints(a.value)) for a in assigned),
        stores=() if loops else tuple(_stores(kernel.stores, prints, target)),
        early=tuple(tuple(_stores(stores, prints, target)) for stores in early),
        late=tuple(_stores(late, prints, target)),
        calls=calls_of(kernel, target),
        blocks=tuple(map(_block, kernel.blocks)),
        given=tuple(a for a in ARRAYS if a in {*sizes, *arguments}),
        sizes=(*(sizes.get(a, 0) for a in ARRAYS[:4]), kernel.work_size, kernel.out_size),
        work_size=kernel.work_size,
        after_setup=_is_after_setup(program, kernel),
        rolled=loops,
        iterated=kernel if isinstance(kernel, IteratedKernel) else None,
    )


def _series(program: Program, kernels: tuple[KernelView, ...], target: Target) -> SeriesView:
    solve = next((k for k in kernels if k.name == "solve"), None)
    orders = {k.name: order_view(k, _type(target), printer(target)) for k in program.series}
    sides, name = next(k for k in program.series if k.name == "sides"), "series"
    speed = orders.get("speed")
    return SeriesView(
        name,
        _prototype(program.name, name, _type(target)),
        sides.rows,
        sides.coordinates,
        sides.coordinates if speed else sides.out_size - sides.coordinates,
        sides.products,
        sides.ahead,
        sum(k.out_size for k in program.series if k.name == "along") - sides.watched - bool(speed),
        sides.watched,
        orders.get("ahead"),
        orders["sides"],
        orders.get("behind"),
        speed,
        orders.get("along"),
        solve is None,
        solve if solve and _is_inlined(solve) else None,
        calls_of_series(program.series, target.precision),
    )


def _is_inlined(solve: KernelView) -> bool:
    """Return whether the solution is part of the loop over the orders of power series."""
    return len(solve.assignments) + len(solve.stores) <= INLINED and not solve.rolled


def _is_after_setup(program: Program, kernel: Kernel) -> bool:
    """Return whether a kernel reads the entries that 'setup' appends to the parameters."""
    if program.setup is None:
        return False
    offset = dict(program.setup.inputs)["p"]
    places = {f"p[{offset + i}]" for i in range(program.setup.out_size)}
    values = [a.value for a in kernel.assignments] + [s.value for s in kernel.stores]
    called = (*kernel.first, *kernel.then)
    return bool(places & set(references(values))) or any(_is_after_setup(program, k) for k in called)


def _scheduled(kernel: Kernel) -> tuple[list[list[Store]], list[Store]]:
    """Return the stores that can follow each assignment, and those that remain behind all of them.

    A value is stored as soon as it is known and the entry that it replaces is no longer read: if all values
    of a large factorisation wait for their stores, compilers spend their time on spilling them.
    """
    assigned = {a.target: i for i, a in enumerate(kernel.assignments)}
    last_read = {name: i for i, a in enumerate(kernel.assignments) for name in references([a.value])}
    loaded = set(references([s.value for s in kernel.stores]))
    early: list[list[Store]] = [[] for _ in assigned]
    late: list[Store] = []
    for store in kernel.stores:
        names, entry = references([store.value]), f"{store.array}[{store.index}]"
        if names and all(name in assigned for name in names) and entry not in loaded:
            early[max(last_read.get(entry, 0), *(assigned[name] for name in names))].append(store)
        else:
            late.append(store)
    return early, late


def _stores(stores: Iterable[Store], prints: Printer, target: Target) -> Iterator[TextAssignment]:
    """Yield the stores; in C a loop stores consecutive zeros: a Jacobian of n rods has n squared of them."""
    following = groupby(enumerate(stores), lambda x: (x[1].array, x[1].value == _ZERO, x[1].index - x[0]))
    for (array, is_zero, _), run in following:
        stores = [store for _, store in run]
        if target.language == "c" and is_zero and len(stores) >= ZEROS:
            each = f"for (int i = {stores[0].index}; i <= {stores[-1].index}; i++) {array}[i]"
            yield TextAssignment(each, prints(_ZERO))
        else:
            yield from (TextAssignment(f"{array}[{s.index}]", prints(s.value)) for s in stores)


def _block(block: Block) -> BlockView:
    rows, columns = block.shape
    last = block.offset + rows * columns - 1
    return BlockView(
        block.name,
        block.offset,
        last,
        rows,
        columns,
        block.unit,
        block.description,
    )


def _prototype(model: str, kernel: str, c_type: str) -> str:
    read = ", ".join(f"const {c_type} *SYMGEN_RESTRICT {a}" for a in ARRAYS[:4])
    write = ", ".join(f"{c_type} *SYMGEN_RESTRICT {a}" for a in ARRAYS[4:])
    return f"void {model}_{kernel}({read}, {write})"
