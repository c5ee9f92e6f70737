"""Pages of all shipped scenes, checked in Chromium at the widths of a phone and of a desktop screen.

``python benchmarks/pages.py [FOLDER] [SCENE ...]`` writes pages to FOLDER (``pages``), prints a line per
page, and returns exit code 1 if one has a defect. ``--speed`` includes the measurement of speed against
error, ``--pictures`` saves screenshots next to the pages.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from time import perf_counter

from browser import chromium, look, picture

import symgen
from symgen.inspection.page import scene_page
from symgen.report.page.page import render
from symgen.scene.loading import read_scene

WIDTHS = (390, 1440)
#: Maximum size of a page [bytes].
LARGEST = 2_000_000


def main() -> int:
    """Write and check the pages; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", nargs="?", default="pages", type=Path)
    parser.add_argument("scenes", nargs="*")
    parser.add_argument("--speed", action="store_true")
    parser.add_argument("--pictures", action="store_true")
    asked = parser.parse_args()
    if chromium() is None:
        print("there is no Chromium: apt install chromium")
        return 1
    asked.folder.mkdir(parents=True, exist_ok=True)
    faults = 0
    for name in asked.scenes or symgen.shipped_scenes():
        begun = perf_counter()
        text = render(scene_page(read_scene(name), speed=asked.speed, told=lambda _: None))
        page = asked.folder / f"{name}.html"
        page.write_text(text)
        took = perf_counter() - begun
        found = [f"{len(text)} bytes"] if len(text) > LARGEST else []
        with tempfile.TemporaryDirectory() as scratch:
            for (_, width), seen in look([page], WIDTHS, Path(scratch)).items():
                if asked.pictures:
                    picture(page, seen, (asked.folder / f"{name}-{width}.png").resolve(), Path(scratch))
                found += [f"at {width} px: {fault}" for fault in seen.faults]
        print(
            f"{name}: {len(text) / 1e3:.0f} kB in {took:.1f} s, {seen.math} equations",
            *found,
            sep="\n  ",
            flush=True,
        )
        faults += len(found)
    print(f"{faults} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
