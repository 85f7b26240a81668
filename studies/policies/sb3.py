"""Agents of Stable-Baselines3 on the benchmarks' task, trained for the minutes that one waits.

    python -m studies sb3

Its DQN has the paper's network and hyperparameters, but for fewer picks and a smaller batch;
MaskablePPO its own network, two layers on the flattened observation, and the paper's discount and
learning rate. Beside them, ``unload.train`` makes the same picks with the DQN's settings.
"""

import time
from dataclasses import replace
from functools import partial
from importlib.metadata import version
from itertools import product
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
import torch
from sb3_contrib import MaskablePPO
from stable_baselines3 import DQN
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.dqn.policies import DQNPolicy, QNetwork

from studies.policies.comparison import LOADS, SEED
from studies.results import COMMAND, keep_all, publish
from unload.agent.config import EXPLORATION_FRACTION, TrainConfig
from unload.agent.evaluation import Policy, evaluate
from unload.agent.training import train
from unload.network.peq import PEQNetwork

CONFIG = TrainConfig(picks=2**15, replay_size=2**15, batch_size=64)
SEEN = {"ranks": True, "positions": False}  # what is seen, and whether that is equalized
SEEDS = range(3)
ROLLOUT = 2048  # picks, the default of MaskablePPO for one environment


class PEQValues(QNetwork):
    """``PEQNetwork`` where Stable-Baselines3 expects a network; n is ``net_arch[0]``."""

    def __init__(self, *args, **kwargs) -> None:
        super().__init__(*args, **kwargs)
        self.q_net = PEQNetwork(self.net_arch[0])

    def forward(self, obs):
        return self.q_net(obs)


class PEQPolicy(DQNPolicy):
    """Stable-Baselines3's DQN policy with the paper's network; ``net_arch=[n]``."""

    def make_q_net(self) -> PEQValues:
        arguments = self._update_features_extractor(self.net_args, features_extractor=None)
        return PEQValues(**arguments).to(self.device)


def containers(config: TrainConfig) -> VecEnv:
    """The environments of a configuration, one after the other in a loop."""
    settings = {"physics": "table", "equalize": config.equalize, "max_picks": config.max_picks}
    return make_vec_env("unload/Container-v0", config.num_envs, env_kwargs=settings)


def dqn(config: TrainConfig, envs: VecEnv) -> DQN:
    """Stable-Baselines3's DQN with the settings of ours."""
    return DQN(
        PEQPolicy,
        envs,
        learning_rate=config.learning_rate,
        buffer_size=config.replay_size,
        learning_starts=config.batch_size,
        batch_size=config.batch_size,
        gamma=config.gamma,
        train_freq=1,  # of all environments
        gradient_steps=config.gradient_steps,
        target_update_interval=config.target_update_interval,
        exploration_fraction=EXPLORATION_FRACTION,
        exploration_initial_eps=config.epsilon_init,
        exploration_final_eps=config.epsilon_final,
        policy_kwargs={"net_arch": [config.n_features]},
        device="cpu",
        seed=config.seed,
    )


def maskable_ppo(config: TrainConfig, envs: VecEnv) -> MaskablePPO:
    """MaskablePPO, which trains with the mask."""
    return MaskablePPO(
        "MlpPolicy",
        envs,
        learning_rate=config.learning_rate,
        n_steps=ROLLOUT // config.num_envs,
        batch_size=config.batch_size,
        gamma=config.gamma,
        device="cpu",
        seed=config.seed,
    )


AGENTS = {"DQN": dqn, "MaskablePPO": maskable_ppo, "unload": None}


def greedy(
    model: DQN | MaskablePPO, observations: np.ndarray, masks: np.ndarray, rng
) -> np.ndarray:
    """The policy of a trained model; that of DQN knows no masks."""
    if isinstance(model, MaskablePPO):
        return model.predict(observations, action_masks=masks, deterministic=True)[0]
    with torch.no_grad():
        values = model.q_net(torch.from_numpy(observations)).numpy()
    return np.where(masks, values, -np.inf).argmax(axis=1)


def trained(agent: str, seen: str, seed: int) -> list[dict]:
    """Train an agent and let it unload the benchmarks' containers, with the mask and without.

    Returns:
        A row for each: ``mask``, ``msr``, ``longest_deadlock`` and ``cpu_s`` of the training.
    """
    config, start = replace(CONFIG, seed=seed, equalize=SEEN[seen]), time.process_time()
    if AGENTS[agent] is None:
        with TemporaryDirectory() as folder:
            policy: Policy = train(config, folder, progress=False).policy
        equalize = False  # it does that itself
    else:
        model = AGENTS[agent](config, containers(config))
        model.learn(config.picks)
        policy, equalize = partial(greedy, model), config.equalize
    seconds, rows = time.process_time() - start, []
    for mask in (True, False):
        table = evaluate(policy, LOADS, SEED, mask=mask, equalize=equalize)
        longest = int(table["longest_deadlock"].max())
        msr = float(table["success_rate"].mean())
        rows.append({"mask": mask, "msr": msr, "longest_deadlock": longest, "cpu_s": seconds})
    return rows


def sb3_data(n_jobs: int = 1) -> None:
    """Train all agents: ``sb3.csv``, a row per agent, what it sees, seed and mask."""
    runs = [dict(zip(("agent", "seen", "seed"), run)) for run in product(AGENTS, SEEN, SEEDS)]
    settings = {"configuration": CONFIG.plain(), "rollout": ROLLOUT}
    settings |= {"loads": LOADS, "seed of the loads": SEED}
    settings |= {name: version(name) for name in ("stable-baselines3", "sb3-contrib")}
    asked = [(run | settings, (*run.values(),)) for run in runs]
    answers = keep_all("sb3", trained, asked, n_jobs)
    rows = [run | row for run, answer in zip(runs, answers) for row in answer.value]
    settings["seeds"] = [*SEEDS]
    publish("sb3", {"sb3": pd.DataFrame(rows)}, f"{COMMAND} sb3", settings, answers)
