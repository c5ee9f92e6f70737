"""Pages in headless Chromium: what it logs, how wide they come out, what of their mathematics is visible."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

#: Runs in a copy of the page alone: writes what it finds into an element, which is read from the dumped page.
_MEASURE = """
<script>
addEventListener("load", () => {
  const width = document.documentElement.clientWidth;
  const within = (e) => e.closest(".scroll, pre, svg");
  const wide = [...document.body.querySelectorAll("*")]
    .filter((e) => !within(e.parentElement) && e.getBoundingClientRect().right > width + 0.5)
    .map((e) => e.tagName + "." + e.className + " " + Math.round(e.getBoundingClientRect().right));
  const math = [...document.querySelectorAll("math")].filter((e) => !e.closest("details:not([open])"));
  const seen = math.filter((e) => e.getBoundingClientRect().width > 3 && e.getBoundingClientRect().height > 5);
  const tables = [...document.querySelectorAll("mtable")].filter((e) => !e.closest("details:not([open])"));
  const flat = tables.filter((e) => e.querySelectorAll(":scope > mtr").length > 1
    && e.getBoundingClientRect().height < 12 * e.querySelectorAll(":scope > mtr").length);
  const images = [...document.images].filter((e) => !e.complete || e.naturalWidth === 0).length;
  const texts = [...document.querySelectorAll(".drawing svg > text")].map((e) => e.getBoundingClientRect());
  let met = 0;
  texts.forEach((a, i) => texts.slice(i + 1).forEach((b) => {
    met += a.left < b.right && b.left < a.right && a.top + 3 < b.bottom && b.top + 3 < a.bottom ? 1 : 0;
  }));
  const out = document.createElement("pre");
  out.id = "measured";
  out.textContent = JSON.stringify({
    width, page: document.documentElement.scrollWidth, wide: wide.slice(0, 8), math: math.length,
    seen: seen.length, flat: flat.length, images, met, height: document.documentElement.scrollHeight,
    elsewhere: performance.getEntriesByType("resource").map((e) => e.name).filter((n) => !n.startsWith("data:")),
  });
  document.body.append(out);
});
</script>
"""


@dataclass(frozen=True, slots=True)
class Seen:
    """What a browser makes of a page at one width [px].

    Attributes
    ----------
    width, page
        Of the window, and of what stands in it.
    wide
        Elements that stand out of the window, those inside a box that scrolls left out.
    math, seen, flat
        Equations; those with a visible size; matrices whose rows are not one below the other.
    images, met, height, elsewhere
        Pictures that do not show; names in the drawing that overlap; height; what the page asked others for.
    console
        Lines that the page logged: errors and warnings too.
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
        """What is wrong with it, in words."""
        found = [f"console: {line}" for line in self.console]
        found += [f"{self.page} px wide in {self.width}"] if self.page > self.width else []
        found += [f"stands out: {what}" for what in self.wide]
        found += (
            [f"{self.math - self.seen} of {self.math} equations invisible"] if self.seen < self.math else []
        )
        found += [f"{self.flat} matrices are not laid out"] if self.flat else []
        found += [f"{self.images} pictures do not show"] if self.images else []
        found += [f"{self.met} names in the drawing overlap"] if self.met else []
        return found + [f"asked for {what}" for what in self.elsewhere]


def chromium() -> str | None:
    """Return Chromium's command, if it is installed."""
    return next((c for c in ("chromium", "chromium-browser", "google-chrome") if shutil.which(c)), None)


def look(page: Path, width: int, folder: Path, picture: Path | None = None) -> Seen:
    """Open a copy of a page in a window of this width, measure it, and take a picture if asked.

    Parameters
    ----------
    page
        The HTML file.
    width
        Width of the window [px].
    folder
        Where the copy and the browser's profile go.
    picture
        Where a picture of the whole page goes.
    """
    text = page.read_text()
    copy = folder / f"{page.stem}-measured.html"
    copy.write_text(text.replace("</body>", f"{_MEASURE}</body>"))
    dumped, console = _run(copy, width, 900, folder, "--dump-dom")
    found = re.search(r'<pre id="measured">(.*?)</pre>', dumped, re.S)
    if found is None:
        raise RuntimeError(f"Chromium did not measure {page.name}: {console or dumped[:400]}")
    data = json.loads(found[1].replace("&amp;", "&").replace("&lt;", "<").replace("&gt;", ">"))
    if picture is not None:
        _run(page, width, min(data["height"], 16000), folder, f"--screenshot={picture}")
    return Seen(**data, console=console)


def _run(page: Path, width: int, height: int, folder: Path, *options: str) -> tuple[str, list[str]]:
    """Run Chromium on a page; return what it prints, and what the page logs."""
    command = chromium()
    if command is None:
        raise RuntimeError("there is no Chromium")
    done = subprocess.run(
        [
            command,
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--hide-scrollbars",
            "--disable-dev-shm-usage",
        ]
        + [f"--user-data-dir={folder / 'profile'}", f"--window-size={width},{height}"]
        + ["--enable-logging=stderr", *options, page.as_uri()],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    return done.stdout, [line for line in done.stderr.splitlines() if "CONSOLE" in line]
