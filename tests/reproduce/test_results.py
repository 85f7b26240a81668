import pytest

from unload.reproduce.results import read_table


@pytest.mark.parametrize(
    ("content", "exact", "error", "message"),
    [
        (None, False, FileNotFoundError, "t.csv is missing; make tea makes it"),
        ("a\n1\n", False, ValueError, "t.csv has no b; expected a, b"),
        ("a\n1\n", True, ValueError, r"has columns \['a'\]; expected \['a', 'b'\]"),
        ("a,b,c\n1,2,3\n", True, ValueError, r"has columns \['a', 'b', 'c'\]"),
        ("a,b\n", True, ValueError, "has no rows; expected at least one"),
        ("a,b\n1,inf\n", True, ValueError, r"holds inf at index \(0, 1\)"),
        ("a,b\n1,\n", True, ValueError, "holds nan"),
    ],
)
def test_another_table_is_refused(tmp_path, content, exact, error, message):
    path = tmp_path / "t.csv"
    if content is not None:
        path.write_text(content)
    with pytest.raises(error, match=message):
        read_table(path, "make tea", ["a", "b"], exact)


def test_a_table_is_read(tmp_path):
    (tmp_path / "t.csv").write_text("a,b,c\n1,,x\n")
    assert read_table(tmp_path / "t.csv", "make tea", ["b", "a"]).shape == (1, 3)
    (tmp_path / "t.csv").write_text("a,b\n1,x\n")
    assert read_table(tmp_path / "t.csv", "make tea", ["a", "b"], exact=True).shape == (1, 2)
