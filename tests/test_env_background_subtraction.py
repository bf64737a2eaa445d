"""Background subtraction: what stands still is grey in any light, what moves is seen."""

from typing import Any

import gymnasium
import numpy as np
import pytest
from numpy.typing import NDArray

from dojo_env.background_subtraction import Background, BackgroundSubtraction
from dojo_env.conditions import PRESETS
from dojo_env.env import TrafficSignalEnv
from dojo_env.errors import ConfigError

Pictures = NDArray[np.uint8]
SMALL: dict[str, Any] = {"scenario": "cologne1", "num_seconds": 300, "height": 84, "width": 84}
GREY, PLAIN = 128, 32
"""The background, and what a deviation of the whole picture amounts to."""


def watch(env: gymnasium.Env[Any, Any], decisions: int = 59) -> Pictures:
    """Show the lights one after another, and collect what is seen."""
    with env:
        env.reset(seed=1)
        phases = int(env.action_space.n)
        return np.stack([env.step(k // 4 % phases)[0] for k in range(decisions)])


def see(**settings: Any) -> gymnasium.Env[Any, Any]:
    """Make an environment that shows the junction from above."""
    return TrafficSignalEnv(observation="bev", **SMALL, **settings)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", ["day", "dusk", "night", "rain"])
def test_what_stands_still_is_grey_and_vehicles_are_plain_in_any_light(name: str) -> None:
    seen = watch(BackgroundSubtraction(see(conditions=PRESETS[name])))[-20:].astype(int)
    away = np.abs(seen - GREY).max(axis=-1)
    assert np.median(away) < PLAIN / 2
    moving = (away > PLAIN).mean(axis=(1, 2))
    assert ((moving > 0.002) & (moving < 0.2)).all()


def test_darker_and_duller_looks_the_same() -> None:
    def dull(picture: Pictures) -> Pictures:
        return (picture // 2 + 20).astype(np.uint8)

    plain, raw = see(), see()
    dulled = gymnasium.wrappers.TransformObservation(raw, dull, raw.observation_space)
    a, b = (watch(BackgroundSubtraction(env)).astype(int) for env in (plain, dulled))
    assert np.abs(a - b).mean() < 1
    assert np.corrcoef(a.ravel(), b.ravel())[0, 1] > 0.97


def test_episodes_begin_with_nothing_known() -> None:
    env = BackgroundSubtraction(see())
    first = env.reset(seed=1)[0]
    later = [env.step(0)[0] for _ in range(10)]
    again = env.reset(seed=1)[0]
    assert (first == GREY).all()
    assert np.array_equal(first, again)
    assert np.array_equal(later, [env.step(0)[0] for _ in range(10)])
    env.close()


def test_each_of_several_pictures_is_told_by_itself() -> None:
    pictures = watch(see(), 20)
    lit, dark = pictures, (pictures // 4).astype(np.uint8)
    together = Background((2, *pictures.shape[1:]))
    alone = [Background(pictures.shape[1:]) for _ in range(2)]
    for pair in zip(lit, dark, strict=True):
        parts = [background.subtract(picture) for background, picture in zip(alone, pair, strict=True)]
        assert np.array_equal(together.subtract(np.stack(pair)), parts)


@pytest.mark.parametrize("observation", ["features", {"far": "bev:depth"}, {"what": "bev:semantic"}])
def test_what_is_no_picture_is_refused(observation: Any) -> None:
    env = TrafficSignalEnv(observation=observation, **SMALL)
    with pytest.raises(ConfigError, match="no pictures"):
        BackgroundSubtraction(env)
    env.close()
