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

    Args:
        source: a path, a packaged scenario's name, or a bundle; the file stays as it is.
        only: the checks to repair; empty means all but those that are repaired on request.

    Returns:
        The network before and after, with what was done to it and what was left alone.

    Raises:
        SourceError: it cannot be read.
        ToolMissingError: the scenario's package is not installed.
        UsageError: `only` names a check that has no repair, or is one text and no list of them.
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
    """Write what was done, and what it cost, as plain XML files.

    Args:
        fixed: the repair.
        cost: said in a comment at the head of each file; None leaves it out.

    Returns:
        The text of each file by its name; no file where there is nothing to say.
    """
    edits = [(made.check, made.edit) for made in fixed.made]
    return plain_files(fixed.after.site.text, edits, str(cost) if cost else "")


def as_record(fixed: Fixed, cost: Cost | None = None) -> dict[str, Any]:
    """Write what was done, what was left alone, every check's count and what it cost, as JSON values.

    Args:
        fixed: the repair.
        cost: as `waiting`; None where it was not measured.

    Returns:
        What the command writes as JSON: repairs, what was left and why, and counts before and after.
    """
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
    """Say what was done, what was left alone and why, every check's count before and after, and the cost.

    Args:
        fixed: the repair.
        cost: told in a line of its own; None leaves it out.

    Yields:
        Lines for people, safe to print, without line ends.
    """
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

    Args:
        fixed: the repair.
        output: the file of the mended network; None writes none.
        patch: the folder for plain XML files, made where there is none; None writes none.
        record: the file of what `as_record` says, as JSON; None writes none.
        cost: said in the patch and the record; None where it was not measured.

    Raises:
        UsageError: a file's path is a folder or lies in none, or a file is in the way of the patch's folder.
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
