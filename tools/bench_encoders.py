"""What frozen encoders tell of the queues, and how long they take.

Episodes of several controllers are seen from above. From some of them a linear probe (ridge regression)
learns the queue of each lane, at most six vehicles, as no more are in the picture. It is scored on an episode
of another controller and seed: R2, the mean over the lanes that had a queue. The control is the
same network with random weights. Times are the fastest of many, since others may use the machine.
"""

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_env.controllers import make_controller
from dojo_env.encoders import ENCODERS, load_encoder
from dojo_env.encoders.base import Encoder
from dojo_env.encoders.efficientnet import SCALING, build_network, read_weights
from dojo_env.encoders.onnx_file import OnnxEncoder
from dojo_env.env import TrafficSignalEnv
from dojo_maps.whole_file import write_json

Array = NDArray[Any]
EPISODES = ("cycle", "max-pressure", "random", "webster")
"""Controllers; the last one's episode is held out."""
RANDOM = "random-weights"
MOST_IN_LANE = 6
PENALTY = 0.1
TIMED = 40


def record(scenario: str, controller: str, seed: int, frames: int) -> tuple[Array, Array]:
    """Run an hour: pictures (frames, h, w, 3) and queues (frames, lanes), evenly over the hour."""
    env = TrafficSignalEnv(scenario=scenario, observation="bev", num_seconds=3600)
    chooser = make_controller(controller)
    chooser.reset(seed)
    env.reset(seed=seed)
    pictures, queues = [], []
    ended, decision, every = False, 0, 720 // frames
    while not ended:
        seen, _, _, ended, _ = env.step(chooser.act(env.instant)[env.signal])
        decision += 1
        if decision % every == 0:
            view = env.instant.signals[env.signal]
            pictures.append(seen)
            queues.append(np.minimum(view.lanes.halting, MOST_IN_LANE))
    env.close()
    return np.array(pictures), np.array(queues)


def probe(features: list[Array], queues: list[Array]) -> float:
    """Fit on all episodes but the last; R2 there, the mean over lanes that had a queue."""
    x, wanted = np.concatenate(features[:-1]).astype(float), np.concatenate(queues[:-1])
    centre, spread, mean = x.mean(0), x.std(0) + 1e-6, wanted.mean(0)
    x, held_out = ((each - centre) / spread / np.sqrt(x.shape[1]) for each in (x, features[-1]))
    weights = np.linalg.solve(x @ x.T + PENALTY * np.eye(len(x)), wanted - mean)
    missed = held_out @ x.T @ weights + mean - queues[-1]
    variance = ((queues[-1] - queues[-1].mean(0)) ** 2).mean(0)
    queued = variance > 0
    return float((1 - (missed**2).mean(0)[queued] / variance[queued]).mean())


def open_random(seed: int = 0) -> Encoder:
    """Build EfficientNet-Lite0 with weights drawn so that signals keep their size."""
    drawn = np.random.default_rng(seed)
    weights = {}
    for name, trained in read_weights().items():
        if trained.ndim == 4:
            deviation = np.sqrt(2 / np.prod(trained.shape[1:]))
            weights[name] = (drawn.standard_normal(trained.shape) * deviation).astype(np.float32)
        else:
            ones = name.endswith((".weight", ".running_var"))
            weights[name] = np.full(trained.shape, ones, np.float32)
    return OnnxEncoder(RANDOM, build_network(weights), SCALING)


def measure(name: str, recorded: dict[str, list[tuple[Array, Array]]]) -> dict[str, Any]:
    """Score one encoder on every scenario."""
    encoder = open_random() if name == RANDOM else load_encoder(name)
    row: dict[str, Any] = {"encoder": name, "size": encoder.size, "r2": {}}
    for scenario, episodes in recorded.items():
        features = [encoder.encode(pictures) for pictures, _ in episodes]
        row["r2"][scenario] = round(probe(features, [queues for _, queues in episodes]), 3)
    fresh = np.random.default_rng(0).integers(0, 256, (TIMED, 256, 356, 3), np.uint8)
    seconds = []
    for picture in fresh:
        start = time.perf_counter()
        encoder.encode(picture[None])
        seconds.append(time.perf_counter() - start)
    row["ms"] = round(1000 * min(seconds), 1)
    return row


def main() -> None:
    """Print a row per encoder."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--encoders", nargs="+", default=[*ENCODERS, RANDOM])
    parser.add_argument("--scenarios", nargs="+", default=["two-way", "cologne1"])
    parser.add_argument("--frames", type=int, default=180, help="of each episode")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    recorded = {
        scenario: [record(scenario, name, seed, options.frames) for seed, name in enumerate(EPISODES)]
        for scenario in options.scenarios
    }
    rows = []
    for name in options.encoders:
        rows.append(measure(name, recorded))
        print(f"{name:20} {rows[-1]['size']:5} values {rows[-1]['ms']:6} ms", rows[-1]["r2"], flush=True)
    if options.json:
        write_json(options.json, rows)


if __name__ == "__main__":
    main()
