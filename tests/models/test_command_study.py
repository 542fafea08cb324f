"""Studies of programs from end to end: the documented example, archives, workers, Ctrl-C."""

import os
import re
import shutil
from pathlib import Path

import pytest

import uqpen
from uqpen.core.errors import ModelError
from uqpen.execution.processes import processes
from uqpen.results.output_tables import output_tables
from uqpen.study.load import parse_study

pytestmark = pytest.mark.slow

DOCUMENT = Path(__file__).parents[2] / "docs" / "models.md"


@pytest.fixture
def beam(tmp_path):
    """The study of the documentation, with its files."""
    text = DOCUMENT.read_text(encoding="utf-8").partition("## A program: `command`")[2]
    blocks = re.findall(r"```(sh|text|toml)\n(.*?)```", text, flags=re.DOTALL)
    names = {"sh": "solver", "text": "beam.dat.template", "toml": "beam.toml"}
    (tmp_path / "study").mkdir()
    for language, content in reversed(blocks):  # of several, the first
        (tmp_path / "study" / names[language]).write_text(content, encoding="utf-8")
    (tmp_path / "study" / "solver").chmod(0o755)
    return tmp_path / "study" / "beam.toml"


def test_the_documented_example_runs_and_is_right(beam):
    table = next(output_tables(uqpen.run(uqpen.load_study(beam))))
    assert table.title == "deflection [mm]"
    mean = float(dict(table.rows)["mean"][0].split()[0])
    # 10 kN · (3 m)³ / 80.64 = 3.35 mm; the spread of the inputs adds 0.003 %.
    assert mean == pytest.approx(3.35, rel=0.01)
    assert not (beam.parent / "beam_runs").exists()


def test_two_workers_give_the_same_bytes_as_none(beam):
    solver = beam.parent / "solver"
    script = solver.read_text().replace(
        "#!/bin/sh", '#!/bin/sh\ngrep -q "LENGTH *2" "$1" && echo "too short: $1" >&2 && exit 2'
    )
    solver.write_text(script)
    text = beam.read_text().replace("runs = 50", "runs = 10")
    study = parse_study(text, name="beam", folder=beam.parent)
    alone = uqpen.run(study)
    with processes(2) as pool:
        together = uqpen.run(study, map=pool)
    assert alone.identical(together)
    lost = alone["runs/sample/lost_reason"].values
    assert 0 < len(lost) < 10
    assert set(lost) == {"exit code 2: too short: beam.dat"}
    assert len(list((beam.parent / "beam_runs").iterdir())) == len(lost)


def test_an_archive_brings_its_program_along_but_only_runs_it_if_trusted(beam, command_line):
    command_line("study", str(beam), "-o", "beam.nc")
    shutil.rmtree(beam.parent)
    checked = command_line("verify", "beam.nc")
    assert "execute code that the archive names (./solver beam.dat)" in checked.said
    assert "computed again: bit-equal" in checked.said
    assert command_line("rerun", "beam.nc").code == 2
    trusted = command_line("verify", "beam.nc", "--trust")
    assert trusted.code == 0
    assert "50 of 50 repeated: bit-equal" in trusted.said


def test_what_is_kept_of_failed_runs_lies_beside_the_archive_of_a_rerun(beam, command_line):
    (beam.parent / "solver").write_text("#!/bin/sh\necho no licence >&2\nexit 1\n")
    with beam.open("a") as text:
        text.write("[failures]\nstop_after = 0\n")
    command_line("study", str(beam), "-o", "beam.nc")
    shutil.rmtree(beam.parent)
    command_line("rerun", "beam.nc", "--trust", "-o", "again/other.nc")
    folders = list(Path("again/other_runs").iterdir())
    assert len(folders) == 50
    assert (folders[0] / "stderr").read_text() == "no licence\n"


def test_another_program_of_the_same_name_is_reported(beam, command_line, monkeypatch):
    program = Path("beam-solver").absolute()
    shutil.copy(beam.parent / "solver", program)
    monkeypatch.setenv("PATH", str(program.parent), prepend=os.pathsep)
    beam.write_text(beam.read_text().replace("./solver", "beam-solver"))
    command_line("study", str(beam), "-o", "beam.nc")
    assert "another than then" not in command_line("verify", "beam.nc", "--trust").said
    with program.open("a") as script:
        script.write("# a newer version\n")
    checked = command_line("verify", "beam.nc", "--trust")
    assert re.search(r"another than then: beam-solver beam.dat \w{8} \(here \w{8}\)", checked.said)
    assert checked.code == 0


def test_check_names_the_program_that_is_taken_and_runs_that_nobody_asked_for(beam, command_line):
    assert "the program" not in command_line("check", str(beam)).said
    text = beam.read_text().replace("./solver", "true")
    beam.write_text(text)
    (beam.parent / "true").write_text("#!/bin/sh\n")
    assert re.search(
        r'warning: the program true is /\S+; the one beside the study is "./true"',
        " ".join(command_line("check", str(beam)).out.split()),
    )
    (beam.parent / "true").unlink()
    rare = '[designs.rare]\nkind = "importance-sampling"\nevent = "deflection > 9 mm"\n'
    beam.write_text(text + rare)
    checked = " ".join(command_line("check", str(beam)).out.split())
    numbers = "samples = 2000, replicates = 5"
    assert f"rare makes 10000 of the 10050 runs by default ({numbers})" in checked
    assert "10050 runs in all" in checked
    beam.write_text(f"{text}{rare}samples = 2000\n")
    assert "by default" not in command_line("check", str(beam)).out


def test_a_program_that_is_changed_while_the_study_runs_stops_it(beam):
    study = uqpen.load_study(beam)
    solver = beam.parent / "solver"
    solver.write_text(solver.read_text().replace("80.64", "80.65"))
    with pytest.raises(ModelError, match='"solver" was changed while the study ran'):
        uqpen.run(study)


def test_several_programs_can_be_models_of_one_study(beam):
    model, rest = re.findall(r"(\[model\].*?)(\[inputs\].*)", beam.read_text(), re.DOTALL)[0]
    models = [model.replace("[model", f"[models.{name}") for name in ("fine", "coarse")]
    coarse = models[1].replace('"./solver"', '"./coarse"')
    text = f"seed = 1\n{models[0]}{coarse}{rest}".replace("runs = 50", "runs = 10")
    (beam.parent / "coarse").write_text("#!/bin/sh\nexit 1\n")
    (beam.parent / "coarse").chmod(0o755)
    tree = uqpen.run(parse_study(text, name="beam", folder=beam.parent))
    assert tree["models/coarse"].attrs["model_name"] == "./coarse beam.dat"
    assert not tree["models/fine/runs/sample/status"].values.any()
    assert len(list((beam.parent / "beam_runs" / "coarse").iterdir())) == 10
