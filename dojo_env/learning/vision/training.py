"""Training of the network that sees lanes: examples of drawn episodes, weights, and how far they err."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from dojo_env.errors import SimulationError
from dojo_env.learning.episode_pools import Mapper
from dojo_env.learning.pace import Pace
from dojo_env.learning.process_setup import prepare_process
from dojo_env.learning.settings import write_settings
from dojo_env.learning.universal.settings import count_junctions, list_junctions
from dojo_env.learning.vision.episodes import Case, Examples, draw_case, take_examples
from dojo_env.learning.vision.network import LaneNet
from dojo_env.learning.vision.settings import CURVE, KIND, NETWORK, SETTINGS, VisionTraining
from dojo_env.sensors.lane_network import SEEN, find_chances, scale_colours
from dojo_env.sensors.strip_geometry import GEOMETRY
from dojo_maps.progress import say
from dojo_maps.whole_file import replaced, write_table

_FIRST_SEED, _SEEDS_PER_RUN = 2_000_000, 10_000
_KEPT_BACK = 8
"""Of so many episodes one is for validation."""
_EMPTY = 0.4
"""The share of strips without anybody that is learned from: most are such, and teach little."""
_RARE = 4.0
"""How much buses and emergency vehicles count beside the others, of which there are more."""
_MIRRORED, _GAINS = 0.5, (0.75, 1.3)
"""The share of strips that are shown mirrored, and how much darker or brighter they are."""
_SCORED = 1024
"""Strips that are judged at once."""


def train(
    training: VisionTraining, folder: Path, run_all: Mapper, *, tell: Callable[[str], None] = say
) -> None:
    """Take pictures, train, and keep the weights and how far they err.

    Args:
        training: all that it depends on.
        folder: where all of it goes.
        run_all: simulates.
        tell: takes lines of how far it is.

    Raises:
        ConfigError: a scenario cannot be learned from.
        SimulationError: fewer than two episodes came to their end.
    """
    prepare_process()
    examples = collect_examples(training, run_all, tell)
    network, rows = fit(training, examples, tell)
    folder.mkdir(parents=True, exist_ok=True)
    write_table(folder / CURVE, ["epoch", "cars", *COLUMNS], rows)
    write_weights(network.export(), folder / NETWORK)
    write_settings(KIND, asdict(training), folder / SETTINGS)


def collect_examples(
    training: VisionTraining, run_all: Mapper, tell: Callable[[str], None]
) -> list[Examples]:
    """Take all pictures; the same whoever simulates.

    Args:
        training: the run's settings.
        run_all: simulates.
        tell: takes lines of how far it is, and of episodes that are left out.

    Returns:
        An item per episode that came to its end, in the order in which they were drawn.

    Raises:
        ConfigError: a scenario cannot be learned from.
        SimulationError: fewer than two episodes came to their end.
    """
    junctions = list_junctions(training.scenarios)
    tell(count_junctions(junctions))
    first = _FIRST_SEED + training.seed * _SEEDS_PER_RUN
    cases = [
        draw_case(junctions, seed=first + number, seconds=training.seconds, looks=training.looks)
        for number in range(training.episodes)
    ]
    pace, found = Pace(len(cases), tell, unit="episodes"), list[Examples]()
    size = max(1, len(cases) // 8)
    for start in range(0, len(cases), size):
        part = cases[start : start + size]
        for case, each in zip(part, run_all(_try, part), strict=True):
            if isinstance(each, Examples):
                found.append(each)
            else:
                tell(f"{case.scenario}, seed {case.seed}: left out, for {each}")
        pace.note(start + len(part))
    if len(found) < 2:
        raise SimulationError("fewer than two episodes came to their end; leave such scenarios out")
    return found


def _try(case: Case) -> Examples | SimulationError:
    """Take an episode's pictures; where SUMO stops at one, the others go on."""
    try:
        return take_examples(case)
    except SimulationError as error:
        return error


def fit(
    training: VisionTraining, examples: Sequence[Examples], tell: Callable[[str], None]
) -> tuple[LaneNet, list[list[float]]]:
    """Train on most episodes, and judge on the others after each epoch.

    Args:
        training: the run's settings.
        examples: an item per episode. Every eighth is kept back to judge on; of fewer than eight, the last
            one is learned from and judged on, too.
        tell: takes lines of how far it is.

    Returns:
        The network, and for each epoch its number, from 1, and the figures of `judge`.
    """
    torch.manual_seed(training.seed)
    draw = np.random.default_rng(training.seed)
    network = LaneNet()
    learned = [each for number, each in enumerate(examples) if (number + 1) % _KEPT_BACK]
    others = [each for number, each in enumerate(examples) if not (number + 1) % _KEPT_BACK] or learned[-1:]
    chosen = [
        (episode, row)
        for episode, each in enumerate(learned)
        for row in np.flatnonzero(each.truth.any((1, 2)) | (draw.random(len(each.truth)) < _EMPTY))
    ]
    network.train()
    steps = -(-len(chosen) // training.batch_size) * training.epochs
    optimizer = torch.optim.AdamW(network.parameters(), weight_decay=1e-3)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimizer, training.learning_rate, total_steps=max(steps, 2), pct_start=0.2
    )
    pace, rows = Pace(training.epochs, tell, unit="epochs"), list[list[float]]()
    for epoch in range(training.epochs):
        order = draw.permutation(len(chosen))
        for start in range(0, len(order), training.batch_size):
            batch = _gather(learned, [chosen[place] for place in order[start : start + training.batch_size]])
            loss: Any = _compute_loss(network, _vary(batch[0], draw), *batch[1:])
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            schedule.step()
        found = judge(network.export(), others)
        rows.append([epoch + 1, *(round(each, 4) for each in found.values())])
        pace.say(epoch + 1, ": " + ", ".join(f"{name} {each:.3f}" for name, each in found.items()))
        pace.note(epoch + 1)
    return network, rows


def _gather(
    examples: Sequence[Examples], chosen: Sequence[tuple[int, int]]
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Put a batch together: what the network sees, what there is, and which cells are in view."""
    places = [examples[episode].places[row] for episode, row in chosen]
    strips = np.stack([examples[episode].strips[row] for episode, row in chosen])
    where = [(examples[episode], place) for (episode, _), place in zip(chosen, places, strict=True)]
    geometry = np.stack([each.geometry[place] for each, place in where])
    truth = np.stack([examples[episode].truth[row] for episode, row in chosen]).astype(np.float32)
    in_view = np.stack([each.shares[place] > 0 for each, place in where]).astype(np.float32)
    values = np.concatenate([scale_colours(strips), geometry], axis=3)
    return torch.from_numpy(values), torch.from_numpy(truth), torch.from_numpy(in_view)


def _vary(values: torch.Tensor, draw: np.random.Generator) -> torch.Tensor:
    """Mirror half of the strips, and make each brighter or darker: there are more streets than we have."""
    count = len(values)
    mirrored = torch.from_numpy(draw.random(count) < _MIRRORED)
    varied = torch.where(mirrored[:, None, None, None], values.flip(2), values)
    side = len(GEOMETRY) - GEOMETRY.index("side")
    varied[..., -side] *= torch.where(mirrored, -1.0, 1.0)[:, None, None]
    gain = torch.from_numpy(draw.uniform(*_GAINS, (count, 1, 1, 1)).astype(np.float32))
    colours = ((varied[..., : -len(GEOMETRY)] + 1.0) * gain - 1.0).clamp(-1.0, 1.0)
    return torch.cat([colours, varied[..., -len(GEOMETRY) :]], dim=3)


def _compute_loss(
    network: LaneNet, values: torch.Tensor, truth: torch.Tensor, in_view: torch.Tensor
) -> torch.Tensor:
    errors = torch.nn.functional.binary_cross_entropy_with_logits(network(values), truth, reduction="none")
    weights = in_view[..., None] * torch.tensor([1.0, 1.0, _RARE, _RARE])
    return (errors * weights).sum() / in_view.sum().clamp(min=1.0)


COLUMNS = ("standing_error", "moving_error", "empty_error", "bus_found", "bus_false", "emergency_found",
           "emergency_false")  # fmt: skip
"""Of `judge`."""


def judge(weights: Mapping[str, NDArray[np.float32]], examples: Iterable[Examples]) -> dict[str, float]:
    """Measure how far the network errs.

    Args:
        weights: of the network.
        examples: that it has not learned from.

    Returns:
        The mean vehicles of a strip, in view; the mean absolute error of those that stand, and of those that
        move; what is seen on an empty strip in the mean; which share of the strips with a bus, or with an
        emergency vehicle, is found, and in which share of the others one is seen.
    """
    seen, there = list[NDArray[np.float64]](), list[NDArray[np.float64]]()
    most, has = list[NDArray[np.float64]](), list[NDArray[np.float64]]()
    for each in examples:
        for start in range(0, len(each.places), _SCORED):
            part = slice(start, start + _SCORED)
            places = each.places[part]
            chances = find_chances(weights, each.strips[part], each.geometry[places])
            in_view = each.shares[places, :, None] > 0
            truth = each.truth[part] * in_view
            chances = chances * in_view
            seen.append(chances.sum(1))
            there.append(truth.sum(1))
            most.append(chances.max(1))
            has.append(truth.max(1))
    sums, counts, peak, is_there = (np.concatenate(each) for each in (seen, there, most, has))
    errors = np.abs(sums - counts)[:, :2].mean(axis=0)
    empty = counts[:, :2].sum(axis=1) == 0
    figures = {
        "cars": float(counts[:, :2].sum(axis=1).mean()),
        "standing_error": float(errors[0]),
        "moving_error": float(errors[1]),
        "empty_error": float(sums[empty, :2].sum(axis=1).mean()) if empty.any() else 0.0,
    }
    for name in ("bus", "emergency"):
        place = SEEN.index(name)
        is_one, is_told = is_there[:, place] > 0, peak[:, place] > 0.5
        figures[f"{name}_found"] = float(is_told[is_one].mean()) if is_one.any() else 0.0
        figures[f"{name}_false"] = float(is_told[~is_one].mean())
    return figures


def write_weights(weights: Mapping[str, NDArray[np.float32]], path: Path) -> None:
    """Write a network's weights, as `sensors.lane_network` reads them.

    Args:
        weights: arrays by name, as `LaneNet.export` gives them.
        path: of the file, which is replaced whole; it ends in `.npz`.

    Raises:
        UsageError: the path is a folder, or lies in none.
        WriteError: the folder cannot be written.
    """
    with replaced(path) as fresh:
        np.savez(fresh, allow_pickle=False, **dict(weights))
