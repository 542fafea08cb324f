"""Tables over seeds go on behind what their file has, and stand between their marks."""

import sys

import pytest

seed_table = pytest.importorskip("seed_table", reason="the folder of benchmarks is not here")


@pytest.fixture
def made(tmp_path, monkeypatch):
    """Make a table of two cases with some options; return the blocks of seeds that were made."""

    def make(*options):
        blocks = []

        def rows(name, seeds, factor):
            blocks.append((name, *seeds))
            yield {"sum": factor * sum(seeds)}

        columns = {"case": "name", "seeds": "count", "sum": lambda cell: cell.sum}
        table = seed_table.SeedTable(
            {"name": ("one", "two")},
            rows,
            {"sums": seed_table.summed(columns, "name")},
            lambda found: ["too large"] if any(row["sum"] > 10 for row in found) else [],
            at_once=2,
            options={"--factor": {"type": int, "default": 1}},
        )
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", ["sums.py", *options])
        table.main("A table.")
        return blocks

    return make


def test_what_is_in_the_file_is_not_made_again(made, tmp_path):
    assert made("--seeds", "3", "--only", "^one") == [("one", 0, 1), ("one", 2)]
    page = tmp_path / "page.md"
    page.write_text("before\n<!-- sums: begin -->\nold\n<!-- sums: end -->\nafter\n")
    made_now = made("--seeds", "4", "--markdown", str(page))
    assert made_now == [("two", 0, 1), ("one", 3), ("two", 2, 3)]
    table = "| case | seeds | sum |\n|---|---|---|\n| one | 4 | 6 |\n| two | 4 | 6 |"
    assert f"begin -->\n{table}\n<!-- sums: end -->\nafter" in page.read_text()


def test_files_of_other_seeds_add_up(made, capsys):
    made("--seeds", "2", "--output", "a.csv")
    made("--first", "2", "--seeds", "2", "--output", "b.csv", "--workers", "2")
    capsys.readouterr()
    assert made("--from", "a.csv", "b.csv") == []
    assert "| two | 4 | 6 |" in capsys.readouterr().out


def test_a_cell_that_fails_is_named_and_the_exit_code_is_1(made, capsys):
    with pytest.raises(SystemExit) as left:
        made("--seeds", "4", "--factor", "3")
    assert left.value.code == 1
    assert "FAILS too large" in capsys.readouterr().out


def test_a_script_of_several_tables_makes_the_one_that_is_named(monkeypatch, tmp_path, capsys):
    tables = {
        name: seed_table.SeedTable(
            {"name": (name,)},
            lambda _, seeds: [{"sum": sum(seeds)}],
            {"sums": seed_table.summed({name: "sum"}, "name")},
        )
        for name in ("one", "two")
    }
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["sums.py", "two", "--seeds", "3"])
    seed_table.main(tables, "Tables.")
    assert "| two |\n|---|\n| 3 |" in capsys.readouterr().out
    assert [file.name for file in tmp_path.iterdir()] == ["sums_two.csv"]
    monkeypatch.setattr(sys, "argv", ["sums.py", "--seeds", "3"])
    with pytest.raises(SystemExit, match="which table\\? the first argument is one of one, two"):
        seed_table.main(tables, "Tables.")


def test_a_table_of_two_keys_has_a_text_for_cells_that_are_not_there():
    rows = [{"row": row, "column": column, "n": 2} for row, column in ("ax", "bx", "by", "by")]
    cells = seed_table.totals(rows, "row", "column").values()
    found = seed_table.cross_table(
        cells,
        "",
        lambda cell: cell.row,
        lambda cell: cell.column,
        lambda some: sum(cell.n for cell in some),
        columns=("z",),
    )
    assert [*found] == [
        "| | z | x | y |",
        "|---|---|---|---|",
        "| a | 0 | 2 | 0 |",
        "| b | 0 | 2 | 4 |",
    ]


def test_a_page_without_the_marks_is_left_alone(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("nothing\n")
    with pytest.raises(SystemExit, match="no mark"):
        seed_table.fill(page, "sums", "| a |")
    assert page.read_text() == "nothing\n"


def test_tables_of_coverage_are_data_beside_their_page(tmp_path):
    page = tmp_path / "coverage" / "page.md"
    page.parent.mkdir()
    page.write_text("<!-- two sums: begin -->\n<!-- two sums: end -->\n")
    table = "| case | sum |\n|---|---|\n| one, two | 6 |"
    seed_table.fill(page, "two sums", f"{table}\n\n{table}\n\nSeeds: 4.")
    for number in (1, 2):
        file = page.parent / f"two_sums_{number}.csv"
        assert file.read_text() == 'case,sum\n"one, two",6\n'
        assert f":file: {file.name}\n" in page.read_text()
    assert "|" not in page.read_text()
    assert "\nSeeds: 4.\n<!-- two sums: end -->" in page.read_text()


def test_the_methods_of_the_wall_are_shown_without_the_most_runs():
    bunker = pytest.importorskip("bunker")
    answer = bunker.Answer("P(> 60 cm)", 100, 0.1, 0.05, 0.2)._asdict()
    rows = [{"method": "few", "first": seed, **answer} for seed in (0, 1)]
    *_, runs, blank, last = bunker.page(rows)
    assert (runs, blank) == ("| runs | 100 |", "")
    assert last.startswith("No table of agreement: no file has the rows of Monte Carlo, 10 million")
    most = {**rows[0], "method": bunker.MOST_RUNS}
    assert "| P(> 60 cm) | 2 of 2 |" in [*bunker.page([*rows, most])]
