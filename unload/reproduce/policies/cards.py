"""The cards of the policies that come with the package: how each was trained, and how it does.

    python -m unload.reproduce policies

Read them with ``print(unload.load_policy("recommended"))``.
"""

from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

from unload import task
from unload.agent.config import TrainConfig
from unload.agent.evaluation import Policy, evaluate
from unload.agent.greedy import load_policy, save_policy
from unload.load.substacks import stack_load
from unload.reproduce.paper.grids import DEFAULTS, PAPER
from unload.reproduce.paper.training import PLAYERS
from unload.reproduce.variants.grids import GRIDS, RECOMMENDED
from unload.support import files
from unload.support.provenance import read_provenance

LOADS, SEED = 200, 5000  # fresh containers of 500 picks each; no other data uses the seed
SCALES = 1.0, 0.8, 1.2  # of the boxes
_DEFAULT = PAPER.cells[DEFAULTS].config
# By name: the grid whose run it is, and the run's configuration.
ORIGINS: dict[str, tuple[str, TrainConfig]] = {
    **{name: (PAPER.name, replace(_DEFAULT, seed=seed)) for seed, name in PLAYERS.items()},
    "recommended": (GRIDS["recommended"].name, RECOMMENDED),
}


def write_cards(
    loads: int = LOADS, data: str | Path = files.DATA, folder: str | Path = files.SHIPPED
) -> None:
    """Measure the policies in ``folder/policies`` and write their cards into their files.

    Args:
        loads: fresh containers per scale of the boxes.
        data: folder of the provenance of the training runs.
        folder: of the policies' folder.
    """
    for name, (grid, config) in ORIGINS.items():
        path = Path(folder) / "policies" / f"{name}.safetensors"
        policy = load_policy(path)
        policy.card = {
            "configuration": asdict(config),
            "loads": "the paper's",
            "picks": config.picks,
            "fingerprint": read_provenance(data, grid)["fingerprint"],
            **{loads_of(scale): measure(policy, scale, loads) for scale in SCALES},
        }
        save_policy(policy, path)


def loads_of(scale: float) -> str:
    """What a card calls the measures on loads of boxes of a scale."""
    return "on the paper's loads" if scale == 1 else f"on boxes × {scale:g}"


def measure(policy: Policy, scale: float, loads: int = LOADS) -> dict[str, float]:
    """How a policy does in fresh containers, each for 500 picks or until it is empty.

    Args:
        policy: see ``unload.policies``.
        scale: of the boxes, see ``unload.stack_load``.
        loads: how many containers.

    Returns:
        ``msr``, ``misses`` and ``picks`` with the mask, and ``msr_no_mask``.
    """
    stack = partial(stack_load, scale=scale)
    masked, free = (evaluate(policy, loads, SEED, mask=mask, stack=stack) for mask in (True, False))
    picks = (masked["unloaded"] / masked["success_rate"]).fillna(task.MAX_PICKS)
    return {
        "msr": round(masked["success_rate"].mean(), 5),
        "misses": round((picks - masked["unloaded"]).sum()),
        "picks": round(picks.sum()),
        "msr_no_mask": round(free["success_rate"].mean(), 5),
    }
