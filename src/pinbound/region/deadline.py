"""A time limit for work on regions: it ends in an error that says what remains, never in a wrong answer."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator
from typing import TypeVar

from pinbound.exceptions import DimensionError, UnsupportedError

__all__ = ["Deadline"]

T = TypeVar("T")


class Deadline:
    """The time limit, and the work that it is for.

    Example:
        >>> deadline = Deadline(60.0, "tracing")
        >>> [one for one in deadline.each(("beta_1", "beta_2"))]
        ['beta_1', 'beta_2']
    """

    def __init__(self, budget: float, task: str) -> None:
        """Start the clock.

        Raises:
            DimensionError: If the budget [s] is not positive.
        """
        if not budget > 0.0:
            raise DimensionError(f"the budget is {budget}; give seconds above 0, inf for no limit")
        self.budget, self.task, self.left = budget, task, ""
        self.end = math.inf if budget == math.inf else time.monotonic() + budget

    def check(self) -> None:
        """Raise if time is up.

        Raises:
            UnsupportedError: With the task, what of it is left, and what to do.
        """
        if time.monotonic() > self.end:
            left = f"; left: {self.left}" if self.left else ""
            raise UnsupportedError(
                f"{self.task} is not finished after the budget of {self.budget:g} s{left}; give a larger budget, a "
                "coarser accuracy or a smaller window"
            )

    def each(self, items: Iterable[T]) -> Iterator[T]:
        """Iterate; check the clock before each item, and keep the names of the remaining items."""
        todo = list(items)
        for index, item in enumerate(todo):
            names = [str(getattr(one, "name", one)) for one in todo[index : index + 4]]
            self.left = ", ".join(names) + (f", ... ({len(todo) - index} in all)" if len(todo) - index > 4 else "")
            self.check()
            yield item
        self.left = ""
