"""Animations and live pages in headless Chromium: how fast they play, and faults of their layout.

``python benchmarks/moving_pages.py [SCENE ...]`` opens the animations of all shipped scenes, and the
live pages of some, 390 and 1440 pixels wide. It prints a line per page: frames per second while it plays,
the median time to draw a frame and, on live pages, frames per second while a slider moves and the median
time from a slider to the new picture. The exit code is 1 if a page has a fault. With ``--rate``, for a
machine without other load, fewer than 58 frames per second are one. Live pages need Zig
(``pip install 'symgen[live]'``).
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Event, Thread
from typing import Any

from browser import chromium

import symgen
from symgen.inspection.film import FRAMES, film_of
from symgen.inspection.live import live_of
from symgen.report.page.animation import animation
from symgen.report.page.live import live
from symgen.scene.loading import read_scene

WIDTHS = (390, 1440)
#: Scenes with a live page here, and the largest size of such a page [bytes].
LIVE = ("crank_rocker", "peaucellier", "slider_crank", "elastic_four_bar")
LARGEST = 1_000_000
#: A screen shows this many frames a second; those counted in a second may be two fewer.
RATE, COUNTED = 60, 58

#: Added to the head of a page: it collects what goes wrong.
_WATCH = """<script>
const wrong = [];
addEventListener("error", (e) => wrong.push(e.message));
addEventListener("unhandledrejection", (e) => wrong.push(String(e.reason)));
</script>"""
#: Added to the script of a page, whose functions it calls; it sends its measurements to the server.
_TRY = Path(__file__).with_suffix(".js").read_text()


def main() -> int:
    """Open the pages and print the measurements; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("scenes", nargs="*")
    parser.add_argument("--rate", action="store_true", help="require 60 frames per second")
    options = parser.parse_args()
    if chromium() is None:
        print("there is no Chromium: apt install chromium")
        return 1
    faults = 0
    for name in options.scenes or symgen.shipped_scenes():
        pages = {"moving": animation(film_of(read_scene(name), FRAMES))}
        if name in LIVE:
            pages["live"] = live(live_of(read_scene(name), {}, FRAMES))
        for kind, text in pages.items():
            for width in WIDTHS:
                found = opened(text, width)
                wrong = found["wrong"]
                wrong += [f"{len(text)} bytes"] if kind == "live" and len(text) > LARGEST else []
                slow = found.get("change") or found.get("draw", 0.0)
                wrong += [f"{slow:.1f} ms for a new picture"] if slow > 1000 / RATE else []
                rates = [found[key] for key in ("seen", "dragged") if found.get(key) and options.rate]
                wrong += [f"{rate} frames/s" for rate in rates if rate < COUNTED]
                faults += len(wrong)
                print(
                    f"{name}, {kind}, {width} px: {_words(found)}, {len(text) / 1e3:.0f} kB",
                    *wrong,
                    sep="\n  ",
                )
    print(f"{faults} faults")
    return 1 if faults else 0


def _words(found: dict[str, Any]) -> str:
    if "seen" not in found:
        return "not measured"
    change = ""
    if found["change"]:
        change = (
            f"; while a slider moves {found['dragged']} frames/s, {found['change']:.2f} ms to a new picture"
        )
    return f"{found['seen']} frames/s, {found['draw']:.2f} ms to draw one{change}"


def opened(page: str, width: int) -> dict[str, Any]:
    """Open a page in a window of a width [px]; return the measurements of its script."""
    head, _, tail = page.rpartition("</script>")
    text = head.replace("<head>", f"<head>{_WATCH}", 1) + _TRY + "</script>" + tail
    frame = f'<iframe src="/page" style="width: {width}px; height: 900px; border: 0"></iframe>'
    around = f'<!DOCTYPE html><body style="margin: 0">{frame}<img src="/wait" alt=""></body>'
    found: dict[str, Any] = {}
    done = Event()

    class Server(BaseHTTPRequestHandler):
        """Serves the page in its window; ``/wait`` keeps the browser open until the page has answered."""

        def do_GET(self) -> None:
            if self.path == "/wait":
                done.wait(60)
            with suppress(ConnectionError):  # the browser may be gone after a wait
                self.send_response(200)
                self.send_header("Content-Type", "text/html; charset=utf-8")
                self.end_headers()
                self.wfile.write({"/page": text, "/": around}.get(self.path, "").encode())

        def do_POST(self) -> None:
            found.update(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
            self.send_response(204)
            self.end_headers()
            done.set()

        def log_message(self, *_: Any) -> None:
            """Print nothing."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Server) as server, tempfile.TemporaryDirectory() as profile:
        Thread(target=server.serve_forever, daemon=True).start()
        subprocess.run(
            [
                *(str(chromium()), "--headless", "--no-sandbox", "--disable-gpu", "--dump-dom"),
                *("--disable-dev-shm-usage", f"--user-data-dir={Path(profile)}", "--window-size=1500,900"),
                f"http://127.0.0.1:{server.server_port}/",
            ],
            capture_output=True,
            timeout=120,
            check=True,
        )
        server.shutdown()
    return found or {"wrong": ["the page did not answer"]}


if __name__ == "__main__":
    sys.exit(main())
