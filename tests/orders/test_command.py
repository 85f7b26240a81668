"""The command ``unload``."""

import io
import logging
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pandas as pd
import pytest

from unload.orders import command
from unload.task import VERSION

ROOT = Path(__file__).resolve().parents[2]
STACK = "id,x_min,y_min,z_min,size_x,size_y,size_z\na,6,0.1,0,0.5,0.4,0.3\n"


def refused(capsys, *arguments: str) -> str:
    """The sentence with which the command ends, with status 1."""
    with pytest.raises(SystemExit, match="1"):
        command.main([*map(str, arguments)])
    return capsys.readouterr().err


def test_it_reads_what_read_load_reads(tmp_path, capsys, monkeypatch):
    """Each option; what is said of boxes that were moved stands on stderr.

    No cell becomes a formula in a spreadsheet.
    """
    (tmp_path / "boxes.csv").write_text(
        "nr;x;y;z;length;width;height;weight;stop;=note\n"
        "=a;50;50;50;100;100;100;5;2.1234567;=1\n"
        "b;50;50;159;100;100;100;7;1;x\n",
        encoding="utf-8",
    )
    options = "--units cm --container 12 2 2.4 --x-from door --tolerance 0.1"
    with monkeypatch.context() as usual:
        usual.setattr(logging.root, "handlers", [])  # pytest's; a program has none
        command.main([f"{tmp_path}/boxes.csv", "--column", "nr=id", *options.split()])
    printed, said = capsys.readouterr()
    order = pd.read_csv(io.StringIO(printed))
    assert order["id"].tolist() == ["b", "'=a"] and order["weight"].tolist() == [7, 5]
    assert order["stop"].tolist() == [1, 2.1234567] and order["'=note"].tolist() == ["x", "'=1"]
    assert said.splitlines() == [
        "1 of 2 boxes moved by up to 90.0 mm",
        "An order may overlook overlaps of up to 380 mm",
        "2 picks, 0 under and 0 behind others",
    ]


def test_what_is_refused_names_the_option_that_may_help(capsys, tmp_path):
    """And not the argument of ``read_load``."""
    (tmp_path / "boxes.csv").write_text(STACK, encoding="utf-8")
    file = tmp_path / "boxes.csv"
    said = refused(capsys, file, "--container", "3", "2", "2")
    assert said.endswith("expected it inside the container, [0 0 0] to [3. 2. 2.] m; "
                         "see the option --container\n")  # fmt: skip
    file.write_text(STACK.replace("size_x", "Länge"), encoding="utf-8")
    assert refused(capsys, file).endswith("size_x; see the option --column NAME=MEANING\n")
    file.write_text(STACK.replace("0.3\n", "wide\n"), encoding="utf-8")
    assert (
        refused(capsys, file)
        == "row 1 (id 'a'): size_z is 'wide'; expected a number, at most 1,000,000\n"
    )
    file.write_text(STACK.replace("size_z", "stop"), encoding="utf-8")
    assert "stop" in refused(capsys, file, "--by", "town")


def test_it_orders_by_stops_and_draws(tmp_path, capsys):
    list_ = tmp_path / "boxes.csv"
    list_.write_text(
        "id,x_min,y_min,z_min,size_x,size_y,size_z,stop,town,weight\n"
        "a,0,0,0,1,1,1,1,,30\nb,1,0,0,1,1,1,2,B,2\nc,0,1,0,1,1,1,2,C,3\n",
        encoding="utf-8",
    )
    out, picture = tmp_path / "order.csv", tmp_path / "order.png"
    command.main([str(list_), "--by", "stop", "--output", str(out), "--picture", str(picture)])
    order = pd.read_csv(out)
    assert order["id"].tolist() == ["b", "a", "c"] and order["weight"].tolist() == [2, 30, 3]
    assert picture.read_bytes().startswith(b"\x89PNG")
    said = f"0 under and 0 behind others, 1 before their stop; the picture is {picture}\n"
    assert capsys.readouterr() == ("", f"3 picks, {said}") and order["early"].tolist() == [1, 0, 0]
    assert refused(capsys, list_, "--by", "town").startswith("3 boxes have no number in 'town'")


@pytest.mark.needs("symlinks")
def test_nothing_is_written_before_all_can_be(tmp_path, capsys, monkeypatch):
    """And no file over another one that is named."""
    boxes, order, picture = (tmp_path / name for name in ("boxes.csv", "order.csv", "order.png"))
    boxes.write_text(STACK, encoding="utf-8")
    (tmp_path / "link").symlink_to(boxes)
    held = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    for output, drawn in (
        (boxes, picture),
        (order, boxes),
        (order, order),
        (tmp_path / "link", picture),
    ):
        said = refused(capsys, boxes, "--output", output, "--picture", drawn)
        assert said.endswith("one file; expected different ones\n")
    folder = "; expected the name of a file\n"
    assert refused(capsys, boxes, "--output", tmp_path, "--picture", picture).endswith(folder)
    assert refused(capsys, boxes, "--output", order, "--picture", tmp_path).endswith(folder)
    below, folder = (
        tmp_path / "missing" / "order",
        "expected it in a folder that is there and may be",
    )
    assert folder in refused(capsys, boxes, "--output", below, "--picture", picture)
    assert folder in refused(capsys, boxes, "--output", order, "--picture", below)
    monkeypatch.setitem(sys.modules, "matplotlib", None)  # as if it were not installed
    for module in [name for name in sys.modules if name.startswith("unload.drawing.picture")]:
        monkeypatch.delitem(sys.modules, module)
    said = refused(capsys, boxes, "--output", order, "--picture", picture)
    assert "--picture needs matplotlib, which is not installed; expected it: in the che" in said
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == held


def test_the_line_of_names_may_stand_below_a_title(tmp_path, capsys):
    (tmp_path / "boxes.csv").write_text(f"Truck 7\n\n{STACK}", encoding="utf-8")
    said = refused(capsys, tmp_path / "boxes.csv")
    assert said.endswith("as line 3 may hold them; see the option --header\n")
    command.main([str(tmp_path / "boxes.csv"), "--header", "3"])
    assert capsys.readouterr().out.splitlines()[1] == "1,a,0,False,False"
    assert "header is 0; expected an integer >= 1" in refused(capsys, "--header", "0")


def test_names_of_any_language_are_written_to_any_console_and_drawn_without_a_display(tmp_path):
    """As UTF-8, where the console's encoding knows them or not; once a header was all."""
    (tmp_path / "boxes.csv").write_text(STACK.replace("a,", "Łódź 箱,"), encoding="utf-8")
    environment = os.environ | {"PYTHONIOENCODING": "cp1252", "PYTHONPATH": str(ROOT)}
    environment = environment | {"DISPLAY": "", "MPLBACKEND": "TkAgg"}
    program = [sys.executable, "-m", "unload", "boxes.csv", "--picture", "order.png"]
    done = subprocess.run(program, cwd=tmp_path, env=environment, capture_output=True, check=True)
    assert done.stdout.decode("utf-8").splitlines()[1] == "1,Łódź 箱,0,False,False"
    assert (tmp_path / "order.png").stat().st_size > 1_000


@pytest.mark.skipif(os.name != "posix", reason="a shell closes what a program has open")
@pytest.mark.parametrize(
    ("closed", "code", "printed", "said"),
    [
        (">&-", 1, "", "the standard output is closed; expected it open, or --output\n"),
        ("2>&-", 0, "pick,id,item,covered,behind\n1,a,0,False,False\n", ""),
    ],
)
def test_what_is_closed_is_not_written_to(tmp_path, closed, code, printed, said):
    """The summary once stood in the order instead."""
    (tmp_path / "boxes.csv").write_text(STACK, encoding="utf-8")
    program = f"{sys.executable} -m unload boxes.csv --picture drawn.png {closed}"
    options = {"cwd": tmp_path, "env": os.environ | {"PYTHONPATH": str(ROOT)}}
    done = subprocess.run(program, shell=True, capture_output=True, text=True, **options)
    assert (done.returncode, done.stdout, done.stderr) == (code, printed, said)
    assert (tmp_path / "drawn.png").exists() == (code == 0)


@pytest.mark.parametrize("module", ["unload.orders.command", "pandas"])
def test_ctrl_c_ends_it_without_a_word(tmp_path, run_python, module):
    """Also while it imports, which takes most of its time."""
    program = f"""if True:
        import sys
        from unload.__main__ import command

        class Interrupted:
            def find_spec(self, name, *others):
                if name == {module!r}:
                    raise KeyboardInterrupt

        sys.meta_path.insert(0, Interrupted())
        sys.argv[1:] = []
        try:
            command()
        except SystemExit as end:
            print(end.code)
    """
    assert run_python(program, tmp_path, PYTHONPATH=str(ROOT)) == ("130\n", "")


@pytest.mark.needs("SIGPIPE")
def test_nothing_is_imported_before_it_is_needed(tmp_path, run_python):
    """An order takes pandas, but compiles nothing; help takes neither.

    A script entry point calls ``command``. A pipe that is closed, as by ``head``, ends the program
    without an error.
    """
    entry = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
        "scripts"
    ]
    module, _, name = entry["unload"].partition(":")
    (tmp_path / "bad.csv").write_bytes(b"\xff")
    program = f"""if True:
        import signal, sys
        from {module} import {name}

        for arguments in ("--version", "--help", "bad.csv", ""):
            sys.argv[1:], code = arguments.split(), None
            try:
                {name}()
            except SystemExit as end:
                code = end.code
            slow = {{"numba", "torch", "pandas", "matplotlib", "plotly", "pybullet"}}
            slow &= {{each for each in sys.modules if sys.modules[each]}}
            print(code, signal.getsignal(signal.SIGPIPE).name, *sorted(slow), file=sys.stderr)
    """
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    compiled = str(tmp_path / "compiled")
    printed, said = run_python(program, tmp_path, PYTHONPATH=path, NUMBA_CACHE_DIR=compiled)
    *before, refused, after, summary, ordered = said.splitlines()
    assert before == ["0 SIG_DFL", "0 SIG_DFL"] and after == "1 SIG_DFL pandas"
    assert refused.startswith("bad.csv is not a readable list: ")
    assert summary == "136 picks, 0 under and 0 behind others"
    assert ordered == "None SIG_DFL pandas"
    assert not (tmp_path / "compiled").exists()
    assert printed.startswith(f"unload {VERSION}\n")
    for text in ("x_min", "size_z", "in m", "--units", "rear wall", "entrance"):
        assert text in printed
