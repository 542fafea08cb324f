"""Archives to draw: those that are kept, and small ones of what is not among them."""

from __future__ import annotations

import gzip
from collections import UserDict
from pathlib import Path

import pytest
import xarray as xr

import uqpen

DATA = Path(__file__).parents[1] / "data"
RODS = (DATA / "rods.toml").read_text().split("[inputs]")[1].replace("(60 ± 25)", "(100 ± 25)")

KEPT = sorted(path.name.removesuffix(".nc.gz") for path in DATA.glob("archives/*.nc.gz"))

ROD_MODELS = f"""
title = "Three rods"
seed = 1
[models.original]
use = "walker-anderson"
[models.smoothed]
use = "walker-anderson"
with = {{ smoothing = 1 }}
[models.rigid]
use = "rigid-penetration"
[inputs]{RODS}
[outputs.penetration_depth]
unit = "cm"
exceeds = ["60 cm", "90 cm"]
[designs.latin]
kind = "latin-hypercube"
runs = 100
"""

BEAM = """
title = "$5 and $6: \\\\frac{1}{0} \\u001b[31m --> <script> 中"
seed = 1
[model]
python = "beam.py:bend"
[model.inputs]
load = "N"
span = "m"
[model.outputs]
deflection = "m"
[inputs]
load = { uniform = { lower = "10 kN", upper = "20 kN" } }
span = "(3 ± 0.1) m"
[outputs.deflection]
unit = "mm"
exceeds = ["2 mm"]
[designs.only]
kind = "monte-carlo"
runs = 120
"""

SOURCE = """
def bend(load, span):
    if load > LIMIT:
        raise ValueError("too heavy")
    return {"deflection": load * span**3 / 1e8}
"""


def _kept(name: str, folder: Path) -> xr.DataTree:
    """An archive that is kept, unpacked."""
    path = folder / f"{name}.nc"
    path.write_bytes(gzip.decompress((DATA / "archives" / f"{name}.nc.gz").read_bytes()))
    return uqpen.open_archive(path)


def _beam(folder: Path, limit: float) -> xr.DataTree:
    """A study whose title means harm, and whose heavy loads are lost."""
    folder = folder / str(limit)
    folder.mkdir()
    (folder / "beam.py").write_text(SOURCE.replace("LIMIT", str(limit)))
    return uqpen.run(uqpen.parse_study(BEAM, folder=folder))


class Archives(UserDict[str, xr.DataTree]):
    """Archives by their names, each made when it is asked for."""

    def __init__(self, folder: Path) -> None:
        super().__init__(dict.fromkeys([*KEPT, "rods", "beam", "lost"]))
        self.folder = folder

    def __getitem__(self, name: str) -> xr.DataTree:
        if self.data[name] is None:
            self.data[name] = self._made(name)
        return self.data[name]

    def _made(self, name: str) -> xr.DataTree:
        if name in KEPT:
            return _kept(name, self.folder)
        if name == "rods":
            return uqpen.run(uqpen.parse_study(ROD_MODELS))
        return _beam(self.folder, 0 if name == "lost" else 18e3)


@pytest.fixture(scope="session")
def archives(tmp_path_factory: pytest.TempPathFactory) -> Archives:
    """All of them, by name."""
    return Archives(tmp_path_factory.mktemp("archives"))
