"""Output of studies: a page with tables, plots, and the numbers of the plots."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from symgen.study.cases import Case, StudyResult
from symgen.study.plots import Array, components, draw, shown_input

PAGE = "index.md"


def files_of(
    scene: str, title: str, studies: Sequence[StudyResult], done: Callable[[], None]
) -> dict[str, bytes]:
    """Return the contents of all files by name; the page comes last, when its figures are complete.

    ``scene`` is the scene's name on the command line, for the reproduction line; ``done`` is called after
    every plot.
    """
    files: dict[str, bytes] = {}
    lines = [f"# {title}: studies", "", f"Made by `symgen study {scene} FOLDER`.", ""]
    for study in studies:
        lines += [f"## {study.plan.about}", ""]
        if study.plan.changes:
            lines += [f"With {', '.join(f'`{k} = {v}`' for k, v in study.plan.changes.items())}.", ""]
        for table in (_cases(study), _limits(study), _ranges(study)):
            lines += [*table, ""] if table else []
        drawn = any(case.turn for case in study.cases)
        for output in study.plan.plots if drawn else ():
            picture = f"{study.plan.name}-{output}.png"
            files[picture] = draw(output, study.plan.about, study.cases)
            done()
            lines += [f"![{output}]({picture})", ""]
        if drawn and study.plan.plots:
            files[f"{study.plan.name}.csv"] = _numbers(study)
            lines += [f"The numbers: [{study.plan.name}.csv]({study.plan.name}.csv).", ""]
    files[PAGE] = "\n".join(lines).encode()
    return files


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    return ["| " + " | ".join(cells) + " |" for cells in (head, ["---"] * len(head), *rows)]


def _settings(study: StudyResult) -> tuple[list[str], list[list[str]]]:
    """Return names and values of the varied parameters, one row per case."""
    names = [s.parameter for s in study.cases[0].settings]
    return names, [[s.text for s in case.settings] for case in study.cases]


def _cases(study: StudyResult) -> list[str]:
    """Return the table of closure, conditioning and poles of all cases."""
    names, values = _settings(study)
    rows = []
    for case, own in zip(study.cases, values, strict=True):
        if case.turn is None:
            rows.append([*own, "-", "-", case.problem])
            continue
        _, unit, size = shown_input(case.turn)
        poles = ", ".join(f"{p.at / size:.6f} {unit}" for p in case.turn.poles)
        least = f"{case.turn.statistics['least_singular']:.3f}"
        rows.append([*own, f"{case.turn.closure:.1e}", least, poles or "none"])
    return _table([*names, "closure defect", "least singular value", "poles of the efforts"], rows)


def _limits(study: StudyResult) -> list[str]:
    names, values = _settings(study)
    rows = []
    for case, own in zip(study.cases, values, strict=True):
        for limit in case.limits:
            s = limit.search
            if limit.value is None:
                found = [f"none up to {s.in_unit(s.stop):g} {s.unit}", "-"]
            else:
                found = [f"{s.in_unit(limit.value):.6f} {s.unit}", f"{s.in_unit(limit.width):.0e} {s.unit}"]
            rows.append([*own, s.parameter, *found, f"{limit.closure:.1e}", f"{limit.least_singular:.1e}"])
    head = [*names, "limit of", "value", "within", "closure defect there", "least singular value there"]
    return _table(head, rows) if rows else []


def _ranges(study: StudyResult) -> list[str]:
    """Return minimum and maximum of every plotted component over the input."""
    rows = []
    for output in study.plan.plots:
        for i, (name, unit) in enumerate(_components(study, output)):
            rows.append([name, unit, *(_range(case, output, name, i) for case in study.cases)])
    return _table(["output", "unit", *(case.label for case in study.cases)], rows) if rows else []


def _components(study: StudyResult, output: str) -> list[tuple[str, str]]:
    turn = next((case.turn for case in study.cases if case.turn), None)
    return [(name, unit) for name, unit, _ in components(turn, output)] if turn else []


def _range(case: Case, output: str, name: str, index: int) -> str:
    if case.turn is None:
        return "-"
    if any(name in p.residues for p in case.turn.poles):
        return "unbounded"
    values = list(components(case.turn, output))[index][2]
    low, high = _short(np.min(values)), _short(np.max(values))
    return low if low == high else f"{low} to {high}"


def _short(value: float) -> str:
    """Return a number with six digits; round-off becomes zero."""
    return f"{value:.6g}" if abs(value) > 1e-9 else "0"


def _numbers(study: StudyResult) -> bytes:
    """Return input and outputs of all cases as CSV, with one column per component and case."""
    columns = list(_columns(study))
    stream = io.StringIO()
    stream.write(",".join(f'"{head}"' for head, _ in columns) + "\n")
    for row in zip(*(values.tolist() for _, values in columns), strict=True):
        stream.write(",".join("" if np.isnan(x) else repr(x) for x in row) + "\n")
    return stream.getvalue().encode()


def _columns(study: StudyResult) -> Iterator[tuple[str, Array]]:
    first = True
    for case in study.cases:
        if case.turn is None:
            continue
        x, unit, _ = shown_input(case.turn)
        if first:
            yield f"{case.turn.input} [{unit}]", x
            first = False
        for output in study.plan.plots:
            for name, of, values in components(case.turn, output):
                yield f"{name} [{of}] {case.label}", values
