"""The command `fix`: read a network, repair it, say what was done, write it whole or not at all."""

import gzip
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from dojo_maps.bundle import write_json
from dojo_maps.errors import UsageError
from dojo_maps.inspection import read_source
from dojo_maps.issue import Severity
from dojo_maps.repair.cost import Cost
from dojo_maps.repair.patch import plain_files
from dojo_maps.repair.repairs import ON_REQUEST, REPAIRS
from dojo_maps.repair.rounds import Fixed, Made, State, fix_network
from dojo_maps.report.formats import printable
from dojo_maps.whole_file import added_files, replaced
from dojo_maps.wording import counted


def fix(source: str, only: Collection[str] = ()) -> Fixed:
    """Repair a network, or that of a bundle, in memory.

    Raises:
        SourceError: it cannot be read.
        UsageError: `only` names a check that has no repair.
    """
    if isinstance(only, str):
        raise UsageError(
            f"only={printable(only)!r}: expected a list of checks; write only=[{printable(only)!r}]"
        )
    for check in only:
        if check not in REPAIRS:
            raise UsageError(
                f"{printable(check)}: no check with a repair; there are {', '.join(sorted(REPAIRS))}"
            )
    read = read_source(source)
    return fix_network(read.data, read.path, only)


def patch_of(fixed: Fixed, cost: Cost | None = None) -> dict[str, str]:
    """Write what was done, and what it cost, as plain XML files, by name."""
    edits = [(made.check, made.edit) for made in fixed.made]
    return plain_files(fixed.after.site.text, edits, str(cost) if cost else "")


def as_record(fixed: Fixed, cost: Cost | None = None) -> dict[str, Any]:
    """Write what was done, what was left alone, every check's count and what it cost, as JSON values."""
    states = {"before": fixed.before, "after": fixed.after}
    return {
        "format": "dojo-repair",
        "version": 1,
        "repairs": [_record(made) for made in fixed.made],
        "left": [{**_record(made), "reason": made.reason} for made in fixed.refused],
        "checks": [
            {"id": check, **{when: state.counts.get(check, (0, 0))[0] for when, state in states.items()}}
            for check in {**fixed.before.counts, **fixed.after.counts}
        ],
        "counts": {
            when: {severity.value: count for severity, count in _by_severity(state).items()}
            for when, state in states.items()
        },
        "waiting": None if cost is None else asdict(cost),
    }


def _record(made: Made) -> dict[str, Any]:
    return {"check": made.check, "element": asdict(made.edit.element), "what": made.edit.what}


def _by_severity(state: State) -> dict[Severity, int]:
    found = Counter(issue.severity for issue in state.issues)
    return {severity: found[severity] for severity in Severity}


def describe(fixed: Fixed, cost: Cost | None = None) -> Iterator[str]:
    """Say what was done, what was left alone and why, every check's count before and after, and the cost."""
    for made in fixed.made:
        yield printable(f"{made.check}: {made.edit.element.kind} {made.edit.element.id}: {made.edit.what}")
    for made in fixed.refused:
        element = made.edit.element
        yield printable(f"{made.check}: {element.kind} {element.id}: left as it is, {made.reason}")
    before, after = fixed.before.counts, fixed.after.counts
    yield f"{'check':36}{'before':>7}{'after':>7}"
    for check in {**before, **after}:
        asked = "  repaired on request: --only" if check in ON_REQUEST and check in after else ""
        yield f"{check:36}{before.get(check, (0, 0))[0]:7}{after.get(check, (0, 0))[0]:7}{asked}"
    if cost is not None:
        yield printable(str(cost))
    counts = ", ".join(counted(count, severity) for severity, count in _by_severity(fixed.after).items())
    repairs, rounds = counted(len(fixed.made), "repair"), counted(fixed.rounds, "round")
    yield f"{repairs} in {rounds}; {counts} are left"


def write_fixed(
    fixed: Fixed, output: Path | None, patch: Path | None, record: Path | None, cost: Cost | None
) -> None:
    """Write the network, packed if its name says so, the patch's files and the record; each whole or not.

    Raises:
        UsageError: a path is a folder, or lies in none.
        WriteError: a path cannot be written.
    """
    if patch is not None:
        with added_files(patch) as fresh:
            for name, text in patch_of(fixed, cost).items():
                (fresh / name).write_text(text, encoding="utf-8")
    if output is not None:
        data = fixed.after.data
        with replaced(output) as fresh:
            fresh.write_bytes(gzip.compress(data, mtime=0) if output.name.endswith(".gz") else data)
    if record is not None:
        with replaced(record) as fresh:
            write_json(fresh, as_record(fixed, cost))
