"""What an error report looks at: compiled kernels of a scene or of a building block, and their truth."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError
from symgen.lowering.kernel import Program
from symgen.lowering.program import lower_system
from symgen.lowering.tape import Tape
from symgen.models import BLOCKS
from symgen.models.analyses import elastic_systems
from symgen.models.system import with_redundancy
from symgen.pipeline import build, derive, with_forces
from symgen.precision import FLOAT64, Precision
from symgen.precision import precision as precision_named
from symgen.runtime import _core
from symgen.runtime.elastic_model import ElasticModel
from symgen.runtime.evaluate import Evaluator
from symgen.runtime.library import shipped_module
from symgen.runtime.loop_kernels import LoopKernels
from symgen.runtime.loop_model import LoopModel
from symgen.runtime.model import Model
from symgen.runtime.system_model import SystemModel
from symgen.scene.loading import load_scene, override, read_scene
from symgen.scene.resolve import resolve_linkage
from symgen.study.loop_states import of_loop
from symgen.study.states import At, States, of_beams, of_block, of_linkage
from symgen.symbolic.exact import Exact, number
from symgen.symbolic.system import Export, System

Array = NDArray[np.float64]
#: Kernel and arrays of each group, to what it writes into ``out``.
Call = Callable[[str, Mapping[str, Array]], Array]


@dataclass(eq=False)
class Kernels:
    """Compiled kernels of one System, where they are looked at, and their truth.

    Attributes
    ----------
    prefix
        What comes before the names of its kernels; empty for those of the motion.
    call
        Returns what a compiled kernel writes.
    states
        Where they are looked at.
    redundant
        Constraints that follow from the others: their multipliers are zero, off the constraints nothing is
        solved.
    without
        Kernels that cannot be called by themselves.
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
        """The operations of every kernel that has results, from the parameters on, by name."""
        setup, without = self.program.setup, self.without
        results = (k for k in self.program.kernels if k.out_size and k is not setup)
        return {k.name: Tape(k, setup) for k in results if k.name not in without}

    @cached_property
    def exports(self) -> dict[str, tuple[str, ...]]:
        """The matrices that each kernel writes, those that solve left out."""
        return {e.kernel: e.matrices for e in self.system.exports if e.kernel in self.tapes}

    def of_matrix(self, name: str) -> Kernels:
        """Return the same with one kernel, of this name, that writes one matrix; it cannot be called.

        Raises
        ------
        DerivationError
            When there is no such matrix.
        """
        matrix = self.system[name]
        export = Export(name, matrix.description, (name,))
        system = replace(self.system, exports=(export,), saddle_point=None)
        return Kernels(self.prefix, system, self.call, self.states)

    def exports_at(self, at: At) -> dict[str, tuple[str, ...]]:
        """Return the kernels that mean something in a state, with the matrices that they write."""
        return {k: m for k, m in self.exports.items() if not (at.closed and k in _LEADING)}

    def solves(self, at: At) -> bool:
        """Tell whether the equations of motion can be solved there."""
        return self.system.saddle_point is not None and (at.closed or not self.redundant)


def kernels_of(
    scene: str | os.PathLike[str],
    *,
    set: Mapping[str, Any] | None = None,
    count: int,
    seed: int,
    run: bool,
    precision: str,
) -> tuple[str, list[Kernels]]:
    """Return the title of a scene or of a building block, and all kernels to look at.

    Raises
    ------
    SceneError, ModelError
        When there is no such scene, block or precision, or values are given for a block.
    """
    typed = precision_named(precision)
    if scene in BLOCKS:
        if set or typed != FLOAT64:
            raise ModelError(
                f"{scene} is a building block: it has no values to set, and is in {FLOAT64.name}"
            )
        system = BLOCKS[str(scene)]()
        return system.title, [Kernels("", system, _shipped(str(scene)), of_block(system, count, seed))]
    model = build(scene, set=set, precision=precision)
    if isinstance(model, SystemModel):
        system = derive(scene)
        states = of_block(system, count, seed)
        return system.title, [Kernels("", system, _of_system(model), states, without=("solve",))]
    model = with_forces(model)
    system = derive(override(read_scene(scene), set or {}))
    if isinstance(model, LoopModel):
        own = Kernels("", system, _of_loop(model.kernels), of_loop(model, count, seed, run))
        return system.title, [own if typed == FLOAT64 else _in_type(own, model, typed)]
    rigid = model.rigid if isinstance(model, ElasticModel) else model
    own = _of_linkage(rigid, system, count, seed, run)
    if typed != FLOAT64:
        return system.title, [_in_type(own, rigid, typed)]
    elastic = _of_elastic(scene, set, model, own.states, count, seed) if rigid is not model else ()
    return system.title, [own, *elastic]


#: Kernels that lead a drawing to the start: they read no velocity but the way they are on.
_LEADING = ("assembly",)


def _of_linkage(model: Model, system: System, count: int, seed: int, run: bool) -> Kernels:
    labels = model.description.labels
    redundant = tuple(labels.index(name) for name in model.redundant)
    if redundant:
        system = with_redundancy(system)
    states = of_linkage(model, count, seed, run)
    return Kernels("", system, _of_evaluator(model.evaluator), states, redundant)


def _of_elastic(
    scene: Any, set_: Any, model: Any, states: States, count: int, seed: int
) -> Iterator[Kernels]:
    for kind, made in elastic_systems(resolve_linkage(load_scene(scene, set_))).items():
        yield Kernels(f"{kind}.", made, _of_evaluator(model.rigid.analysis(kind)), states)
    for element in sorted({b.info.element for b in model.beams}):
        name, block = f"element_{element}", _of_element(element)
        yield Kernels(f"{name}.", block, _shipped(name), of_beams(model, element, block, count, seed))


def _in_type(own: Kernels, model: Model | LoopModel, typed: Precision) -> Kernels:
    """Return the same kernels in another number type, at the states that it can hold."""
    names = list(model.parameters)

    def call(kernel: str, arrays: Mapping[str, Array]) -> Array:
        tuned = model.with_parameters(**dict(zip(names, arrays["p"].tolist(), strict=True)))
        size = next(k.work_size for k in model.description.kernels if k.name == kernel)
        rows = (arrays["q"][None, :], arrays["u"][None, :], arrays["work"][None, :size] if size else None)
        found, rest = tuned._evaluate_many(kernel, arrays["t"], *rows)
        wide = [number(x) for block in found.values() for x in block.ravel()]
        low = [number(x) for block in rest.values() for x in block.ravel()] or [0.0] * len(wide)
        whole = [mpmath.fadd(a, b, exact=True) for a, b in zip(wide, low, strict=True)]
        return np.array(whole, dtype=object)

    def held(at: At) -> At:
        kept = {k: a.astype(typed.dtype).astype(float) for k, a in at.arrays.items()}
        return replace(at, arrays=kept)

    states = replace(own.states, all=tuple(held(at) for at in own.states.all))
    return Kernels(own.prefix, own.system, call, states, own.redundant, ("solve",))


def _of_element(element: str) -> System:
    """Return the building block of an element with the kernels that a run calls."""
    block = BLOCKS[f"element_{element}"]()
    return replace(block, exports=tuple(e for e in block.exports if not e.kernel.startswith("global_")))


def _of_evaluator(evaluator: Evaluator) -> Call:
    def call(kernel: str, arrays: Mapping[str, Array]) -> Array:
        own = Evaluator(evaluator.description, evaluator.library, arrays["p"])
        t, q, u = float(arrays["t"][0]), arrays["q"], arrays["u"]
        work = np.zeros(max(own.work_size, len(arrays["work"])) + 1)
        work[: len(arrays["work"])] = arrays["work"]
        if kernel != "solve":
            return own(kernel, t, q, u, work)
        own("factor", t, q, u, work)  # it leaves its factors in work
        out = np.append(arrays["rhs"], 0.0)
        q, u = np.append(q, 0.0), np.append(u, 0.0)
        _core.call(own.library.addresses[kernel], arrays["t"], q, u, own.parameters, work, out)
        return out[:-1]

    return call


def _of_loop(kernels: LoopKernels) -> Call:
    def call(kernel: str, arrays: Mapping[str, Array]) -> Array:
        own = LoopKernels(kernels.description, kernels.library, arrays["p"].tolist())
        found = own(kernel, float(arrays["t"][0]), arrays["q"], arrays["u"], arrays["work"])
        return np.concatenate([block.ravel() for block in found.values()])

    return call


def _of_system(model: SystemModel) -> Call:
    def call(kernel: str, arrays: Mapping[str, Array]) -> Array:
        given: dict[str, Any] = {k: arrays[k] for k in ("q", "u", "p", "work") if k in arrays}
        found = model.evaluate(kernel, t=float(arrays["t"][0]) if "t" in arrays else 0.0, **given)
        return np.concatenate([block.ravel() for block in found.values()])

    return call


def _shipped(name: str) -> Call:
    module = shipped_module(name)

    def call(kernel: str, arrays: Mapping[str, Array]) -> Array:
        found: Array = getattr(module, kernel)(**{k: arrays[k] for k in ("q", "u", "p") if k in arrays})
        return found

    return call
