"""Compiles what ``generated/manifest.json`` lists, and the runtime core."""

import json
import os
from pathlib import Path

from Cython.Build import cythonize
from setuptools import Extension, find_packages, setup
from setuptools.command.editable_wheel import editable_wheel

MODELS = json.loads(Path("generated/manifest.json").read_text(encoding="utf-8"))["models"]


def flags(optimisation):
    """Return the compiler flags: no contraction, so that all processors give the same bits."""
    if os.name == "nt":
        return []
    return [f"-O{optimisation}", "-std=c11", "-ffp-contract=off", "-Werror=implicit-function-declaration"]


# What Cython's arrays need, compiled once instead of into each module: most of what there is to compile.
SHARED = "symgen._cython"
CORE = Path("symgen/runtime/core")

extensions = [
    Extension(SHARED, []),
    Extension(
        "symgen.runtime._core",
        ["symgen/runtime/_core.pyx", *(str(path) for path in sorted(CORE.glob("*.c")))],
        include_dirs=["symgen/runtime"],
        depends=[str(path) for path in sorted(CORE.glob("*.h"))],
        extra_compile_args=flags(3),
    ),
    *(
        Extension(
            f"symgen.runtime.{name}",
            [f"symgen/runtime/{name}.pyx"],
            include_dirs=["symgen/runtime"],
            depends=["symgen/runtime/_core.pxd", *(str(path) for path in sorted(CORE.glob("*.h")))],
            extra_compile_args=flags(1),
        )
        for name in (
            "_loop",
            "_beams",
            "_kinematics",
            "_kinematic_lanes",
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
            include_dirs=["generated"],
            extra_compile_args=flags(model["optimisation"]),
        )
        for name, model in sorted(MODELS.items())
    ),
]


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


setup(
    packages=[*find_packages(include=["symgen", "symgen.*"]), "symgen.generated", "symgen.templates"],
    cmdclass={"editable_wheel": EditableWheel},
    ext_modules=cythonize(
        extensions, build_dir="build/cython", language_level=3, shared_utility_qualified_name=SHARED
    ),
    options={"build_ext": {"parallel": os.cpu_count()}},
)
