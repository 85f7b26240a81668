"""The hyperparameter search of Sec. IV-A: its grid, data and measures, and Figs. 8–10.

python -m studies tuning
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies import paths
from studies.grid import Cell, Grid, read_grid, train_grid
from studies.results import COMMAND, read_table
from studies.style import COLOURS, styled
from unload import task
from unload.agent.config import TrainConfig
from unload.env.highest_item import GRID
from unload.support import files

LEARNING_RATES = (1e-1, 1e-2, 1e-3)
BATCH_SIZES = (64, 256, 1024, 2048)
RUN_COUNT = 10  # of each configuration
STEPS = 3000  # K, one pick in each of 64 environments and one update per step
# Of all runs; they differ in batch size b, learning rate μ, seed, and with or without FE.
CONFIG = TrainConfig(
    env="unload/HighestItem-v0", picks=STEPS * task.NUM_ENVS, equalize=True, log_interval=1
)
# What the paper's plots read of the search: its folder, the column, batch size, learning rate, run.
SHOWN = (
    ("with", "hitrate", 1024, 1e-1, 6),
    ("with", "hitrate", 1024, 1e-2, 7),
    ("with", "hitrate", 1024, 1e-3, 5),
    ("with", "hitrate", 64, 1e-3, 9),
    ("with", "hitrate", 256, 1e-3, 9),
    ("with", "hitrate", 2048, 1e-3, 6),
    ("with", "loss", 2048, 1e-3, 6),
    ("without", "loss", 2048, 1e-3, 8),
)

SMOOTHING_STEPS = 25  # of the running means
FINAL = 100  # steps at the end of a run that its final values are means of
SOLVED = 0.99  # MSR
REACHED = 0.9  # greedy MSR
LEAST_GREEDY = 0.05  # share of the picks from which the greedy MSR can be told
RESAMPLES = 500  # of the runs, for intervals

Curves = dict[int, np.ndarray]  # one value per training step, by the number of the run
FE_COLOURS = {"with FE": COLOURS["ranks"], "without FE": COLOURS["positions"]}


def tuning_cell(batch_size: int, learning_rate: float, equalize: bool) -> str:
    """The name of a cell of the search, such as ``b64_with_fe/lr_0.1``."""
    return f"b{batch_size}_{'with' if equalize else 'without'}_fe/lr_{learning_rate:g}"


def tuning_grid(
    learning_rates: Sequence[float] = LEARNING_RATES,
    batch_sizes: Sequence[int] = BATCH_SIZES,
    runs: int = RUN_COUNT,
    equalize: Sequence[bool] = (True, False),
    steps: int = STEPS,
) -> Grid:
    """The paper's search, or a smaller one.

    The slow runs, of large batches, come first, so that no process is left with one of them at
    the end.
    """
    cells = {}
    for batch_size in sorted(batch_sizes, reverse=True):
        for equalized in equalize:
            for learning_rate in learning_rates:
                fields = {"batch_size": batch_size, "learning_rate": learning_rate}
                config = replace(CONFIG, picks=steps * task.NUM_ENVS, equalize=equalized, **fields)
                name = tuning_cell(batch_size, learning_rate, equalized)
                cells[name] = Cell(config, range(runs))
    return Grid("tuning", f"{COMMAND} tuning", cells, policies=False)


TUNING = tuning_grid()


def tuning_data(n_jobs: int = -1) -> None:
    """Train the search, see ``train_grid``, and write what the paper's plots read of it."""
    train_grid(TUNING, n_jobs=n_jobs)
    export_tuning()


def export_tuning() -> None:
    """Write the curves that the paper's plots read of the published search.

    ``dummy_sim_{with,without}_hist_equal/{hitrate,loss}_curve_bz_<b>_lr_<μ>_agent_<run>.csv``: a
    value per step and no header; the loss before the first update is ``nan``, which the plots
    leave out.
    """
    for fe, kind, batch_size, rate, run in SHOWN:
        run_name = f"{tuning_cell(batch_size, rate, fe == 'with')}/seed_{run}"
        name = f"{kind}_curve_bz_{batch_size}_lr_{rate:g}_agent_{run}.csv"
        column = {"hitrate": "success_rate", "loss": "loss"}[kind]
        values = read_table(TUNING.name)[f"{column} {run_name}"]
        files.write_text(
            paths.DATA / f"dummy_sim_{fe}_hist_equal" / name,
            values.to_csv(
                index=False, header=False, na_rep="nan", float_format="%.6g", lineterminator="\n"
            ),
        )


def read_curves(
    column: str, batch_size: int, learning_rate: float, equalize: bool = True
) -> dict[int, np.ndarray]:
    """The curves of all runs of a configuration, by the number of the run.

    Args:
        column: ``"success_rate"`` or ``"loss"``.
        batch_size, learning_rate, equalize: the configuration.

    Returns:
        A value per training step, (steps,) float64, NaN where there is none yet.
    """
    curves = read_grid(TUNING, [tuning_cell(batch_size, learning_rate, equalize)])
    return {int(run): curve[column].to_numpy() for run, curve in curves.groupby("seed")}


def running_mean(values: np.ndarray) -> np.ndarray:
    """Means over 25 steps around each one, fewer at the ends; NaN does not count."""
    return pd.Series(values).rolling(SMOOTHING_STEPS, min_periods=1, center=True).mean().to_numpy()


def chance() -> float:
    """MSR of random picks in the tuning environment: the expected share of highest items.

    An item of a height is among the highest if none of the 127 others is higher.
    """
    heights, counts = np.unique(GRID[:, 2].round(6), return_counts=True)
    share = counts / counts.sum()
    return float((share * share.cumsum() ** (task.N_VISIBLE - 1)).sum())


def greedy_msr(success_rate: np.ndarray) -> np.ndarray:
    """The MSR that an agent's greedy picks had while it explored.

    Of the picks at a step a share ε is random, and succeeds by chance. Therefore
    MSR = (1 - ε) · greedy MSR + ε · chance, here solved for the greedy MSR with means over 25
    steps. The fewer picks are greedy, the noisier it is: it may leave [0, 1].

    Args:
        success_rate: (..., steps) MSR while training at each step of a whole run.

    Returns:
        (..., steps), NaN where fewer than one pick in twenty is greedy.
    """
    steps = success_rate.shape[-1]
    config = replace(CONFIG, picks=steps * task.NUM_ENVS, batch_size=1)
    epsilon = np.array([config.epsilon(step * task.NUM_ENVS) for step in range(steps)])
    greedy = running_mean(1 - epsilon)
    by_greedy = np.apply_along_axis(running_mean, -1, success_rate - epsilon * chance())
    return np.where(greedy < LEAST_GREEDY, np.nan, by_greedy / np.maximum(greedy, LEAST_GREEDY))


def reached_at(msr: np.ndarray) -> np.ndarray:
    """The step from which on an MSR stays at 90 % or above.

    Args:
        msr: (..., steps), NaN where it is not known.

    Returns:
        (...) float64, NaN if it does not end there.
    """
    below = ~(msr[..., ::-1] >= REACHED)  # from the last step back; NaN counts as below
    since = np.where(below.any(axis=-1), below.argmax(axis=-1), msr.shape[-1])
    return np.where(since > 0, msr.shape[-1] - since, np.nan)


def greedy_reached(curves: Iterable[np.ndarray]) -> dict[str, float]:
    """When the mean greedy MSR of runs reaches 90 %, of their (steps,) MSR while training.

    The mean, because at that time one run alone has too few greedy picks.

    Returns:
        ``step``, see ``reached_at``, and ``low`` and ``high``, its 95 % bootstrap interval over
        the runs.
    """
    runs = greedy_msr(np.array(list(curves)))
    rng = np.random.default_rng(0)
    drawn = rng.integers(len(runs), size=(RESAMPLES, len(runs)))
    steps = reached_at(runs[drawn].mean(axis=1))
    low, high = np.nanpercentile(steps, [2.5, 97.5])
    return {"step": float(reached_at(runs.mean(axis=0))), "low": low, "high": high}


def run_summary(success_rate: np.ndarray, loss: np.ndarray) -> dict[str, float]:
    """How a tuning run ended, and its loss on the way.

    Args:
        success_rate: (steps,) MSR at each step.
        loss: (steps,) loss, NaN before the first update.

    Returns:
        ``final_msr``: mean over the last 100 steps. ``solved``: whether the running mean of the
        MSR ends at 99 % or above. ``loss_start``: the first loss; ``loss_dip`` and ``loss_peak``:
        where the running mean of the loss begins and ends its largest rise; ``loss_end``: mean
        over the last 100 steps.
    """
    known = np.isfinite(loss)
    smooth = running_mean(loss)[known]
    lowest = np.minimum.accumulate(smooth)
    peak = np.argmax(smooth - lowest)
    return {
        "final_msr": success_rate[-FINAL:].mean(),
        "solved": running_mean(success_rate)[-1] >= SOLVED,
        "loss_start": loss[known][0],
        "loss_dip": lowest[peak],
        "loss_peak": smooth[peak],
        "loss_end": loss[known][-FINAL:].mean(),
    }


def tuning_summary() -> pd.DataFrame:
    """One row per configuration of the published search: means over its runs of ``run_summary``.

    Columns: ``equalize``, ``batch_size``, ``learning_rate``; the means, but of ``solved`` the
    number of runs; ``final_msr_std``, a standard deviation; and ``runs``.
    """
    searched, rows = ["equalize", "batch_size", "learning_rate"], []
    for (cell, _), curve in read_grid(TUNING).groupby(["cell", "seed"]):
        settings = {name: getattr(TUNING.cells[cell].config, name) for name in searched}
        rows.append(settings | run_summary(*curve[["success_rate", "loss"]].to_numpy().T))
    groups = pd.DataFrame(rows).groupby(searched)
    summary = groups.mean().assign(
        solved=groups["solved"].sum(), final_msr_std=groups["final_msr"].std(), runs=groups.size()
    )
    return summary.reset_index()


@styled
def over_steps(curves: Mapping[str, tuple[Curves, int]], label: str) -> Figure:
    """Running means over 25 steps of all runs, one of each configuration as a strong line.

    Args:
        curves: by name: the curves of all runs, and the number of the strong one, which stands
            in the legend if there are others.
        label: of the vertical axis, an MSR unless it says "loss".
    """
    figure, axes = plt.subplots()
    for (name, (runs, shown)), colour in zip(curves.items(), colours_of(curves)):
        draw_runs(axes, name, runs, shown, colour)
    steps = max(len(values) for runs, _ in curves.values() for values in runs.values())
    axes.set(xlabel="step $k$", ylabel=label, xlim=(0, steps))
    axes.set(ylim=(0, 0.6) if "loss" in label else (0, 1.02))
    others = any(len(runs) > 1 for runs, _ in curves.values())
    note = "thin: the other runs of the same configuration" if others else None
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=2, title=note, title_fontsize=8)
    return figure


def draw_runs(axes: Axes, name: str, runs: Curves, shown: int, colour) -> None:
    """Draw the runs of a configuration, one of them as a strong line; see ``over_steps``."""
    for run, values in runs.items():
        smooth = running_mean(values)
        if run == shown:
            label_of_run = f"{name}, run {shown}" if len(runs) > 1 else name
            axes.plot(smooth, color=colour, label=label_of_run, zorder=3)
        else:
            axes.plot(smooth, color=colour, linewidth=0.5, alpha=0.4)


def colours_of(names: Collection[str]) -> list:
    """A colour a name: of what an agent sees, else from a scale for the values of a setting."""
    scale = plt.get_cmap("viridis")(np.linspace(0, 0.85, len(names)))
    return [FE_COLOURS.get(name, colour) for name, colour in zip(names, scale)]
