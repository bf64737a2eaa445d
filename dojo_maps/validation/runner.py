"""Run every check on a map and put what they find into one report."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from typing import Any

from dojo_maps.description import RoadMap
from dojo_maps.issue import Issue, Report, Severity
from dojo_maps.meshes.mesh import Mesh
from dojo_maps.sumo_loading import Loading
from dojo_maps.validation.catalogue import CHECKS
from dojo_maps.validation.check import Check, Need, place
from dojo_maps.validation.exclusions import Exclusion, split_excluded
from dojo_maps.validation.facts import Facts
from dojo_maps.validation.positions import earth_positions
from dojo_maps.validation.profiles import DEFAULT, Profile

REPORT_FORMAT = "dojo-report"
REPORT_VERSION = 1


def find_issues(
    road_map: RoadMap,
    meshes: Sequence[Mesh] | None,
    known: Iterable[Issue],
    profile: Profile = DEFAULT,
    checks: Sequence[Check] = CHECKS,
    sumo: Loading | None = None,
) -> tuple[list[Issue], dict[str, str]]:
    """Run every check.

    Args:
        road_map: the description.
        meshes: its scene; None skips the checks of meshes.
        known: what was found while reading the source.
        profile: limits and severities.
        checks: which to run.
        sumo: the network on its way into SUMO; None skips the checks that ask SUMO.

    Returns:
        The issues in the order of the catalogue, and the state of each check that did not complete:
        "skipped" or "crashed", with the reason. A check that breaks counts as an error.
    """
    facts = Facts(road_map, meshes, sumo)
    there = {
        Need.NOTHING: True,
        Need.MESHES: meshes is not None,
        Need.SUMO: sumo is not None,
        Need.IMPORT: road_map.source.kind != "sumo",
    }
    issues, states = list(known), {}
    for check in checks:
        if not there.get(check.needs):
            states[check.id] = f"skipped: it needs {check.needs.value}"
            continue
        try:
            issues.extend(_run(check, facts, profile))  # one by one: what is found before a crash stays
        except Exception as error:  # noqa: BLE001 - one broken check must not hide what the others find
            states[check.id] = f"crashed: {type(error).__name__}: {error}"
            issues.append(_crash(check, error, road_map))
    order = {check.id: k for k, check in enumerate(checks)}
    issues.sort(key=lambda issue: order.get(issue.check, len(order)))
    return issues, states


def run_checks(
    road_map: RoadMap,
    meshes: Sequence[Mesh] | None,
    known: Iterable[Issue],
    profile: Profile = DEFAULT,
    exclusions: Sequence[Exclusion] = (),
    *,
    sumo: Loading | None = None,
) -> Report:
    """Run every check and write the report as JSON values.

    Args:
        road_map: the description.
        meshes: its scene; None skips the checks of meshes.
        known: what was found while reading the source.
        profile: limits and severities.
        exclusions: known issues, which are listed apart and not counted.
        sumo: the network on its way into SUMO; None skips the checks that ask SUMO.

    Returns:
        The report: the map's and the profile's names, how many issues there are of each severity, every check
        and its status, the issues with their places on the earth, and those that are excluded, with the
        reason.
    """
    found, states = find_issues(road_map, meshes, known, profile, CHECKS, sumo)
    issues, excluded = split_excluded(found, exclusions)
    return Report(
        {
            "format": REPORT_FORMAT,
            "version": REPORT_VERSION,
            "map": road_map.name,
            "profile": profile.name,
            "counts": {severity.value: sum(i.severity is severity for i in issues) for severity in Severity},
            "checks": [_encode_check(check, states.get(check.id, ""), issues) for check in CHECKS],
            "issues": [
                {**_encode(issue), "lonlat": lonlat}
                for issue, lonlat in zip(issues, earth_positions(issues, road_map.projection), strict=True)
            ],
            "excluded": [{**_encode(issue), "reason": reason} for issue, reason in excluded],
        }
    )


def _run(check: Check, facts: Facts, profile: Profile) -> Iterator[Issue]:
    severity = profile.severities.get(check.id)
    for finding in check.run(facts, profile.limits) if check.run else ():
        yield Issue(
            check=check.id,
            severity=severity or finding.severity or check.severity,
            elements=finding.elements,
            position=place(finding.at),
            message=finding.message,
            measured=finding.measured,
            limit=finding.limit,
            hint=check.hint,
        )


def _crash(check: Check, error: Exception, road_map: RoadMap) -> Issue:
    return Issue(
        check=check.id,
        severity=Severity.ERROR,
        elements=(),
        position=(*road_map.origin, 0.0),
        message=f"the check itself failed: {type(error).__name__}: {error}",
        hint="report this with the network; the other checks are not affected",
    )


def _encode_check(check: Check, state: str, issues: Sequence[Issue]) -> dict[str, Any]:
    status, _, reason = state.partition(": ")
    encoded: dict[str, Any] = {
        "id": check.id,
        "title": check.title,
        "status": status or "completed",
        "count": sum(issue.check == check.id for issue in issues),
    }
    return {**encoded, "reason": reason} if reason else encoded


def _encode(issue: Issue) -> dict[str, Any]:
    def rounded(value: float | None) -> float | None:
        return None if value is None else round(value, 4)

    return {
        **asdict(issue),
        "severity": issue.severity.value,
        "measured": rounded(issue.measured),
        "limit": rounded(issue.limit),
    }
