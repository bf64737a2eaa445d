"""Build one site of all documents: guides, rooms' pages, and a reference out of docstrings.

Needs the extra `docs`. Pages keep the places that they have in the repository, so links between them work in
both. `site.yml` has the navigation.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from types import ModuleType

import dojo_env
import dojo_maps
from dojo_maps.input_files import read_bytes

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = (dojo_maps, dojo_env)
FOUND = (
    *("*.md", "*.cff", "LICENSE", ".github/*.md", "examples/**/*.md"),
    *("dojo_maps/**/*.md", "dojo_env/**/*.md", "dojo_maps/*.json"),
    *("tools/results/**/*.md", "tools/results/*.csv", "**/pictures/*.jpg", "**/pictures/*.png"),
)
"""The documents, and what they show or link to."""


def build_site(site: Path) -> None:
    """Build the site; a link that leads nowhere is an error.

    Args:
        site: the folder to write, or to write anew.

    Raises:
        SystemExit: mkdocs found an error, and said it.
    """
    with tempfile.TemporaryDirectory() as folder:
        pages = Path(folder) / "pages"
        copy_pages(pages)
        for package in PACKAGES:
            _write_reference(pages / "reference" / f"{package.__name__}.md", package)
        settings = Path(folder) / "mkdocs.yml"
        handlers = {"python": {"paths": [str(ROOT)]}}
        changes = {
            "INHERIT": str(ROOT / "tools" / "site.yml"),
            "docs_dir": str(pages),
            "site_dir": str(site.resolve()),
            "plugins": {"mkdocstrings": {"handlers": handlers}},
        }
        settings.write_text(json.dumps(changes), encoding="utf-8")  # JSON is YAML, too.
        command = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "-f", str(settings)]
        variables = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
        done = subprocess.run(command, check=False, env=variables)  # noqa: S603 - our own words
        if done.returncode:
            raise SystemExit(done.returncode)


def copy_pages(pages: Path) -> None:
    """Copy documents to the places that they have in the repository, and what they show beside them.

    Args:
        pages: the folder to make.
    """
    for path in sorted({path for pattern in FOUND for path in ROOT.glob(pattern)}):
        place = path.relative_to(ROOT)
        target = pages / Path(*(part.lstrip(".") for part in place.parts))  # Without the dot of .github.
        if place.parts[0].startswith((".venv", "build")):
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        if path.suffix == ".md":
            text = read_bytes(path).decode().replace("(.github/", "(github/")
            target.write_text(text, encoding="utf-8")
        else:
            shutil.copy(path, target)


def _write_reference(path: Path, package: ModuleType) -> None:
    lines = [f"# {package.__name__}", "", str(package.__doc__), ""]
    lines += [f"::: {package.__name__}.{name}\n" for name in sorted(package.__all__, key=str.lower)]
    path.parent.mkdir(exist_ok=True)
    path.write_text("\n".join(lines), encoding="utf-8")


def main() -> int:
    """Build it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "-o", "--output", type=Path, default=ROOT / "build" / "site", help="(default: build/site)"
    )
    output = parser.parse_args().output
    build_site(output)
    print(output / "index.html")
    return 0


if __name__ == "__main__":
    sys.exit(main())
