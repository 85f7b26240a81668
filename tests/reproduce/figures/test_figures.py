"""The figures of the paper: what they show comes from the data."""

import json

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from unload.reproduce.figures import observation, study, training, tuning
from unload.reproduce.figures.lifting import lift_sequences
from unload.reproduce.figures.mdp import fig01_mdp
from unload.reproduce.figures.network import fig07_network
from unload.reproduce.figures.style import save
from unload.reproduce.figures.substacks import fig03_substacks, rows
from unload.reproduce.tuning import running_mean, set_name
from unload.support import files

matplotlib.use("Agg")


@pytest.fixture(autouse=True)
def close_figures():
    yield
    plt.close("all")


FROM_DATA = [
    observation.fig04_observation,
    observation.fig05_histogram,
    observation.fig06_equalized,
    tuning.fig08_learning_rate,
    tuning.fig09_batch_size,
    tuning.fig10_loss,
    training.fig11_loss,
    training.fig12_reward,
    study.why_60,
    study.offline_msr,
    study.factorial_msr,
    study.factorial_curves,
]


@pytest.mark.parametrize("draw", [fig01_mdp, fig03_substacks, fig07_network, *FROM_DATA])
def test_figure_is_saved_as_the_same_bytes(draw, tmp_path):
    for folder in ("a", "b"):
        save(draw(), draw.__name__, tmp_path / folder)
    for suffix in ("png", "pdf"):
        first, second = (tmp_path / folder / f"{draw.__name__}.{suffix}" for folder in "ab")
        assert first.read_bytes() == second.read_bytes()
        assert first.stat().st_size > 5000


@pytest.mark.parametrize("draw", FROM_DATA)
def test_missing_data_names_the_command_that_makes_it(draw, tmp_path):
    with pytest.raises(FileNotFoundError, match="python -m unload.reproduce"):
        draw(tmp_path)


def test_learning_rate_figure_draws_the_stored_curves():
    drawn = [line.get_ydata() for line in tuning.fig08_learning_rate().axes[0].lines]
    stored = tuning.read_curve(files.DATA, "hitrate_curve_bz_1024_lr_0.001_agent_5")
    assert any(np.array_equal(curve, running_mean(stored)) for curve in drawn)


def test_strong_lines_are_the_papers_runs():
    figure, axes = plt.subplots()
    runs = {run: np.full(30, run / 10) for run in (2, 5, 7)}
    tuning.draw_curves(axes, {"a": (runs, 5), "b": (runs, 6)}, "MSR")
    named = {line.get_label(): line.get_ydata()[0] for line in axes.lines if line.get_zorder() == 3}
    assert named == {"a": 0.5, "b": 0.2}  # the first one where the paper's is missing
    assert len(axes.lines) == 6


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("Step,Value\n1,2\n", r"has columns \['Step', 'Value'\]; expected \['Wall time', "),
        ("Wall time,Step,Value\n", "has no rows; expected at least one"),
        ("Wall time,Step,Value\n1,2,\n", "holds nan"),
    ],
)
def test_bad_training_curves_are_refused(tmp_path, content, message):
    (tmp_path / "loss_function_agent.csv").write_text(content)
    with pytest.raises(ValueError, match=f"loss_function_agent.csv {message}"):
        training.read_curve(tmp_path, "loss_function_agent")


@pytest.mark.parametrize("content", ["", "a\nb\n", "1,2\n3,4\n"])
def test_bad_tuning_curves_are_refused(tmp_path, content):
    path = tmp_path / set_name(True) / "curve.csv"
    path.parent.mkdir()
    path.write_text(content)
    with pytest.raises(ValueError, match="curve.csv (is not a column of numbers|has 2 columns)"):
        tuning.read_curve(tmp_path, "curve")


@pytest.mark.parametrize(
    ("combinations", "message"),
    [
        ([(0, 0, 0, -1)], "combinations holds -1 to 0; expected 0 to 2"),
        ([(0,)], r"combinations has shape \(1, 1\); expected \(any, 4\)"),
        ([], "combinations has shape"),
    ],
)
def test_bad_rows_are_refused(combinations, message):
    with pytest.raises(ValueError, match=message):
        rows(combinations)
    assert len(rows([(0, 1, 2, 0)]).axes) == 1


def test_bad_lift_sequences_are_refused():
    sizes, poses = np.ones((2, 2)), np.zeros((1, 2, 3))
    for lifts, times, error, message in (
        ({}, [0.0], ValueError, "lifts has 0 and times 1 entries; expected at least one"),
        ({"a": (sizes, poses)}, [], ValueError, "lifts has 1 and times 0 entries"),
        ([1], [0.0], TypeError, r"lifts is \[1\]; expected a dict"),
        ({"a": (sizes, poses)}, [0.0, 0.1], ValueError, "poses of 'a' has shape"),
    ):
        with pytest.raises(error, match=message):
            lift_sequences(lifts, times)
    assert len(lift_sequences({"a": (sizes, poses)}, [0.0]).axes) == 1


@pytest.mark.parametrize("reduced", [True, False])
def test_a_reduced_run_says_so(tmp_path, reduced):
    for name in ("loss_function_agent.csv", "training.provenance.json"):
        (tmp_path / name).write_text((files.DATA / name).read_text())
    path = tmp_path / "training.provenance.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"reduced": reduced}))
    note = training.fig11_loss(tmp_path).get_supxlabel()
    assert ("reduced run" in note) == reduced


def test_every_figure_of_the_paper_is_committed():
    for suffix in ("png", "pdf"):
        numbers = sorted(path.name[:5] for path in files.FIGURES.glob(f"fig*.{suffix}"))
        assert numbers == [f"fig{number:02d}" for number in range(1, 13)]


def test_bars_of_why_60_are_the_means_of_the_data():
    bars = [bar.get_width() for bar in study.why_60().axes[0].patches]
    rows = pd.read_csv(files.DATA / "study" / "factorial.csv")
    rows = rows[rows["epsilon_final"] == 0]

    def end(features, mask):
        cell = rows[(rows["features"] == features) & (rows["mask"] == mask)]
        return cell["msr_training"].mean()

    ours = pd.read_csv(files.DATA / "training_summary.csv")["msr_end"].mean()
    changed = [("noisy ranks", False), ("noisy ranks", True), ("tied ranks", False)]
    expected = [0.6, ours, *(end(*cell) for cell in changed), end("positions", False)]
    np.testing.assert_allclose(bars, expected)


def test_factorial_table_summarizes_each_cell():
    rows = pd.read_csv(files.DATA / "study" / "factorial.csv")
    table = study.factorial_table()
    assert table["runs"].sum() == len(rows)
    for _, cell in table.iterrows():
        group = rows[(rows[study.CELL] == cell[study.CELL]).all(axis=1)]
        assert np.isclose(cell["msr_mask"], group["msr_mask"].mean())
        assert cell["msr_mask_low"] <= cell["msr_mask"] <= cell["msr_mask_high"]
        assert cell["longest_deadlock"] == group["longest_deadlock"].max()
        assert cell["reached"] == group["picks_to_goal_no_mask"].notna().sum()


def write_study(folder, experiment, settings):
    """A study of one run per setting; the n-th comes to an MSR of n / 10."""
    rows = [
        {"run": f"run {number}", "features": "positions", "picks": 64, "msr_mask": number / 10,
         "msr_no_mask": number / 10, **each}
        for number, each in enumerate(settings)
    ]  # fmt: skip
    (folder / "study").mkdir(exist_ok=True)
    pd.DataFrame(rows).to_csv(folder / "study" / f"{experiment}.csv", index=False)
    curves = pd.DataFrame({"run": [row["run"] for row in rows]})
    curves.to_csv(folder / "study" / f"{experiment}_curves.csv", index=False)


def test_varied_settings_are_named_by_what_differs(tmp_path):
    base = {"n_features": 64, "batch_size": 256}
    write_study(tmp_path, "search", [base, base | {"n_features": 16}, base | {"batch_size": 64}])
    axes = study.varied_msr("search", list(base), tmp_path).axes[0]
    names = [label.get_text() for label in axes.get_yticklabels()]
    assert names == ["unchanged", "n features 16", "batch size 64"]
    strong = [line for line in axes.lines if line.get_marker() != "None" and not line.get_alpha()]
    means = [line.get_xdata()[0] for line in strong]
    assert means == [0, 0, 0.1, 0.1, 0.2, 0.2]
    with pytest.raises(ValueError, match="the experiment has no gamma; expected gamma"):
        study.varied_msr("search", "gamma", tmp_path)


def test_several_studies_share_a_figure(tmp_path):
    write_study(tmp_path, "networks", [{"network": "peq"}, {"network": "stack"}])
    write_study(tmp_path, "rewards", [{"network": "attention"}])
    axes = study.varied_msr(["networks", "rewards"], "network", tmp_path).axes[0]
    names = [label.get_text() for label in axes.get_yticklabels()]
    assert names == ["network peq", "network stack", "network attention"]
    with pytest.raises(ValueError, match="experiment is 'nonsense'; expected one of"):
        study.varied_msr("nonsense", "network", tmp_path)


def test_other_columns_of_the_fits_are_refused(tmp_path):
    (tmp_path / "study").mkdir()
    (tmp_path / "study" / "offline.csv").write_text("features,seed\npositions,0\n")
    with pytest.raises(ValueError, match="offline.csv has no deadlocked, loss, msr_mask"):
        study.offline_msr(tmp_path)
