"""The site: its pages' code runs as it stands, every public name is in it, and no page is forgotten."""

import doctest
import importlib.util
import os
import re
import shlex
import shutil
from pathlib import Path
from types import ModuleType

import pytest
import yaml
from typer.testing import CliRunner

import pinbound
from pinbound.cli import app

HERE = Path(__file__).resolve().parents[1]
DOCS = HERE / "docs"
TUTORIALS = sorted((DOCS / "tutorials").glob("*.md"))
LEARNT = [*TUTORIALS, *sorted((DOCS / "howto").glob("*.md"))]
FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
BLOCK = re.compile(r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```', re.MULTILINE | re.DOTALL)


def plain(text: str) -> str:
    """Return what a table says, without its frame."""
    return " ".join(re.sub(r"[^\x20-\x7e\n]", " ", text).split())


@pytest.mark.parametrize("page", [DOCS / "index.md", DOCS / "install.md", *LEARNT], ids=lambda page: page.stem)
def test_a_page_runs_as_it_stands(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Files are written, commands run, examples print what is shown, and figures are those that the page shows."""
    monkeypatch.chdir(tmp_path)
    text = page.read_text(encoding="utf-8")
    said, names = "", dict[str, object]()
    runner = doctest.DocTestRunner(optionflags=FLAGS)
    for kind, title, body in BLOCK.findall(text):
        if title:
            Path(title).write_text(body, encoding="utf-8")
        elif kind == "sh":
            for line in body.strip().splitlines():
                if line.startswith("pinbound "):
                    result = CliRunner().invoke(app, shlex.split(line)[1:])
                    assert result.exit_code in (0, 1), result.output
                    said = plain(result.output)
        elif kind == "python":
            example = doctest.DocTestParser().get_doctest(body, names, page.stem, str(page), None)
            assert example.examples, body
            runner.run(example, clear_globs=False)
            names |= example.globs
        elif kind == "text" and said:
            for line in body.strip().splitlines():
                assert plain(line) in said
            said = ""
    assert runner.failures == 0
    drawn = {path.name for path in tmp_path.glob("*.svg")}
    assert drawn == set(re.findall(r"!\[[^]]+\]\(([\w-]+\.svg)\)", text))
    if os.environ.get("PINBOUND_DRAW"):
        for name in drawn:
            shutil.copy(tmp_path / name, page.parent)
    assert all((page.parent / name).exists() for name in drawn)


def test_there_are_five_tutorials() -> None:
    assert [path.stem[:2] for path in TUTORIALS] == [f"{number}-" for number in range(1, 6)]


def test_every_public_name_is_in_the_reference_once() -> None:
    shown = [
        name
        for page in (DOCS / "reference").glob("*.md")
        for name in re.findall(r"^::: pinbound\.(\w+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    ]
    assert sorted(shown) == sorted(pinbound.__all__)


def test_every_public_name_is_used_in_a_tutorial_or_a_how_to() -> None:
    text = "\n".join(page.read_text(encoding="utf-8") for page in LEARNT)
    assert [name for name in pinbound.__all__ if not re.search(rf"\bpb\.{name}\b", text)] == []


def test_every_page_is_in_the_navigation_once() -> None:
    listed: list[str] = []

    def walk(entry: object) -> None:
        if isinstance(entry, str):
            listed.append(entry)
        elif isinstance(entry, dict):
            for value in entry.values():
                walk(value)
        elif isinstance(entry, list):
            for value in entry:
                walk(value)

    walk(yaml.safe_load((HERE / "mkdocs.yml").read_text(encoding="utf-8"))["nav"])
    made = {"changelog.md", "contributing.md", "security.md", "reference/cli.md"}
    there = {str(path.relative_to(DOCS)) for path in DOCS.rglob("*.md")}
    assert len(listed) == len(set(listed))
    assert set(listed) == there | made


def test_what_the_pages_name_exists() -> None:
    for page in DOCS.rglob("*.md"):
        text = page.read_text(encoding="utf-8")
        for name in re.findall(r"`((?:tests|benchmarks|examples)/[\w/]+\.\w+)`", text):
            assert (HERE / name).exists(), (page.name, name)
        for name in re.findall(r"`python ((?:benchmarks|examples)/\w+\.py)", text):
            assert (HERE / name).exists(), (page.name, name)


def test_every_block_of_code_opens_as_the_site_reads_it() -> None:
    """A name without `title=` ended the block on the site, and the rest of the page stood in the wrong letters."""
    opens = re.compile(r'```\w+( title="[^"]+")?')
    for page in [*DOCS.rglob("*.md"), *(HERE / name for name in ("CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md"))]:
        fences = [line.strip() for line in page.read_text(encoding="utf-8").splitlines() if line.lstrip()[:3] == "```"]
        assert fences[1::2] == ["```"] * (len(fences) // 2), page.name
        assert [line for line in fences[::2] if not opens.fullmatch(line)] == [], page.name


def site_text() -> ModuleType:
    """Return what the site's hook does to text, which needs nothing but Python."""
    spec = importlib.util.spec_from_file_location("site_text", HERE / ".ci" / "site_text.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_what_the_hook_does_to_text_is_what_its_examples_say() -> None:
    result = doctest.testmod(site_text())
    assert result.attempted >= 5
    assert result.failed == 0


def test_names_of_files_become_titles_and_code_stays_as_it_is() -> None:
    titled = site_text().titled
    titles = {"howto/regions.md": "Work with regions", "loops.md": "Loops"}
    assert titled("[regions.md](regions.md#a)", "howto/index.md", titles) == "[Work with regions](regions.md#a)"
    assert titled("(docs/loops.md, Branches)", "changelog.md", titles) == "([Loops](loops.md), Branches)"
    for kept in (
        "[the loops](loops.md)",
        "`--out docs/loops.md`",
        "```sh\ncat docs/loops.md\n```",
        "[other.md](other.md)",
        "mine/loops.md",
    ):
        assert titled(kept, "index.md", titles) == kept


def test_code_breaks_between_words_only() -> None:
    broken = {
        "pip install .": "pip <wbr>install <wbr>.",
        "tests/test_a.py": "tests/<wbr>test_a.py",
        "first_contact(1)": "first_<wbr>contact(1)",
        "--require-coverage": "--require-<wbr>coverage",
        "&lt;axis&gt;": "&lt;axis&gt;",
        "-0.25": "-0.25",
        "first.q": "first.q",
    }
    for code, there in broken.items():
        assert site_text().breakable(f"<code>{code}</code>") == f"<code>{there}</code>"


def test_the_words_of_the_glossary_are_in_order() -> None:
    rows = (DOCS / "glossary.md").read_text(encoding="utf-8").splitlines()
    words = [row.split("|")[1].strip() for row in rows if row.startswith("| ")][2:]
    assert len(words) > 30
    assert words == sorted(words)


def test_the_site_asks_nobody_else() -> None:
    """No font, no script, no style of others is fetched by a reader."""
    settings = yaml.safe_load((HERE / "mkdocs.yml").read_text(encoding="utf-8"))
    assert settings["theme"]["font"] is False
    assert not any("://" in one for key in ("extra_css", "extra_javascript") for one in settings.get(key, []))
    assert "://" not in (DOCS / "site.css").read_text(encoding="utf-8")
