"""Reports for people and for other programs: text, SARIF and GeoJSON."""

from collections.abc import Iterator, Mapping
from typing import Any
from urllib.parse import quote

from dojo_maps.wording import counted

_SARIF = "https://json.schemastore.org/sarif-2.1.0.json"


def as_text(report: Mapping[str, Any]) -> Iterator[str]:
    """Write a report as lines for a terminal.

    Args:
        report: as JSON values.

    Yields:
        Lines without their ends: the issues, each after its check's hint where the check is another one than
        before; then the checks that crashed; last the counts.
    """
    last = ""
    for issue in report["issues"]:
        if issue["check"] != last:
            last = issue["check"]
            yield f"{last}: {printable(issue['hint'])}"
        x, y = issue["position"][:2]
        yield f"  {issue['severity']:7} at {x:.1f},{y:.1f}: {printable(issue['message'])}"
    for check in report["checks"]:
        if check["status"] == "crashed":
            yield f"{check['id']}: crashed: {printable(check.get('reason', ''))}"
    skipped = sum(check["status"] == "skipped" for check in report["checks"])
    counts = ", ".join(counted(count, severity) for severity, count in report["counts"].items())
    excluded = f", {len(report['excluded'])} excluded" if report.get("excluded") else ""
    checks = counted(len(report["checks"]), "check")
    yield f"{printable(report['map'])}: {counts}{excluded}; {checks}, {skipped} skipped"


def as_sarif(report: Mapping[str, Any], network: str, lines: Mapping[tuple[str, str], int]) -> dict[str, Any]:
    """Write a report in the Static Analysis Results Interchange Format, 2.1.0, for code review tools.

    Args:
        report: as JSON values.
        network: the network's file, as a path relative to where it is reviewed.
        lines: the line of each element in it, by kind and id.

    Returns:
        One run as JSON values, with a rule for each check; an issue whose elements have no line is put on the
        first.
    """
    hints = {issue["check"]: issue["hint"] for issue in report["issues"]}
    places = {check["id"]: place for place, check in enumerate(report["checks"])}
    crashed = [check for check in report["checks"] if check["status"] == "crashed"]
    rules = [
        {
            "id": check["id"],
            "shortDescription": {"text": check["title"]},
            **({"help": {"text": hints[check["id"]]}} if check["id"] in hints else {}),
        }
        for check in report["checks"]
    ]
    run = {
        "tool": {"driver": {"name": "dojo-maps", "rules": rules}},
        "columnKind": "unicodeCodePoints",
        "invocations": [
            {
                "executionSuccessful": not crashed,
                "toolExecutionNotifications": [
                    {"level": "error", "message": {"text": f"{check['id']}: {check.get('reason', '')}"}}
                    for check in crashed
                ],
            }
        ],
        "results": [_sarif_result(issue, places, quote(network), lines) for issue in report["issues"]],
    }
    return {"$schema": _SARIF, "version": "2.1.0", "runs": [run]}


def _sarif_result(
    issue: Mapping[str, Any],
    places: Mapping[str, int],
    uri: str,
    lines: Mapping[tuple[str, str], int],
) -> dict[str, Any]:
    named = [(element["kind"], element["id"]) for element in issue["elements"]]
    line = next((lines[name] for name in named if name in lines), 1)
    rule = {"ruleIndex": places[issue["check"]]} if issue["check"] in places else {}
    return {
        "ruleId": issue["check"],
        **rule,
        "level": issue["severity"],
        "message": {"text": f"{issue['message']}; {issue['hint']}"},
        "locations": [
            {
                "physicalLocation": {"artifactLocation": {"uri": uri}, "region": {"startLine": line}},
                "logicalLocations": [{"kind": kind, "fullyQualifiedName": id_} for kind, id_ in named],
            }
        ],
        "properties": {key: issue[key] for key in ("position", "lonlat", "measured", "limit")},
    }


def as_geojson(report: Mapping[str, Any]) -> dict[str, Any]:
    """Write the issues as GeoJSON points, WGS 84.

    Args:
        report: as JSON values.

    Returns:
        A FeatureCollection as JSON values, with a feature for each issue; those without a place on the earth,
        as of a map without a projection, have no geometry.
    """
    return {
        "type": "FeatureCollection",
        "features": [
            {
                "type": "Feature",
                "geometry": {"type": "Point", "coordinates": issue["lonlat"]} if issue["lonlat"] else None,
                "properties": {key: value for key, value in issue.items() if key != "lonlat"},
            }
            for issue in report["issues"]
        ],
    }


def printable(text: str) -> str:
    """Keep a line one line, and terminals as they are, whatever the map's names hold.

    Args:
        text: of a map or a report.

    Returns:
        The text, with `?` for each character that is not printable, such as a line's end.
    """
    return "".join(letter if letter.isprintable() else "?" for letter in text)
