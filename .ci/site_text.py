"""What `.ci/site.py` does to the text of pages. It needs nothing but Python, so that the tests can run it."""

import posixpath
import re
from collections.abc import Mapping

_CODE = re.compile(r"(^ *```.*?^ *```[^\n]*$|`[^`\n]+`)", re.MULTILINE | re.DOTALL)
_NAMED = re.compile(r"\[([\w/-]+\.md)\]\(([\w./-]+?\.md)(#[\w-]+)?\)")
_PATH = re.compile(r"(?<!\]\()(?<![\w/\[.-])(?:docs/)?([\w/-]+\.md)\b(?!\])")
_BREAKS = re.compile(
    r"(?<=[ /=,:])(?=[^ _/=,(:<])|(?<=\w{3}[_(])(?=\w{3})|(?<=[a-z]-)(?=[a-z])"
    r"|(?<=[a-z\d)\]]\.)(?!yaml|urdf|json|html)(?=\w{4})"
)

_ITEM = re.compile(r"(?:[-*]|\d+\.) +(?=\S)")
_INDENT = 4  # spaces by which the site's Markdown wants what belongs to an item of a list


def listed(markdown: str) -> str:
    r"""Write lists as the site's Markdown reads them: CommonMark needs neither the blank line nor four spaces.

    Example:
        >>> print(listed("Two cases:\n- one\n\n  more of it\n- two"))
        Two cases:
        <BLANKLINE>
        - one
        <BLANKLINE>
            more of it
        <BLANKLINE>
        - two
    """
    lines: list[str] = []
    fenced, width, begun = False, 0, 0
    for line in markdown.split("\n"):
        item, indent = _ITEM.match(line), len(line) - len(line.lstrip())
        if fenced or line.startswith("```"):
            fenced, width = fenced != line.startswith("```"), 0
        elif item:
            if lines and lines[-1].strip() and (not width or (lines[-1].startswith(" ") and "" in lines[begun:])):
                lines.append("")
            width, begun = item.end(), len(lines)
        elif line and indent < width and not (lines[-1].strip() and width):
            width = 0
        lines.append(" " * (_INDENT - width) + line if width and not item and indent >= width else line)
    return "\n".join(lines)


def titled(markdown: str, page: str, titles: Mapping[str, str]) -> str:
    """Let links and paths that name a file of `docs/` show the title of its page, and lead there.

    Args:
        markdown: The text of a page; code is left as it is, except code that is such a path and nothing else.
        page: Its file, relative to `docs/`.
        titles: Title of each page by its file, relative to `docs/`.

    Example:
        >>> titled("See [closures.md](closures.md).", "loops.md", {"closures.md": "Closed loops"})
        'See [Closed loops](closures.md).'
        >>> titled("`docs/loops.md` says more.", "howto/index.md", {"loops.md": "Loops"})
        '[Loops](../loops.md) says more.'
    """
    folder = posixpath.dirname(page)

    def link(found: re.Match[str]) -> str:
        name, target, part = found.groups()
        title = titles.get(posixpath.normpath(posixpath.join(folder, target)))
        return f"[{title}]({target}{part or ''})" if title and target.endswith(name) else found.group()

    def path(found: re.Match[str]) -> str:
        title = titles.get(found[1])
        return f"[{title}]({posixpath.relpath(found[1], folder or '.')})" if title else found.group()

    parts = _CODE.split(markdown)
    for index, part in enumerate(parts):
        alone = _PATH.fullmatch(part.strip("`"))
        if index % 2 == 0:
            parts[index] = _PATH.sub(path, _NAMED.sub(link, part))
        elif alone and alone[1] in titles:
            parts[index] = path(alone)
    return "".join(parts)


def breakable(html: str) -> str:
    """Let code in a line of text break where its words end, and nowhere else (`site.css` forbids the rest).

    Example:
        >>> breakable("<td><code>robot.home</code></td><pre><code>a.b</code></pre>")
        '<td><code>robot.<wbr>home</code></td><pre><code>a.b</code></pre>'
    """

    def code(found: re.Match[str]) -> str:
        return found[1] + _BREAKS.sub("<wbr>", found[2]) + found[3] if found[1] else found.group()

    return re.sub(r"<pre\b.*?</pre>|(<code>)([^<]*)(</code>)", code, html, flags=re.DOTALL)


def enlarged(html: str) -> str:
    """Let each picture lead to its own file, in which a reader can zoom.

    Example:
        >>> enlarged('<p><img alt="a region" src="region.svg" /></p>')
        '<p><a class="figure" href="region.svg"><img alt="a region" src="region.svg" /></a></p>'
    """
    return re.sub(r'<img\b[^>]*\bsrc="([^"]+)"[^>]*>', r'<a class="figure" href="\1">\g<0></a>', html)
