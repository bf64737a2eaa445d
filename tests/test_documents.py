"""What the documents say is so: their links lead somewhere, their commands and code run.

Blocks marked `python` and `console` are run, page by page, in a folder of their own; a block with a title is
a file there. What a `console` block shows must appear in the output, where `...` stands for anything. Blocks
marked `py` and `sh` need a network, minutes or a browser: their imports and options must exist.
"""

import ast
import importlib.util
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from conftest import command_environment, import_ours

import dojo_env.cli
import dojo_maps.cli
from dojo_maps.cli_area import join_signed

REPOSITORY = Path(__file__).resolve().parents[1]
ROOMS = ("dojo_maps", "dojo_env", "examples", ".github")
PAGES = sorted(
    [REPOSITORY / "README.md", *(page for room in ROOMS for page in (REPOSITORY / room).rglob("*.md"))]
)
PARSERS = {"dojo-maps": dojo_maps.cli.build_parser, "dojo-env": dojo_env.cli.build_parser}
LENGTHS = {"README.md": 150, "dojo_maps/README.md": 120, "dojo_env/README.md": 120}
NEEDS = re.compile(r"<!-- test: needs (\w+); takes minutes -->")


@dataclass(frozen=True)
class Block:
    """A block of code: its language, its title, and its text."""

    language: str
    title: str
    text: str


def name_of(page: Path) -> str:
    return str(page.relative_to(REPOSITORY))


def list_blocks(page: Path) -> list[Block]:
    found = re.findall(
        r"^```(\w*)(?: title=\"([^\"]+)\")?\n(.*?)^```$", page.read_text("utf-8"), re.MULTILINE | re.DOTALL
    )
    return [Block(*each) for each in found]


def runs(page: Path) -> bool:
    return any(block.language in {"python", "console"} for block in list_blocks(page))


def without_blocks(page: Path) -> str:
    return re.sub(r"^```.*?^```$", "", page.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)


def list_anchors(page: Path) -> set[str]:
    """List what headings are called in addresses, as GitHub and Python-Markdown have it."""
    headings = re.findall(r"^#+ (.*)$", without_blocks(page), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_lead_somewhere(page: Path) -> None:
    for link in re.findall(r"\]\(([^)\s]+)\)", re.sub(r"`[^`\n]*`", "", without_blocks(page))):
        if not link.startswith(("http://", "https://")):
            path, _, anchor = link.partition("#")
            target = (page.parent / path).resolve() if path else page
            assert target.exists(), link
            assert not anchor or anchor in list_anchors(target), link


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_commands_exist(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for block in list_blocks(page):
        if block.title:
            Path(block.title).write_text(block.text, encoding="utf-8")
    for line in list_commands(page):
        words = shlex.split(re.sub(r"[&|].*", "", line), comments=True)
        if words[0] in PARSERS and not {"--help", "..."} & set(words):
            PARSERS[words[0]]().parse_args(join_signed(words[1:]))


def list_commands(page: Path) -> Iterator[str]:
    """List the command lines of a page: in the blocks of shells, one a line."""
    for block in list_blocks(page):
        if block.language in {"sh", "console", ""}:
            for line in block.text.splitlines():
                for part in line.removeprefix("$ ").split(" && "):
                    if part.startswith(("dojo-maps ", "dojo-env ")):
                        yield part


def test_every_command_has_an_example_that_exists() -> None:
    for program, build in PARSERS.items():
        (commands,) = (action for action in build()._actions if hasattr(action, "_name_parser_map"))
        for name, parser in commands._name_parser_map.items():
            found = re.fullmatch(r"example: (dojo-\w+) (.*)", parser.epilog)
            assert found, name
            assert (found[1], found[2].split()[0]) == (program, name)
            build().parse_args(join_signed(shlex.split(found[2])))


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_imports_exist(page: Path) -> None:
    for block in list_blocks(page):
        if block.language in {"py", "python"}:
            for node in ast.walk(ast.parse(block.text)):
                if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("dojo_"):
                    module = import_ours(str(node.module))
                    if module is None:
                        pytest.skip(f"a package that {node.module} needs is not installed")
                    assert all(hasattr(module, alias.name) for alias in node.names), ast.unparse(node)
                is_ours = isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)
                if is_ours and node.value.id in {"dojo_env", "dojo_maps"}:
                    assert node.attr in sys.modules[node.value.id].__all__, ast.unparse(node)


@pytest.mark.parametrize("name", LENGTHS)
def test_readme_is_short(name: str) -> None:
    assert len((REPOSITORY / name).read_text("utf-8").splitlines()) <= LENGTHS[name]


def list_scripts(whole: bool) -> list[Path]:
    return [page for page in PAGES if runs(page) and (whole or not NEEDS.search(page.read_text("utf-8")))]


@pytest.mark.slow
@pytest.mark.sampled(2)
@pytest.mark.parametrize("page", list_scripts(whole=True), ids=name_of)
def test_page_runs(page: Path, tmp_path: Path, pytestconfig: pytest.Config) -> None:
    needed = NEEDS.search(page.read_text("utf-8"))
    if needed and not (pytestconfig.getoption("--whole") and importlib.util.find_spec(needed[1])):
        pytest.skip(f"needs {needed[1]}, and minutes: --whole")
    folder, programs = tmp_path / "page", tmp_path / "programs"
    folder.mkdir()
    programs.mkdir()
    for program in PARSERS:
        script = programs / program
        script.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m {program.replace("-", "_")} "$@"\n')
        script.chmod(0o755)
    environment = command_environment(PATH=f"{programs}{os.pathsep}{os.environ['PATH']}")
    said_so_far = ""
    for block in list_blocks(page):
        if block.title:
            (folder / block.title).write_text(block.text, encoding="utf-8")
        elif block.language == "console":
            run_console(block.text, folder, environment)
        elif block.language == "python":
            # Later blocks of a page use the names of earlier ones.
            said_so_far += block.text
    if said_so_far:
        done = subprocess.run(
            [sys.executable, "-c", said_so_far], cwd=folder, env=environment, capture_output=True, text=True,
            timeout=600, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr


def run_console(text: str, folder: Path, environment: dict[str, str]) -> None:
    """Run each command of a block, and compare what it says with what is shown of it."""
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        command, *shown = part.splitlines()
        done = subprocess.run(
            ["bash", "-c", command], cwd=folder, env=environment, capture_output=True, text=True,
            timeout=600, check=False,
        )  # fmt: skip
        tells_errors = command.startswith(("dojo-maps validate", "dojo-maps fix", "dojo-maps convert"))
        assert done.returncode in ({0, 1} if tells_errors else {0}), f"{command}\n{done.stderr}"
        for line in shown:
            pattern = ".*".join(re.escape(each) for each in line.split("..."))
            assert re.search(f"^{pattern}$", done.stdout, re.MULTILINE), f"{command}\n{line}\n{done.stdout}"


@pytest.mark.slow
def test_site_is_built(tmp_path: Path) -> None:
    """In strict mode: a link or an anchor that leads nowhere, or a name without a docstring, is an error."""
    if not (importlib.util.find_spec("mkdocstrings") and importlib.util.find_spec("material")):
        pytest.skip("needs the extra docs")
    command = [sys.executable, str(REPOSITORY / "tools" / "build_site.py"), "-o", str(tmp_path / "site")]
    done = subprocess.run(command, env=command_environment(), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    for package in (dojo_maps, dojo_env):
        page = (tmp_path / "site" / "reference" / f"{package.__name__}.html").read_text("utf-8")
        assert all(f'id="{package.__name__}.{name}"' in page for name in package.__all__)
