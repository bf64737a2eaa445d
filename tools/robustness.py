"""Evaluate rows under what they were not trained for, and write the matrix of results.

Who sees images gets other light, weather and cameras; who sees features gets them from a detector that looks
through the approaches' cameras, from a perfect one to a noisy one. Rows of controllers must be named. Each
row's results go to its folder; what is there already for the same policy is not run again.
"""

import argparse
import shlex
import sys
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, fields, is_dataclass
from pathlib import Path
from typing import Any

from dojo_env.benchmark.kept_rows import KeptRow, read_kept
from dojo_env.benchmark.row_runs import tell_weights
from dojo_env.controllers import make_controller
from dojo_env.errors import ConfigError
from dojo_env.learning.other_conditions import (
    ALL,
    CAMERAS,
    DETECTORS,
    choose_for_controller,
    list_conditions,
)
from dojo_env.learning.result_files import read_result
from dojo_env.learning.settings import POLICY, SETTINGS, RunFileError, list_versions, read_training
from dojo_env.metrics import SIX
from dojo_env.runs import run_controller, summarize
from dojo_maps.command import Parser, run_command
from dojo_maps.input_files import sha256_of
from dojo_maps.interruption import begin
from dojo_maps.whole_file import write_json, write_table, write_text

FILE = "robustness.json"
_BESIDE = {"MaxPressure": "which knows all vehicles", "Blind": "which sees nothing"}
"""Rows that are told under each table."""
_TEXT = """## Under other conditions

Policies as they were trained, evaluated under conditions that most of them never met: travel time / \
accumulated waiting, in seconds. A short travel time beside thousands of seconds of waiting is a jam: only \
the first trips end. Rows named *random* learned in conditions drawn anew for each episode, \
and see of each pixel how far it is from its own mean in the episode.
"""


def run_under(row: KeptRow, names: Sequence[str], seeds: int, seconds: int) -> None:
    """Evaluate a row under those of the named conditions that it can meet; all without names."""
    scenario, settings = row.folder.parent.name, row.result.get("settings", {})
    words = ["python", "tools/robustness.py", "--scenarios", scenario, "--rows", row.name,
             "--seeds", str(seeds), "--seconds", str(seconds)]  # fmt: skip
    basis = {"row": row.name, "seeds": seeds, "seconds": seconds}
    if row.learned:
        training = read_training(row.folder / SETTINGS)
        known = list_conditions(training)
        basis["policy"] = sha256_of(row.folder / POLICY, error=RunFileError)
    else:
        controller = make_controller(row.result["controller"])
        basis |= tell_weights(controller)
        if controller.preferred:
            basis["preferred"] = controller.preferred
        known = choose_for_controller(controller, [ALL])
    path = row.folder / FILE
    kept = read_result(path, "under") if path.is_file() else {}
    done = kept["under"] if basis.items() <= kept.items() else {}
    for name in (name for name in known if name in (names or known)):
        told = {setting: _plain(value) for setting, value in known[name].items()}
        if done.get(name, {}).get("changes") == told:
            continue
        if row.learned:
            from dojo_env.learning.evaluation import run_policy  # torch takes long to load

            episodes, _ = run_policy(training, row.folder, range(seeds), num_seconds=seconds, **known[name])
        else:
            own = {"scenario": scenario, "num_seconds": seconds, **settings, **known[name]}
            episodes = run_controller(controller, range(seeds), **own)
        figures = {key: value for key, value in summarize(episodes).items() if key in SIX}
        done = {**done, name: {"changes": told, "figures": figures}}
        result = {**basis, "command": shlex.join(words), "versions": list_versions(), "under": done}
        write_json(path, result)
        print(f"{scenario}: {row.name} under {name}", file=sys.stderr, flush=True)


def _plain(value: Any) -> Any:
    """Tell a setting as JSON: of a dataclass, what differs from its defaults."""
    if is_dataclass(value) and not isinstance(value, type):
        usual = {field.name: field.default for field in fields(value)}
        return {key: each for key, each in asdict(value).items() if each != usual[key]}
    return {key: list(each) for key, each in value.items()} if isinstance(value, Mapping) else value


def find_rows(results: Path, scenarios: Sequence[str], names: Sequence[str] | None) -> list[KeptRow]:
    """Find the rows to evaluate: the named ones, or all that have a policy.

    Raises:
        ConfigError: a named one has neither a policy nor a controller.
    """
    kept = read_kept(results)
    found = []
    for scenario in scenarios:
        rows = kept.get(scenario, {})
        policies = {name: row for name, row in rows.items() if (row.folder / POLICY).is_file()}
        acting = {name: row for name, row in rows.items() if "controller" in row.result}
        if missing := set(names or ()) - set(policies) - set(acting):
            raise ConfigError(
                f"{scenario}: no policy of {', '.join(sorted(missing))}; run dojo-env benchmark first"
            )
        found += [row for name, row in rows.items() if name in (names or policies)]
    return found


def write_matrix(results: Path) -> str:
    """Write `matrix.md` and `matrix.csv` of all rows that were evaluated so; returns the first."""
    parts, lines = [_TEXT], []
    for scenario, rows in read_kept(results).items():
        found = {name: read_result(row.folder / FILE, "under")["under"]
                 for name, row in rows.items() if (row.folder / FILE).is_file()}  # fmt: skip
        for known in (CAMERAS, DETECTORS):
            shown = {name: under for name, under in found.items() if under.keys() & known}
            parts += [_table(scenario, shown, known, rows)] if shown else []
        lines += [
            [scenario, name, under, figure, cell["figures"][figure]["mean"], cell["figures"][figure]["std"]]
            for name, cells in found.items()
            for under, cell in cells.items()
            for figure in SIX
        ]
    parts.append(_explain({under for _, _, under, *_ in lines}))
    text = "\n".join(parts)
    write_text(results / "matrix.md", text)
    write_table(results / "matrix.csv", ["scenario", "row", "under", "figure", "mean", "std"], lines)
    return text


def _table(
    scenario: str, shown: Mapping[str, Any], known: Mapping[str, Any], rows: Mapping[str, KeptRow]
) -> str:
    """Write a table of those that see alike."""
    columns = [name for name in known if any(name in under for under in shown.values())]
    lines = [f"| {scenario} | {' | '.join(columns)} |", "|---" * (len(columns) + 1) + "|"]
    for row, under in shown.items():
        cells = [_cell(under[name]["figures"]) if name in under else "not run" for name in columns]
        lines.append(f"| {row} | {' | '.join(cells)} |")
    beside = [
        f"{name}, {what}: {_cell(rows[name].figures)}." for name, what in _BESIDE.items() if name in rows
    ]
    return "\n".join([*lines, "", " ".join(beside), ""])


def _cell(figures: Mapping[str, Mapping[str, float]]) -> str:
    return f"{figures['travel_time']['mean']:.1f} / {figures['accumulated_waiting']['mean']:.0f}"


def _explain(columns: Collection[str]) -> str:
    """Tell what each column changes."""
    lines = ["| column | what is changed |", "|---|---|"]
    for name in (name for name in {**CAMERAS, **DETECTORS} if name in columns):
        ((setting, value),) = {**CAMERAS, **DETECTORS}[name].items()
        told = _plain(value)
        if isinstance(told, dict):
            told = ", ".join(f"{key} {each}" for key, each in told.items()) or "as by default"
        lines.append(f"| {name} | {setting}: {type(value).__name__ if is_dataclass(value) else ''} {told} |")
    return "\n".join([*lines, ""])


def build_parser() -> Parser:
    """Declare what the command takes."""
    parser = Parser(description=__doc__)
    parser.add_argument(
        "--rows", nargs="*", metavar="ROW", help="all with a policy, unless named; controllers' rows, too"
    )
    parser.add_argument("--scenarios", nargs="+", default=["two-way", "cologne1"], metavar="NAME")
    parser.add_argument("--under", nargs="+", default=[], choices=(*CAMERAS, *DETECTORS), metavar="NAME",
                        help=f"of {', '.join((*CAMERAS, *DETECTORS))}; all, unless named")  # fmt: skip
    parser.add_argument("--seeds", type=int, default=2, help="episodes each, seeds 0 to N-1")
    parser.add_argument("--seconds", type=int, default=3600, help="simulated seconds an episode")
    parser.add_argument("--results", type=Path, default=Path(__file__).parent / "results", metavar="FOLDER")
    parser.set_defaults(run=run)
    return parser


def run(options: argparse.Namespace) -> int:
    """Evaluate what is asked for and write the matrix."""
    if options.seeds < 1:
        raise ConfigError(f"--seeds {options.seeds}: expected a number above 0")
    for row in find_rows(options.results, options.scenarios, options.rows):
        run_under(row, options.under, options.seeds, options.seconds)
    print(write_matrix(options.results))
    return 0


def main() -> int:
    """Evaluate; see `dojo_maps.command`."""
    return run_command("robustness", build_parser, None)


if __name__ == "__main__":
    begin("robustness: interrupted; the same command goes on where it ended")
    main()
