"""The example of ``docs/rehearse.md`` works as printed."""

import re
import shlex
from pathlib import Path

from page_blocks import ROOT, blocks_of

PAGE = ROOT / "docs" / "rehearse.md"


def words(line):
    """Letters and signs of a line; its numbers may differ on another processor."""
    return " ".join(re.findall(r"[A-Za-z_%>:\[\]]+", line))


def test_the_example_is_what_the_command_shows(command_line):
    blocks = list(blocks_of(PAGE))
    (study,) = (block for block in blocks if block.file)
    Path(study.file).write_text(study.text, encoding="utf-8")
    assert command_line("study", study.file).code == 0
    (example,) = (block.text for block in blocks if block.text.startswith("$ "))
    command, *printed = example.splitlines()
    done = command_line(*shlex.split(command)[2:])
    assert done.code == 0
    shown = {words(line) for line in done.out.splitlines()}
    assert {words(line) for line in printed} <= shown
