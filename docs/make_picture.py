"""Draws the README's picture from an archive: ``python docs/make_picture.py archives/concrete.nc``.

Needs the ``docs`` extra. The same archive gives the same bytes.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("svg")
mpl.rcParams["svg.hashsalt"] = "uqpen"
mpl.rcParams["font.family"] = "DejaVu Sans"

import matplotlib.pyplot as plt  # noqa: E402 - after the backend has been chosen
import numpy as np  # noqa: E402
import xarray as xr  # noqa: E402

import uqpen  # noqa: E402

PICTURE = Path(__file__).with_name("concrete.svg")
DESIGN = "monte_carlo"
WALL = 0.60  # m
BLUE, ORANGE = "#0072b2", "#d55e00"  # told apart by every kind of colour vision


def main(archive: str) -> None:
    tree = uqpen.open_archive(archive)
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.4), layout="constrained")
    _histogram(left, tree)
    _exceedance(right, tree)
    figure.savefig(PICTURE, metadata={"Date": None})


def _histogram(axes: plt.Axes, tree: xr.DataTree) -> None:
    depth = tree[f"runs/{DESIGN}"]["penetration_depth"].values
    mean = tree[f"moments/{DESIGN}"]["penetration_depth_mean"].values
    median = tree[f"quantiles/{DESIGN}"]["penetration_depth"].sel(penetration_depth_probability=0.5)
    axes.hist(depth[np.isfinite(depth)], bins=np.linspace(0.25, 1.2, 77), color=BLUE, alpha=0.6)
    for values, style, name in ((median.values, "-", "median"), (mean, "--", "mean")):
        label = f"{name} {values[0]:.3f} m"
        axes.axvline(values[0], color="black", linestyle=style, linewidth=1, label=label)
    axes.set(xlabel="penetration depth [m]", ylabel="runs", title="10 000 draws of the target")
    axes.legend(frameon=False)


def _exceedance(axes: plt.Axes, tree: xr.DataTree) -> None:
    cdfs = tree[f"cdfs/{DESIGN}"]
    depth = cdfs["penetration_depth"].values
    band = 1 - cdfs["penetration_depth_band"].values
    axes.fill_between(depth, band[:, 1], band[:, 2], color=BLUE, alpha=0.3, label="95 % band")
    axes.plot(depth, band[:, 0], color=BLUE)
    asked = tree[f"exceedance/{DESIGN}"]["penetration_depth"].values[0]
    error = [[asked[0] - asked[1]], [asked[2] - asked[0]]]
    label = f"P(> 60 cm) = {asked[0]:.3f} ({asked[1]:.3f} … {asked[2]:.3f})"
    axes.errorbar([WALL], [asked[0]], yerr=error, fmt="o", color=ORANGE, capsize=3, label=label)
    axes.set(xlabel="depth x [m]", ylabel="P(depth > x)", xlim=(0.25, 1.2), ylim=(0, 1))
    axes.set_title("Does it go deeper than x?")
    axes.legend(frameon=False)


if __name__ == "__main__":
    main(sys.argv[1])
