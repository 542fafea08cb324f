"""Run two studies with what is installed, and check what they find and what is loaded."""

import subprocess
import sys

import numpy as np
import xarray as xr

LOADED = "print([name for name in ('chaospy', 'SALib', 'matplotlib') if name in sys.modules])"
# What starts must load neither library; both lines print what is loaded at the end.
STARTS = (
    f"import sys, uqpen; {LOADED}",
    f"import atexit, runpy, sys; atexit.register(lambda: {LOADED}); "
    "sys.argv = ['uqpen', '--help']; runpy.run_module('uqpen', run_name='__main__')",
)


def statistics(study, names):
    """Run a study and return the values of its statistics, by source and name."""
    subprocess.run([sys.executable, "-m", "uqpen", "study", f"{study}.toml"], check=True)
    archive = xr.open_datatree(f"archives/{study}.nc", engine="netcdf4")
    found = {each: archive["statistics/{}/y/{}".format(*each)].values[..., 0] for each in names}
    assert all(np.isfinite(values).all() for values in found.values()), found
    return found


statistics(
    "wheel", [("mc", "salib_rbd_fast"), ("mc", "salib_pawn"), ("leja", "mean"), ("pce", "mean")]
)
joint = statistics("wheel_joint", [("mc", "mean"), ("pce", "mean"), ("mc", "salib_pawn")])
assert abs(joint["mc", "mean"] - joint["pce", "mean"]) < 1
for code in STARTS:
    made = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert made.stdout.strip().endswith("[]"), made.stdout
print(f"Python {sys.version.split()[0]}, numpy {np.__version__}: right")
