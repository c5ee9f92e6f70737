"""Mobility of a closed loop: idle freedoms, inputs that cannot be followed, reasons of open loops."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symgen.errors import InitialStateError
from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.closure.assemblies import Closing, ClosureSearch
from symgen.runtime.loop.kernels import LoopKernels, in_words

#: Part of the largest component by which a variable takes part in a motion.
_PART = 1e-6
#: How far an idle freedom is moved to verify it [rad, or sizes of the loop].
_AWAY = 0.1
#: Part of the largest singular value below which a loop at the end of its reach has lost rank.
_WEAK = 1e-3
#: Defect of closure that an assembly tolerance may cover.
_TOLERABLE = 1e-3


def scaled_screws(kernels: LoopKernels, t: float, q: Array) -> Array:
    """Return the screws of all variables, shape (6, n), made dimensionless by the size of the loop."""
    screws: Array = kernels("position", t, q, np.zeros_like(q))["closure_jacobian"].copy()
    screws[3:] /= kernels.description.size
    return screws * kernels.scale


def not_determined(kernels: LoopKernels, t: float, q: Array, rank: int) -> InitialStateError:
    """Return the error of a closed pose whose dependent variables are not all determined by closure."""
    d = kernels.description
    solved, where = d.having("dependent"), kernels.value_at(t)
    counts = f"the screws of the {len(solved)} dependent variables have rank {rank}"
    away, one = _moved(kernels, t, q, rank), len(solved) - rank == 1
    several = "freedom" if one else "freedoms"
    moving, links = _moving(kernels, t, rank, [q] if away is None else [q, away])
    rows = "; ".join(d.row(j) for j in moving)
    if away is None:
        problem = (
            f"at {where} the loop is at a dead centre, with {len(solved) - rank} instantaneous {several} "
            f"neither prescribed nor free ({counts})"
        )
        hint = f"The closure does not determine {rows}. Begin at another value of the input."
    else:
        inputs = " and ".join(d.variables[j].name for j in d.having("input", "free"))
        problem = (
            f"at {where} the loop closes, but has {'an' if one else len(solved) - rank} idle {several}, "
            f"neither prescribed nor free: with {inputs} held, {', '.join(links) or 'no link'} can still "
            "move "
            f"({counts})"
        )
        hint = (
            f"The variables that move are {rows}. Make {'one' if one else len(solved) - rank} of them "
            f"{'an input or a free variable' if one else 'inputs or free variables'}, or take joints with "
            "fewer freedoms."
        )
    return InitialStateError(f"{problem}\n  {hint}", where="loop.rows")


def _basis(kernels: LoopKernels, t: float, q: Array, rank: int) -> Array:
    """Return the motions of the dependent variables that closure allows, scaled, one in each row."""
    screws = scaled_screws(kernels, t, q)[:, kernels.description.having("dependent")]
    return np.linalg.svd(screws)[2][rank:]


def _moved(kernels: LoopKernels, t: float, q: Array, rank: int) -> Array | None:
    """Return a closure at a distance, along a motion that the screws allow; None if there is none."""
    d = kernels.description
    solved = d.having("dependent")
    scale = kernels.scale[solved]
    close, basis = Closing(kernels, t), _basis(kernels, t, q, rank)
    for motion in (np.sum(basis, axis=0), *basis, *-basis):
        start = q.copy()
        start[solved] += _AWAY * scale * motion / np.max(np.abs(motion))
        other = close(start)
        if other is not None and np.max(np.abs(other - q)[solved] / scale) > 0.5 * _AWAY:
            return other
    return None


def _moving(kernels: LoopKernels, t: float, rank: int, poses: Sequence[Array]) -> tuple[list[int], list[str]]:
    """Return the numbers of the dependent variables and the links that idle freedoms move at these poses."""
    d = kernels.description
    solved = d.having("dependent")
    twists, parts = np.zeros(len(d.links)), np.zeros(len(solved))
    for q in poses:
        screws, basis = scaled_screws(kernels, t, q), _basis(kernels, t, q, rank)
        twist = np.zeros((len(d.links), 6, len(basis)))
        for k, j in enumerate(solved):
            twist[d.variables[j].row :] += np.multiply.outer(screws[:, j], basis[:, k])
        twists = np.maximum(twists, np.max(np.abs(twist), axis=(1, 2)))
        parts = np.maximum(parts, np.max(np.abs(basis), axis=0))
    links = [link for link, size in zip(d.links[:-1], twists, strict=False) if size > _PART]
    return [j for j, part in zip(solved, parts, strict=True) if part > _PART], links


def not_followed(kernels: LoopKernels, t: float, q: Array, tolerance: float) -> InitialStateError | None:
    """Return the error of the first input or free variable that closure does not let move; None if all can.

    Each is judged together with those before it, which are prescribed, the one that leads first; those after
    it are left to follow.
    """
    d = kernels.description
    prescribed, solved = _prescribed(kernels), d.having("dependent")
    screws = scaled_screws(kernels, t, q)
    columns = screws / np.maximum(np.linalg.norm(screws, axis=0), 1e-300)
    for k, j in enumerate(prescribed):
        others = columns[:, [*solved, *prescribed[k + 1 :]]]
        left = columns[:, j] - others @ np.linalg.lstsq(others, columns[:, j], rcond=tolerance / 10)[0]
        if np.linalg.norm(left) > tolerance:
            return _over_driven(kernels, t, q, prescribed[: k + 1])
    return None


def _prescribed(kernels: LoopKernels) -> list[int]:
    """Return the numbers of inputs and free variables, the leading input first."""
    d = kernels.description
    lead = [i for i in kernels.inputs if d.variables[i].name == d.lead]
    return [*lead, *(i for i in kernels.inputs if i not in lead), *d.having("free")]


def _over_driven(kernels: LoopKernels, t: float, q: Array, prescribed: list[int]) -> InitialStateError:
    d = kernels.description
    *before, j = prescribed
    solved = d.having("dependent")
    rank = np.linalg.matrix_rank(scaled_screws(kernels, t, q)[:, solved], tol=1e-8)
    others = f" together with {' and '.join(d.variables[i].name for i in before)}" if before else ""
    return InitialStateError(
        f"at {kernels.value_at(t)} the loop closes, but cannot follow {d.row(j)}{others}: its screw is "
        f"independent of those of the {len(solved)} dependent variables, which have rank {rank}\n"
        "  The table has too few variables, or too many inputs. A ball has three angles, a constant "
        "one is allowed only in one of the two rows of a ball-ball link.",
        where="loop.rows",
    )


def open_loop(kernels: LoopKernels, t: float, result: ClosureSearch) -> InitialStateError:
    """Return the error of a loop that does not close: its defect, the row, the closest pose, a remedy."""
    d = kernels.description
    solved = d.having("dependent")
    at = f"the loop {' '.join(d.joints)} cannot be assembled at {kernels.value_at(t)}"
    if result.closest is None:
        hint = "Check the expressions of its rows and inputs."
        return InitialStateError(f"{at}: its table has no finite value\n  {hint}", where="loop.rows")
    nearest = result.closest
    screws = scaled_screws(kernels, t, nearest)[:, solved]
    _, values, right = np.linalg.svd(screws)
    rank = int(np.count_nonzero(values > _WEAK * values.max(initial=1e-300)))
    weakest = d.row(solved[int(np.argmax(np.abs(right[-1])))])
    pose = ", ".join(_value(kernels, j, nearest[j]) for j in solved)
    few = len(solved) < 6
    hints = [f"The closest pose is {pose}."]
    if few and result.defect < _TOLERABLE:
        tolerance = f"{1.1 * result.defect * d.size:.2g} m"
        hints.append(f'An error of manufacture is tolerated by analysis.assembly_tolerance = "{tolerance}".')
    else:
        hints += _released(kernels, t, nearest)
    hints.append(_TOO_FEW if few else "Change a length or an angle of the table, or the value of the input.")
    return InitialStateError(
        f"{at}: the best of many starts leaves it open by {result.defect:.2g} (rotation in radians, "
        f"displacement over {d.size:.4g} m), where the screws of its {len(solved)} dependent variables have "
        f"rank {rank} and {weakest} holds the loop least\n  {' '.join(hints)}",
        where="loop.rows",
    )


def _released(kernels: LoopKernels, t: float, q: Array) -> list[str]:
    """Return in words with which input left to follow the loop closes, and where; the leading one last."""
    d = kernels.description
    solved, prescribed = d.having("dependent"), kernels.prescribed(t)[:, 0]
    for j in reversed([i for i in _prescribed(kernels) if i in kernels.inputs]):
        whole = np.append(q, 0.0)
        if kernels.equations([*solved, j], min(len(solved) + 1, 6)).assemble(t, whole)[0] != _core.DONE:
            continue
        value = _value(kernels, j, prescribed[kernels.inputs.index(j)]).partition(" = ")[2]
        others = " and ".join(d.variables[i].name for i in kernels.inputs if i != j)
        beside = f" together with {others}" if others else ""
        return [f"It closes at {_value(kernels, j, whole[j])}: {d.row(j)} cannot be {value}{beside}."]
    return []


def _value(kernels: LoopKernels, j: int, value: float) -> str:
    v = kernels.description.variables[j]
    return f"{v.name} = {in_words(float(value), v.is_length, kernels.description)}"


_TOO_FEW = (
    "Fewer than 6 dependent variables close a loop only where lengths and twists meet a condition of their "
    "own: check the table, or the value of the input."
)
