"""Pages in headless Chromium: console messages, layout width and visibility of equations."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from html import unescape
from pathlib import Path

#: Script added to a copy of the page: it sends its measurements to the enclosing frame, which prints them.
_MEASURE = """
<script>
addEventListener("load", () => {
  for (const folded of document.querySelectorAll("details")) folded.open = true;
  const width = document.documentElement.clientWidth;
  const within = (e) => e.closest(".scroll, pre, svg");
  const wide = [...document.body.querySelectorAll("*")]
    .filter((e) => !within(e.parentElement) && e.getBoundingClientRect().right > width + 0.5)
    .map((e) => e.tagName + "." + e.className + " " + Math.round(e.getBoundingClientRect().right));
  const math = [...document.querySelectorAll("math")];
  const box = (e) => e.getBoundingClientRect();
  const seen = math.filter((e) => box(e).width > 3 && box(e).height > 5);
  const tables = [...document.querySelectorAll("mtable")];
  const flat = tables.filter((e) => e.querySelectorAll(":scope > mtr").length > 1
    && e.getBoundingClientRect().height < 12 * e.querySelectorAll(":scope > mtr").length);
  const images = [...document.images].filter((e) => !e.complete || e.naturalWidth === 0).length;
  const texts = [...document.querySelectorAll(".drawing svg > text")].map((e) => e.getBoundingClientRect());
  let met = 0;
  texts.forEach((a, i) => texts.slice(i + 1).forEach((b) => {
    const across = a.left < b.right && b.left < a.right;
    met += across && a.top + 3 < b.bottom && b.top + 3 < a.bottom ? 1 : 0;
  }));
  parent.postMessage(JSON.stringify({
    name: NAME, width, page: document.documentElement.scrollWidth, wide: wide.slice(0, 8), math: math.length,
    seen: seen.length, flat: flat.length, images, met, height: document.documentElement.scrollHeight,
    elsewhere: performance.getEntriesByType("resource").map((e) => e.name)
      .filter((n) => !n.startsWith("data:")),
  }), "*");
});
</script>
"""
#: Document with pages in frames of given widths: a browser window is at least 500 px wide.
_AROUND = """<!DOCTYPE html><html><body style="margin: 0">
<script>
addEventListener("message", (e) => {
  const out = document.createElement("pre");
  out.className = "measured";
  out.textContent = e.data;
  document.body.append(out);
});
</script>
FRAMES
</body></html>
"""


@dataclass(frozen=True, slots=True)
class Seen:
    """Measurements of a rendered page at one width [px].

    Attributes
    ----------
    width, page
        Widths of the window and of the content.
    wide
        Elements that extend beyond the window, except those in a scrolling box.
    math, seen, flat
        Number of equations; of visible ones; of matrices whose rows are not laid out vertically.
    images, met, height, elsewhere
        Broken images; overlapping labels in the drawing; height of the page; URLs of requested resources.
    console
        Console messages of the page, including errors and warnings.
    """

    width: int
    page: int
    wide: list[str]
    math: int
    seen: int
    flat: int
    images: int
    met: int
    height: int
    elsewhere: list[str]
    console: list[str]

    @property
    def faults(self) -> list[str]:
        """Defects of the page as text."""
        found = [f"console: {line}" for line in self.console]
        found += [f"{self.page} px wide in {self.width}"] if self.page > self.width else []
        found += [f"stands out: {what}" for what in self.wide]
        found += (
            [f"{self.math - self.seen} of {self.math} equations invisible"] if self.seen < self.math else []
        )
        found += [f"{self.flat} matrices are not laid out"] if self.flat else []
        found += [f"{self.images} pictures do not show"] if self.images else []
        found += [f"{self.met} names in the drawing overlap"] if self.met else []
        return found + [f"requested {what}" for what in self.elsewhere]


def chromium() -> str | None:
    """Return Chromium's command if it is installed."""
    return next((c for c in ("chromium", "chromium-browser", "google-chrome") if shutil.which(c)), None)


def look(pages: Sequence[Path], widths: Sequence[int], folder: Path) -> dict[tuple[str, int], Seen]:
    """Open copies of pages in frames of the given widths, in one browser, and measure them.

    Parameters
    ----------
    pages
        The HTML files.
    widths
        Widths [px].
    folder
        Folder for the copies and the browser profile.

    Returns
    -------
    dict
        Measurements by page name and width.
    """
    frames = []
    for page in pages:
        text = page.read_text()
        for width in widths:
            name = f"{page.stem}-{width}"
            script = _MEASURE.replace("NAME", json.dumps(name))
            (folder / f"{name}.html").write_text(text.replace("</body>", f"{script}</body>"))
            frames.append(_frame(f"{name}.html", width, 900))
    around = folder / "around.html"
    around.write_text(_AROUND.replace("FRAMES", "\n".join(frames)))
    dumped, console = _run(around, 1500, 900, folder, "--dump-dom", "--virtual-time-budget=20000")
    found = {}
    for text in re.findall(r'<pre class="measured">(.*?)</pre>', dumped, re.S):
        data = json.loads(unescape(text))
        name = data.pop("name")
        stem, _, width = name.rpartition("-")
        own = [line for line in console if f"/{name}.html" in line or ".html" not in line]
        found[stem, int(width)] = Seen(**data, console=own)
    if len(found) < len(frames):
        raise RuntimeError(f"Chromium measured {len(found)} of {len(frames)} pages: {console}")
    return found


def picture(page: Path, file: Path, width: int, height: int, *, dark: bool = False) -> None:
    """Write a PNG of a page in a window of at least 500 px width, in its light or dark colours."""
    scheme = f"--blink-settings=preferredColorScheme={0 if dark else 1}"
    _run(page, width, height, file.parent, f"--screenshot={file}", scheme)


def _frame(source: str, width: int, height: int) -> str:
    return f'<iframe src="{source}" style="width: {width}px; height: {height}px; border: 0"></iframe>'


def _run(page: Path, width: int, height: int, folder: Path, *options: str) -> tuple[str, list[str]]:
    """Run Chromium on a page; return its output and the console messages of the page."""
    command = chromium()
    if command is None:
        raise RuntimeError("there is no Chromium")
    done = subprocess.run(
        [
            *(command, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"),
            *("--disable-dev-shm-usage", "--enable-logging=stderr", f"--user-data-dir={folder / 'profile'}"),
            *(f"--window-size={width},{height}", *options, page.as_uri()),
        ],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    return done.stdout, [line for line in done.stderr.splitlines() if "CONSOLE" in line]
