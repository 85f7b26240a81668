"""Fingerprints of how the code trains, lifts and evaluates, for results that rest on it.

One is a digest of what short runs, some lifts or short episodes yield. As long as it stays the
same, the code still trains, lifts or evaluates as it did when a result was made; a result of
another fingerprint would come out otherwise today. All are a part of what kept answers are known
by, see ``results.keep_all``, and that of training is published.
"""

from collections.abc import Callable, Iterable
from functools import cache, partial
from hashlib import blake2b
from tempfile import TemporaryDirectory

import numpy as np

from studies.changes import height_reward
from studies.networks import NETWORKS
from unload import task
from unload.agent import policies
from unload.agent.config import TrainConfig
from unload.agent.evaluation import evaluate
from unload.agent.training import Training, train
from unload.load.substacks import stack_load
from unload.physics.full import FullPhysics
from unload.physics.local import LocalPhysics
from unload.physics.table import TablePhysics

# Of the boxes of a wall from above, all or every twelfth, because simulating takes long.
LIFTED = {partial(TablePhysics, exact=True): 1, LocalPhysics: 12, FullPhysics: 12}


def training_fingerprint(networks: Iterable[str | Callable] = ("peq",)) -> str:
    """Digest of the learning curves of short runs, 16 hexadecimal digits.

    It covers the loads, the lifts, what is observed, the choices and the updates. MSR,
    deadlocks and loss are rounded to three digits, because processors round otherwise in the
    seventh; the runs are so short that such a difference changes no choice.

    Args:
        networks: of the configurations that the result rests on.
    """
    digest = blake2b(digest_size=8)
    for network in sorted(map(name_of, {*networks})):
        digest.update(_curves(network).encode())
    return digest.hexdigest()


def name_of(network: str | Callable) -> str:
    """The name of a configuration's network in published settings; its own if it has none."""
    return next((name for name, kind in NETWORKS.items() if kind is network), str(network))


def short_runs(network: str) -> list[tuple[TrainConfig, Callable[[Training], None] | None]]:
    """The runs of a network, and what is changed in each (see ``train``).

    The paper's network has its configurations and the factors of the studies.
    """
    if network != "peq":
        size = {"picks": 40 * task.NUM_ENVS, "batch_size": 64, "n_features": 16}
        config = TrainConfig(network=NETWORKS.get(network, network), log_interval=10, **size)
        return [(config, None)]
    paper = {"picks": 200 * task.NUM_ENVS, "log_interval": 40}
    small = paper | {"batch_size": 256}
    return [
        (TrainConfig(**paper), None),
        (TrainConfig(**small, equalize=False, mask=True, epsilon_final=0.05), None),
        (TrainConfig(**small, ties="average", gradient_steps=2), partial(height_reward, share=0.5)),
        (TrainConfig(**small, env="unload/HighestItem-v0"), None),
    ]


@cache
def _curves(network: str) -> str:
    """The rounded curves of a network's runs."""
    text = ""
    for config, change in short_runs(network):
        with TemporaryDirectory() as folder:
            curve = train(config, folder, progress=False, change=change).curve
        columns = ["picks", "success_rate", "deadlocked", "loss"]
        text += curve[columns].to_csv(index=False, float_format="%.3g", lineterminator="\n")
    return text


@cache
def physics_fingerprint() -> str:
    """Digest of lifts in a container of one wall, 16 hexadecimal digits.

    It covers the load, the engine that decides here, and the physics ``table``, empty at first,
    ``local``, which fills it, and ``full``. How far a box moved is rounded to three digits.
    """
    digest = blake2b(digest_size=8)
    load = stack_load(np.random.default_rng(0), walls=1)
    for kind, step in LIFTED.items():
        physics, here = kind(), (load, np.ones(len(load), bool))
        if isinstance(physics, FullPhysics):
            physics.reset(load)
            here = ()
        for item in np.argsort(-load.positions[:, 2], kind="stable")[::step]:
            digest.update(f"{physics.lift(*here, int(item)):.3g} ".encode())
        physics.close()
    return digest.hexdigest()


@cache
def evaluation_fingerprint() -> str:
    """Digest of what ``evaluate`` says of short episodes, 16 hexadecimal digits."""
    rows = evaluate(policies.random, 3, max_picks=100).to_csv(
        index=False, float_format="%.3g", lineterminator="\n"
    )
    return blake2b(rows.encode(), digest_size=8).hexdigest()
