"""Write the report of a results folder, whole: tables, pictures, and `README.md` that explains them.

All numbers come from the rows' files, from the settings in the code, and from the file of published figures
where one is given; a row that was not run says so.
"""

import argparse
import shlex
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from statistics import fmean, median

from dojo_env.benchmark.kept_rows import KeptRow, read_kept
from dojo_env.benchmark.pictures import WINDOW, draw_all
from dojo_env.benchmark.rows import SCENARIOS, list_rows, read_packaged_rows
from dojo_env.benchmark.tables import write_tables
from dojo_env.config import SignalConfig
from dojo_env.learning.result_files import Published, read_published
from dojo_env.learning.settings import ALGORITHMS, REWARD, RunFileError, Training
from dojo_env.metrics import SIX
from dojo_env.series import TITLES
from dojo_maps.command import Parser, run_command
from dojo_maps.input_files import read_bytes
from dojo_maps.interruption import begin
from dojo_maps.whole_file import write_text

RIVAL = "MaxPressure"
"""What a policy must beat to be worth its training: a rule that knows all vehicles."""
MATRIX = "matrix.md"
"""What `robustness.py` writes."""
MEANINGS = {
    "travel_time": "mean duration of the trips that have ended, averaged over all decisions of the episode; "
    "what a vehicle waits before it may enter the map does not count",
    "throughput": "vehicles that have reached the end of their trip",
    "delay": "for each lane that leads to a signal: 1 minus mean speed over speed limit, 0 if empty; "
    "summed over lanes, averaged over decisions",
    "accumulated_waiting": "the seconds that each vehicle on these lanes has stood so far, summed over "
    "vehicles, averaged over decisions; it grows with the square of a wait, so it shows who is forgotten",
    "queue": "vehicles that stand on these lanes, averaged over decisions",
    "co2": "what the vehicles on these lanes emit, averaged over decisions",
}
WORDS = {
    "hour": f"The hour of the first seed. Each curve is the mean of the last {WINDOW} minutes. What leaves "
    "the picture jams.",
    "paper": "The same for the rows that the paper draws.",
    "training": "Mean trip on validation seeds during training, with those that have not ended: travel time "
    "alone would praise who jams the junction.",
    "figures": "All rows. Where a bar ends in a number, the axis was cut for the others' sake.",
}
_OPENING = """# Results

A traffic signal is controlled by an agent: every {interval} s it names the green phase that shall be shown. \
A change passes through {yellow:g} s of yellow, and a green lasts at least {least:g} s, so requests before \
that are held. SUMO simulates the traffic; no controller may do what another may not.

Some rows follow a rule, as *MaxPressure*, which serves the links with the longest queues before and the \
shortest behind them. The others learn it from a reward: by DQN, PPO or A2C, from what their name says:

| name | the policy sees |
|---|---|
| F | features: the phase, whether it may change, and how full and how congested each lane is |
| MV | one camera image per approach, taken at the junction |
| BEV | one image from straight above the junction |
| BEV* | the same through a frozen, pretrained encoder of images |
| blind | nothing but its own phase, and for how long that has been green |
| shared, independent | several signals: all use one policy, or each learns its own |
| random | trained in light, weather and camera mounts drawn anew each episode; of each pixel, how far it is \
from its own mean in the episode |

Each figure is a mean over episodes of one hour with seeds that no training has seen, ± its standard \
deviation. The best policy of a training is chosen on yet other seeds.

| figure | what it is |
|---|---|
{meanings}

More is better for throughput, less for all others.

*Blind* is the best timing plan that a search finds on validation seeds: it sees nothing. *Of the way* \
tells how far a row comes from it (0 %) to the best row known, published ones included (100 %), in travel \
time; who serves less than nine tenths of the best throughput *jams*. An hour jams where one vehicle in 20 \
is late at its end; that is not told of rows that were run before it was counted. *Tuned* rows are SUMO's \
logics with times found by the same search. *Learned* and *Learned-vision* are the policies for any junction \
that ship with the package; their trainings met these junctions among many others. Scenarios such as \
*cologne1-surges* have traffic drawn anew for each seed, in which one side after another is busy, and nobody \
who does not look knows which.
"""
_PAPER = """All rows but *FixedTime*, the network's own program, change in the same way: 2 s of yellow, no \
all-red, and the same time where green is only added; minimum greens are below, under *Settings*. *SOTL* and \
*MaxPressure* as published and the learned rows have no longest red; SUMO's own logics (*Pretimed*, \
*Actuated*, *DelayBased*) keep their order of phases and at most 60 s of each; for the other rows it is \
120 s or one and a half of the signal's shortest cycles. The learned rows of cologne1 and cologne3 add green \
at once."""
_STREET = """The same controllers with a yellow of 3 to 6 s by each approach's speed limit (ITE's formula) \
and 2 s of red for all; who loses priority to traffic that starts yields for the time of the yellow. \
*FixedTime* is the network's own program as it stands."""
_HOURS = """Of each learned row: how far its mean is from {rival}'s, and in how many of the same hours it is \
better. A few percent with some hours won and some lost is no difference that so few hours can tell; where \
throughput falls by percents, travel time is of those who got through."""
_WHY = """Why figures differ from the published ones:

- The plans of *FixedTime* and the thresholds of *SOTL* are not published for all scenarios. Here stand the \
networks' own programs, and thresholds that reproduce the first scenario; no plan was tuned to a cell.
- What counts as minimum green is not published either: of green alone, or of all time since the last \
change. A scenario's setting is the one with which MaxPressure comes out as published; policies get the same.
- The published policies learn from the difference of waiting alone. Ours have the queue in their reward, \
too, so that trips are short and nobody is forgotten; and the algorithms' settings are our own.
- Images are drawn by another renderer and are smaller, so that a laptop can train in hours; the frozen \
encoder is a small one that runs on a plain CPU.
- Policies are evaluated without exploration.
- Left-turners of cologne1 block each other, and SUMO lets them go in an order that depends on where its \
objects lie in memory. So each episode runs in empty memory, and a command gives the same figures again.
"""
_AGAIN = """`python tools/report.py` writes this page, its tables and pictures anew from the rows' files. \
The commands below make the rows; one that is there with the same settings is not run again, so delete its \
folder first. `tools/robustness.py` makes the matrix, `tools/compare_resco.py` the page of \
[RESCO's eight scenarios](resco/README.md)."""


def write_report(results: Path, paper: Path | None) -> Path:
    """Write tables, pictures and the report; returns the report's path."""
    published = read_published(paper)
    table = write_tables(results, published)
    pictures = draw_all(results, published)
    kept = read_kept(results)
    matrix = results / MATRIX
    parts = [
        _opening(),
        "## The table\n\nThe best figure of ours is bold, the second best underlined; *published* is the "
        f"TrafficDojo paper's. {_PAPER}\n",
        table.replace("\n### ", "\n\n### "),
        *_intergreen(results),
        _beside_rival(kept),
        *([_differences(kept, published)] if published else []),
        _show(results, pictures),
        *([read_bytes(matrix, error=RunFileError).decode("utf-8", "replace")] if matrix.is_file() else []),
        _settings(),
        _commands(kept),
    ]
    path = results / "README.md"
    write_text(path, "\n".join(parts))
    return path


def _intergreen(results: Path) -> list[str]:
    """Show the rows that were run with the changes of a street, where there are any."""
    folder = results / "intergreen"
    if not read_kept(folder):
        return []
    table = write_tables(folder, {})
    return [f"## With the changes of a street\n\n{_STREET}\n", table.replace("\n### ", "\n\n### ")]


def _opening() -> str:
    rules = SignalConfig()
    return _OPENING.format(
        interval=Training().delta_time,
        yellow=rules.yellow_time,
        least=rules.min_green,
        meanings="\n".join(f"| {TITLES[name]} | {MEANINGS[name]} |" for name in SIX),
    )


def _beside_rival(kept: Mapping[str, Mapping[str, KeptRow]]) -> str:
    """Tell how far learned rows are from the best rule, and in how many of the same hours they are better."""
    lines = [f"## Beside {RIVAL}", "", _HOURS.format(rival=RIVAL), ""]
    for scenario, rows in kept.items():
        learned = [row for row in rows.values() if row.learned]
        if RIVAL not in rows or not learned:
            continue
        rule = {hour["seed"]: hour for hour in rows[RIVAL].result["episodes"]}
        lines += [f"**{scenario}**", "", _head("row", TITLES.values())]
        for row in learned:
            pairs = [(hour, rule[hour["seed"]]) for hour in row.result["episodes"] if hour["seed"] in rule]
            lines.append(_line(row.name, (_compare(pairs, figure) for figure in SIX)))
        lines.append("")
    return "\n".join(lines)


def _compare(pairs: Sequence[tuple[Mapping[str, float], Mapping[str, float]]], figure: str) -> str:
    """Tell the difference of the means, and how many pairs are better; a tie is not."""
    ours, theirs = (fmean(hour[figure] for hour in hours) for hours in zip(*pairs, strict=True))
    better = sum(_is_better(hour[figure], other[figure], figure) for hour, other in pairs)
    return f"{ours / theirs - 1:+.1%}, {better} of {len(pairs)}"


def _differences(kept: Mapping[str, Mapping[str, KeptRow]], published: Mapping[str, Published]) -> str:
    """Tell how far ours are from the published figures, row by row, and why that may be."""
    lines = ["## Beside the published figures", ""]
    for scenario, theirs in published.items():
        both = [row for name, row in kept.get(scenario, {}).items() if name in theirs]
        if not both:
            continue
        lines += [f"**{scenario}**, ours relative to the published ones:", "", _head("row", TITLES.values())]
        lines += [_line(row.name, (f"{_ratio(row, theirs, f):+.1%}" for f in SIX)) for row in both]
        if learned := [row for row in both if row.learned]:
            better = sum(
                all(_is_better(*_means(row, theirs, figure), figure) for figure in SIX) for row in learned
            )
            middle = median(_ratio(row, theirs, "travel_time") for row in learned)
            lines += ["", f"Of {len(learned)} learned rows, {better} are better than published in all six "
                      f"figures; travel time differs by {middle:+.1%} in the median."]  # fmt: skip
        lines.append("")
    return "\n".join([*lines, _WHY])


def _ratio(row: KeptRow, theirs: Published, figure: str) -> float:
    ours, other = _means(row, theirs, figure)
    return ours / other - 1


def _means(row: KeptRow, theirs: Published, figure: str) -> tuple[float, float]:
    return row.figures[figure]["mean"], theirs[row.name][figure]["mean"]


def _is_better(value: float, other: float, figure: str) -> bool:
    return value > other if figure == "throughput" else value < other


def _show(results: Path, pictures: Iterable[Path]) -> str:
    """Show every picture with a sentence."""
    lines = ["## Pictures", ""]
    for path in pictures:
        scenario, _, kind = path.stem.rpartition("-")
        place = path.relative_to(results).as_posix()
        lines += [f"**{scenario}.** {WORDS[kind]}", "", f"![{scenario}: {kind}]({place})", ""]
    return "\n".join(lines)


def _settings() -> str:
    """Tell what all trainings have in common, and the algorithms' own settings."""
    usual, rules = Training(), SignalConfig()
    own: dict[tuple[int, str], list[str]] = {}
    for row in read_packaged_rows().values():
        for scenario in SCENARIOS:
            if "min_green" in (settings := row.scenarios.get(scenario, {})):
                own.setdefault((settings["min_green"], scenario), []).append(row.name)
    others = "; ".join(
        f"{least} on {scenario} for {', '.join(names)}" for (least, scenario), names in own.items()
    )
    algorithms = "\n".join(
        f"- {name.upper()}: {', '.join(f'{key} {value:g}' for key, value in settings.items())}."
        for name, settings in ALGORITHMS.items()
    )
    return f"""## Settings

- A decision every {usual.delta_time} s, {rules.yellow_time:g} s yellow, {rules.min_green:g} s minimum green \
(but {others}).
- Trainings: {usual.steps:,} decisions in {usual.processes} environments side by side, episodes of \
{usual.seconds:,} s, images of {usual.height} x {usual.width} pixels unless a row's settings say otherwise.
- Reward, unless a row has its own: {_tell_reward(REWARD)}; what is bad counts as negative.
- Learning rates fall from what is given here to 0 at the end.
{algorithms}
- Each row's folder holds all of its settings and the versions that it ran on, in `figures.json`, and in \
`training.json` where it learned.
"""


def _commands(kept: Mapping[str, Mapping[str, KeptRow]]) -> str:
    """Give the command of each row, and say which rows were not run."""
    lines = ["## Make it again", "", _AGAIN, "", _head("scenario", ("row", "trained for", "command"))]
    missing = []
    for scenario in [*SCENARIOS, *sorted(set(kept) - set(SCENARIOS))]:
        there = kept.get(scenario, {})
        for name, row in there.items():
            cells = (name, _tell_training(row), f"`{row.result['command']}`")
            lines.append(_line(scenario, cells))
        for name in (name for name in list_rows(scenario) if name not in there):
            words = ["dojo-env", "benchmark", "--rows", name, "--scenarios", scenario]
            missing.append(_line(scenario, (name, "not run", f"`{shlex.join(words)}`")))
    return "\n".join([*lines, *missing, ""])


def _tell_training(row: KeptRow) -> str:
    """Tell how long a row's policy learned, and what is unusual about its reward and weights."""
    if not row.learned:
        return ""
    training = Training(**row.result["training"])
    reward = "" if training.reward == REWARD else f", reward {_tell_reward(training.reward)}"
    averaged = ", averaged weights" if training.averaged_weights else ""
    return f"{training.steps:,} decisions{reward}{averaged}"


def _tell_reward(reward: Mapping[str, float]) -> str:
    return " + ".join(f"{weight:g} x {name}" for name, weight in reward.items())


def _head(first: str, others: Iterable[str]) -> str:
    names = [first, *others]
    return _line(names[0], names[1:]) + "\n" + "|---" * len(names) + "|"


def _line(first: str, cells: Iterable[str]) -> str:
    return f"| {first} | {' | '.join(cells)} |"


def build_parser() -> Parser:
    """Declare what the command takes."""
    parser = Parser(description=__doc__)
    parser.add_argument("--results", type=Path, default=Path(__file__).parent / "results", metavar="FOLDER")
    parser.add_argument("--paper", type=Path, metavar="FILE", help="JSON of published figures")
    parser.set_defaults(run=run)
    return parser


def run(options: argparse.Namespace) -> int:
    """Write it from what there is."""
    print(write_report(options.results, options.paper))
    return 0


def main() -> int:
    """Write it; see `dojo_maps.command`."""
    return run_command("report", build_parser, None)


if __name__ == "__main__":
    begin("report: interrupted")
    main()
