"""Generated C and the core, compiled with GCC's sanitizers and called at random and extreme states.

``python benchmarks/sanitized.py`` compiles with ``-fsanitize=address,undefined``: the kernels of every
shipped scene and of its analyses, the committed kernels under ``generated/``, and the core. Every kernel is
called with arrays of exactly the sizes in its header, filled with zeros, small, huge and denormal numbers,
infinities and NaN. The core steps, projects, closes, follows and assembles from such states, by every method,
and also from ordinary ones. It stops at the first report of a sanitizer.
"""

from __future__ import annotations

import argparse
import ctypes
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

import symgen
from symgen.errors import SymgenError
from symgen.runtime import _core
from symgen.runtime.beams.methods import BEAM_METHODS, integrator_of
from symgen.runtime.elastic.mesh import MeshedMotion
from symgen.runtime.elastic.model import ElasticModel
from symgen.runtime.integrate.integrators import INTEGRATORS
from symgen.runtime.loop.driven import PARTS
from symgen.runtime.loop.model import LoopModel
from symgen.runtime.rods.model.rods import RodModel
from symgen.toolchain.compiler import find_compiler
from symgen.toolchain.kernels import BuildSettings

Array = Any
SANITIZERS = "-fsanitize=address,undefined,float-cast-overflow -fno-sanitize-recover=all"
FLAGS = f"-std=c11 -O0 -ffp-contract=off {SANITIZERS}"
GENERATED = Path(__file__).parents[1] / "generated"
COMMITTED = "generated/"
#: Analyses whose kernels are called in addition to those of the motion.
ANALYSES = ("kinematics", "statics", "tangent")
ELASTIC = ("elastic_motion", "elastic_joints")
STEPS = 20

EXTREMES = np.array(
    [
        0.0,
        -0.0,
        1.0,
        -1.0,
        5e-324,
        1e-310,
        -1e-310,
        1e-160,
        1e160,
        -1e160,
        1.7e308,
        -1.7e308,
        np.inf,
        -np.inf,
        np.nan,
    ]
)


def arrays(count: int, rng: np.random.Generator, times: int) -> Iterator[Array]:
    """Yield arrays of ``count`` numbers: equal, mixed, ordinary with one extreme value, and ordinary."""
    for value in EXTREMES:
        yield np.full(count, value)
    for _ in range(times):
        yield rng.choice(EXTREMES, count)
        ordinary = rng.normal(size=count)
        yield ordinary.copy()
        if count:
            ordinary[rng.integers(count)] = rng.choice(EXTREMES)
        yield ordinary


def call_kernel(address: int, sizes: Sequence[int], rng: np.random.Generator) -> int:
    """Call a kernel with arrays of these sizes (t, q, u, p, work, out) and arbitrary contents."""
    function = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 6)(address)
    given = [list(arrays(size, rng, 6)) for size in sizes]
    for row in zip(*given, strict=True):
        exact = [np.array(a) for a in row]
        function(*(a.ctypes.data if len(a) else None for a in exact))
    return len(given[0])


def kernels_of(description: Any, library: Any, rng: np.random.Generator) -> int:
    """Call all kernels of a model; return the number of calls."""
    return sum(
        call_kernel(library.addresses[k.name], (*description.sizes, k.work_size, k.out_size), rng)
        for k in description.kernels
    )


def run_from(equations: Any, starts: Sequence[Array], rng: np.random.Generator, **options: Any) -> int:
    """Run by every applicable method from each of these states; return the number of runs."""
    count = 0
    tangent, explicit_only = options.pop("tangent", False), options.pop("explicit", False)
    ends = options.pop("ends", (1e-3, 0.1, 1e3, 1e300, np.inf, np.nan))
    for start in starts:
        for method in INTEGRATORS.values():
            if (method.needs_tangent and not tangent) or (explicit_only and method.kind != "explicit"):
                continue
            t_end = float(rng.choice(ends))
            fixed = not method.adaptive
            tolerance = (0.0, 0.0) if fixed else (1e-9, 1e-12)
            step = float(rng.choice([1e-4, 1e-2, 1e10, 5e-324])) if fixed else 0.0
            run = _core.Run(
                equations, method, 0.0, start, t_end, *tolerance, step, np.array([1e-4, 1e-3]), **options
            )
            if run.begin() == _core.MORE:
                run.advance(STEPS)
            count += 1
    return count


def rods(model: RodModel, rng: np.random.Generator) -> int:
    """Run a linkage from ordinary and extreme states."""
    d, state = model.description, model.initial_state()
    tangent = model.analysis("tangent")
    done = 0
    for way, rate in ((0, 0.0), (1, 10.0), (2, 0.0)):
        made = model.evaluator.equations(
            len(d.redundant), stabilisation=rate, tangent=None if way else tangent
        )
        start = np.concatenate([state.q, state.u, np.zeros(made.extra)])
        events = {"directions": [e.direction for e in d.events], "terminal": [e.ends_run for e in d.events]}
        starts = [start, *arrays(len(start), rng, 2), *(start * x for x in (1 + 1e-9, 1e3, 1e-200))]
        done += run_from(made, starts, rng, stabilisation=way, tangent=not way, explicit=bool(way), **events)
        for y in arrays(len(start) + 1, rng, 4):
            made.derivative(0.0, y)
            made.check(float(rng.choice(EXTREMES)), y)
            made.solutions(np.array([0.0]), y[None, :])
    return done


def loop(model: LoopModel, rng: np.random.Generator) -> int:
    """Close, follow and run a loop from ordinary and extreme states."""
    d, begin, kernels = model.description, model.closed_start(), model.kernels
    width = (d.kernel("outputs").out_size if d.kernel("outputs") else 0) + 1
    done = 0
    for solved in (d.having("dependent"), [*d.having("dependent"), *d.having("free")]):
        made = kernels.equations(solved, begin.rank)
        for q in (np.append(begin.q, 0.0), *arrays(d.coordinates + 1, rng, 4)):
            t = float(rng.choice([begin.t, 0.5, *EXTREMES]))
            made.close(t, q.copy())
            made.closed_screws(t, q.copy())
            for wanted in (np.linspace(begin.t, begin.t + 0.1, 4), *rng.choice(EXTREMES, (2, 4))):
                rows = np.zeros((4, 3 * d.coordinates + 7)), np.zeros((4, width)), np.zeros((4, 5))
                times = np.sort(np.abs(wanted))  # NaN is sorted last
                longest = max(abs(times[-1] - begin.t), 1e-12) / PARTS
                made.follow(begin.t, q.copy(), times, longest, *rows)
                done += 1
        if not model.is_driven:
            start = np.concatenate([begin.q, np.zeros(d.coordinates + 1)])
            done += run_from(made, [start, *arrays(len(start), rng, 1)], rng, explicit=True)
    return done


def elastic(model: ElasticModel, rng: np.random.Generator) -> int:
    """Assemble and step elastic links from ordinary and extreme states and times."""
    done = rods(model.rigid, rng)
    motion = MeshedMotion(model.rigid)
    n = motion.layout.unknowns
    for thesis in (False, True):
        made = motion.equations(thesis)
        for t in (0.0, 0.01, *EXTREMES):
            made.matrices(float(t))
            made.matrices(float(t), True)
        made = motion.equations(thesis)
        for y in arrays(2 * n + 1, rng, 2):
            made.derivative(float(rng.choice([0.0, 0.001, np.nan])), y)
        # A rigid motion is followed up to the requested time: keep it short.
        starts = [np.zeros(2 * n), *arrays(2 * n, rng, 1)]
        done += run_from(made, starts, rng, explicit=True, ends=(1e-3, 0.01, np.nan))
    for method in BEAM_METHODS.values():
        for y in (np.zeros(2 * n), *arrays(2 * n, rng, 1)):
            for end in (1e-3, 1e300):
                run = _core.Run(
                    motion.equations(), integrator_of(method), 0.0, y, end, 0.0, 0.0, 0.0, np.array([end]),
                    stabilisation=2, nodes=np.array([0.0, end]), counts=np.array([0, 8]),
                )  # fmt: skip
                if run.begin() == _core.MORE:
                    run.advance(STEPS)
            done += 1
    model.simulate(method="gauss", steps=64, samples=5)
    return done


def scene(name: str) -> str:
    """Test one scene; return a summary."""
    rng = np.random.default_rng(1)
    model = symgen.build(name)
    rigid = model.rigid if isinstance(model, ElasticModel) else model
    calls = kernels_of(model.description, rigid.library, rng)
    if isinstance(model, LoopModel):
        runs = loop(model, rng)
        model.inverse_dynamics(samples=7) if model.is_driven else model.simulate(0.05)
    else:
        kinds = (*ANALYSES, *(ELASTIC if isinstance(model, ElasticModel) else ()))
        for kind in kinds:
            evaluator = rigid.analysis(kind)
            calls += kernels_of(evaluator.description, evaluator.library, rng)
        runs = elastic(model, rng) if isinstance(model, ElasticModel) else rods(model, rng)
        rigid.simulate(min(0.05, rigid.description.t_end))
    return f"{name}: {calls} calls of kernels, {runs} runs"


def committed() -> str:
    """Test the kernels under generated/."""
    rng = np.random.default_rng(2)
    calls = 0
    compiler = find_compiler()
    assert compiler
    with tempfile.TemporaryDirectory() as folder:
        for header in sorted(GENERATED.glob("*/*_kernel.h")):
            name = header.name.removesuffix("_kernel.h")
            library = Path(folder) / f"{name}.so"
            sources = [str(p) for p in sorted(header.parent.glob(f"{name}_kernel*.c"))]
            subprocess.run(
                [
                    *compiler.command,
                    *compiler.flags,
                    "-O0",
                    "-shared",
                    "-fPIC",
                    "-o",
                    str(library),
                    *sources,
                    "-lm",
                ],
                check=True,
                env={**os.environ, "LD_PRELOAD": ""},
            )
            calls += of_header(name, header.read_text(encoding="utf-8"), ctypes.CDLL(str(library)), rng)
    return f"{COMMITTED}: {calls} calls of kernels"


def of_header(name: str, text: str, library: Any, rng: np.random.Generator) -> int:
    """Call the kernels declared in a header, with the sizes documented there."""
    if f"{name}_work(ptrdiff_t" in text:
        return chain(name, text, library, rng)
    groups = {array: int(size) for array, size in re.findall(r"^ \*   (\w+)\[(\d+)\]:", text, re.MULTILINE)}
    calls = 0
    for comment, kernel in re.findall(rf"/\*((?:(?!\*/).)*)\*/\nvoid {name}_(\w+)\(", text, re.DOTALL):
        work = max(map(int, re.findall(r"; work: (\d+)", comment)), default=0)
        out = max((int(last) + 1 for last in re.findall(r"out\[\d+\.\.(\d+)\]", comment)), default=0)
        address = ctypes.cast(getattr(library, f"{name}_{kernel}"), ctypes.c_void_p).value or 0
        calls += call_kernel(address, (*(groups.get(a, 0) for a in "tqup"), work, out), rng)
    return calls


def chain(name: str, text: str, library: Any, rng: np.random.Generator) -> int:
    """Call the kernels of chains of a few lengths, straight and branched, alone and in lanes."""
    lanes = int(re.search(rf"{name}_lanes = (\d+)", text)[1])  # type: ignore[index]
    dimension = int(re.search(r"force\[n \+ 1\]\[(\d)\]", text)[1])  # type: ignore[index]
    sizes_of_work = re.search(r"return (\d+)\*n \+ (\d+)\*\(n \+ 1\) \+ (\d+)", text)
    per_rod, per_point, further = map(int, sizes_of_work.groups())  # type: ignore[union-attr]
    calls = 0
    for n in (1, 2, 7):
        parent = np.array([rng.integers(0, k + 1) for k in range(n)], dtype=np.intp)
        points, rods = (n + 1) * dimension, n * dimension
        for suffix, count in (("", 1), ("_lanes", lanes)):
            of_rods = {"accelerations": rods, "solve": n}
            for kernel, third in of_rods.items():
                sizes = [
                    n,
                    n + 1,
                    points,
                    rods,
                    third,
                    points,
                    n,
                    dimension,
                    per_rod * n + per_point * (n + 1) + further,
                ]
                function = getattr(library, f"{name}_{kernel}{suffix}")
                for row in zip(*(list(arrays(count * size, rng, 3)) for size in sizes), strict=True):
                    exact = [np.array(a) for a in row]
                    for held, tree in ((0, None), (1, parent)):
                        at = None if tree is None else tree.ctypes.data_as(ctypes.c_void_p)
                        pointers = [ctypes.c_void_p(a.ctypes.data) for a in exact]
                        more = [ctypes.c_int(2)] if kernel == "solve" else []
                        function(ctypes.c_ssize_t(n), at, ctypes.c_int(held), *pointers, *more)
                        calls += 1
    return calls


def inside(names: Sequence[str]) -> None:
    """Test scenes in a process with the sanitizer library preloaded."""
    core = BuildSettings(find_compiler()).core()
    _core.DOUBLE = core
    np.seterr(all="ignore")
    for name in names:
        try:
            print(committed() if name == COMMITTED else scene(name), flush=True)
        except SymgenError as error:
            raise SystemExit(f"{name}: {error}") from None


def outside(names: Sequence[str], processes: int) -> int:
    """Distribute the scenes over processes; return 0 if no sanitizer reports an error."""
    compiler = os.environ.get("CC", "gcc")
    library = subprocess.run(
        [compiler, "-print-file-name=libasan.so"], capture_output=True, text=True, check=True
    )
    with tempfile.TemporaryDirectory() as cache:
        environment = os.environ | {
            "CC": compiler,
            "LD_PRELOAD": library.stdout.strip(),
            "ASAN_OPTIONS": "detect_leaks=0:allocator_may_return_null=1",
            "UBSAN_OPTIONS": "print_stacktrace=1",
            "SYMGEN_CFLAGS": FLAGS,
            "SYMGEN_CACHE": cache,
            "OPENBLAS_NUM_THREADS": "1",
        }
        command = [sys.executable, __file__, "--inside"]
        with ThreadPoolExecutor(processes) as pool:
            parts = [names[k::processes] for k in range(min(processes, len(names)))]
            ended = pool.map(
                lambda part: subprocess.run([*command, *part], env=environment, check=False), parts
            )
            codes = [done.returncode for done in ended]
    print("no sanitizer has anything to report" if not any(codes) else "a sanitizer reports")
    return int(any(codes))


def main() -> int:
    """Test the selected scenes; by default all shipped ones and generated/."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenes", nargs="*", help="names of shipped scenes, or 'generated/'")
    parser.add_argument("--processes", type=int, default=2, help="number of processes (2)")
    parser.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    names = given.scenes or [COMMITTED, *symgen.shipped_scenes()]
    if given.inside:
        inside(names)
        return 0
    return outside(names, given.processes)


if __name__ == "__main__":
    raise SystemExit(main())
