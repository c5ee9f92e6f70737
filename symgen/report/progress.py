"""Progress bar for long computations."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Column

#: Maximum length of the title next to the bar.
_TITLE = 40


@contextmanager
def bar(title: str) -> Iterator[Callable[[float], None]]:
    """Show a bar on standard error; yield a callback that receives the completed fraction."""
    title_column = Column(max_width=_TITLE, no_wrap=True, overflow="ellipsis")
    text = TextColumn("{task.description}", table_column=title_column)
    columns = (text, BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(title, total=1.0)
        yield lambda done: progress.update(task, completed=done)
