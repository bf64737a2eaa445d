"""Reports for people and for other programs: text, SARIF and GeoJSON."""

from collections.abc import Iterator, Mapping
from typing import Any

_SARIF = "https://json.schemastore.org/sarif-2.1.0.json"


def as_text(report: Mapping[str, Any]) -> Iterator[str]:
    """Write a report as lines: one per issue, its hint once per check, then what did not run, then counts."""
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
    counts = ", ".join(f"{count} {severity}s" for severity, count in report["counts"].items())
    excluded = f", {len(report['excluded'])} excluded" if report.get("excluded") else ""
    yield f"{printable(report['map'])}: {counts}{excluded}; {len(report['checks'])} checks, {skipped} skipped"


def as_sarif(report: Mapping[str, Any], network: str) -> dict[str, Any]:
    """Write a report in the Static Analysis Results Interchange Format, 2.1.0, for code review tools."""
    return {
        "$schema": _SARIF,
        "version": "2.1.0",
        "runs": [
            {
                "tool": {
                    "driver": {
                        "name": "dojo-maps",
                        "rules": [
                            {"id": check["id"], "shortDescription": {"text": check["title"]}}
                            for check in report["checks"]
                        ],
                    }
                },
                "results": [_sarif_result(issue, network) for issue in report["issues"]],
            }
        ],
    }


def _sarif_result(issue: Mapping[str, Any], network: str) -> dict[str, Any]:
    return {
        "ruleId": issue["check"],
        "level": issue["severity"],
        "message": {"text": f"{issue['message']}. {issue['hint']}"},
        "locations": [
            {
                "physicalLocation": {"artifactLocation": {"uri": network}, "region": {"startLine": 1}},
                "logicalLocations": [
                    {"kind": element["kind"], "fullyQualifiedName": element["id"]}
                    for element in issue["elements"]
                ],
            }
        ],
        "properties": {key: issue[key] for key in ("position", "lonlat", "measured", "limit")},
    }


def as_geojson(report: Mapping[str, Any]) -> dict[str, Any]:
    """Write the issues as GeoJSON points, WGS 84; issues of a map without a projection have no geometry."""
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
    """Keep a line one line, and terminals as they are, whatever the map's names hold."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)
