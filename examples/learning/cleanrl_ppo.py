"""PPO in one file, in the style of CleanRL: all of the algorithm is here to be read and changed.

pip install "traffic-dojo[learn]"
python cleanrl_ppo.py --scenario cologne1 --steps 20000

Source: Schulman et al., arXiv:1707.06347; Huang et al., CleanRL, JMLR 23 (2022).
"""

import argparse

import gymnasium
import numpy as np
import torch
from torch import nn
from torch.distributions import Categorical

import dojo_env  # noqa: F401 - it registers the environment

ROLLOUT, EPOCHS, PARTS = 90, 3, 4
GAMMA, TRACE, CLIP, ENTROPY = 0.97, 0.9, 0.2, 0.005


def build_network(inputs: int, outputs: int) -> nn.Sequential:
    """Build two layers of 64."""
    return nn.Sequential(
        nn.Linear(inputs, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, outputs)
    )


def main() -> None:
    """Collect, improve, repeat; a line for every episode that ends."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenario", default="cologne1")
    parser.add_argument("--steps", type=int, default=20_000, help="decisions of all environments together")
    parser.add_argument("--seconds", type=int, default=3600, help="of an episode")
    parser.add_argument("--environments", type=int, default=4)
    options = parser.parse_args()
    torch.manual_seed(0)
    environments = gymnasium.make_vec(
        "dojo_env/TrafficSignal-v0",
        num_envs=options.environments,
        vectorization_mode="async",
        scenario=options.scenario,
        num_seconds=options.seconds,
        reward_fn={"queue": 0.01, "diff-waiting-time": 0.05},
    )
    inputs, phases = environments.single_observation_space.shape[0], environments.single_action_space.n
    actor, critic = build_network(inputs, phases), build_network(inputs, 1)
    weights = [*actor.parameters(), *critic.parameters()]
    optimizer = torch.optim.Adam(weights, lr=5e-4, eps=1e-5)
    seen, _ = environments.reset(seed=list(range(1_000, 1_000 + options.environments)))
    seen, earned = torch.from_numpy(seen), np.zeros(options.environments)
    for done in range(0, options.steps, ROLLOUT * options.environments):
        rows = []
        for _ in range(ROLLOUT):
            with torch.no_grad():
                chances = Categorical(logits=actor(seen))
                action = chances.sample()
                value = critic(seen)[:, 0]
            following, reward, terminated, truncated, _ = environments.step(action.numpy())
            over = terminated | truncated
            earned += reward
            for place in np.flatnonzero(over):
                print(f"{done:8} steps: an episode earned {earned[place]:.1f}", flush=True)
                earned[place] = 0
            rows.append(
                (seen, action, chances.log_prob(action), value, torch.as_tensor(reward).float(), over)
            )
            seen = torch.from_numpy(following)
        with torch.no_grad():
            last = critic(seen)[:, 0]
        learn(rows, last, actor, critic, optimizer)
    environments.close()


def learn(rows: list, last: torch.Tensor, actor: nn.Module, critic: nn.Module, optimizer) -> None:
    """Improve both networks by what was collected."""
    seen, actions, before, values, rewards, over = zip(*rows, strict=True)
    advantages, later = [], torch.zeros_like(last)
    for place in reversed(range(len(rows))):
        goes_on = 1.0 - torch.as_tensor(over[place]).float()
        ahead = last if place + 1 == len(rows) else values[place + 1]
        later = rewards[place] + GAMMA * ahead * goes_on - values[place] + GAMMA * TRACE * goes_on * later
        advantages.insert(0, later)
    seen, actions, before = torch.cat(seen), torch.cat(actions), torch.cat(before)
    gains = torch.cat(advantages)
    returns = gains + torch.cat(values)
    for _ in range(EPOCHS):
        for part in torch.randperm(len(seen)).chunk(PARTS):
            chances = Categorical(logits=actor(seen[part]))
            ratio = (chances.log_prob(actions[part]) - before[part]).exp()
            gain = (gains[part] - gains[part].mean()) / (gains[part].std() + 1e-8)
            policy = -torch.minimum(ratio * gain, ratio.clamp(1 - CLIP, 1 + CLIP) * gain).mean()
            error = (critic(seen[part])[:, 0] - returns[part]).square().mean()
            loss = policy + 0.5 * error - ENTROPY * chances.entropy().mean()
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_([*actor.parameters(), *critic.parameters()], 0.5)
            optimizer.step()


if __name__ == "__main__":
    main()
