"""report.html: one page, readable offline, with the map and what was found; all text is escaped."""

import base64
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 62rem; padding: 0 1rem }
img { max-width: 100%; max-height: 70vh }
table { border-collapse: collapse; width: 100% }
th, td { text-align: left; padding: .3rem .6rem; vertical-align: top }
tr { border-bottom: 1px solid #ddd } .error { color: #b00020 } .warning { color: #9a6700 }
"""


def write_page(report: Mapping[str, Any], overview: Path, page: Path) -> None:
    """Write the report as a page, with the overview picture inside."""
    picture = base64.b64encode(overview.read_bytes()).decode("ascii")
    counts = ", ".join(f"{number} {severity}s" for severity, number in report["counts"].items())
    name = escape(str(report["map"]))
    page.write_text(
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{name}: report</title>'
        f"<style>{_STYLE}</style></head><body><h1>{name}</h1><p>{escape(counts)}</p>"
        f'<img alt="the map from above" src="data:image/png;base64,{picture}">'
        f"<h2>Checks</h2>{_checks(report['checks'])}<h2>Findings</h2>{_issues(report['issues'])}</body></html>\n",
        encoding="utf-8",
    )


def _checks(checks: list[dict[str, Any]]) -> str:
    return _table(
        ("check", "what", "status", "findings"),
        [[c["id"], c["title"], c["status"], c["count"]] for c in checks],
    )


def _issues(issues: list[dict[str, Any]]) -> str:
    if not issues:
        return "<p>None.</p>"
    rows = [
        [
            i["severity"],
            i["check"],
            ", ".join(f"{e['kind']} {e['id']}" for e in i["elements"]),
            i["message"],
            i["hint"],
        ]
        for i in issues
    ]
    return _table(("severity", "check", "elements", "what is wrong", "what to do"), rows)


def _table(head: tuple[str, ...], rows: list[list[Any]]) -> str:
    def row(cells: Any, tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{escape(str(cell))}</{tag}>" for cell in cells) + "</tr>"

    return f"<table>{row(head, 'th')}{''.join(row(cells, 'td') for cells in rows)}</table>"
