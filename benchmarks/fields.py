"""What a study of fields takes: processor time, memory and disk of ``uqpen study``.

The model is vectorised and does next to nothing. So the figures are those of the runs' way into the
archive, of their statistics at each place, and of the archive's hashes.

    python benchmarks/fields.py
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from flat_memory import cost

MODEL = """\
import numpy as np

PLACES = {places}


def simulate(x, y):
    x, y = np.asarray(x)[:, np.newaxis], np.asarray(y)[:, np.newaxis]
    lines = (x + (y + n) * np.linspace(0, 1, PLACES) for n in range({outputs}))
    return {{f"field_{{n}}": line.reshape(-1, *{shape}) for n, line in enumerate(lines)}}
"""
STUDY = """\
seed = 1
[model]
python = "model.py:simulate"
inputs = {{ x = "1", y = "1" }}
vectorized = true
[model.outputs]
{outputs}
[inputs]
x = "0 ± 1"
y = "0 ± 1"
[outputs.field_0]
exceeds = [2]
[designs.mc]
kind = "monte-carlo"
runs = {runs}
"""
COMMANDS = {
    "study": ["study", "study.toml", "--quiet"],
    "verify": ["verify", "archives/study.nc", "--trust"],
    "show": ["show", "archives/study.nc"],
}


@dataclass(frozen=True)
class Case:
    """Number of runs and of fields, and the shape of each."""

    runs: int
    outputs: int
    shape: tuple[int, ...]

    def write(self, folder: Path) -> None:
        """Write the study and its model."""
        along = ", ".join(
            f"{name} = {{ from = 0, to = 1, size = {size} }}"
            for name, size in zip(("height", "width"), self.shape, strict=False)
        )
        outputs = "\n".join(
            f'field_{n} = {{ unit = "1", along = {{ {along} }} }}' for n in range(self.outputs)
        )
        model = MODEL.format(places=math.prod(self.shape), outputs=self.outputs, shape=self.shape)
        (folder / "model.py").write_text(model)
        (folder / "study.toml").write_text(STUDY.format(outputs=outputs, runs=self.runs))


CASES = [Case(10_000, 3, (1000,)), Case(200, 1, (300, 300))]


def main() -> None:
    """Measure the commands for each case."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--command", choices=COMMANDS, action="append")
    wanted = parser.parse_args().command or list(COMMANDS)
    for case in CASES:
        print(f"{case.runs} runs, {case.outputs} of shape {case.shape}")
        with tempfile.TemporaryDirectory() as scratch:
            case.write(Path(scratch))
            for command in dict.fromkeys(["study", *wanted]):
                print(f"  {command:7} {_measured(COMMANDS[command], Path(scratch))}")


def _measured(command: list[str], folder: Path) -> str:
    """Return processor time and peak memory of a command."""
    found = cost([sys.executable, "-m", "uqpen", *command], folder)
    return f"{found.seconds:6.1f} s of processor time, at most {found.memory / 2**20:5.0f} MB"


if __name__ == "__main__":
    main()
