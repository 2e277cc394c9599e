"""What the site takes from outside `docs/`: the changelog, two pages more, and the commands with their options.

Links that name a file show the title of its page; inline code breaks between its words; pictures open alone.
`mkdocs.yml` names this file as a hook.
"""

import re
from collections.abc import Iterator
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.nav import Navigation
from mkdocs.structure.pages import Page
from site_text import breakable, enlarged, listed, titled

ROOT = Path(__file__).resolve().parents[1]
TAKEN = {"CHANGELOG.md": "changelog.md", "CONTRIBUTING.md": "contributing.md", "SECURITY.md": "security.md"}
TITLES: dict[str, str] = {}  # of the pages, by their files


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that stand at the root of the repository."""
    for name, place in TAKEN.items():
        files.append(File.generated(config, place, content=(ROOT / name).read_text(encoding="utf-8")))
    files.append(File.generated(config, "reference/cli.md", content="\n".join(command_lines())))
    return files


def command_lines() -> Iterator[str]:
    """Yield the page of the command line, as the commands themselves say it."""
    import typer.main

    from pinbound.cli import app

    yield "# Command line\n"
    yield "`pinbound COMMAND -h` prints the same in a terminal. Exit codes: [reading](../reading.md#exit-codes).\n"
    group = typer.main.get_command(app)
    for name, command in group.commands.items():
        arguments = [str(one.name).upper() for one in command.params if one.param_type_name == "argument"]
        yield f"## {name}\n\n```text\npinbound {' '.join([name, *arguments])} [OPTIONS]\n```\n\n{command.help}\n"
        yield "| option | meaning |\n| --- | --- |"
        for one in command.params:
            if one.param_type_name == "option":
                words = " ".join(f"`{word}`" for word in one.opts)
                text = (one.help or "").replace("|", "\\|").replace("<", "&lt;")
                yield f"| {words} | {text} |"
        yield ""


def on_nav(nav: Navigation, config: MkDocsConfig, files: Files) -> Navigation:
    """Remember the title of each page, as the navigation has it."""
    TITLES.update({page.file.src_path: str(page.title) for page in nav.pages})
    return nav


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Let inline code break between its words, and each picture open alone."""
    return enlarged(breakable(html))


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Let links out of `docs/` lead to the page of the site, or name the file where the site has none."""

    def lead(found: re.Match[str]) -> str:
        words, target = found.groups()
        name = target.removeprefix("../").removeprefix("../")
        if not (ROOT / name).exists():
            raise FileNotFoundError(f"{page.file.src_path} links to {target}, which does not exist")
        depth = page.file.src_path.count("/")
        return f"[{words}]({'../' * depth}{TAKEN[name]})" if name in TAKEN else f"{words} (`{name}`)"

    markdown = titled(listed(markdown), page.file.src_path, TITLES)
    if page.file.src_path in TAKEN.values():
        return re.sub(r"\]\(docs/", "](", markdown)
    return re.sub(
        r"(?<!!)\[([^\]]+)\]\((\.\./(?:\.\./)?(?:[A-Z]+\.md|examples/[^)]*|benchmarks/[^)]*))\)", lead, markdown
    )
