"""Tasks of ``docs/how_to.md`` work as printed, each in an empty folder."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from click.shell_completion import BashComplete
from page_blocks import ROOT, blocks_of

from uqpen.cli.main import COMMANDS, COMPLETION, uqpen
from uqpen.core.lookup import resolve

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="programs run on POSIX only")

PAGE = ROOT / "docs" / "how_to.md"
TEXT = PAGE.read_text(encoding="utf-8")
SECTIONS = dict(re.findall(r"^## (.+)\n([\s\S]+?)(?=^## |\Z)", TEXT, re.MULTILINE))
IN_A_NOTEBOOK = "How do I do this in a notebook?"
IN_A_SHELL = "Can my shell complete the commands?"

# The programs of shipped studies, and their packages in Debian.
PROGRAMS = {"filter.toml": ("ngspice", "ngspice"), "cantilever.toml": ("ccx", "calculix-ccx")}

# Processors differ in the last digit, and many intervals are shown by two: one of them is 10 %.
LAST_DIGIT = 0.1


def section(title):
    return list(blocks_of(PAGE, SECTIONS[title]))


def skip_without_program(text):
    for study, (program, package) in PROGRAMS.items():
        if study in text and shutil.which(program) is None:
            pytest.skip(f"there is no {program} here (Debian's package {package})")


def write_file(block, folder):
    (folder / block.file).write_text(block.text, encoding="utf-8")


def write_linked_files(text, folder):
    """Write what a section takes from the studies and from pages that it links."""
    shutil.copytree(ROOT / "studies", folder / "studies")
    for page in set(re.findall(r"\]\((data\.md|models\.md)#", text)):
        for block in blocks_of(PAGE.parent / page):
            if block.file:
                write_file(block, folder)


def edit(block, folder):
    """Replace a line of the only study in a folder, as a diff says."""
    old, new = (line[1:] for line in block.text.splitlines())
    (study,) = folder.glob("*.toml")
    text = study.read_text(encoding="utf-8")
    assert text.count(f"{old}\n") == 1
    study.write_text(text.replace(old, new), encoding="utf-8")


def run_as_printed(blocks, folder, command_line):
    """Write the files of a page, make its edits and calls, and compare what they show."""
    output = ""
    for block in blocks:
        if block.file:
            write_file(block, folder)
        elif block.language == "diff":
            edit(block, folder)
        elif block.language == "sh":
            output = output_of(block, command_line)
        else:
            check_shown(block, output)


def output_of(block, command_line):
    """Run commands; return what they show."""
    output = ""
    for line in block.text.splitlines():
        program, *arguments = shlex.split(line)
        if program == "uqpen":
            outcome = command_line(*arguments)
            assert outcome.code == block.exit_code, outcome.err
            output += outcome.err + outcome.out
        else:
            program = sys.executable if program == "python" else program
            subprocess.run([program, *arguments], check=True)
    return output


def words_and_numbers(line):
    """A line without durations, widths of columns and numbers; and its numbers."""
    line = re.sub(r"(?<=\d)\s(?=\d{3}\b)", "", line.strip())
    line = re.sub(r"\d+(\.\d+)? (ms|s|min)\b", "a while", line)
    line = re.sub(r"─+", "─", re.sub(r"\s+", " ", line))
    number = r"(?<![A-Za-z])\d+(?:\.\d+)?"
    return re.sub(number, "#", line), [float(each) for each in re.findall(number, line)]


def check_shown(block, output):
    """Check that the lines of a block stand in an output, in their order."""
    lines = iter([words_and_numbers(line) for line in output.splitlines()])
    for line in filter(None, block.text.splitlines()):
        words, numbers = words_and_numbers(line)
        found = next((found for found in lines if found[0] == words), None)
        assert found is not None, f"{line!r} is not shown (or not after the line before):\n{output}"
        assert found[1] == pytest.approx(numbers, rel=LAST_DIGIT), line


def test_they_are_eleven():
    assert len(re.findall(r"^##+ .+\?$", TEXT, re.MULTILINE)) == 11


@pytest.mark.slow
@pytest.mark.parametrize("title", sorted(SECTIONS.keys() - {IN_A_NOTEBOOK, IN_A_SHELL}))
def test_it_works_as_printed(title, command_line, tmp_path):
    skip_without_program(SECTIONS[title])
    write_linked_files(SECTIONS[title], tmp_path)
    run_as_printed(section(title), tmp_path, command_line)


@pytest.mark.slow
def test_bash_completes_as_printed(tmp_path):
    if shutil.which("bash") is None:
        pytest.skip("there is no bash here")
    line, offered = section(IN_A_SHELL)
    (words,) = re.findall(r"type `(.+)`", SECTIONS[IN_A_SHELL])
    typed = f"COMP_WORDS=({words})\nCOMP_CWORD={len(words.split()) - 1}"
    asked = f'{line.text}\n{typed}\n_uqpen_completion uqpen\necho "${{COMPREPLY[@]}}"'
    folders = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    done = subprocess.run(
        ["bash", "-c", asked],
        env={**os.environ, "PATH": folders},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert sorted(done.stdout.split()) == sorted(offered.text.split())


def _options(command):
    for parameter in resolve(COMMANDS[command]).params:
        if parameter.param_type_name == "option":
            yield from (*parameter.opts, *parameter.secondary_opts)


def test_every_command_and_option_is_completed():
    bash = BashComplete(uqpen, {}, "uqpen", COMPLETION)
    assert [found.value for found in bash.get_completions([], "")] == list(COMMANDS)
    for command in COMMANDS:
        offered = {found.value for found in bash.get_completions([command], "-")}
        # click keeps the help option of a command from its first use, which may be one without -h.
        assert offered - {"-h"} == {*_options(command), "--help"}
