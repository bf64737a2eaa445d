"""Convert every network of a folder and measure how right the conversion and the report are.

Prints each network's status, seconds, errors and last line. In the end: networks lost (SUMO loads them and no
bundle comes of it), networks called clean that SUMO refuses, the share of networks in which each of SUMO's
warnings on signals has its own issue of ours, and how many errors each check found. Exits with 1 if a
network is lost or wrongly called clean.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dojo_maps.sumo_programs import find_program

SUMOS_WORDS = {
    "Missing yellow phase": "signals.missing_yellow",
    "Unsafe green phase": "signals.green_conflict",
    "Unused state": "signals.unused_index",
    "Missing green phase": "signals.never_green",
    "Mismatching phase": "signals.state_length",
    "Low green": "signals.green_fraction",
}
"""How a warning of SUMO's on a signal begins, and our check of the same."""


@dataclass(kw_only=True)
class Outcome:
    """What became of a network."""

    name: str
    status: int
    said: str
    seconds: float
    loads: bool
    issues: list[dict[str, Any]] = field(default_factory=list)

    @property
    def errors(self) -> list[dict[str, Any]]:
        """The issues that are errors."""
        return [issue for issue in self.issues if issue["severity"] == "error"]

    @property
    def lost(self) -> bool:
        """SUMO loads it, and no bundle came of it."""
        return self.status not in (0, 1) and self.loads

    @property
    def called_clean(self) -> bool:
        """SUMO refuses it, and the report has no error."""
        return not self.loads and self.status in (0, 1) and not self.errors

    @property
    def missed(self) -> list[str]:
        """SUMO's warnings on signals for which the same signal has no issue of ours."""
        ours = {(issue["check"], item["id"]) for issue in self.issues for item in issue["elements"]}
        return [
            issue["message"]
            for issue in self.issues
            for begin, check in SUMOS_WORDS.items()
            if issue["check"] == "sumo.warning" and begin in issue["message"]
            if not any((check, item["id"]) in ours for item in issue["elements"] if item["kind"] == "signal")
        ]


def main() -> int:
    """Survey a folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="searched for .net.xml and .net.xml.gz")
    parser.add_argument("--export", nargs="*", default=[], help="formats to write, too")
    parser.add_argument("--patience", type=float, default=120.0, help="seconds for each program")
    parser.add_argument("--jobs", type=int, default=1, help="networks at a time")
    parser.add_argument("--errors", type=Path, help="a file for all errors, one in each line, to judge them")
    options = parser.parse_args()
    extra = ["--export", *options.export] if options.export else []
    networks = sorted([*options.folder.rglob("*.net.xml"), *options.folder.rglob("*.net.xml.gz")])
    outcomes = []
    with ThreadPoolExecutor(options.jobs) as pool:
        for outcome in pool.map(lambda path: _survey(path, extra, options.patience), networks):
            note = "" if outcome.loads else " SUMO does not load it"
            print(
                f"{outcome.name}\t{outcome.status}{note}\t{outcome.seconds:.1f} s\t"
                f"{len(outcome.errors)} errors\t{outcome.said}",
                flush=True,
            )
            outcomes.append(outcome)
    if options.errors:
        rows = [
            f"{outcome.name}\t{issue['check']}\t{issue['message']}"
            for outcome in outcomes
            for issue in outcome.errors
        ]
        options.errors.write_text("".join(f"{row}\n" for row in rows))
    return _sum_up(outcomes)


def _sum_up(outcomes: Sequence[Outcome]) -> int:
    lost = [outcome.name for outcome in outcomes if outcome.lost]
    clean = [outcome.name for outcome in outcomes if outcome.called_clean]
    missed = {outcome.name: outcome.missed for outcome in outcomes if outcome.missed}
    print(f"\n{len(outcomes)} networks")
    print(f"lost: {len(lost)} {' '.join(lost)}")
    print(f"refused by SUMO and called clean: {len(clean)} {' '.join(clean)}")
    share = 1 - len(missed) / max(len(outcomes), 1)
    print(f"all of SUMO's warnings on signals found: in {share:.1%} of the networks")
    for name, words in missed.items():
        print(f"  {name}: {words[0]}")
    checks = Counter(issue["check"] for outcome in outcomes for issue in outcome.errors)
    networks = Counter(
        check for outcome in outcomes for check in {issue["check"] for issue in outcome.errors}
    )
    for check, count in checks.most_common():
        print(f"{count:6d} errors in {networks[check]:3d} networks: {check}")
    return int(bool(lost or clean))


def _survey(network: Path, extra: Sequence[str], patience: float) -> Outcome:
    """Convert one network; the status is -1 if it took too long."""
    begin = time.monotonic()
    loads = _loads(network, patience)
    with tempfile.TemporaryDirectory() as folder:
        bundle = Path(folder) / "x.dojo"
        command = [sys.executable, "-m", "dojo_maps.cli", "convert", str(network), "--quiet", *extra]
        command += ["-o", str(bundle), "--jobs", "1"]
        try:
            done = subprocess.run(  # noqa: S603 - this project's own command
                command, capture_output=True, text=True, timeout=patience, check=False
            )
            status, said = done.returncode, (done.stderr or done.stdout).strip().replace(f"{folder}/", "")
        except subprocess.TimeoutExpired:
            status, said = -1, f"not done after {patience:.0f} s"
        report = bundle / "report.json"
        issues = json.loads(report.read_text())["issues"] if report.is_file() else []
    return Outcome(
        name=network.name,
        status=status,
        said=said.split("\n")[-1],
        seconds=time.monotonic() - begin,
        loads=loads,
        issues=issues,
    )


def _loads(network: Path, patience: float) -> bool:
    """Tell whether SUMO loads a network, within some seconds."""
    command = [find_program("sumo"), "-n", str(network), "--end", "1", "--no-step-log"]
    try:
        done = subprocess.run(command, capture_output=True, timeout=patience, check=False)  # noqa: S603 - SUMO
    except subprocess.TimeoutExpired:
        return False
    return done.returncode == 0


if __name__ == "__main__":
    sys.exit(main())
