"""Compiles what ``generated/manifest.json`` lists, and the runtime core with its declarations for Cython."""

import ast
import json
import os
import re
from hashlib import sha256
from pathlib import Path
from textwrap import dedent, indent

from Cython.Build import cythonize
from setuptools import Extension, find_packages, setup
from setuptools.command.build_ext import build_ext
from setuptools.command.editable_wheel import editable_wheel

MODELS = json.loads(Path("generated/manifest.json").read_text(encoding="utf-8"))["models"]


def flags(optimisation, *further):
    """Return the compiler flags: no contraction, so that all processors give the same bits."""
    if os.name == "nt":
        return []
    return [
        f"-O{optimisation}",
        "-g0",  # Python's own flags ask for debugging symbols, a third of the time of compilation
        "-std=c11",
        "-ffp-contract=off",
        "-Werror=implicit-function-declaration",
        *further,
    ]


# What Cython's arrays need, compiled once instead of into each module: most of what there is to compile.
SHARED = "symgen._cython"
CORE = Path("symgen/runtime/core")

# What Cython writes in C, and how much it is optimised: it holds no loops, and full optimisation takes
# several times as long. Calls of models from Python are checks of their arguments.
WRITTEN = "build/cython"
LIGHTLY = {f"{WRITTEN}/symgen/": 1, f"{WRITTEN}/generated/": "g"}

# Headers of the core with what bindings use; a structure stands before those that contain it.
HEADERS = (
    "equations run envelope system kinematics qr balls loop loops loop_lanes lane_runs start "
    "variations elastic_columns rigid_motion beams elastic lane_functions core"
)
# What a header declares: structures with and without their members, whole numbers, other numbers, and texts.
INTERFACE = re.compile(
    r"^struct (?P<name>\w+) \{\n(?P<members>.*?)^\};|^struct (?P<hidden>\w+);"
    r"|^enum ?\w* \{(?P<values>.*?)\};|^#define (?P<whole>\w+) \d+L$"
    r"|^#define (?P<number>\w+) \d+e-?\d+$|^#define (?P<text>\w+_NAMES)",
    re.MULTILINE | re.DOTALL,
)
# Names in Cython of numbers and functions of the core, and types besides its structures.
NUMBERS = {"real": "double", "wide": "double", "kernel": "kernel_t"}
NUMBERS |= {"ptrdiff_t": "Py_ssize_t", "mask": "Py_ssize_t"}
PLAIN = {*NUMBERS.values(), "long", "int", "size_t", "void", "char", "unsigned char", "signed char"}
KERNEL = "void (*kernel_t)(" + 4 * "const double *, " + "double *, double *) noexcept nogil"

# Types for Python of numbers in C, and of arrays of them.
TYPES = {"double": "float", "bint": "bool", "long": "int", "Py_ssize_t": "int", "uintptr_t": "int"}
ARRAYS = {"double": "Array", "Py_ssize_t": "Indices", "unsigned char": "NDArray[np.uint8] | bytes"}
ARRAYS |= {"char": "NDArray[np.int8]", "signed char": "NDArray[np.int8]"}
# An argument with a type of C; one with None as its default.
ARGUMENT = re.compile(r"(?:const )?\b((?:un)?signed char|\w+)(\[[:, 1]+\])? (\w+)(=None)?")
# A class, with what it declares.
CLASS = re.compile(r"^cdef class (\w+).*\n((?:    .*\n|\n)+)", re.MULTILINE)
# What a binding has for Python: imports of its classes and for types; constants, of type int unless a comment
# tells another; classes; attributes; functions that tell the type of their result; constructors.
DECLARATION = re.compile(
    r"^from (?P<module>symgen\S*) cimport (?P<names>\([^)]*\)|.*)$"
    r"|^if TYPE_CHECKING:\n(?P<block>(?:    .*\n|\n)+)"
    r"|^(?P<constants>[A-Z_]+(?:, [A-Z_]+)*) = .*?(?:  # type: (?P<of>.+))?$"
    r"|^cdef (?P<name>class .*:)$"
    r"|^    cdef readonly (?P<kind>\w+) (?P<attributes>.+?)(?:  # type: (?P<held>.+))?$"
    r"|^(?P<function>(?: *@property\n)? *def (?:__init__\((?:[^()]|\(\))*\)|\w+\((?:[^()]|\(\))*\) -> .+):)$",
    re.MULTILINE,
)
STUB = '''"""Types of the binding ``{}``, written by ``setup.py``; see there for what things do."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symgen.runtime.arrays import Array, Indices
'''

extensions = [
    Extension(SHARED, []),
    Extension(
        "symgen.runtime._core",
        ["symgen/runtime/_core.pyx", *(str(path) for path in sorted(CORE.glob("*.c")))],
        include_dirs=["symgen/runtime"],
        depends=[str(path) for path in sorted(CORE.glob("*.h"))],
        extra_compile_args=flags(3, "-fvisibility=hidden"),  # calls inside the core may be inlined
    ),
    *(
        Extension(
            f"symgen.runtime.{name}",
            [f"symgen/runtime/{name}.pyx"],
            include_dirs=["symgen/runtime"],
            depends=["symgen/runtime/_core.pxd", *(str(path) for path in sorted(CORE.glob("*.h")))],
        )
        for name in (
            "_loop",
            "_beams",
            "_constrained",
            "_kinematics",
            "_start",
            "_many",
            "_rhs",
            "_variations",
        )
    ),
    *(
        Extension(
            f"symgen.generated.{name}",
            [f"generated/{file}" for file in sorted(model["sources"]) if file.endswith((".pyx", ".c"))],
            include_dirs=sorted({f"generated/{Path(file).parent}" for file in model["sources"]}),
            depends=[f"generated/{file}" for file in sorted(model["sources"]) if file.endswith(".h")],
            extra_compile_args=flags(model["optimisation"]),
        )
        for name, model in sorted(MODELS.items())
    ),
]


def members(text, structures):
    """Yield what a structure in C has, for Cython: functions, and numbers and structures of known types."""
    text = re.sub(r"\bstruct (?=\w)", "", text.replace("*const *", "**"))
    text = re.sub(r"\w+", lambda at: NUMBERS.get(at[0], at[0]), " ".join(text.split()))
    for each in filter(None, (part.strip() for part in text.split(";"))):
        kind = re.match(r"(?:const )?((?:un)?signed char|\w+) ", each)
        if ")(" in each:
            yield each.replace("(void)", "() noexcept nogil") + " noexcept nogil"
        elif kind[1] in structures | PLAIN:
            for name in each[kind.end() :].split(", "):
                known = re.sub(r"^\*lambda$", '*lambda_ "lambda"', name)  # a word of Python
                yield kind[0] + re.sub(r"\b[A-Z_]+\b(?=.*\])", r"_\g<0>", known)


def interface():
    """Return what headers of the core declare, for Cython; whole numbers have names with an underscore."""
    texts = ((CORE / f"{name}.h").read_text(encoding="utf-8") for name in HEADERS.split())
    found = [
        at for text in texts for at in INTERFACE.finditer(re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL))
    ]
    defined = {at["name"] for at in found if at["name"]}
    hidden = {at["hidden"] for at in found if at["hidden"]} - defined
    lines = [f"    cdef struct {name}:\n        pass" for name in sorted(hidden)]
    for at in found:
        if at["name"]:
            lines.append(f"    cdef struct {at['name']}:")
            lines += [f"        {member}" for member in members(at["members"], defined | hidden)]
        elif at["values"] or at["whole"]:
            names = re.findall(r"(?:^|,)\s*(\w+)", at["values"] or at["whole"])
            lines += ["    enum:", *(f'        _{name} "{name}"' for name in names)]
        elif at["number"]:
            lines.append(f"    double {at['number']}")
        elif at["text"]:
            lines.append(f"    const char *{at['text']}")
    head = f'"""What headers of the core declare, written by ``setup.py``."""\n\nctypedef {KERNEL}\n\n'
    return "\n".join([f'{head}cdef extern from "core/core.h" nogil:', *lines, ""])


def write(path, text):
    """Write a file if its text has changed."""
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def signature(text):
    """Return a function of a binding with types of Python instead of those of C."""

    def typed(at):
        kind, array, name, none = at.groups()
        kind = ARRAYS[kind] if array else TYPES.get(kind, kind)
        return f"{name}: {kind} | None=None" if none else f"{name}: {kind}"

    function = ast.parse(ARGUMENT.sub(typed, dedent(text).replace("def ", "def\t")) + " ...").body[0]
    arguments, unknown = function.args, ast.Constant(...)
    arguments.defaults = [unknown for _ in arguments.defaults]
    arguments.kw_defaults = [default and unknown for default in arguments.kw_defaults]
    function.returns = function.returns or ast.Constant(None)
    return ast.unparse(function)


def stub(path):
    """Return the types of a binding for Python, from its declarations."""
    source, header = path.read_text(encoding="utf-8"), path.with_suffix(".pxd")
    lines = [STUB.format(path.name)]
    for name, body in re.findall(CLASS, header.read_text(encoding="utf-8")) if header.exists() else ():
        declared = "".join(re.findall(r"    cdef readonly .*\n", body))
        source = re.sub(rf"^cdef class {name}\b.*\n", rf"\g<0>{declared}", source, flags=re.MULTILINE)
    for at in DECLARATION.finditer(source):
        if at["names"]:
            names = re.findall(r"\b[A-Z][a-z]\w+", at["names"])
            lines += [f"from {at['module']} import {name}" for name in names]
        elif at["block"]:
            lines.append(dedent(at["block"]))
        elif at["constants"]:
            lines += [f"{name}: {at['of'] or 'int'}" for name in at["constants"].split(", ")]
        elif at["name"]:
            lines.append(f"{at['name']}\n    ...")
        elif at["attributes"]:
            held = at["held"] or TYPES.get(at["kind"], at["kind"])
            lines += [f"    {name}: {held}" for name in at["attributes"].split(", ")]
        else:
            within = len(at["function"]) - len(at["function"].lstrip(" "))
            lines.append(indent(signature(at["function"]), " " * within))
    return "\n".join([*lines, ""])


class BuildExt(build_ext):
    """In a checkout, compiles an extension only if its sources, headers or compiler arguments changed.

    Their digest is kept with the binary. Times of files would not do: each installation brings new copies of
    Cython's files, on which all sources in C then seem to depend.
    """

    KEPT = "build/in_place"

    def finalize_options(self):
        """Keep binaries, which an editable installation builds in a temporary folder."""
        super().finalize_options()
        if self.inplace:
            self.build_lib = self.KEPT

    def build_extensions(self):
        """Compile what Cython writes with less optimisation than the kernels."""
        compile_source = self.compiler._compile

        def compile_lightly(target, source, suffix, arguments, options, definitions):
            for folder, optimisation in LIGHTLY.items():
                if source.startswith(folder):
                    options = [*options, *flags(optimisation)]
            compile_source(target, source, suffix, arguments, options, definitions)

        self.compiler._compile = compile_lightly
        super().build_extensions()

    def build_extension(self, ext):
        """Compile an extension, unless it is there already."""
        if self.build_lib != self.KEPT:
            super().build_extension(ext)
            return
        digest = sha256(repr((self.compiler.compiler_so, ext.extra_compile_args, LIGHTLY)).encode())
        for path in (*ext.sources, *ext.depends):
            digest.update(Path(path).read_bytes())
        binary = Path(self.get_ext_fullpath(ext.name))
        record = binary.with_name(f"{binary.name}.sha256")
        if not (binary.exists() and record.exists() and record.read_text() == digest.hexdigest()):
            record.unlink(missing_ok=True)
            self.force = True
            super().build_extension(ext)
            record.write_text(digest.hexdigest())


class EditableWheel(editable_wheel):
    """Puts the checkout on the path, too: a folder named symgen elsewhere is then not taken for the package.

    The import hook of an editable installation comes after the path, on which such a folder is a namespace
    package; a package that is on the path comes first.
    """

    def _install_namespaces(self, installation_dir, pth_prefix):
        super()._install_namespaces(installation_dir, pth_prefix)
        checkout = Path(__file__).resolve().parent
        Path(installation_dir, "__editable__.symgen_checkout.pth").write_text(
            f"{checkout}\n", encoding="utf-8"
        )


write(Path("symgen/runtime/_headers.pxd"), interface())
for binding in sorted(Path("symgen/runtime").glob("*.pyx")):
    write(binding.with_suffix(".pyi"), stub(binding))

setup(
    packages=[*find_packages(include=["symgen", "symgen.*"]), "symgen.generated", "symgen.templates"],
    cmdclass={"build_ext": BuildExt, "editable_wheel": EditableWheel},
    ext_modules=cythonize(
        extensions,
        build_dir=WRITTEN,
        language_level=3,
        compiler_directives={"annotation_typing": False},  # they are for Python
        shared_utility_qualified_name=SHARED,
    ),
    options={"build_ext": {"parallel": os.cpu_count()}},
)
