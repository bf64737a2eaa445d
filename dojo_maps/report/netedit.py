"""Files that open netedit on an issue: selections, and views that look at its place."""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

from dojo_maps.whole_file import added_files

_KINDS = {
    "road": "edge",
    "lane": "lane",
    "junction": "junction",
    "crossing": "crossing",
    "connection": "connection",
}
_ZOOM = 1500
_MOST_VIEWS = 1000


def selection_lines(issues: Iterable[Mapping[str, Any]]) -> list[str]:
    """Name the elements of issues as netedit's selection files do, each once.

    Args:
        issues: as JSON values.

    Returns:
        `edge:ID`, `lane:ID` and so on, without line ends, in the issues' order; signals, walking areas and
        others that such a file cannot name are left out.
    """
    lines = (
        f"{_KINDS[element['kind']]}:{element['id']}"
        for issue in issues
        for element in issue["elements"]
        if element["kind"] in _KINDS and "\n" not in element["id"]
    )
    return list(dict.fromkeys(lines))


def write_netedit_files(report: Mapping[str, Any], folder: Path) -> None:
    """Write a selection per check, and a selection and a view per issue, into a folder.

    Use them as `netedit -s NET --selection-file 0007.selection.txt -g 0007.view.xml`.

    Args:
        report: as JSON values; of its issues the first 1000 have files of their own.
        folder: it is made where there is none, and may hold other files.

    Raises:
        UsageError: a file is in the folder's way.
        WriteError: the folder cannot be written; none of the files is there then.
    """
    by_check: dict[str, list[Mapping[str, Any]]] = defaultdict(list)
    with added_files(folder) as fresh:
        for number, issue in enumerate(report["issues"], 1):
            by_check[issue["check"]].append(issue)
            if number <= _MOST_VIEWS:
                _write_selection(fresh / f"{number:04}.selection.txt", [issue])
                x, y = (quoteattr(f"{value:.2f}") for value in issue["position"][:2])
                view = f'<viewport zoom="{_ZOOM}" x={x} y={y} angle="0"/>'
                (fresh / f"{number:04}.view.xml").write_text(
                    f"<viewsettings>\n    {view}\n</viewsettings>\n", encoding="utf-8"
                )
        for check, issues in by_check.items():
            _write_selection(fresh / f"{check}.selection.txt", issues)


def _write_selection(path: Path, issues: Iterable[Mapping[str, Any]]) -> None:
    path.write_text("".join(f"{line}\n" for line in selection_lines(issues)), encoding="utf-8")
