"""A study of two inputs that is interrupted at any of its calls, and on two workers."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
from study_text import study_text

import uqpen
from uqpen.core.progress import Progress
from uqpen.execution.processes import processes

# Stops, as Ctrl-C would, at a number of calls: that of a file's name, as a file that a run opens
# would belong to the model.
MODEL = """\
import pathlib, signal
here = pathlib.Path(__file__).parent
def model(a, b):
    with (here / "calls").open("a") as stream:
        stream.write("call\\n")
    stops = [int(file.name[5:]) for file in here.glob("stop_*")]
    if len((here / "calls").read_text().split()) in stops:
        signal.raise_signal(signal.SIGINT)
    return {"depth": DEPTH}
"""
STUDY = study_text(
    {
        "python": "model.py:model",
        "noise": False,
        "vectorized": True,
        "inputs": {"a": "1", "b": "1"},
        "outputs": {"depth": "m"},
    },
    seed=3,
    inputs={"a": "0 ± 1", "b": "0 ± 1"},
    designs={"rare": {}},
)


class Interrupted(Progress):
    """Stops, as Ctrl-C would, at a number of batches; it counts runs and notes warnings."""

    def __init__(self, batches: int = 0) -> None:
        self.left = batches
        self.restored = 0
        self.made = 0
        self.warnings = list[str]()

    def count_restored(self, runs: int) -> None:
        self.restored += runs

    def warn(self, text: str) -> None:
        self.warnings.append(text)

    def advance(self, runs: int, failed: int, in_progress: int) -> None:
        self.made += runs
        self.left -= 1
        if not self.left:
            raise KeyboardInterrupt


def check_interruptions_and_workers(
    folder: Path,
    design: str,
    stops: Iterable[int],
    depth: str = "a + b",
    b: str = '"0 ± 1"',
) -> None:
    """Check that neither changes a byte of the archive; `design` is its table in the file."""
    text = STUDY.replace('b = "0 ± 1"', f"b = {b}") + design

    def archive(name: str, stop: int | None = None, **options: Any) -> bytes:
        (folder / name).mkdir()
        (folder / name / "model.py").write_text(MODEL.replace("DEPTH", depth))
        (folder / name / "study.toml").write_text(text)
        study, path = uqpen.load_study(folder / name / "study.toml"), folder / name / "study.nc"
        if stop is not None:
            (folder / name / f"stop_{stop}").touch()
            with pytest.raises(KeyboardInterrupt):
                uqpen.make_archive(study, path)
            (folder / name / f"stop_{stop}").unlink()
        uqpen.make_archive(study, path, **options)
        return path.read_bytes()

    whole = archive("whole")
    for stop in stops:
        assert archive(f"stop{stop}", stop) == whole, stop
    with processes(2) as pool:
        assert archive("workers", map=pool) == whole
