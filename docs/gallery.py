"""The gallery of figures: each figure of the family, drawn at the build from a study's archive."""

from __future__ import annotations

import tempfile
import textwrap
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import xarray as xr

import uqpen
from uqpen.benchmark.methods import BenchmarkSettings
from uqpen.core.lookup import resolve
from uqpen.figures import FIGURES
from uqpen.study.study import ValidatedStudy

STUDIES = Path(__file__).parents[1] / "studies"

# A field along two dimensions, which no shipped study has.
PLATE = {
    "plate.py": """\
import numpy as np

PLACES, TIMES = np.linspace(0, 1, 11), np.linspace(0, 2, 9)


def cool(source, loss, width):
    spread = width**2 + 0.2 * TIMES
    shape = np.exp(-(PLACES[:, None] ** 2) / spread) / np.sqrt(spread)
    return {"temperature": source * shape * np.exp(-loss * TIMES)}
""",
    "plate.toml": """\
title = "A plate that cools"
seed  = 1

[model]
python = "plate.py:cool"

[model.dimensions]
place = { unit = "m", from_model = "PLACES" }
time  = { unit = "s", from_model = "TIMES" }

[model.inputs]
source = "K m"
loss   = "s-1"
width  = "m"

[model.outputs]
temperature = { unit = "K", along = ["place", "time"] }

[inputs]
source = "(20 ± 2) K m"
loss   = "(0.5 ± 0.1) s-1"
width  = "(0.4 ± 0.05) m"

[designs.monte_carlo]
kind = "monte-carlo"
runs = 200
""",
}

# An input that is an interval, which no shipped study has either.
INTERVAL = """\
title = "Ishigami, x3 an interval"
seed  = 1
[model]
use = "ishigami"
[inputs]
x1 = { uniform = { lower = -3, upper = 3 } }
x2 = { uniform = { lower = -3, upper = 3 } }
x3 = { interval = [-3, 3] }
[designs.bounds]
kind   = "interval-bounds"
events = ["y > 8"]
"""

# An input with several values.
SWEEP = """\
title = "Ishigami, x3 at several values"
seed  = 1
[model]
use = "ishigami"
[sweep]
x3 = [0, 1, 2, 3]
[inputs]
x1 = { uniform = { lower = -3, upper = 3 } }
x2 = { uniform = { lower = -3, upper = 3 } }
[outputs.y]
exceeds = [8]
[designs.monte_carlo]
kind = "monte-carlo"
runs = 1000
"""

# Two inputs that measurements teach.
POSTERIOR = """\
title = "Ishigami, two inputs from five measured values"
seed  = 1
[model]
use = "ishigami"
[inputs]
x1 = 1
x2 = { uniform = { lower = 0, upper = 1.5 } }
x3 = { uniform = { lower = 0, upper = 3 } }
[measured.rows]
conditions = ["x1"]
unknown    = ["x2", "x3"]
table      = { x1 = [-2, -1, 0, 1, 2], y = [2.1, 1.9, 5.3, 8.3, 7.5] }
y          = { std = 0.5 }
[designs.posterior]
kind      = "posterior"
measured  = ["rows"]
particles = 200
"""

# Numbers of runs of shipped studies, and of the gallery's.
FEWER = {"10_000": "1_000", "8_192": "1_024", "5_000": "400", "2_000": "100"}

# The archive that shows each figure, and what selects its part.
SHOWN: Mapping[str, tuple[str, Mapping[str, str]]] = {
    "cdf": ("concrete", {"output": "penetration_depth"}),
    "exceedance": ("concrete", {"output": "penetration_depth"}),
    "bounds": ("interval", {}),
    "histogram": ("concrete", {"output": "penetration_depth"}),
    "scatter": ("concrete", {"output": "penetration_depth"}),
    "convergence": ("concrete", {"output": "penetration_depth"}),
    "methods": ("concrete", {"output": "penetration_depth"}),
    "sensitivity": ("concrete", {"output": "penetration_depth"}),
    "responses": ("concrete", {"output": "penetration_depth"}),
    "surrogate": ("concrete", {"output": "penetration_depth"}),
    "losses": ("concrete", {}),
    "velocity-profile": ("concrete", {}),
    "models": ("rods", {"output": "penetration_depth"}),
    "sweep": ("sweep", {"output": "y"}),
    "measurements": ("rod_measurements", {}),
    "posterior": ("posterior", {}),
    "trajectory": ("rods", {}),
    "fan": ("rod_course", {"output": "tail_velocity_at_depth"}),
    "model-curves": ("rod_course", {"output": "tail_velocity_at_depth"}),
    "sensitivity-along": ("rod_course", {"output": "tail_velocity_at_depth"}),
    "map": ("plate", {}),
    "errors": ("ishigami_compare", {}),
    "rates": ("ishigami_compare", {}),
    "coverage": ("ishigami_compare", {}),
}
COMMANDS = {
    "concrete": "uqpen study studies/concrete.toml",
    "rods": "uqpen study studies/rods.toml",
    "rod_course": "uqpen study studies/rod_course.toml",
    "plate": "uqpen study plate.toml",
    "interval": "uqpen study interval.toml",
    "sweep": "uqpen study sweep.toml",
    "rod_measurements": "uqpen study studies/rod_measurements.toml",
    "posterior": "uqpen study posterior.toml",
    "ishigami_compare": "uqpen compare studies/ishigami.toml",
}


def with_fewer_runs(name: str) -> ValidatedStudy:
    """Return a shipped study with fewer runs, so that the page is built in seconds."""
    text = (STUDIES / f"{name}.toml").read_text(encoding="utf-8")
    for many, few in FEWER.items():
        text = text.replace(f"= {many}", f"= {few}")
    if name == "ishigami":
        text = text.partition("[designs.training]")[0]  # fits would take most of the time
    return uqpen.parse_study(text, folder=STUDIES)


def plate(folder: Path) -> ValidatedStudy:
    """Return the study of the plate, written into a folder."""
    for name, text in PLATE.items():
        (folder / name).write_text(text, encoding="utf-8")
    return uqpen.load_study(folder / "plate.toml")


def archives(folder: Path) -> Mapping[str, Callable[[], xr.DataTree]]:
    """Return what makes each archive of the gallery."""
    settings = BenchmarkSettings(budgets=(128, 256, 512), repeats=10, reference=65_536)
    return {
        "concrete": lambda: uqpen.run(with_fewer_runs("concrete")),
        "rods": lambda: uqpen.run(with_fewer_runs("rods")),
        "rod_course": lambda: uqpen.run(with_fewer_runs("rod_course")),
        "plate": lambda: uqpen.run(plate(folder)),
        "interval": lambda: uqpen.run(uqpen.parse_study(INTERVAL, name="interval")),
        "sweep": lambda: uqpen.run(uqpen.parse_study(SWEEP, name="sweep")),
        "rod_measurements": lambda: uqpen.run(with_fewer_runs("rod_measurements")),
        "posterior": lambda: uqpen.run(uqpen.parse_study(POSTERIOR, name="posterior")),
        "ishigami_compare": lambda: uqpen.compare(with_fewer_runs("ishigami"), settings),
    }


def write(folder: Path) -> None:
    """Write the page and its figures into a folder; figures that are there already stay."""
    if unshown := FIGURES.keys() ^ SHOWN.keys():
        raise ValueError(f"the gallery and the figures differ by {', '.join(sorted(unshown))}")
    folder.mkdir(parents=True, exist_ok=True)
    missing = {name: folder / f"{name}.svg" for name in SHOWN}
    missing = {name: path for name, path in missing.items() if not path.exists()}
    with tempfile.TemporaryDirectory() as made:
        sources = archives(Path(made))
        trees = {archive: sources[archive]() for archive in {SHOWN[name][0] for name in missing}}
    for name, path in missing.items():
        archive, selected = SHOWN[name]
        uqpen.figure(trees[archive], name, **selected).save(path)
    (folder / "gallery.md").write_text("\n".join(page()) + "\n", encoding="utf-8")


def page() -> Iterator[str]:
    """Yield the page of all figures, each with the lines that draw it."""
    yield "# Gallery of figures\n"
    yield "Each figure is drawn from an archive alone, by a command or in Python. Those of this"
    yield "page are made when it is built, from the studies that they name with fewer runs."
    yield "[Figures](../../figures.md) says what marks, bands and notes mean, and how a figure is"
    yield "selected.\n"
    for name, (archive, selected) in SHOWN.items():
        title = (resolve(FIGURES[name]).__doc__ or "").partition("\n")[0].removesuffix(".")
        options = "".join(f" --{key} {value}" for key, value in selected.items())
        arguments = "".join(f', {key}="{value}"' for key, value in selected.items())
        yield f"## {name}\n"
        yield f"{title}.\n"
        yield f"![{title}.]({name}.svg)\n"
        yield "```sh"
        yield COMMANDS[archive]
        yield f"uqpen figure archives/{archive}.nc {name}{options}"
        yield "```\n"
        yield "```python"
        yield f'archive = uqpen.open_archive("archives/{archive}.nc")'
        yield f'uqpen.figure(archive, "{name}"{arguments}).save("{name}.svg")'
        yield "```\n"
    yield "## The study of the plate\n"
    for name, text in PLATE.items():
        yield f"```{'python' if name.endswith('.py') else 'toml'}"
        yield f"# {name}\n{textwrap.dedent(text)}```\n"
