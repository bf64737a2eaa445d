"""A trained policy in the place of a controller: it acts on what its training's environment would show it."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gymnasium import spaces

from dojo_env.background_subtraction import Background
from dojo_env.controllers import Controller
from dojo_env.errors import ConfigError
from dojo_env.instant import Instant
from dojo_env.learning.settings import POLICY, SETTINGS, read_training

if TYPE_CHECKING:
    from dojo_env.learning.joint_signals import Stack

_ABOUT_THE_RUN = ("scenario", "num_seconds", "reward_fn", "conditions")
"""Settings of a training's environment that another episode need not have."""


class PolicyController(Controller):
    """Acts by a policy that `dojo-env train` kept; it fits the junctions that it was trained for.

    Weights are loaded where the first episode begins: that may be another process.

    Attributes:
        trained_on: the scenario of its training.
    """

    def __init__(self, path: str | Path) -> None:
        """Read a run's settings.

        Args:
            path: the run's folder, or its `policy.pt`.

        Raises:
            RunFileError: there is no run.
        """
        path = Path(path)
        self._folder = path.parent if path.name == POLICY else path
        self._training = read_training(self._folder / SETTINGS)
        known = self._training.environment
        super().__init__({name: value for name, value in known.items() if name not in _ABOUT_THE_RUN})
        self.name = f"{self._training.algorithm} from {self._training.observation}"
        self.trained_on = self._training.scenario
        self._policy: Any = None
        self._encoder: Any = None
        self._stack: Stack | None = None
        self._backgrounds: dict[str, Background] = {}
        self._signal = ""
        self._actions: dict[str, int] = {}

    def reset(self, seed: int) -> None:  # noqa: ARG002 - no exploration
        """Forget the last episode."""
        self._backgrounds = {}

    def meet(self, known: Mapping[str, tuple[spaces.Space[Any], spaces.Discrete]]) -> None:
        """Load the weights for what the signals observe.

        Raises:
            ConfigError: the policy is for one signal, and there are several.
            RunFileError: the weights do not fit them.
        """
        if self._policy is not None:
            return
        from dojo_env.learning.algorithms import build_policies
        from dojo_env.learning.checkpoints import load_policy
        from dojo_env.learning.environments import turn_images
        from dojo_env.learning.joint_signals import Stack
        from dojo_env.learning.process_setup import prepare_process

        prepare_process()
        if self._training.agents == "single":
            if len(known) != 1:
                raise ConfigError(
                    f"{self._folder}: a policy for one signal, and there are {len(known)}; name one, as in "
                    f"--signals {next(iter(known))}"
                )
            ((self._signal, (observed, _)),) = known.items()
        else:
            self._stack = Stack(known)
            observed = self._stack.row_space
        if self._training.encoder != "none":
            from dojo_env.encoders import load_encoder
            from dojo_env.encoders.base import encoded_space

            self._encoder = load_encoder(self._training.encoder)
            observed = encoded_space(observed, self._encoder)
        elif self._training.sees:
            observed = turn_images(observed)
        policy = build_policies(self._training, observed, [int(action.n) for _, action in known.values()])
        load_policy(policy, self._folder / POLICY)
        self._policy = policy

    def see(self, observations: Mapping[str, Any]) -> None:
        """Choose, from what the signals observe."""
        seen = observations[self._signal] if self._stack is None else self._stack.stack(observations)
        if self._training.background_subtraction:
            seen = self._subtract(seen)
        if self._encoder is not None:
            seen = self._encode(seen)
        actions, _ = self._policy.predict(seen, deterministic=True)
        self._actions = (
            {self._signal: int(actions)} if self._stack is None else self._stack.name_actions(actions)
        )

    def act(self, instant: Instant) -> dict[str, int]:  # noqa: ARG002 - see `see`
        """Give what was chosen."""
        return self._actions

    def _subtract(self, seen: Any) -> Any:
        parts = seen if isinstance(seen, Mapping) else {"": seen}
        for name, picture in parts.items():
            self._backgrounds.setdefault(name, Background(picture.shape))
        shown = {name: self._backgrounds[name].subtract(picture) for name, picture in parts.items()}
        return shown if isinstance(seen, Mapping) else shown[""]

    def _encode(self, seen: Any) -> Any:
        from dojo_env.encoders.base import encode_observations

        if self._stack is not None:
            return encode_observations(self._encoder, seen)
        several = isinstance(seen, Mapping)
        batch = {name: image[None] for name, image in seen.items()} if several else seen[None]
        return encode_observations(self._encoder, batch)[0]
