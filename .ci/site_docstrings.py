"""How the site reads docstrings: "Example:" is code, and `[0, 1] [m]` is no link; `mkdocs.yml` names this file."""

import re
from typing import Any

import griffe


def plain(line: str) -> str:
    """Return a line of prose as Markdown: brackets are no link, and the name of a page is one."""
    line = re.sub(r"\]( ?)\[", r"]\1\\[", line)
    return re.sub(r"`docs/([\w-]+)\.md`", r"[\1](../\1.md)", line)


class Examples(griffe.Extension):
    """Lets the parser of docstrings take "Example:" for what it calls "Examples:"."""

    def on_object(self, *, obj: Any, **_: Any) -> None:
        """Change the docstring of one object before it is parsed."""
        if obj.is_alias or obj.docstring is None:
            return
        lines: list[str] = []
        is_code = False
        for line in obj.docstring.value.splitlines():
            word = line.strip()
            is_code = word == "Example:" or (is_code and (not word or line.startswith(" ")))
            lines.append(line.replace("Example:", "Examples:") if is_code else plain(line))
        obj.docstring.value = "\n".join(lines)
