"""A compiled rotor, and its modes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from symgen.calls import checked
from symgen.errors import ModelError
from symgen.runtime import _core
from symgen.runtime.arrays import Array
from symgen.runtime.beams.modal.structure import UnstableError, modes_at_rest
from symgen.runtime.kernels.description import BlockInfo
from symgen.runtime.kernels.evaluate import as_taken, part
from symgen.runtime.model.model import Model
from symgen.runtime.result.modes import RotorModes, relative
from symgen.runtime.rotor.description import RotorDescription
from symgen.runtime.rotor.structure import RotorStructure, parts, structure

#: Unknowns up to which frequencies are compared with those of halved elements.
_REFINED = 400
_EPS = float(np.finfo(float).eps)
#: Rotation [rad] of the steady deflection above which a note is given.
_ROTATED = 0.01
#: Part of a frequency that round-off may change, above which a note is given.
_ROUND_OFF = 1e-3


@checked
class RotorModel(Model):
    """Elastic links in space that rotate as a whole at constant speed.

    Made by :func:`symgen.build`.
    """

    description: RotorDescription
    MISSING: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("", "batch"), "it is a rotor, whose modes alone are found"
    )

    def __repr__(self) -> str:
        return f"<RotorModel {self.name!r}: {self.description.extent}, {self.backend} backend>"

    def _numbers(self) -> dict[str, Array]:
        """Return the numbers of links, masses and axis by name."""
        d = self.description
        info = d.kernels[[k.name for k in d.kernels].index("rotor")]
        parameters = as_taken(self._library, self.parameter_values)
        out = _core.evaluate(
            self._library.addresses["rotor"],
            (*d.sizes, info.work_size, info.out_size),
            0.0,
            np.zeros(0),
            np.zeros(0),
            parameters,
            None,
        )
        blocks = {b.name: part(out, b) for b in info.blocks}
        links = next(b for b in info.blocks if b.name == "links")
        _refuse(self.name, links, blocks["links"].reshape(links.shape))
        if not all(np.all(np.isfinite(x)) for x in blocks.values()):
            raise ModelError(f"{self.name}: a number of the scene is not finite at these parameters")
        return {"masses": np.zeros(0), **blocks}

    def _modes(self) -> RotorModes:
        self._refuse_types("modes of rotors are")
        numbers = self._numbers()
        assembled = structure(self.description, numbers)
        speed = float(numbers["rotation"].ravel()[3])
        frequencies, shapes, noise = _modes_of(self.name, assembled, speed)
        lost = noise > _ROUND_OFF
        errors = np.zeros(0)
        if len(frequencies) <= _REFINED:
            halved = structure(self.description, numbers, divided=2)
            finer, _, noise = (x[..., : len(lost)] for x in _modes_of(self.name, halved, speed))
            errors = np.where(lost | (noise > _ROUND_OFF), np.inf, relative(frequencies, finer))
        notes = []
        if assembled.rotation > _ROTATED:
            notes.append(
                f"the rotation bends or twists links by {assembled.rotation:.3g} rad; frequencies are those "
                "about "
                "the drawn shape"
            )
        if np.any(lost):
            notes.append(
                f"frequencies of the modes {', '.join(str(k + 1) for k in np.flatnonzero(lost))} are not "
                "accurate: round-off of the stiffness of links may change them by more than "
                f"{_ROUND_OFF:.1%}; a higher speed or fewer elements lessen it"
            )
        return RotorModes(
            self.name,
            speed,
            frequencies,
            shapes,
            assembled.names,
            parts(assembled, shapes),
            errors,
            tuple(notes),
        )


def _refuse(name: str, links: BlockInfo, values: Array) -> None:
    """Raise ModelError for sections of links that are not physical at the tunable parameters."""
    places = [f"links.{row}, {q}" for row in links.rows for q in links.columns[9:]]
    for place, value in zip(places, values[:, 9:].ravel().tolist(), strict=True):
        if not value > 0.0:
            raise ModelError(
                f"{name}: {place}: expected a value above zero, got {value:g} at these parameters\n"
                "  Give with_parameters other values."
            )


def _modes_of(name: str, assembled: RotorStructure, speed: float) -> tuple[Array, NDArray[Any], Array]:
    """Return frequencies [Hz] by rising size and complex shapes (n, modes) of M s'' + C s' + K s = 0.

    In the modes of M and K, of squared frequencies w^2, the state (w q, q') has a skew-symmetric matrix, so
    that its eigenvalues are imaginary to the last digit. Null vectors of K are the shapes of zero
    frequencies, which gyroscopic terms between two of them make fewer by one.

    The third result is the part of each frequency that round-off of the terms of K may change, by the strain
    energy of its shape. Of zero frequencies it is a part of ``speed``, with which a stiffness that round-off
    hides would grow; at rest there is none.

    Raises
    ------
    ModelError
        Where K is not positive: above the first critical speed, or where a free link twists out of its place.
    """
    try:
        speeds, modes, rigid = modes_at_rest(name, assembled.mass, assembled.stiffness, assembled.sizes)
    except UnstableError:
        if speed == 0.0:
            raise ModelError(f"{name}: the stiffness matrix of the frame at rest is not positive") from None
        raise ModelError(
            f"{name}: the stiffness under rotation at {speed:g} rad/s is not positive definite\n"
            "  Either it rotates above its first critical speed, where rotation takes more stiffness than\n"
            "  links have: give a lower speed, or stiffer links. Or a joint lets a link leave its place at\n"
            "  any speed, as the rotation twists a blade on a ball joint until its width is in the plane of\n"
            "  rotation: weld the link, or draw its width in that plane."
        ) from None
    n = len(speeds)
    gyroscopic = modes.T @ assembled.gyroscopic @ modes
    skew = np.block(
        [[np.zeros((n, n)), np.diag(speeds)], [-np.diag(speeds), (gyroscopic.T - gyroscopic) / 2]]
    )
    values, vectors = np.linalg.eigh(1j * skew)
    squares, shapes = np.maximum(values[n:], 0.0), modes @ vectors[n:, n:]
    turned = np.linalg.svd(gyroscopic[:rigid, :rigid], compute_uv=False)
    still = rigid - (np.count_nonzero(turned > n * _EPS * np.max(np.abs(gyroscopic))) + 1) // 2
    squares[:still], shapes[:, :still] = 0.0, modes[:, :still]
    energies = _EPS * np.sum((assembled.sizes[:, None] * np.abs(shapes)) ** 2, axis=0)
    scale = np.where(np.arange(n) < still, abs(speed), squares) ** 2
    noise = np.divide(energies, scale, out=np.full(n, 0.0 if speed == 0.0 else np.inf), where=scale > 0.0)
    largest = shapes[np.argmax(np.abs(shapes), axis=0), np.arange(n)]
    shapes = np.divide(shapes, largest, out=np.zeros_like(shapes), where=np.abs(largest) > 0.0)
    return squares / (2 * math.pi), shapes, noise
