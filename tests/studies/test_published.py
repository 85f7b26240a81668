"""What is published follows from the data: figures, and tables of the reports."""

import ast
import re
from base64 import b64decode
from contextlib import redirect_stdout
from functools import partial
from io import BytesIO, StringIO
from itertools import count

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from PIL import Image
from scipy import stats

from studies import paths, style
from studies.falls.long import LONG
from studies.grid import read_grid
from studies.heap.table import compared
from studies.order.training import ORDER
from studies.paper import diagrams
from studies.paper.training import PAPER, PAPER_CELLS
from studies.play import animation
from studies.policies.comparison import comparison_msr
from studies.results import read_table
from studies.seamless.training import SEAMLESS
from studies.statistics import PAPER_MSR, by_cell, by_run, windows
from studies.ties.criterion import READINGS, likeness, noisier_readings
from studies.ties.training import TIES
from tests.test_notebooks import cells as cells_in
from tests.test_notebooks import text as text_of
from unload.drawing.view import _PLOTLY_MIMETYPE

SIMULATED = {"fig02_containers"}  # the one figure for which boxes are moved
# The cells, by their ids, that draw the other figures from data/, and some whose figures stand in
# the notebook alone; of a report all.
PUBLISHED = {
    "00_playground": "cell-04 cell-07 cell-09",
    "01_task": "code-08 code-04",
    "02_equalization": "fig04 code-16 code-18",
    "03_network": "code-04",
    "06_why_agents_go_wrong": "why-worth why-guess why-knowing 06-why-runs-fal-c8 why-phase "
    "why-runs-fall-14 why-ways why-mask why-helps",
    "10_lifting": "lifting-jams",
    "11_hyperparameters": "cell-17 d7126e58 tuning-explore cell-19 cell-24 cell-28",
    "12_training": "training-method cell-13 cell-19 cell-23 training-ends training-answer",
    "13_how_sure_are_you": "cell-04 sure-intervals",
    "20_a_policy_without_a_miss": "698c4502",
    "21_when_is_learning_worth_it": "cell-06 cell-09 cell-17 cell-23 cell-25 cell-27 "
    "greed-by-pick greed-ratios greed-switch",
    "22_how_it_became_fast": "52be85f7 fast-lifts certain-figure certain-table certain-shares "
    "592fcdbf c563d4e7",
    "report/01_paper_and_here": "",
    "report/02_evidence": "",
    "report/03_plans_and_verdicts": "",
}
WITH_PYBULLET = {"21_when_is_learning_worth_it", "report/01_paper_and_here"}  # some cells need it
# How Jupyter shows a table.
JUPYTER = "display.max_columns", 20, "display.max_colwidth", 50, "display.max_rows", 60
# The names of styled tables, and the addresses of objects.
RANDOM = re.compile(r"T_[0-9a-f]{5}|( object)? at 0x[0-9a-f]+")


def cells_of(notebook: str) -> dict[str, dict]:
    """The code cells of a notebook, by their ids."""
    path = paths.ROOT / "notebooks" / f"{notebook}.ipynb"
    return {cell["id"]: cell for cell in cells_in(path, "code")}


def saved_by(notebook: str) -> set[str]:
    """The names under which a notebook saves figures."""
    code = "\n".join(map(text_of, cells_of(notebook).values()))
    return set(re.findall(r"\bsave\(.*, \"(\w+)\"\)", code))


def run(code: str, namespace: dict) -> tuple[str, dict]:
    """Run a cell; return what it prints, and how Jupyter shows its last value, by media type."""
    tree, printed = ast.parse(code), StringIO()
    ends_in_value = isinstance(tree.body[-1], ast.Expr)
    last = tree.body.pop().value if ends_in_value else ast.Constant(None, lineno=1, col_offset=0)
    with redirect_stdout(printed):
        exec(compile(tree, "cell", "exec"), namespace)
        value = eval(compile(ast.Expression(last), "cell", "eval"), namespace)
    return printed.getvalue(), shown(value)


def shown(value) -> dict:
    """How Jupyter shows a value, by media type."""
    if hasattr(value, "_repr_mimebundle_"):
        return value._repr_mimebundle_()
    kinds = {"html": "_repr_html_", "markdown": "_repr_markdown_"}
    bundle = {f"text/{k}": getattr(value, of)() for k, of in kinds.items() if hasattr(value, of)}
    return bundle | {"text/plain": repr(value)}


def png(figure, **options) -> BytesIO:
    """The picture of a figure."""
    content = BytesIO()
    with plt.style.context(style.STYLE):
        figure.savefig(content, format="png", **options)
    return BytesIO(content.getvalue())


def compare(found, published, name: str) -> None:
    """Two pictures, as PNG files."""
    found, published = plt.imread(found), plt.imread(published)
    assert found.shape == published.shape, name
    # A processor that rounds otherwise may shade a few pixels otherwise, but no light grey area.
    assert (np.abs(found - published) > 0.05).mean() < 1e-5, name


@pytest.mark.parametrize(
    "notebook",
    [
        pytest.param(name, marks=pytest.mark.pybullet) if name in WITH_PYBULLET else name
        for name in PUBLISHED
    ],
)
def test_figures_and_tables_are_those_that_the_data_give(notebook, monkeypatch):
    drawn, cells = set(), cells_of(notebook)

    def compare_saved(figure, name):
        compare(png(figure), paths.FIGURES / f"{name}.png", name)
        drawn.add(name)

    monkeypatch.setattr(style, "save", compare_saved)
    monkeypatch.setattr(plt, "show", lambda: None)
    # The first two import and set parameters; before them one may install in Colab.
    cells.pop("in-colab", None)
    named = [*list(cells)[:2], *PUBLISHED[notebook].split()] if PUBLISHED[notebook] else [*cells]
    namespace: dict = {}
    with pd.option_context(*JUPYTER):
        for name in named:
            printed, found = run(text_of(cells[name]), namespace)
            outputs = {output["output_type"]: output for output in cells[name]["outputs"]}
            assert printed == "".join(outputs.get("stream", {"text": ""})["text"]), name
            if "display_data" in outputs:  # a figure, as Jupyter shows it
                picture = b64decode(outputs["display_data"]["data"]["image/png"])
                compare(png(plt.gcf(), dpi="figure", bbox_inches="tight"), BytesIO(picture), name)
            plt.close("all")
            if "execute_result" in outputs:
                published = outputs["execute_result"]["data"]
                for kind in published.keys() & {"text/plain", "text/html", "text/markdown"}:
                    texts = (RANDOM.sub("", "".join(each[kind])) for each in (found, published))
                    assert len(set(texts)) == 1, name
                assert found.get(_PLOTLY_MIMETYPE) == published.get(_PLOTLY_MIMETYPE), name
                if "image/png" in found:
                    stills = (BytesIO(b64decode(each["image/png"])) for each in (found, published))
                    compare(*stills, name)
    assert drawn == saved_by(notebook) - SIMULATED


def test_the_table_of_heaps_follows_from_their_episodes():
    """Of 15 picks each; the table of episodes rounds their means."""
    episodes = read_table("heap/episodes")
    for name in ("boxes", "falls"):
        episodes[name] = (15 * episodes[name]).round() / 15
    episodes["net"] = episodes["boxes"] - episodes["falls_weight"] * episodes["falls"]
    found, published = compared(episodes), read_table("heap/table")
    pd.testing.assert_frame_equal(found, published, rtol=1e-5, check_dtype=False)


def test_each_published_figure_is_drawn_by_a_notebook():
    notebooks = (paths.ROOT / "notebooks").rglob("*.ipynb")
    names = [path.relative_to(paths.ROOT / "notebooks").with_suffix("") for path in notebooks]
    saved = {name.as_posix(): saved_by(name.as_posix()) for name in names}
    assert {name for name in saved if saved[name] or "report" in name} <= set(PUBLISHED)
    published = {path.stem for path in paths.FIGURES.glob("*.png")}
    assert set().union(*saved.values()) == published >= SIMULATED
    assert {f"fig{number:02d}" for number in range(1, 13)} <= {name[:5] for name in published}


def test_figures_are_saved_as_the_same_bytes(tmp_path, monkeypatch):
    draws = {"one": comparison_msr, "other": partial(diagrams.fig07_network, 4)}
    for name, draw in draws.items():
        for folder in ("a", "b"):
            monkeypatch.setattr(paths, "FIGURES", tmp_path / "figures" / folder)
            style.save(draw(), name)
        for suffix in ("png", "pdf"):
            both = [tmp_path / "figures" / folder / f"{name}.{suffix}" for folder in "ab"]
            assert both[0].read_bytes() == both[1].read_bytes()


def test_the_moving_picture_is_the_one_that_its_notebook_makes(tmp_path, monkeypatch):
    """Drawn are the frames that its palette is taken from, and two others; and what it shows."""
    committed = paths.ROOT / "figures" / "unloading.gif"
    assert committed.stat().st_size <= 2_000_000, "too large for a README"
    with Image.open(committed) as published:
        last, size = published.n_frames - 1, published.size
    wanted, numbers, draw = (0, 1, 15, (last + 1) // 2, last), count(), animation._frame

    def frame(*arguments) -> Image.Image:
        number = next(numbers)
        if number in wanted:
            return draw(*arguments)
        return Image.new("RGB", size, ("black", "white")[number % 2])  # equal ones become one

    monkeypatch.setattr(animation, "_frame", frame)
    monkeypatch.setattr(paths, "FIGURES", tmp_path)
    cells, namespace = cells_of("01_task"), {}
    for name in (*list(cells)[:2], "code-25"):
        run(text_of(cells[name]), namespace)
    with Image.open(tmp_path / "unloading.gif") as found, Image.open(committed) as published:
        assert found.n_frames == published.n_frames
        for number in wanted:
            shown = (number - (last + 1) // 2) % (last + 1)  # the file begins with the middle one
            found.seek(shown)
            published.seek(shown)
            assert found.info == published.info
            both = [np.asarray(frame.convert("RGB"), int) for frame in (found, published)]
            assert (np.abs(both[0] - both[1]) > 25).mean() < 1e-5
    # As the README and the notebook say: one box for ever; errs and empties; never errs.
    stuck, masked, positions = namespace["episodes"].values()
    last = stuck.picks[-animation.STUCK :]
    assert len({pick.item for pick in last}) == 1 and not any(pick.success for pick in last)
    assert masked.unloaded() == len(masked.load) < len(masked.picks)
    assert positions.unloaded() == len(positions.load) == len(positions.picks)


def prose(notebook: str) -> str:
    """The Markdown of a notebook, in one line."""
    path = paths.ROOT / "notebooks" / f"{notebook}.ipynb"
    return " ".join(" ".join(map(text_of, cells_in(path, "markdown"))).split())


@pytest.fixture(scope="module")
def runs() -> pd.DataFrame:
    """All runs of 20 million picks by the criterion, with their ``grid``."""
    return pd.concat(
        by_run(read_grid(grid), lambda curve: likeness(curve) | noisier_readings(curve)).assign(
            grid=grid.name
        )
        for grid in (PAPER, LONG, SEAMLESS, TIES)
    ).reset_index(drop=True)


@pytest.fixture(scope="module")
def asked() -> pd.DataFrame:
    """The MSR of published networks in new containers in %, a column per noise and mask."""
    choice = read_table("ties/choice").query("place")
    return 100 * choice.pivot_table("msr", ["cell", "seed"], ["noise", "mask"])


def spread(values, digits=0) -> str:
    """From the lowest to the highest of shares, in %."""
    return "–".join(f"{100 * value:.{digits}f}" for value in (values.min(), values.max()))


def test_the_training_is_what_notebook_12_says(runs, asked):
    text = prose("12_training")
    own = runs[runs["cell"].isin([*PAPER_CELLS])]
    agents = asked.loc["paper_b2048_no_mask", ("frozen", True)]
    said = f"succeed in {agents.mean():.0f} % of their picks**, the worst in {agents.min():.0f} %"
    assert said in text
    assert f"All {len(own)} runs start at 26–27 %" in text
    assert own["start"].round(3).between(0.255, 0.275).all() and not own["steady"].any()
    masked = own[~own["cell"].str.contains("no_mask")]
    assert f"{masked['fell'].sum()} of {len(masked)} rise to 95–100 % and fall" in text
    near = own[own["ends"]]
    assert (len(near), near["fell"].sum()) == (9, 7)
    assert "Nine of the 36 end at 55–65 %. Seven of the nine had fallen" in text
    kinds = {  # those with b = 256 stand in three grids
        "36 points with b = 2048": (["paper_b2048_mask"], ["paper_b2048_no_mask"]),
        "13 with b = 256": (
            ["paper_mask", "ranks", "frozen_mask"],
            ["paper_no_mask", "ranks_no_mask", "frozen_no_mask"],
        ),
    }
    text = prose("06_why_agents_go_wrong")
    for said, cells in kinds.items():
        with_it, without_it = (asked.loc[names, ("frozen", True)] for names in cells)
        assert len(with_it) == len(without_it) == (8 if "2048" in said else 16)
        harm = stats.ttest_ind(without_it, with_it, equal_var=False).confidence_interval()
        low, high = (f"{end:.0f}" for end in harm)
        assert said.startswith(f"{without_it.mean() - with_it.mean():.0f} ")
        assert re.search(rf"{said} \((?:95 % interval )?{low} to {high}", text)


def test_the_index_is_what_notebook_12_says():
    text, runs = prose("12_training"), by_run(read_grid(ORDER), likeness)
    masked = runs[runs["cell"].isin(["index_mask", "index_b2048_mask"])]
    number = {3: "three", 4: "four", 5: "five", 6: "six", 7: "seven", 8: "eight", 9: "nine"}
    assert f"All {number[len(masked)]} runs rise steadily" in text
    assert masked[["steady", "slower"]].all(axis=None)
    named = f"{number[masked['fig11'].sum()]} of {number[len(masked)]} runs do what the paper says"
    assert named in text
    assert f"steadily and end at {spread(masked['end']).replace('–', ' to ')} %" in text
    assert (masked["start"].round(2) == 0.27).all() and "The curves start at 27 %" in text
    judged = read_table("order/laboratory").groupby("cell")["judged"].mean()
    assert judged["random_rank"] > 0.99 and round(judged["random_index"], 2) == 0.6
    assert "with the index in 60 %" in text
    alone = read_table("order/choice").query(
        "cell == 'random_index' and mask and noise == 'frozen'"
    )
    assert f"20 million random picks gives {100 * alone['msr'].mean():.0f} %, too" in text
    end = read_table("order/laboratory").groupby("cell")["end"].mean()
    assert f"the index ends at {100 * end['index_weight_0.5']:.0f} % in the laboratory" in text
    none = runs.loc[runs["cell"].str.contains("no_mask"), "end"]
    assert (none.round(2) == 0.01).all() and "success sinks to 1 %" in text
    tuned = read_table("order/tuning").query("cell == 'b2048/lr_0.001'")["final_msr"]
    assert f"ends at {100 * tuned.mean():.0f} % with the index" in text
    said = read_table("order/rows").groupby("weight")["random"].mean()
    assert 0.145 < said[0.5] < 0.16 and "random picks succeed in 15 %" in text


def test_the_readings_are_what_notebook_12_says(runs):
    text = prose("12_training")
    flat = runs[runs["cell"].str.startswith("weight_1")]
    assert len(flat) == 9 and flat["best"].min() > 0.87
    assert f"nine runs start at {spread(flat['start'], 1)} %, and all pass 87 % later" in text
    anew = runs["cell"].str.match(
        r"(no_)?mask_|b2048_(no_)?mask_order|shuffled_mask|positions_mask_"
    )
    anew = runs[anew & (runs["grid"] == SEAMLESS.name)]
    assert f"{len(anew)} runs start at {spread(anew['start'], 1)} %" in text
    assert anew["best"].max() < 0.602
    ties = runs[(runs["grid"] == TIES.name) & ~runs["cell"].str.contains("jams")]
    fresh = ties[ties["cell"].str.contains("anew")]
    assert len(fresh) == 7 and not fresh["fell"].any()
    assert 0.91 <= fresh["end"].min() < 0.92 and 0.997 < fresh["end"].max() < 0.9985
    assert "seven runs stay up and end at 91–99.8 %" in text
    drifting = ties[ties["cell"].str.contains("drifting")]
    assert (len(drifting), drifting["fell"].sum()) == (6, 5) and "six runs; five fall" in text
    ordered = read_table("ties/earlier").query("cell.str.startswith('ties_by_order')")
    assert len(ordered) == 10 and ordered["end"].min() > 0.985 and not ordered["fell"].any()
    assert "ten runs stay up and end at 99–100 %" in text


def test_most_runs_that_rise_steadily_look_like_the_papers(runs):
    started = runs[runs["starts"]]
    rising = started[started["steady"]]
    alike = rising[rising[["slower", "ends", "fig11"]].all(axis=1)]
    assert (len(started), len(rising), len(alike)) == (59, 19, 17)
    curves = {grid.name: read_grid(grid) for grid in (SEAMLESS, TIES)}
    for run in alike.itertuples():
        curve = curves[run.grid].query("cell == @run.cell and seed == @run.seed")
        late = curve["picks"] > 0.9 * curve["picks"].iloc[-1]
        assert 0 < windows(curve)["loss"].max() - curve.loc[late, "loss"].mean() < 0.01
    counts = [alike[name].sum() for name in READINGS]
    assert counts == [1, 6, 7] and alike["both"].sum() == alike["windows"].sum()
    frozen = started[started["cell"].isin(["mask_noise", "no_mask_noise"])]
    assert len(frozen) == 10 and not frozen["steady"].any()
    assert "17 of 19 such runs meet every part but *noisier*" in prose("12_training")
    text = prose("report/02_evidence")
    assert "Of the 59 that do, 19 are steady, and 17 of the 19 meet every part" in text
    assert "most runs that rise steadily look like the paper's" in text
    assert "ranks and our frozen noise none" in text


def test_the_first_report_says_what_the_data_say(runs, asked):
    text = prose("report/01_paper_and_here")
    applied = asked.loc["paper_b2048_no_mask"]["frozen"] / 100
    said = f"{applied[True].mean():.0%} of their picks in new containers".replace("%", " %")
    said += f" ({spread(applied[True])}; b = 2048, eight agents), without the mask in "
    said += f"{100 * applied[False].mean():.0f} % ({spread(applied[False])})"
    assert said in text
    own = runs[runs["cell"].isin([*PAPER_CELLS])]
    means = [100 * own.loc[own["cell"] == cell, "end"].mean() for cell in PAPER_CELLS]
    assert "means of {:.0f}, {:.0f}, {:.0f} and {:.0f} %".format(*means) in text
    assert f"{own['fig11'].sum()} of 36 runs | in part" in text
    without = own[own["cell"].str.contains("no_mask")]["fig11"]
    masked = own["fig11"].sum() - without.sum()
    said = f"{without.sum()} of the 18 runs without the mask, and in {masked} of the 18 with it"
    assert said in text


def test_the_evidence_says_what_the_data_say(runs, asked):
    text = prose("report/02_evidence")
    four = asked.loc[[*PAPER_CELLS]].mean()
    said = f"succeed in {four['frozen', False]:.0f} % of their picks with frozen noise and no mask."
    said += f" The mask alone brings them to {four['frozen', True]:.0f} %, noise anew alone to "
    assert said + f"{four['anew', False]:.0f} %, both to {four['anew', True]:.0f} %." in text
    frozen, cells = asked["frozen"], asked["frozen"].groupby("cell").mean()
    anew = frozen.loc[["anew_mask", "anew_no_mask"]].mean()
    said = f"succeed in {anew[False]:.0f} % without the mask and in {anew[True]:.0f} % with it"
    assert said in text
    no_mask, mask = (cells.loc[f"paper_{name}"] for name in ("no_mask", "mask"))
    said = f"({no_mask[False]:.0f} and {no_mask[True]:.0f} %, with the mask in training "
    assert said + f"{mask[False]:.0f} and {mask[True]:.0f} %)" in text
    assert f"reaches {cells.loc['b2048_anew_no_mask', True]:.0f} % with the mask" in text
    short = cells.loc["episodes_25", True]
    assert f"three long networks succeed in {short:.0f} % of the picks of whole" in text
    walls = dict(list(runs[runs["grid"] == SEAMLESS.name].groupby("cell")))
    noise = pd.concat([walls["mask_noise"], walls["no_mask_noise"]])
    said = f"ten runs rise to {spread(noise['best'])} % and end at {spread(noise['end'])} %"
    assert said in text
    high, low = (
        spread(
            pd.concat([walls[f"measured_{each}_{mask}_order"] for mask in ("mask", "no_mask")])[
                "start"
            ]
        )
        for each in ("1.0", "0.64")
    )
    assert f"start at {high} % or {low} %" in text
    lab = 100 * read_table("ties/laboratory").groupby("cell")["end"].mean()
    said = f"with the mask ({lab['renewed']:.0f} and {lab['rho_0.0']:.0f} %), and half as high "
    assert (
        said + f"without it ({lab['renewed_no_mask']:.0f} and {lab['rho_0.0_no_mask']:.0f} %)"
        in text
    )


def test_the_first_plans_verdict_is_in_part(runs):
    text, own = prose("report/03_plans_and_verdicts"), runs[runs["cell"].isin([*PAPER_CELLS])]
    cells = by_cell(own[["cell", "seed", "end"]])
    holds = (cells["low"] <= PAPER_MSR) & (PAPER_MSR <= cells["high"])
    assert holds.sum() == 3 and "**in part in three of four cells**" in text
    widest = 100 * (cells["high"] - cells["low"]).max()
    nearest = 100 * (PAPER_MSR - cells["low"])[holds].min()
    assert f"one interval is {widest:.0f} points wide" in text and 0.05 < nearest < 0.15
    assert f"{own['end'].between(0.5, 0.7).sum()} of the 36 runs end at 50–70 %" in text
    fresh = own[own["cell"].str.contains("no_mask") & (own["seed"] > 3)].groupby("cell")["end"]
    small, large = 100 * fresh.mean()[["paper_no_mask", "paper_b2048_no_mask"]]
    assert (
        f"the means are {small:.0f} % (b = 256, six runs) and {large:.0f} % (b = 2048, four)"
        in text
    )
    long = TIES.configs(), read_grid(TIES).groupby(["cell", "seed"]).ngroups
    assert f"{len(long[0]) - long[1]} of the {len(long[0])} runs of 20 million picks" in text
    assert f"{long[1]} were made" in text
    seen = read_table("ties/laboratory").query("5000 <= seed <= 5009")
    assert f"{len(seen)} runs were seen before any prediction of them" in text


def test_the_laboratories_are_what_the_evidence_says():
    text = prose("report/02_evidence")
    parted = read_table("ties/choice_laboratory")
    of_choice = parted.groupby([parted["cell"].str.split("_").str[1], "cell"])["end"].mean()
    anew, frozen = (spread(of_choice[noise]).replace("–", " to ") for noise in ("anew", "frozen"))
    assert f"runs end at {anew} %, whatever stands in the memory, and with frozen noise at" in text
    assert f"at {frozen} %. The preference" in text
    best = parted.groupby("cell")["frozen_mask"].mean().nlargest(2)
    assert {*best.index} == {f"choice_anew_memory_frozen{mask}" for mask in ("", "_no_mask")}
    assert f"({spread(best).replace('–', ' and ')} %)" in text
    cells = dict(list(read_table("ties/mask_laboratory").groupby("cell")))
    judged = {cell: 100 * rows["frozen_mask"] for cell, rows in cells.items()}
    base, masked = judged["episodes_500_no_mask"], judged["episodes_500"]
    low, high = stats.ttest_ind(masked, base, equal_var=False).confidence_interval()
    assert f"succeed in {masked.mean():.0f} % of their picks, those trained without it in" in text
    said = f"in {base.mean():.0f} % (difference −{base.mean() - masked.mean():.0f} points, 95 %"
    assert f"{said} interval −{-low:.0f} to {high:.0f})" in text
    assert f"the networks do as well ({judged['no_deadlocks_stored_no_mask'].mean():.0f} %)" in text
    tilt = {cell: rows["tilt"].mean() for cell, rows in cells.items()}
    said = f"with the mask ({tilt['episodes_500']:.2f}) than without it "
    assert f"{said}({tilt['episodes_500_no_mask']:.2f})" in text
    filled = judged["filled_at_deadlocks_no_mask"]
    low, high = stats.ttest_ind(filled, base, equal_var=False).confidence_interval()
    said = f"{filled.mean() - base.mean():.0f} points better ({low:.0f} to {high:.0f}), but their "
    assert f"{said}tilt is the same ({tilt['filled_at_deadlocks_no_mask']:.2f})" in text
