"""The gallery of the site: a page for every shipped scene, from its run, its drawing and its equations."""

import html
import re
from pathlib import Path

import symgen
from symgen.inspection.film import FRAMES, film_of, sheet_of
from symgen.report.page.animation import animation
from symgen.report.page.views import matrix_view
from symgen.scene.loading import SceneText, check_scene, read_scene

#: The matrix that is shown, and the page of its derivation: linkages have the first, loops the second.
EXCERPTS = {"constraints": "method_rods", "closure_defect": "method_dual_euler"}
#: Entries of a matrix that is too long to be shown as a whole.
ENTRIES = 3


def write(pages: Path, pictures: Path) -> None:
    """Write pages in Markdown into one folder, their pictures as SVG and HTML into another."""
    for folder in (pages, pictures):
        folder.mkdir(parents=True, exist_ok=True)
    titles = {}
    for name in symgen.shipped_scenes():
        text = read_scene(name)
        titles[name] = check_scene(text).title
        (pictures / f"{name}.svg").write_text(sheet_of(text).svg(), "utf-8")
        film = film_of(text, FRAMES)
        (pictures / f"{name}_moving.html").write_text(animation(film), "utf-8")
        (pages / f"{name}.md").write_text(_page(text, film.result.facts), "utf-8")
    cards = (
        f'<a href="{name}.html"><img src="{name}.svg" alt="" loading="lazy">{html.escape(title)}</a>'
        for name, title in titles.items()
    )
    index = [
        "# Gallery",
        "Shipped scenes, each with its motion, its errors and an excerpt of its equations.",
        _raw('<div class="gallery">', *cards, "</div>"),
        "\n".join(["```{toctree}", ":hidden:", "", *titles, "```"]),
    ]
    (pages / "index.md").write_text("\n\n".join(index), "utf-8")


def _page(text: SceneText, facts: tuple[tuple[str, str], ...]) -> str:
    scene, name = check_scene(text), text.name
    rows = [("mobility", "; ".join(symgen.build(name).mobility)), *facts]
    return "\n\n".join(
        [
            f"# {scene.title}",
            _plain(scene.about.strip()),
            _raw(
                f'<iframe class="moving" src="{name}_moving.html" title="{name}"></iframe>',
                f'<p><a href="{name}_moving.html">The animation as a page of its own</a></p>',
            ),
            "\n".join([f"| `{name}` | |", "|---|---|", *(f"| {k} | {_plain(v)} |" for k, v in rows)]),
            "## Equations",
            *_excerpt(name),
            f"`symgen report {name}` writes all of them on one page.",
            "## Scene",
            f"```{{literalinclude}} ../../symgen/scenes/{name}.toml\n:language: toml\n```",
        ]
    )


def _excerpt(name: str) -> list[str]:
    """Return a derived matrix, or its first entries, as raw HTML with a sentence on it."""
    matrices = {matrix.name: matrix for matrix in symgen.derive(name).matrices}
    key = next(key for key in EXCERPTS if key in matrices)
    matrix = matrix_view(matrices[key])
    shown = [matrix.math] if matrix.math else [e.math for e in matrix.entries if e.math][:ENTRIES]
    first = "" if matrix.math else f"; the first {len(shown)} entries"
    return [
        f"{_plain(matrix.about[:1].upper() + matrix.about[1:])} ({matrix.shape}, {matrix.unit}){first}. "
        f"[The method](../{EXCERPTS[key]}.md) derives them.",
        _raw(*(f'<div class="math"><math display="block">{m}</math></div>' for m in shown)),
    ]


def _plain(text: str) -> str:
    """Return text in which Markdown reads no marks."""
    return re.sub(r"([\\`*_<\[$|])", r"\\\1", text)


def _raw(*lines: str) -> str:
    return "\n".join(["```{raw} html", *lines, "```"])
