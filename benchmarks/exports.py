"""Every shipped scene exported to C, compiled by GCC and Clang, and compared to the last bit.

Each export is compiled with ``-std=c11 -Wall -Wextra -Werror -ffp-contract=off`` by every available compiler.
Its test must reproduce symgen's results bit for bit, and its example must run. CMake, if available, builds
and tests the first export.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import symgen
from symgen.export import export_c

STRICT = ("-std=c11", "-Wall", "-Wextra", "-Werror", "-O1", "-ffp-contract=off")
COMPILERS = ("gcc", "clang")


def tried(name: str, compilers: tuple[str, ...]) -> list[str]:
    """Export and test a scene; return one line per compiler, starting with FAILED on failure."""
    with tempfile.TemporaryDirectory() as root:
        folder = Path(root) / name
        export_c(name, folder)
        return [
            f"{name:24} {compiler:6} {_compiled_and_run(folder, name, compiler)}" for compiler in compilers
        ]


def _compiled_and_run(folder: Path, name: str, compiler: str) -> str:
    objects = Path(f"{folder}-{compiler}")
    objects.mkdir()
    sources = [f"{name}.c", *sorted(p.name for p in folder.glob("*_kernel*.c"))]
    sources += [f"core/{p.name}" for p in sorted(folder.glob("core/*.c"))]
    try:
        absolute = [str(folder / s) for s in (*sources, "main.c", "check.c")]
        said = _run([compiler, *STRICT, "-I", str(folder), "-c", *absolute], objects)
        library = sorted(str(p) for p in objects.glob("*.o") if p.stem not in ("main", "check"))
        for program in ("main", "check"):
            _run([compiler, "-o", program, f"{program}.o", *library, "-lm"], objects)
        _run([str(objects / "main")], objects)
        verdict = _run([str(objects / "check"), "--bits"], objects).splitlines()[-1]
    except subprocess.CalledProcessError as error:
        return f"FAILED: {' '.join(error.cmd[:6])} ...\n{error.stdout}"
    return f"FAILED: {said}" if said else verdict


def _run(command: list[str], folder: Path) -> str:
    done = subprocess.run(
        command,
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=True,
        timeout=300,
    )
    return done.stdout


def by_cmake(name: str) -> str:
    """Build and test an export by CMake."""
    with tempfile.TemporaryDirectory() as root:
        folder = Path(root) / name
        export_c(name, folder)
        try:
            for step in ("cmake -S . -B build", "cmake --build build", "ctest --test-dir build"):
                said = _run(step.split(), folder)
        except subprocess.CalledProcessError as error:
            return f"{name:24} cmake  FAILED\n{error.stdout}"
    return f"{name:24} cmake  {next(line for line in said.splitlines() if 'tests passed' in line)}"


def main() -> int:
    """Test all selected scenes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenes", nargs="*", help="names of shipped scenes; default: all")
    parser.add_argument("--processes", type=int, default=2, help="number of processes (2)")
    given = parser.parse_args()
    names = given.scenes or symgen.shipped_scenes()
    compilers = tuple(c for c in COMPILERS if shutil.which(c))
    for missing in sorted({*COMPILERS, "cmake"} - {*compilers, "cmake" if shutil.which("cmake") else ""}):
        print(f"{missing} is not installed: omitted")
    failed = not compilers
    with ProcessPoolExecutor(given.processes) as pool:
        for lines in pool.map(partial(tried, compilers=compilers), names):
            print(*lines, sep="\n", flush=True)
            failed |= any("FAILED" in line or "all the same to the last bit" not in line for line in lines)
    if shutil.which("cmake"):
        line = by_cmake(names[0])
        print(line)
        failed |= "100% tests passed" not in line
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
