"""Pages that compute (``symgen live``): their size, processor time per change of a slider, and error.

The WebAssembly of each page runs in Node.js, whose engine is that of Chromium, at random values of sliders.
The same C compiled for this machine computes the same frames; the tests of symgen compare that with its runs.
It needs Zig (``pip install 'symgen[live]'``), Node.js and a C compiler.
"""

from __future__ import annotations

import ctypes
import json
import shutil
import subprocess
import sys
import tempfile
from base64 import b64decode, b64encode
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from harness import Measurement, Required, arguments, report_repeats
from numpy.typing import NDArray

from symgen.codegen.emit import SourceFile
from symgen.export.live import sources_of
from symgen.inspection import live as inspected
from symgen.report.page.live import Live, live
from symgen.scene.loading import read_scene
from symgen.toolchain.wasm import compile_wasm

Array = NDArray[np.float64]

SCENES = {
    "crank_rocker": {f"links.{k}.length": f"{a} cm:{b} cm" for k, a, b in
                     (("crank", 6, 9), ("coupler", 34, 40), ("rocker", 28, 34))},
    "peaucellier": {},
    "slider_crank": {"a4": "0 in:12 in", "S1": "0 in:4 in"},
    "four_bar": {},
    "elastic_four_bar": {},
}  # fmt: skip
FRAMES, SETTINGS = 241, 100
#: Most bytes of a page, difference over the largest value of a unit, and processor time of a change [ms]:
#: half of a frame at 60 per second, the other half is for drawing.
LARGEST, LARGEST_ERROR, MOST_TIME = 1e6, 1e-12, 500 / 60

_SCRIPT = """
const { code, settings, outputs, frames } = JSON.parse(require("fs").readFileSync(0, "utf8"));
const wasm = new WebAssembly.Instance(new WebAssembly.Module(Buffer.from(code, "base64"))).exports;
wasm._initialize();
const follow = (values) => {
  new Float64Array(wasm.memory.buffer, wasm.parameters(), values.length).set(values);
  return wasm.follow();
};
for (let i = 0; i < 20; i++) follow(settings[0]);
const times = [], found = [];
for (const values of settings) {
  const begun = process.cpuUsage(), status = follow(values), reached = Number(wasm.reached());
  const { user, system } = process.cpuUsage(begun);
  times.push((user + system) / 1000);
  const table = new Uint8Array(wasm.memory.buffer, wasm.outputs(), reached * outputs * 8);
  found.push({ status, reached, table: Buffer.from(table).toString("base64") });
}
times.sort((a, b) => a - b);
console.log(JSON.stringify({ found, median: times[times.length >> 1], most: times[times.length - 1] }));
"""


def main() -> int:
    """Measure, print, and return the exit code."""
    options = arguments(__doc__)
    if shutil.which("node") is None:
        print("Node.js is not installed.")
        return 0
    return report_repeats(measured, options)


def measured() -> Measurement:
    """Measure once."""
    rows: list[dict[str, Any]] = []
    required: list[Required] = []
    for name, vary in SCENES.items():
        files: list[SourceFile] = []

        def compiled(x: Any, frames: int, files: list[SourceFile] = files) -> bytes:
            files += sources_of(x, frames)
            return compile_wasm(files)

        with patch.object(inspected, "wasm_of", compiled):
            page = inspected.live_of(read_scene(name), vary, FRAMES)
        size = len(live(page).encode())
        settings = _settings(page)
        found = _in_node(page, settings)
        whole = sum(one["reached"] == FRAMES for one in found["found"])
        error = _error(page, files, settings, found["found"])
        rows.append(
            {"scene": name, "sliders": sum(s.low is not None for s in page.sliders), "page [kB]": size / 1e3,
             "median [ms]": found["median"], "most [ms]": found["most"], "difference": error}
        )  # fmt: skip
        required += [
            Required(f"{name}: bytes of the page", size, LARGEST, False),
            Required(f"{name}: settings with all frames", whole, SETTINGS, True),
            Required(f"{name}: difference over the largest value", error, LARGEST_ERROR, False),
            Required(f"{name}: processor time of a change [ms]", found["median"], MOST_TIME, False, True),
        ]
    return Measurement(f"Live pages, {FRAMES} frames, {SETTINGS} random settings", rows, required)


def _settings(page: Live) -> Array:
    rng = np.random.default_rng(1)
    columns = [
        np.full(SETTINGS, s.value)
        if s.low is None or s.high is None
        else rng.uniform(s.low, s.high, SETTINGS)
        for s in page.sliders
    ]
    return np.stack(columns, axis=1) if columns else np.zeros((SETTINGS, 0))


def _in_node(page: Live, settings: Array) -> dict[str, Any]:
    data = {
        "code": b64encode(page.code).decode("ascii"),
        "settings": settings.tolist(),
        "outputs": len(page.outputs),
        "frames": page.frames,
    }
    done = subprocess.run(
        ["node", "-e", _SCRIPT], input=json.dumps(data), capture_output=True, text=True, check=True
    )
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def _error(page: Live, files: Sequence[SourceFile], settings: Array, found: Sequence[Any]) -> float:
    """Return the largest difference of an output over its largest value.

    It is inf where statuses differ, or a number is not finite.
    """
    width, worst = len(page.outputs), 0.0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file in files:
            (folder / file.name).parent.mkdir(exist_ok=True)
            (folder / file.name).write_text(file.text, encoding="utf-8")
        sources = [f.name for f in files if f.name.endswith(".c")]
        flags = ["-std=c11", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-o", "live.so"]
        subprocess.run(["cc", *flags, *sources, "-lm"], cwd=folder, check=True)
        native = ctypes.CDLL(str(folder / "live.so"))
        for function in ("parameters", "outputs"):
            getattr(native, f"live_{function}").restype = ctypes.POINTER(ctypes.c_double)
        for values, other in zip(settings.tolist(), found, strict=True):
            for i, value in enumerate(values):
                native.live_parameters()[i] = value
            status, reached = native.live_follow(), native.live_reached()
            if (status, reached) != (other["status"], other["reached"]):
                return np.inf
            here = np.ctypeslib.as_array(native.live_outputs(), (page.frames, width))[:reached]
            there = np.frombuffer(b64decode(other["table"])).reshape(reached, width)
            if not (np.isfinite(here).all() and np.isfinite(there).all()):
                return np.inf
            # Of one unit: an output may be zero but for round-off of others.
            units = [unit for _, unit, _ in page.outputs]
            for unit in dict.fromkeys(units):
                columns = [k for k, own in enumerate(units) if own == unit]
                size = np.max(np.abs(here[:, columns]), initial=0.0)
                if size:
                    worst = max(worst, float(np.max(np.abs(here - there)[:, columns]) / size))
    return worst


if __name__ == "__main__":
    sys.exit(main())
