"""Compiled kernels of a scene or building block, with their states and reference values."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, cast

import mpmath
import numpy as np
from numpy.typing import NDArray

from symgen.codegen.emit import emit, equations_hash
from symgen.codegen.target import Target
from symgen.errors import ModelError
from symgen.lowering.kernel import Program
from symgen.lowering.program import lower_system
from symgen.lowering.tape import Tape
from symgen.methods import method_of
from symgen.models import BLOCKS, SHIPPED_BLOCKS, element
from symgen.models.analyses import elastic_systems
from symgen.pipeline.build import build, with_forces
from symgen.pipeline.systems import derive
from symgen.precision import FLOAT64, Precision
from symgen.precision import precision as precision_named
from symgen.runtime import _core
from symgen.runtime.beams import elements
from symgen.runtime.elastic.model import ElasticModel
from symgen.runtime.elastic.space.model import SpatialModel
from symgen.runtime.kernels.batch import Batch
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.kernels.library import shipped_module
from symgen.runtime.loop.kernels import LoopKernels
from symgen.runtime.loop.model import LoopModel
from symgen.runtime.model.system import SystemModel
from symgen.runtime.rods.model.rods import RodModel
from symgen.scene.loading import load_scene, override, read_scene
from symgen.scene.resolve import resolve_linkage
from symgen.study.accuracy.loop_states import of_loop
from symgen.study.accuracy.states import At, States, of_beams, of_block, of_linkage
from symgen.symbolic.exact import Exact, number
from symgen.symbolic.system import System

Array = NDArray[np.float64]
#: Outputs by kernel and argument arrays.
Call = Callable[[str, Mapping[str, Array]], Array]


@dataclass(eq=False)
class ComparedKernels:
    """Compiled kernels of one System, with states and reference values.

    Attributes
    ----------
    prefix
        Prefix of the kernel names; empty for the equations of motion.
    call
        Function that evaluates a compiled kernel.
    states
        States at which the kernels are compared.
    redundant
        Redundant constraints: their multipliers are zero, and nothing is solved off the constraints.
    without
        Kernels that cannot be called separately.
    """

    prefix: str
    system: System
    call: Call
    states: States
    redundant: tuple[int, ...] = ()
    without: tuple[str, ...] = ()

    @cached_property
    def exact(self) -> Exact:
        """The original matrices."""
        return Exact(self.system)

    @cached_property
    def program(self) -> Program:
        """The straight-line programs."""
        return lower_system(self.system)

    @cached_property
    def tapes(self) -> dict[str, Tape]:
        """Operations of every kernel with results, starting from the parameters, by name."""
        setup, without = self.program.setup, self.without
        results = (k for k in self.program.kernels if k.out_size and k is not setup)
        fixed = {f"p[{self.program.tolerance_place}]": self.program.rank_tolerance}
        return {k.name: Tape(k, setup, fixed) for k in results if k.name not in without}

    @cached_property
    def exports(self) -> dict[str, tuple[str, ...]]:
        """The matrices written by each kernel, except for 'solve'."""
        return {e.kernel: e.matrices for e in self.system.exports if e.kernel in self.tapes}

    def exports_at(self, at: At) -> dict[str, tuple[str, ...]]:
        """Return the kernels that are meaningful at a state, with the matrices that they write."""
        return {k: m for k, m in self.exports.items() if not (at.closed and k in _LEADING)}

    def solves(self, at: At) -> bool:
        """Return whether the equations of motion can be solved at a state."""
        return self.system.saddle_point is not None and (at.closed or not self.redundant)


def kernels_of(
    scene: str | os.PathLike[str],
    *,
    set: Mapping[str, Any] | None = None,
    count: int,
    seed: int,
    run: bool,
    precision: str,
) -> tuple[str, list[ComparedKernels]]:
    """Return the title of a scene or building block, and all kernels to compare.

    Raises
    ------
    SceneError, ModelError
        If there is no such scene, block or precision, or values are given for a block.
    """
    typed = precision_named(precision)
    if scene in BLOCKS:
        if set or typed != FLOAT64:
            raise ModelError(
                f"{scene} is a building block: it has no values to set, and is computed in {FLOAT64.name}"
            )
        system = BLOCKS[str(scene)]()
        call = _of_module(shipped_module(str(scene))) if scene in SHIPPED_BLOCKS else _in_numpy(system)
        return system.title, [ComparedKernels("", system, call, of_block(system, count, seed))]
    model = build(scene, set=set, precision=precision)
    method = method_of(model)
    if method.claims:  # a scene; those of users have no tables
        model, system = with_forces(cast("Any", model)), derive(override(read_scene(scene), set or {}))
    else:
        system = derive(scene)
    kernels: list[ComparedKernels] = method.load("accuracy")(
        model, KernelComparison(scene, set, system, typed, count, seed, run)
    )
    return system.title, kernels


@dataclass(frozen=True, slots=True)
class KernelComparison:
    """The System whose kernels are compared, the number type, and the states: see :func:`kernels_of`."""

    scene: Any
    set: Mapping[str, Any] | None
    system: System
    typed: Precision
    count: int
    seed: int
    run: bool


def of_user_system(model: SystemModel, request: KernelComparison) -> list[ComparedKernels]:
    """Return the kernels of a user-defined system."""
    states = of_block(request.system, request.count, request.seed)
    return [ComparedKernels("", request.system, _of_system(model), states, without=("solve",))]


def of_loop_model(model: LoopModel, request: KernelComparison) -> list[ComparedKernels]:
    """Return the kernels of a loop in the requested type."""
    states = of_loop(model, request.count, request.seed, request.run)
    kernels = ComparedKernels("", request.system, _of_loop(model.kernels), states)
    return [kernels if request.typed == FLOAT64 else _in_type(kernels, model, request.typed)]


def of_rods(model: RodModel, request: KernelComparison) -> list[ComparedKernels]:
    """Return the kernels of the equations of motion of a linkage in the requested type."""
    labels, system = model.description.labels, request.system
    redundant = tuple(labels.index(name) for name in model.redundant)
    if system.saddle_point:
        tolerance = repr(model.description.rank_tolerance)
        system = replace(system, saddle_point=replace(system.saddle_point, rank_tolerance=tolerance))
    states = of_linkage(model, request.count, request.seed, request.run)
    kernels = ComparedKernels("", system, _of_evaluator(model.evaluator), states, redundant)
    return [kernels if request.typed == FLOAT64 else _in_type(kernels, model, request.typed)]


def of_spatial(model: ElasticModel | SpatialModel, request: KernelComparison) -> list[ComparedKernels]:
    """Return the kernels of the rigid motion, and in double precision those of its rigid parts."""
    (of_motion,) = kernels = of_rods(model.rigid, request)
    if request.typed == FLOAT64:
        for kind, system in elastic_systems(resolve_linkage(load_scene(request.scene, request.set))).items():
            kernels.append(
                ComparedKernels(
                    f"{kind}.", system, _of_evaluator(model.rigid.analysis(kind)), of_motion.states
                )
            )
    return kernels


def of_elastic(model: ElasticModel, request: KernelComparison) -> list[ComparedKernels]:
    """Return the kernels of the rigid motion, and in double precision those of elastic links."""
    kernels = of_spatial(model, request)
    if request.typed != FLOAT64:
        return kernels
    for name, block in sorted({(b.info.element, b.info.block) for b in model.beams}):
        system, call = element(name), _of_module(elements.kernels(block))
        states = of_beams(model, name, system, request.count, request.seed)
        kernels.append(ComparedKernels(f"element_{name}.", system, call, states))
    return kernels


#: Kernels of the initial assembly: their velocity argument holds the position along the path.
_LEADING = ("assembly",)


def _in_type(kernels: ComparedKernels, model: RodModel | LoopModel, typed: Precision) -> ComparedKernels:
    """Return the same kernels in another number type, with the states that it can represent."""
    if model.number_type is None:
        raise ModelError(f"{model.name} has no kernels for batches: build it with symgen.build")
    types = model.number_type

    def call(kernel: str, arrays: Mapping[str, Array]) -> Array:
        tuned = Batch(model.description, types, arrays["p"].tolist())
        size = next(k.work_size for k in model.description.kernels if k.name == kernel)
        rows = (arrays["q"][None, :], arrays["u"][None, :], arrays["work"][None, :size] if size else None)
        result, rest = tuned(kernel, arrays["t"], *rows, 1)
        wide = [number(x) for block in result.values() for x in block.ravel()]
        low = [number(x) for block in rest.values() for x in block.ravel()] or [0.0] * len(wide)
        whole = [mpmath.fadd(a, b, exact=True) for a, b in zip(wide, low, strict=True)]
        return np.array(whole, dtype=object)

    def in_precision(at: At) -> At:
        rounded = {k: a.astype(typed.dtype).astype(float) for k, a in at.arrays.items()}
        return replace(at, arrays=rounded)

    states = replace(kernels.states, all=tuple(in_precision(at) for at in kernels.states.all))
    return ComparedKernels(kernels.prefix, kernels.system, call, states, kernels.redundant, ("solve",))


def _of_evaluator(evaluator: Evaluator) -> Call:
    def call(kernel: str, arrays: Mapping[str, Array]) -> Array:
        variant = Evaluator(evaluator.description, evaluator.library, arrays["p"])
        t, q, u = float(arrays["t"][0]), arrays["q"], arrays["u"]
        work = np.zeros(max(variant.work_size, len(arrays["work"])) + 1)
        work[: len(arrays["work"])] = arrays["work"]
        if kernel != "solve":
            return variant(kernel, t, q, u, work)
        variant("factor", t, q, u, work)  # stores its factors in work
        out = np.append(arrays["rhs"], 0.0)
        q, u = np.append(q, 0.0), np.append(u, 0.0)
        address, sizes = variant.library.addresses[kernel], variant.description.sizes_of(kernel)
        _core.call(address, sizes, arrays["t"], q, u, variant.parameters, work, out)
        return out[:-1]

    return call


def _of_loop(kernels: LoopKernels) -> Call:
    def call(kernel: str, arrays: Mapping[str, Array]) -> Array:
        variant = LoopKernels(kernels.description, kernels.library, arrays["p"].tolist())
        result = variant(kernel, float(arrays["t"][0]), arrays["q"], arrays["u"], arrays["work"])
        return np.concatenate([block.ravel() for block in result.values()])

    return call


def _of_system(model: SystemModel) -> Call:
    def call(kernel: str, arrays: Mapping[str, Array]) -> Array:
        known: dict[str, Any] = {k: arrays[k] for k in ("q", "u", "p", "work") if k in arrays}
        result = model.evaluate(kernel, t=float(arrays["t"][0]) if "t" in arrays else 0.0, **known)
        return np.concatenate([block.ravel() for block in result.values()])

    return call


def _in_numpy(block: System) -> Call:
    """Return the kernels of a building block that is not compiled, as NumPy code."""
    program = lower_system(block)
    (source,) = emit(program, Target("numpy"), equations_hash(program, Target()))
    functions: dict[str, Any] = {}
    exec(compile(source.text, source.name, "exec"), functions)  # noqa: S102 - our own code
    sizes = {k.name: k.out_size for k in program.kernels}

    def call(kernel: str, arrays: Mapping[str, Array]) -> Array:
        result = np.zeros(sizes[kernel])
        work = arrays["work"].copy() if "work" in arrays else None
        functions[kernel](None, *(arrays.get(k) for k in ("q", "u", "p")), work, result)
        return result

    return call


def _of_module(module: Any) -> Call:
    def call(kernel: str, arrays: Mapping[str, Array]) -> Array:
        known = {k: arrays[k] for k in ("q", "u", "p") if k in arrays}
        known |= {"work": arrays["work"].copy()} if "work" in arrays else {}  # kernels may write to it
        return getattr(module, kernel)(**known)

    return call
