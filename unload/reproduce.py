"""The data behind the paper's figures, computed and kept in ``data/`` with its provenance.

    python -m unload.reproduce lifts          the lift table
    python -m unload.reproduce observation    Figs. 4–6
    python -m unload.reproduce tuning         Figs. 8–10
    python -m unload.reproduce training       Figs. 11 and 12
    python -m unload.reproduce all

File names and columns are those that the paper's own plots read. Runs that were stopped
go on where they were; finished ones are not repeated.
"""

import argparse
import time
from dataclasses import asdict
from pathlib import Path

import gymnasium
import pandas as pd

from unload import checks, files, observation, policies, task
from unload.agent import save_policy
from unload.config import TrainConfig
from unload.equalization import equalize
from unload.evaluate import evaluate
from unload.physics import shared_table
from unload.provenance import write_provenance
from unload.sweep import STEPS, export_curves, run_folder, run_sweep, tuning_config
from unload.train import train

COMMAND = "python -m unload.reproduce"
# The runs that the paper's Figs. 8–10 show: batch size, learning rate, run, equalized.
FIGURE_RUNS = (
    (1024, 1e-1, 6, True),
    (1024, 1e-2, 7, True),
    (1024, 1e-3, 5, True),
    (64, 1e-3, 9, True),
    (256, 1e-3, 9, True),
    (2048, 1e-3, 6, True),
    (2048, 1e-3, 8, False),
)
PAPER_PICKS = TrainConfig().picks
REDUCED_PICKS = 1_000_000
LOG_INTERVAL = 100  # steps of all environments per point of the training's loss


def observation_data(seed: int = 0, folder: str | Path = files.DATA) -> None:
    """Item positions of a fresh container, for Figs. 4–6.

    Writes ``obs_hist_equal/{all_items,Observation,Equalized_Observation}.csv`` with columns
    ``x`` and ``y``: scaled x and z of all items, of the 128 observed ones, and of the
    observed ones after equalization.
    """
    start = time.monotonic()
    folder = Path(folder) / "obs_hist_equal"
    env = gymnasium.make("unload/Container-v0").unwrapped
    observed, _ = env.reset(seed=checks.integer("seed", seed, 0))
    everything = observation.scale(env.observed_positions())
    env.close()
    tables = {
        "all_items": everything,
        "Observation": observed,
        "Equalized_Observation": equalize(observed),
    }
    for name, points in tables.items():
        frame = pd.DataFrame(points[:, [0, 2]], columns=["x", "y"])
        files.write_text(folder / f"{name}.csv", frame.to_csv(index=False, float_format="%.6f"))
    seconds = time.monotonic() - start
    write_provenance(
        folder, "observation", f"{COMMAND} observation", {"seed": seed}, seconds, reduced=False
    )


def lift_data(episodes: int = 60, seed: int = 0, folder: str | Path = files.DATA) -> None:
    """Lifts that a newcomer's containers will meet, ``lifts.npz``.

    Plays episodes with each of the policies that need no learning and with a mixture of
    the random and the highest-item policy, and adds what is new to the shared table.

    Args:
        episodes: per policy.
        seed: of the episodes.
        folder: of the table.
    """
    start = time.monotonic()

    def mixed(observations, masks, rng):
        return (policies.random if rng.random() < 0.3 else policies.highest)(
            observations, masks, rng
        )

    for policy in (policies.random, policies.nearest, policies.highest, mixed):
        evaluate(policy, episodes, seed)
    table = shared_table()
    table.save(Path(folder) / "lifts.npz")
    settings = {"episodes": episodes, "seed": seed, "lifts": len(table)}
    seconds = time.monotonic() - start
    write_provenance(folder, "lifts", f"{COMMAND} lifts", settings, seconds, reduced=False)


def tuning_data(
    runs: tuple[tuple[int, float, int, bool], ...] = FIGURE_RUNS,
    steps: int = STEPS,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = -1,
) -> None:
    """Curves in the hyperparameter-tuning environment, for Figs. 8–10.

    Args:
        runs: batch size, learning rate, number and equalization of each run.
        steps: K.
        folder: of the data, see ``unload.sweep.export_curves``.
        runs_dir: where unfinished runs are kept.
        n_jobs: processes.

    Raises:
        RuntimeError: a run failed; the message says which and why.
    """
    start = time.monotonic()
    configs = [
        tuning_config(batch_size, learning_rate, run, equalized, steps)
        for batch_size, learning_rate, run, equalized in runs
    ]
    report = run_sweep(configs, Path(runs_dir) / "tuning", n_jobs)
    failed = report[report.error != ""]
    if len(failed):
        raise RuntimeError("runs failed:\n" + failed[["folder", "error"]].to_string(index=False))
    for config in configs:
        export_curves(config, run_folder(config, Path(runs_dir) / "tuning"), folder)
    settings = {"steps": steps, "runs (batch size, learning rate, seed, equalized)": runs}
    seconds = time.monotonic() - start
    write_provenance(folder, "tuning", f"{COMMAND} tuning", settings, seconds, steps < STEPS)


def training_data(
    picks: int = REDUCED_PICKS,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    progress: bool = True,
) -> None:
    """The paper's training in the container (Sec. IV-B), for Figs. 11 and 12.

    Writes ``loss_function_agent.csv`` and ``total_rew_function_agent.csv`` with the columns
    ``Wall time,Step,Value`` of a TensorBoard export, the reward summed over an episode of
    500 picks; and the trained policy, ``policies/paper.safetensors``.

    Args:
        picks: K, at least one episode of all environments.
        folder: of the data.
        runs_dir: where the unfinished run is kept.
        progress: show a progress bar.
    """
    checks.integer("picks", picks, task.NUM_ENVS * task.MAX_PICKS)
    start = time.monotonic()
    folder = Path(folder)
    config = TrainConfig(picks=picks, log_interval=LOG_INTERVAL)
    result = train(config, Path(runs_dir) / f"training_{picks}", progress)
    curve = result.curve[["wall_time", "picks", "loss", "mean_reward"]]
    # All environments start their episodes together, so that these are means over episodes.
    points = task.MAX_PICKS // LOG_INTERVAL
    complete = curve[: len(curve) // points * points]
    episodes = complete.groupby(complete.index // points)
    reward = episodes["mean_reward"].mean() * task.MAX_PICKS
    for name, rows, values in (
        ("loss_function_agent", curve, curve["loss"]),
        ("total_rew_function_agent", episodes[["wall_time", "picks"]].last(), reward),
    ):
        frame = pd.DataFrame(
            {"Wall time": rows["wall_time"], "Step": rows["picks"], "Value": values}
        ).dropna()
        files.write_text(folder / f"{name}.csv", frame.to_csv(index=False, float_format="%.12g"))
    save_policy(result.policy, folder / "policies" / "paper.safetensors")
    seconds = float(curve["wall_time"].iloc[-1] - curve["wall_time"].iloc[0])
    write_provenance(
        folder,
        "training",
        f"{COMMAND} training --picks {picks}",
        asdict(config),
        max(seconds, time.monotonic() - start),
        reduced=picks < PAPER_PICKS,
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=["lifts", "observation", "tuning", "training", "all"])
    parser.add_argument("--picks", type=int, default=REDUCED_PICKS, help="of the training")
    options = parser.parse_args()
    if options.what in ("lifts", "all"):
        lift_data()
    if options.what in ("observation", "all"):
        observation_data()
    if options.what in ("tuning", "all"):
        tuning_data()
    if options.what in ("training", "all"):
        training_data(options.picks)


if __name__ == "__main__":
    main()
