"""The benchmarks: what they measure is what they say, and their figures are drawn from it."""

import subprocess
import sys

import gymnasium
import matplotlib
import numpy as np
import pandas as pd
import pytest
import stable_baselines3
import torch
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import unload
from benchmarks import engines, soak
from benchmarks.environments import container_costs, pick_rates
from benchmarks.floors import bytes_per_second, operations_per_second
from benchmarks.lifts import fill_rates, lift_rates
from benchmarks.profile_step import step_profile
from benchmarks.run import show
from benchmarks.stable_baselines import PEQPolicy, VectorEnvAdapter
from benchmarks.timing import best_times
from benchmarks.updates import update_times
from unload import task
from unload.physics.local import LocalPhysics
from unload.physics.situation import Situation
from unload.reproduce.figures import speed
from unload.reproduce.style import save
from unload.support import files
from unload.support.provenance import read_provenance

matplotlib.use("Agg")
FIGURES = (speed.speed_ratios, speed.speed_containers, speed.speed_profile)


@pytest.fixture
def make_adapter():
    """``make_adapter(num_envs, max_picks)``: array environments for Stable-Baselines3."""
    made = []

    def make(num_envs, max_picks=3):
        envs = gymnasium.make_vec("unload/Container-v0", num_envs, max_picks=max_picks)
        made.append(VectorEnvAdapter(envs))
        return made[-1]

    yield make
    for envs in made:
        envs.close()


def test_best_times_takes_the_least_and_leaves_the_first_call_out(monkeypatch):
    clock = iter([0.0, 3.0, 10.0, 12.0, 20.0, 25.0])
    monkeypatch.setattr("time.perf_counter", lambda: next(clock))
    calls = []
    assert best_times({"call": lambda: calls.append(1)}, 3) == {"call": 2.0}
    assert len(calls) == 4


def test_adapter_gives_stable_baselines_what_gymnasium_shows(make_adapter):
    adapter = make_adapter(2)

    def single():
        return gymnasium.make("unload/Container-v0", physics="table", max_picks=3)

    loop = SyncVectorEnv([single] * 2, autoreset_mode=AutoresetMode.SAME_STEP)
    adapter.seed(7)
    observations, _ = loop.reset(seed=7)
    assert np.array_equal(adapter.reset(), observations)
    for step in range(7):
        actions = np.array([step, 2 * step])
        observations, rewards, _, truncations, infos = loop.step(actions)
        seen, earned, dones, each = adapter.step(actions)
        assert np.array_equal(seen, observations)
        assert np.array_equal(earned, rewards)
        assert earned.dtype == np.float32
        assert np.array_equal(dones, truncations)
        for env in range(2):
            if dones[env]:
                assert np.array_equal(each[env]["terminal_observation"], infos["final_obs"][env])
                assert each[env]["TimeLimit.truncated"]
            else:
                assert each[env] == {}
    loop.close()


def test_adapter_refuses_another_way_of_resetting():
    envs = gymnasium.make_vec("CartPole-v1", 2, vectorization_mode="sync")
    with pytest.raises(ValueError, match="envs resets with .*expected AutoresetMode.SAME_STEP"):
        VectorEnvAdapter(envs)
    envs.close()


def test_stable_baselines_trains_the_papers_network(make_adapter):
    model = stable_baselines3.DQN(
        PEQPolicy, make_adapter(4), buffer_size=64, learning_starts=8, batch_size=8, train_freq=1,
        policy_kwargs={"net_arch": [6]}, seed=0, device="cpu",
    )  # fmt: skip
    network = model.q_net.q_net
    assert type(network) is unload.PEQNetwork
    assert network.n_features == 6
    assert len(list(model.q_net.parameters())) == 4  # nothing beside the network
    before = [parameter.detach().clone() for parameter in network.parameters()]
    model.learn(32)
    assert not any(torch.equal(old, new) for old, new in zip(before, network.parameters()))
    observations = model.env.reset()
    values = network(torch.from_numpy(observations))
    chosen, _ = model.predict(observations, deterministic=True)
    assert np.array_equal(chosen, values.argmax(dim=1))


def test_rates_are_positive(small_load):
    rates = lift_rates(small_load, full=1, others=2, rounds=1)
    assert list(rates) == ["full", "local", "table"]
    rates |= fill_rates(small_load, rounds=1) | pick_rates(num_envs=2, picks=3, rounds=1)
    rates |= update_times(batch_size=8, n_features=4, rounds=1)
    assert len(rates) == 14
    assert all(np.isfinite(rate) and rate > 0 for rate in rates.values())
    assert operations_per_second(rounds=1) > 1e8
    assert bytes_per_second(rounds=1) > 1e8


def test_container_costs_add_up():
    table = container_costs(counts=(1, 3), picks=4, rounds=1)
    assert list(table.columns) == speed.COLUMNS["containers"]
    assert table["containers"].tolist() == [1, 3]
    assert np.allclose(table["picks_per_s"] * (table["step_ns"] + table["reset_ns"]), 1e9)
    assert table["memory_mb"].is_monotonic_increasing


def test_profile_is_of_the_whole_step():
    table = step_profile(picks=8_000)
    assert list(table.columns) == speed.COLUMNS["profile"]
    assert (table["us"] > 0).all()
    assert (table["floor_us"] >= 0).all()


@pytest.mark.parametrize("draw", FIGURES)
def test_figures_are_saved_as_the_same_bytes_and_committed(draw, tmp_path):
    for folder in ("a", "b"):
        save(draw(), draw.__name__, tmp_path / folder)
    for suffix in ("png", "pdf"):
        name = f"{draw.__name__}.{suffix}"
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
        assert (files.FIGURES / name).exists()


def test_kept_results_name_the_machine():
    provenance = read_provenance(speed.FOLDER, "benchmarks")
    assert provenance["command"] == "python benchmarks/run.py"
    assert {"date", "stable-baselines3"} <= set(provenance["settings"])
    assert {"revision", "versions", "machine", "wall_time_s"} <= set(provenance)


@pytest.mark.parametrize(
    ("content", "error", "message"),
    [
        (None, FileNotFoundError, "is missing; python benchmarks/run.py makes it"),
        ("a,b\n1,2\n", ValueError, r"has columns \['a', 'b'\]; expected \['what', "),
        ("what,how,value,unit,ratio\n", ValueError, "has no rows; expected at least one"),
        ("what,how,value,unit,ratio\na,b,1,c,\n", ValueError, "holds nan"),
    ],
)
def test_bad_tables_are_refused(tmp_path, content, error, message):
    if content is not None:
        (tmp_path / "speeds.csv").write_text(content)
    with pytest.raises(error, match=message):
        speed.speed_ratios(tmp_path)


def test_unknown_table_is_refused():
    with pytest.raises(ValueError, match="name is 'lifts'; expected one of 'speeds', "):
        speed.read_table("lifts")


def test_tables_are_printed_with_their_units(capsys):
    row = {"what": "lifts", "how": "table", "value": 12345.6, "unit": "lifts/s", "ratio": 0.98765}
    show({"speeds": pd.DataFrame([row])})
    printed = capsys.readouterr().out
    assert "12,300 lifts/s 0.988 ×" in printed


@pytest.mark.slow
def test_the_command_measures_everything_and_keeps_nothing_when_quick():
    path = speed.FOLDER / "speeds.csv"
    before = path.read_bytes()
    command = [sys.executable, str(files.ROOT / "benchmarks" / "run.py"), "--quick"]
    printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    for part in ("lifts", "random picks", "update", "training", "containers", "profile"):
        assert part in printed
    assert path.read_bytes() == before


def test_the_soak_prints_memory_and_files(capsys):
    soak.main(picks=640, environments=2, resets=2)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 5
    assert all(" MiB" in line and " files" in line for line in lines[:-1])


@pytest.fixture(scope="module")
def hard_situations():
    return engines.hard_situations(60)


def test_situations_for_the_engines_are_distinct_and_have_one_box_on_top(hard_situations):
    rows, situations = zip(*hard_situations)
    assert len({situation.key for situation in situations}) == 60
    assert {situation.on_top for situation in situations} == {1}
    assert {row["partly"] for row in rows} == {True, False}
    pairs = {row["pair"]: situation.boxes[:2] for row, situation in hard_situations}
    assert all(
        (situation.boxes[:2] == pairs[row["pair"]]).all() for row, situation in hard_situations
    )
    again = engines.hard_situations(20)
    assert [row for row, _ in again] == list(rows[:20])
    with pytest.raises(ValueError, match="wanted is 0"):
        engines.hard_situations(0)


def test_committed_comparison_of_the_engines(hard_situations):
    """It starts with the situations collected here, and PyBullet moves them as it did then."""
    table = engines.read_engines()
    assert len(table) == engines.SITUATIONS
    assert table["situation"].nunique() == len(table)
    first = pd.DataFrame([row for row, _ in hard_situations])
    assert (table[list(first)][: len(first)] == first).all(axis=None)
    local = LocalPhysics()
    distances = [local.simulate(situation) for _, situation in hard_situations]
    local.close()
    assert np.allclose(table["pybullet"][: len(first)], distances, atol=1e-6)
    provenance = read_provenance(speed.FOLDER, "engines")
    assert provenance["command"] == engines.COMMAND
    assert provenance["settings"]["situations"] == len(table)
    assert provenance["settings"]["mujoco"]["mujoco"]


def test_situations_that_the_engines_decide_differently_are_close_to_the_threshold():
    table = engines.read_engines()
    lifted = table[["pybullet", "mujoco"]] >= task.LIFT_THRESHOLD
    differing = table[lifted["pybullet"] != lifted["mujoco"]]
    distances = differing[["pybullet", "mujoco"]].to_numpy()
    assert np.abs(distances - task.LIFT_THRESHOLD).max(initial=0) < 0.01
    assert len(differing) < 0.01 * len(table)
    assert lifted["pybullet"].sum() > 50


def test_disagreements_of_the_engines_are_printed_with_both_distances(capsys):
    row = {"seed": 1, "picks": 0, "item": 5, "situation": "a", "pair": 0, "partly": True}
    distances = [(0.19, 0.21), (0.3, 0.31), (0.01, 0.012), (0.0, 0.0)]
    engines.show(
        pd.DataFrame(
            [row | {"situation": str(i), "pybullet": p, "mujoco": m}
             for i, (p, m) in enumerate(distances)]
        )
    )  # fmt: skip
    printed = capsys.readouterr().out
    assert "agree in 3; they differ in 1, 25.00% (95 %: 0.63% to 80.59%)" in printed
    assert "0.1900  0.2100" in printed and "0.3000" not in printed


def test_without_mujoco_the_command_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "benchmarks.mujoco_lift", None)
    monkeypatch.setattr(sys, "argv", ["engines.py", "--quick"])
    with pytest.raises(SystemExit, match="pip install mujoco"):
        engines.main()


def test_mujoco_lifts_as_the_formula_says():
    pytest.importorskip("mujoco")
    from benchmarks.mujoco_lift import TIME_STEP, mujoco_lift

    edge = 500_000  # micrometres
    box, above = (0, 0, 0, edge, edge, edge), (0, 0, edge, edge, edge, edge)
    for boxes, acceleration in (([box], 20 - 9.81), ([box, above], 20 / 2 - 9.81)):
        situation = Situation(np.array(boxes, np.int32), len(boxes), -edge // 2, ())
        expected = acceleration * 0.3 * (0.3 + TIME_STEP) / 2
        assert mujoco_lift(situation) == pytest.approx(expected, rel=0.02, abs=5e-4)
    fixed = Situation(np.array([box, above], np.int32), 1, -edge // 2, ())
    assert mujoco_lift(fixed) < 1e-3  # a fixed box above holds it


def test_committed_distances_of_mujoco_are_computed_again(hard_situations):
    pytest.importorskip("mujoco")
    from benchmarks.mujoco_lift import SETTINGS, mujoco_lift

    if read_provenance(speed.FOLDER, "engines")["settings"]["mujoco"] != SETTINGS:
        pytest.skip("another version of MuJoCo")
    distances = [mujoco_lift(situation) for _, situation in hard_situations[:10]]
    assert np.allclose(engines.read_engines()["mujoco"][:10], distances, atol=1e-4)
