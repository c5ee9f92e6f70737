"""Template data of an export, and conversion of Python numbers to C."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from symgen.codegen.emit import SourceFile
from symgen.lowering.kernel import Slot
from symgen.runtime import _core
from symgen.runtime.integrate.integrators import INTEGRATORS
from symgen.runtime.integrate.integrators.method import Integrator

#: Latest end [s] of the run that is compared with the stored results.
COMPARED = 1.0
#: Allowed deviation with other compiler flags or another library, relative to the largest entry of an array.
TOLERANCE = "1e-6"
#: Relative tolerance of the comparison run and of the example.
RTOL = 1e-9
#: Absolute tolerance of both [m, m/s].
ATOL = 1e-12

#: Folder with the files of the core.
CORE_FOLDER = Path(__file__).resolve().parent.parent / "runtime" / "core"

#: The methods of ``NAME_run``, the default first.
RUN_METHODS = ("dop853", "taylor")

#: The templates of the export of a scene, and the file names that they produce from its name.
TEMPLATES = (
    ("model.h.j2", "{}.h"),
    ("model.c.j2", "{}.c"),
    ("main.c.j2", "main.c"),
    ("check.c.j2", "check.c"),
    ("CMakeLists.txt.j2", "CMakeLists.txt"),
    ("README.md.j2", "README.md"),
)
_WIDE = 110
_INCLUDED = re.compile(r'^#include "(\w+\.h)"$', re.MULTILINE)


@dataclass(frozen=True, slots=True)
class ConstantArray:
    """A constant array: type, name, and values in braces."""

    type: str
    name: str
    values: str


@dataclass(frozen=True, slots=True)
class ConstantStruct:
    """A constant struct: type, name, and members with values."""

    type: str
    name: str
    members: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class Exported:
    """A model in the form used by the export templates.

    Parameters
    ----------
    name, title, equations, references
        Of the scene and its derivation.
    method
        The method of its runs.
    family
        ``rods``, ``loop`` or ``elastic``, the kind of run; or ``system``, which has none.
    templates
        The templates of the export, and the file names that they produce from its name.
    driven
        Whether the motion follows from prescribed inputs alone.
    core, core_headers
        Source files of the core that the model needs, and the headers that the model includes directly.
    kernels
        The generated kernels.
    coordinates
        Number of coordinates: half of a state, or the whole state of a driven loop.
    state, parameters, outputs
        Descriptions of the entries.
    start, t_start, t_end, defaults
        Values in C syntax.
    tables, records
        Constant data for the core.
    expected
        Reference values for the test of the export.
    notes
        Remarks on this scene for the README.
    specific
        Further data of the template of the family.
    source
        The scene on the command line: its file's name, or that of a shipped scene.
    """

    name: str
    title: str
    equations: str
    references: tuple[str, ...]
    family: str
    core: tuple[str, ...]
    kernels: tuple[SourceFile, ...]
    tables: tuple[ConstantArray, ...]
    expected: tuple[ConstantArray, ...]
    method: Integrator = INTEGRATORS["dop853"]
    core_headers: tuple[str, ...] = ()
    coordinates: int = 0
    state: tuple[Slot, ...] = ()
    start: str = ""
    t_end: str = ""
    records: tuple[ConstantStruct, ...] = ()
    templates: tuple[tuple[str, str], ...] = TEMPLATES
    kernel_names: tuple[str, ...] = ()
    derived: int = 0
    driven: bool = False
    parameters: tuple[Slot, ...] = ()
    outputs: tuple[Slot, ...] = ()
    t_start: str = "0.0"
    defaults: str = ""
    notes: tuple[str, ...] = ()
    events: int = 0
    found: int = 0
    parts: int = 0
    until: str = ""
    specific: Mapping[str, Any] = field(default_factory=dict)
    compares_outputs: bool = False
    tolerance: str = TOLERANCE
    source: str = ""

    @property
    def headers(self) -> tuple[str, ...]:
        """Headers of the kernels."""
        return tuple(f.name for f in self.kernels if f.name.endswith(".h"))

    @property
    def setups(self) -> tuple[str, ...]:
        """Kernels called once per run to evaluate quantities that depend on parameters only."""
        return tuple(
            f"{name}_setup"
            for f in self.kernels
            for name in (f.name.removesuffix("_kernel.h"),)
            if f.name.endswith("_kernel.h") and f"void {name}_setup(" in f.text
        )

    @property
    def sources(self) -> tuple[str, ...]:
        """All files to compile, except those with a ``main``."""
        kernels = [f.name for f in self.kernels if f.name.endswith(".c")]
        if not self.core:
            return tuple(kernels)
        return (f"{self.name}.c", *kernels, *(f"core/{name}" for name in self.core if name.endswith(".c")))

    @property
    def ended(self) -> int:
        """Status of a run that ended at an event."""
        return int(_core.ENDED)


def with_headers(sources: Iterable[str]) -> tuple[str, ...]:
    """Return these files of the core and the headers that they include, sorted by name."""
    files: set[str] = set()
    names = {*sources}
    while names:
        files |= names
        texts = [(CORE_FOLDER / name).read_text(encoding="utf-8") for name in sorted(names)]
        names = {name for text in texts for name in _INCLUDED.findall(text)} - files
    return tuple(sorted(files))


def number(value: float) -> str:
    """Return a double in C with enough digits to reproduce it exactly."""
    value = float(value)
    if np.isnan(value):
        return "NAN"
    return repr(value) if np.isfinite(value) else "INFINITY" if value > 0 else "-INFINITY"


def braces(values: Iterable[Any], spare: int = 0) -> str:
    """Return an initialiser of numbers followed by ``spare`` zeros; a single zero if there are none."""
    flat = np.ravel(np.asarray([*values]))
    whole = flat.dtype.kind in "iub"
    texts = [str(int(x)) if whole else number(x) for x in flat] + ["0"] * spare
    text = ", ".join(texts or ["0"])
    if len(text) < _WIDE:
        return f"{{{text}}}"
    return "{\n" + textwrap.fill(text, _WIDE, initial_indent="    ", subsequent_indent="    ") + "\n}"


def doubles(name: str, values: Iterable[Any]) -> ConstantArray:
    """Return a table of doubles."""
    return ConstantArray("double", name, braces(np.asarray([*values], dtype=float).ravel()))


def indices(name: str, values: Iterable[Any]) -> ConstantArray:
    """Return a table of indices."""
    return ConstantArray("ptrdiff_t", name, braces(np.asarray([*values], dtype=np.intp).ravel()))


def members(**values: Any) -> tuple[tuple[str, str], ...]:
    """Return the members of a struct; numbers are converted to C, text is copied."""
    fields = []
    for name, value in values.items():
        text = value if isinstance(value, str) else number(value) if isinstance(value, float) else str(value)
        fields.append((name, text))
    return tuple(fields)


def functions(prefix: str, known: Iterable[str], there: Iterable[str]) -> dict[str, str]:
    """Return the members of a kernel struct that the model provides, with the function names."""
    defined = set(there)
    return {name: f"{prefix}_{name}" for name in known if name in defined}


def method_tables(method: Integrator = INTEGRATORS["dop853"]) -> tuple[ConstantArray, ConstantArray]:
    """Return the coefficients of an integration method in the layout of the core."""
    (counts, numbers), name = _core.scheme_of(method), method.name.upper()
    return ConstantArray("long", f"{name}_COUNTS", braces(counts)), doubles(f"{name}_NUMBERS", numbers)
