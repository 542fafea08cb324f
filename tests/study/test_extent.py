"""Study files that are none, or far too large: refused at once, with a message."""

import os

import pytest

import uqpen
from uqpen.core.errors import SettingsError, StudyError
from uqpen.core.limits import Limits
from uqpen.study import document, table_reader

HEAD = 'seed = 1\n[model]\nuse = "ishigami"\n'
REST = '[designs.some]\nkind = "monte-carlo"\nruns = 10\n'
UNREADABLE = "study.toml: cannot be read as a study; nothing was run\n\n"


def reported(text):
    with pytest.raises(StudyError) as refused:
        uqpen.parse_study(text)
    return str(refused.value)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no such files")
@pytest.mark.parametrize("name", ["/dev/zero", "pipe"])
def test_what_is_no_file_is_not_read(tmp_path, name, command_line):
    os.mkfifo(tmp_path / "pipe")
    path = tmp_path / name
    outcome = command_line("check", str(path))
    assert outcome.code == 2
    found = f"  {path}\n    found     a device or a pipe\n    expected  a file\n"
    assert found in outcome.err


def test_a_file_that_is_too_large_is_not_read(tmp_path):
    with (tmp_path / "study.toml").open("wb") as file:
        file.truncate(2**40)  # without a byte on the disk
    with pytest.raises(StudyError, match="found     1099511627776 bytes"):
        uqpen.load_study(tmp_path / "study.toml")


@pytest.mark.parametrize("before", ["", "[x.", "x = { ", '"a".'])
def test_a_key_with_too_many_parts_is_refused(before):
    text = f"{HEAD}{before}{'a.' * 100_000}b{']' if before == '[x.' else ' = 1'}\n{REST}"
    found = "found     keys with too many dots"
    assert reported(text) == f"{UNREADABLE}  study.toml\n    {found}\n    expected  a study"


def test_many_dots_that_are_in_no_key_are_no_hindrance():
    dots = f"# {'.' * 100_000}\n# {'0.5, ' * 100_000}\n"
    inputs = "[inputs]\nx1 = 1\nx2 = 2\nx3 = { uniform = { lower = 1, upper = 2 } }\n"
    assert uqpen.parse_study(f"{dots}{HEAD}{inputs}{REST}").seed == 1


def test_tables_nested_too_deeply_are_refused():
    said = reported(f"{HEAD}[inputs]\nx1 = {'{ a = ' * 60}1{' }' * 60}\n{REST}")
    assert "study.toml:5  inputs.x1\n    found     tables nested 51 deep" in said


def test_thousands_of_mistakes_are_counted(monkeypatch):
    compared = 0
    choices = table_reader.choices

    def counted(*arguments):
        nonlocal compared
        compared += 1
        return choices(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(table_reader, "choices", counted)
    unknown = "".join(f"a{number} = 1\n" for number in range(20_000))
    said = reported(f"{HEAD}[inputs]\n{unknown}{REST}")
    assert said.startswith("study.toml: 20000 mistakes; nothing was run")
    assert said.endswith("and 19950 more")
    # To compare a name with all that are known takes most of the time.
    assert compared == 50


def test_lines_that_would_take_too_long_to_find_are_left_out(monkeypatch):
    monkeypatch.setattr(document, "_MOST_PARSED", 100_000)
    entries = "1,\n" * 5_000
    said = reported(f"{HEAD}[inputs]\nx1 = 1\nx2 = [\n{entries}]\nx3 = 1\n{REST}")
    assert "  study.toml  inputs.x2\n    found     a list" in said


@pytest.mark.parametrize("key", ["seed", "model.time_limit", "inputs.x1", "designs.some.runs"])
def test_an_integer_with_thousands_of_digits_is_refused(key):
    name = key.rpartition(".")[2]
    lines = {"seed": "1", "time_limit": '"2 s"', "x1": "1", "runs": "10"}
    lines[name] = f"0x{'f' * 5000}"
    said = reported(
        f"seed = {lines['seed']}\n[model]\nuse = 'ishigami'\ntime_limit = {lines['time_limit']}\n"
        f"[inputs]\nx1 = {lines['x1']}\n[designs.some]\nruns = {lines['runs']}\n"
    )
    found = "found     a whole number of over 4000 digits"
    line = {"seed": 1, "time_limit": 4, "x1": 6, "runs": 8}[name]
    expected = "expected  a whole number of at most 4000 digits"
    assert f"  study.toml:{line}  {key}\n    {found}\n    {expected}" in said


def test_a_time_that_no_system_can_wait_for_is_refused(tmp_path):
    (tmp_path / "m.py").write_text("def f(x): return {'y': x}\n")
    text = (
        "seed = 1\n[model]\npython = 'm.py:f'\ntime_limit = '{}'\n"
        "inputs = {{ x = '1' }}\noutputs = {{ y = '1' }}\n[inputs]\nx = '1 ± 1'\n" + REST
    )
    with pytest.raises(StudyError) as refused:
        uqpen.parse_study(text.format("1e10 s"), folder=tmp_path)
    expected = "a time of at most 24 days; without a limit, a run takes the time that it needs"
    assert str(refused.value).endswith(
        f'study.toml:4  model.time_limit\n    found     "1e10 s"\n    expected  {expected}'
    )
    # The longest one can be waited for.
    uqpen.run(uqpen.parse_study(text.format("24 days"), folder=tmp_path))


def test_a_size_of_hundreds_of_digits_is_refused():
    with pytest.raises(SettingsError, match="memory_limit"):
        Limits(bytes=10**400)
    said = reported(
        f"seed = 1\n[model]\npython = 'm.py:f'\nmemory_limit = '{'9' * 400} GB'\n"
        "inputs = { x = '1' }\noutputs = { y = '1' }\n[inputs]\nx = '1 ± 1'\n" + REST
    )
    assert 'a size such as "2 GB" or "512 MiB", at least 1 MB' in said
