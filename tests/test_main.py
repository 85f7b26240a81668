"""``unload train``, and what every command says without any work."""

import inspect
import os
import re
import sys
import tomllib
from dataclasses import fields

import pytest

import unload
from studies import paths
from tests.agent.runs import CONTAINER, at_step, content, few_walls, interrupt
from unload import PEQNetwork, TrainConfig, train
from unload.__main__ import main
from unload.physics.bullet import engine_of
from unload.task import VERSION

OPTIONS = [
    f"--{name.replace('_', '-')}={value}" for name, value in CONTAINER.items() if name != "picks"
]


def test_training_from_the_command_line_is_training(tmp_path, capsys, monkeypatch):
    """With a network and, in the working directory, a stack of one's own."""
    (tmp_path / "own_loads.py").write_text(
        "from tests.agent.runs import few_walls", encoding="utf-8"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [place for place in sys.path if place])
    own = ["--stack=own_loads:few_walls", "--network=unload:PEQNetwork", "--mask"]
    lifts = tmp_path / "lifts.npz"
    main(
        ["train", f"--run-dir={tmp_path / 'a'}", "--picks=200", f"--lifts={lifts}", *own, *OPTIONS]
    )
    shown = capsys.readouterr().out
    assert "200/200" in shown and shown.endswith(f"\n{tmp_path}/a/policy.safetensors\n")
    assert lifts.exists()
    config = TrainConfig(**CONTAINER, mask=True, network=PEQNetwork)
    train(config, tmp_path / "b", progress=False, stack=few_walls)
    (_, curve), (_, other) = map(content, (tmp_path / "a", tmp_path / "b"))
    assert curve.equals(other)


@pytest.mark.parametrize("given", [str, inspect.cleandoc])
def test_every_field_is_an_option_that_is_explained(monkeypatch, capsys, given):
    """Whether or not docstrings are indented: Python 3.13 takes the indent off them."""
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setattr(TrainConfig, "__doc__", given(TrainConfig.__doc__))
    with pytest.raises(SystemExit):
        main(["train", "--help"])
    told = capsys.readouterr().out
    for field in fields(TrainConfig):
        line = told.partition(f"  --{field.name.replace('_', '-')}")[2].partition("  --")[0]
        assert f"({field.default})" in line, field.name
    assert "--mask, --no-mask" in told and "* whether failed items are masked" in told


@pytest.mark.needs("SIGPIPE")
def test_nothing_is_imported_before_it_is_needed(tmp_path, run_python):
    """Not by help, nor by a list that is refused; an order takes pandas, but compiles nothing.

    A script entry point calls ``command``. A pipe that is closed, as by ``head``, ends the program
    without an error.
    """
    entry = tomllib.loads((paths.ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
        "scripts"
    ]
    module, _, name = entry["unload"].partition(":")
    (tmp_path / "bad.csv").write_bytes(b"\x1f\x8b")
    program = f"""if True:
        import signal, sys
        from {module} import {name}

        for arguments in ("--version", "--help", "bad.csv", "--policy highest", "train --help"):
            sys.argv[1:], code = arguments.split(), None
            try:
                {name}()
            except SystemExit as end:
                code = end.code
            slow = {{"gymnasium", "numba", "torch", "pandas", "matplotlib", "plotly", "pybullet"}}
            slow &= {{each for each in sys.modules if sys.modules[each]}}
            print(code, signal.getsignal(signal.SIGPIPE).name, *sorted(slow), file=sys.stderr)
    """
    path = os.pathsep.join([str(paths.ROOT), os.environ.get("PYTHONPATH", "")])
    compiled = str(tmp_path / "compiled")
    printed, said = run_python(program, tmp_path, PYTHONPATH=path, NUMBA_CACHE_DIR=compiled)
    *before, refused, after, summary, ordered, trained = said.splitlines()
    assert before == ["0 SIG_DFL", "0 SIG_DFL"] and after == "1 SIG_DFL"
    assert refused.startswith("bad.csv is not a readable list: ")
    assert summary == "136 picks, 0 failed, 44% behind other boxes"
    assert ordered == "None SIG_DFL pandas" and "torch" in trained
    assert not (tmp_path / "compiled").exists()
    assert printed.startswith(f"unload {VERSION}, lifts by {engine_of()}\n")
    for text in ("x_min", "size_z", "weight", "in m", "--units", "rear wall", "entrance"):
        assert text in printed


def test_what_an_extra_brings_is_named_where_it_is_missing(monkeypatch, capsys):
    for library, name in (("torch", "agent.greedy"), ("matplotlib", "load.picture")):
        monkeypatch.setitem(sys.modules, library, None)  # as if it were not installed
        for module in [each for each in sys.modules if each.startswith(f"unload.{name}")]:
            monkeypatch.delitem(sys.modules, module)
    monkeypatch.delitem(vars(unload), "load_policy", raising=False)
    wanted = r'needs more than an order; expected torch: pip install "unload\[train\]"'
    with pytest.raises(ModuleNotFoundError, match=f"unload.load_policy {wanted}"):
        _ = unload.load_policy
    for option, message in (("--policy=paper", "unload[train]"), ("--picture=x", "unload[view]")):
        with pytest.raises(SystemExit, match="1"):
            main([option])
        assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("option", "status", "message"),
    [
        ("--learning-rate=-1", 1, "learning_rate is -1.0; expected"),
        ("--stack=unload:stack", 2, "no attribute 'stack'; expected module:function"),
    ],
)
def test_a_bad_option_is_named(tmp_path, capsys, option, status, message):
    with pytest.raises(SystemExit) as stopped:
        main(["train", f"--run-dir={tmp_path / 'run'}", option])
    assert stopped.value.code == status
    assert re.search(message, capsys.readouterr().err)


def test_ctrl_c_says_how_to_go_on(tmp_path, capsys):
    with at_step(3, interrupt), pytest.raises(SystemExit) as stopped:
        main(["train", f"--run-dir={tmp_path}", "--picks=200", *OPTIONS])
    assert stopped.value.code == 130
    assert "stopped after 12 picks; call train again" in capsys.readouterr().err
