"""Tables that fit the terminal: columns fold at spaces, never inside a word; else each row is printed as a record."""

from __future__ import annotations

from collections.abc import Sequence

from rich.cells import cell_len
from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

__all__ = ["fitting_widths", "show"]

_BORDER = 3
"""Characters that a column adds to its text: two spaces and a vertical line; the table has one more line."""


def fitting_widths(rows: Sequence[Sequence[str]], width: int) -> list[int] | None:
    """Return widths of the columns such that no word is cut; None if this is not possible.

    Args:
        rows: Texts of the cells, including the headings.
        width: Number of characters in a line of the terminal.

    Example:
        >>> fitting_widths([("edge", "why"), ("beta_7", "stopped by the upper limit")], 27)
        [6, 14]
        >>> fitting_widths([("edge", "why"), ("beta_7", "stopped by the upper limit")], 15) is None
        True
    """
    columns = list(zip(*rows, strict=True))
    room = width - _BORDER * len(columns) - 1
    most = [max(map(cell_len, column)) for column in columns]
    widths = [max((cell_len(word) for text in column for word in text.split()), default=0) for column in columns]
    if sum(widths) > room:
        return None
    for _ in range(room - sum(widths)):  # the next character goes to the column that is folded most
        folded = max(range(len(widths)), key=lambda k: most[k] / max(widths[k], 1))
        if widths[folded] >= most[folded]:
            break
        widths[folded] += 1
    return widths


def show(console: Console, title: str, columns: Sequence[str], rows: Sequence[Sequence[str]], note: str) -> None:
    """Print a table, or each row as a record; a column whose heading ends in ``]`` is right-aligned."""
    headings = [column.removesuffix(" []") for column in columns]
    widths = fitting_widths([headings, *rows], console.width)
    if widths is None:
        _show_records(console, title, headings, rows, note)
        return
    table = Table(title=title, title_justify="left", title_style="bold", caption=note, caption_justify="left")
    for column, heading, size in zip(columns, headings, widths, strict=True):
        justify = "right" if column.endswith("]") else "left"
        table.add_column(heading, justify=justify, overflow="fold", width=size)
    for row in rows:
        table.add_row(*row)
    console.print(table)


def _show_records(console: Console, title: str, headings: list[str], rows: Sequence[Sequence[str]], note: str) -> None:
    console.print(Text(title, "bold"))
    for first, *others in rows:
        console.print(f"{headings[0]} {first}")
        said = "; ".join(f"{name}: {text}" for name, text in zip(headings[1:], others, strict=True) if text)
        console.print(Padding(Text(said), (0, 0, 0, 2)))
    if note:
        console.print(Text(note, "italic"))
