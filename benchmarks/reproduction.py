"""Make `docs/reproduction.md` and its picture: a report answered item by item, from fresh archives.

    python benchmarks/reproduction.py

Every item has the statement in short, the report's figure, that of the archives and a verdict. The
text is `reproduction.txt`. Where a figure can be tested, the verdict follows from it, and a test
fails if it is another one than on the page.
"""

from __future__ import annotations

import re
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy import stats

import uqpen
from uqpen.replication import PrintedFigure, ReadingResult, Replication, replicate
from uqpen.statistics.published import Comparison

ROOT = Path(__file__).parents[1]
DOCS, STUDIES = ROOT / "docs", ROOT / "studies"
# The nominal rod (table 3.1), in SI units.
L0, V0, S, R = 0.16, 1400.0, 0.1, 0.017


class Archives:
    """The archives of the concrete study, its rods and their transition, and what is read there."""

    def __init__(self, folder: Path, runs: int = 200_000) -> None:
        for name in ("concrete", "rods", "transition"):
            study = uqpen.load_study(STUDIES / f"{name}.toml")
            uqpen.make_archive(study, folder / f"{name}.nc")
        self.concrete = uqpen.open_archive(folder / "concrete.nc")
        self.rods = uqpen.open_archive(folder / "rods.nc")
        self.transition = uqpen.open_archive(folder / "transition.nc")
        self.replication: Replication = replicate(folder / "concrete.nc", runs=runs)
        runs = self.concrete["runs/monte_carlo"].to_dataset()
        self.lost = int((runs["status"].values != 0).sum())
        self.runs = runs.isel(run=runs["status"].values == 0)

    def course(self, model: str) -> xr.Dataset:
        """Return the trajectory of a model's nominal rod."""
        return self.rods[f"models/{model}/trajectory"].to_dataset()

    def depth(self, model: str) -> float:
        """Return the depth of a model's nominal rod."""
        return float(self.course(model)["penetration_depth"][-1])

    def residue(self, model: str) -> float:
        """Return the length that is left of a model's nominal rod."""
        return float(self.course(model)["length"][-1])

    def extent(self, model: str) -> float:
        """Return the largest extent of plastic flow in a model's nominal rod."""
        return float(self.course(model)["plastic_extent"].max())

    def rigid_from(self) -> float:
        """Return the depth from which the nominal rod, the first run of its design, is rigid."""
        return float(self.concrete["runs/responses"]["erosion_end_depth"][0])

    def mean(self, model: str, output: str) -> float:
        """Return the mean of an output over the rods of a model."""
        path = f"models/{model}/statistics/latin_hypercube/{output}"
        return float(self.rods[path]["mean"][0])

    def change(self, model: str, output: str) -> list[float]:
        """Return by how much a criterion of the transition changes an output, mm, with its ends."""
        found = self.transition[f"differences/{model}/monte_carlo/{output}"]["mean"]
        return (1000 * found.values).tolist()

    def share(self, is_so: Any) -> str:
        """Return the share of runs with a property, with its interval."""
        found = stats.binomtest(int(is_so.sum()), is_so.size).proportion_ci()
        return f"{is_so.mean():.4f} ({found.low:.4f} … {found.high:.4f})"

    def moment(self, output: str, figure: str) -> Comparison:
        """Return a published moment beside that found."""
        figures = self.replication.stated.moments.figures
        return next(each for each in figures if (each.output, each.figure) == (output, figure))

    def response(self, name: str, reading: str = "") -> PrintedFigure:
        """Return a published response beside that found, also by a reading."""
        results = (self.replication.stated, *self.replication.readings)
        result = next(each for each in results if each.name == reading)
        return next(each for each in result.responses if each.input == name)


def page(archives: Archives) -> str:
    """Return the page: the text beside this script, with the figures of the archives."""
    text = Path(__file__).with_suffix(".txt").read_text(encoding="utf-8")
    text = text.format(**_figures(archives))
    found = Counter(re.findall(r"^\| \d+ \| .* \| (.) \| [^|]*\|$", text, re.MULTILINE))
    return text.format(**{each: found[each] for each in "RNDT"}, none=found["–"])


def _moment(archives: Archives, output: str, figure: str) -> str:
    found = archives.moment(output, figure)
    # 1.96: a difference in 5 % of right reports.
    verdict = "N" if abs(found.z) <= 1.96 else "D"
    own = f"{found.found:.5f} ± {1.96 * found.found_error:.5f} m"
    return f"{found.published} m | {own} | {verdict} | z = {found.z:.2f}"


def _response(archives: Archives, name: str) -> str:
    central, backward = archives.response(name), archives.response(name, "backward")
    same = [text for text, each in (("central", central), ("backward", backward)) if each.agrees]
    reason = f"{' and '.join(same)} to the digit" if same else "neither to the digit"
    own = f"central {100 * central.found:.2f}, backward {100 * backward.found:.2f}"
    return f"{100 * central.published:.1f} | {own} | {'R' if same else 'T'} | {reason}"


def _transition(archives: Archives) -> tuple[str, bool]:
    """Return what other criteria of the transition change, and whether it comes sooner."""
    texts, sooner = [], []
    for model, label in (
        ("rigid_stress", "where the rest bears its load"),
        ("hugoniot", "with 1.7 Yp by Tate's velocity"),
    ):
        end, low, high = (-each for each in archives.change(model, "erosion_end_depth"))
        depth = archives.change(model, "penetration_depth")
        sooner.append(high > 0)
        texts.append(
            f"{label} {end:.1f} ({high:.1f} … {low:.1f}) mm sooner, "
            f"{depth[0]:.2f} ({depth[1]:.2f} … {depth[2]:.2f}) mm deeper"
        )
    return "; ".join(texts), all(sooner)


def _is(holds: Any) -> str:
    return "R" if holds else "D"


def _figures(archives: Archives) -> dict[str, Any]:
    """Return what stands on the page by name; a verdict that follows begins with `of_`."""
    a, depth, residue = archives, "penetration_depth", "projectile_residue"
    old, rigid = a.depth("original"), a.depth("rigid")
    deeper = a.depth("smoothed") / old - 1
    longer = a.residue("smoothed") / a.residue("original") - 1
    wider = a.extent("smoothed") / a.extent("original")
    sooner, is_sooner = _transition(a)
    depths, ending = a.runs[depth].values, a.runs["termination"].values
    readings, stated = a.replication.readings, a.replication.stated
    most_responding = max(stated.responses, key=lambda each: each.found).input
    indices = a.concrete[f"statistics/sobol_indices/{depth}"]["first_order"]
    first = {str(name): float(indices.sel(input=name)[0]) for name in indices["input"].values}
    most_uncertain = max(first, key=lambda name: first[name])
    form = a.transition[f"model_form/monte_carlo/{depth}"]["model_form_share"].values
    found = {
        "old": old,
        "rigid": rigid,
        "of_rigid": _is(rigid / old > 1.5),
        "deeper": deeper,
        "of_deeper": _is(abs(deeper) <= 0.01),
        "longer": longer,
        "of_longer": _is(abs(longer) <= 0.01),
        "wider": wider,
        "more_extent": wider - 1,
        "of_wider": _is(abs(wider - 1.33) <= 0.01),
        "ratio": rigid / old,
        "of_ratio": _is(1.7 < rigid / old <= 2),
        "mean_deeper": a.mean("smoothed", depth) / a.mean("original", depth) - 1,
        "mean_longer": a.mean("smoothed", residue) / a.mean("original", residue) - 1,
        "mean_ratio": a.mean("rigid", depth) / a.mean("original", depth),
        "flow": L0 * (17.5 / 2.5) ** 0.5,
        "sound": (165e9 / 17500) ** 0.5,
        "crater": 3 / 17,
        "added": 1000 * (old - a.rigid_from()),
        "sooner": sooner,
        "of_sooner": _is(is_sooner),
        "impact": float(a.course("original")["nose_velocity"][0]),
        "residue": a.residue("original"),
        "residue_smoothed": a.residue("smoothed"),
        "extent": 1000 * a.extent("original"),
        "extent_smoothed": 1000 * a.extent("smoothed"),
        "of_extent": _is(a.extent("smoothed") > 0.005 > a.extent("original")),
        "draws": depths.size + a.lost,
        "lost": a.lost,
        "above_54": a.share(depths > 0.54),
        "above_60": a.share(depths > 0.6),
        "ends_equal": a.share(ending == 0),
        "ends_at_rest": a.share(ending == 1),
        "below_40": a.share(depths < 0.4),
        "of_small": _is((depths < 0.4).mean() < 0.05),
        "median": float(np.median(depths)),
        "below_mean": a.share(depths < 0.493),
        "of_half": _is(abs((depths < 0.493).mean() - 0.5) < 0.02),
        "fitting": ", ".join(each.name for each in readings if each.fits) or "none",
        "uncertainties": ", ".join(f"{100 * each.found:.1f}" for each in stated.uncertainties),
        "of_uncertainties": _is(all(each.agrees for each in stated.uncertainties)),
        "most_responding": most_responding,
        "of_responding": _is(most_responding == "target_yield_limit"),
        "most_uncertain": most_uncertain,
        "of_uncertain": _is(most_uncertain == "target_yield_limit"),
        "largest_index": first[most_uncertain],
        "index_of_limit": first["target_yield_limit"],
        "p": stated.moments.p,
        "by_chance": a.replication.chance_agreements,
        "readings": "\n".join(map(_reading, readings)),
        **dict(zip(("choice", "choice_low", "choice_high"), form, strict=True)),
    }
    for name, output in (("depth", depth), ("residue", residue)):
        found |= {f"{name}_{each}": _moment(a, output, each) for each in ("mean", "std")}
    for name in ("target_density", "target_yield_limit", "plasticity_radius", "crater_radius"):
        found[name] = _response(a, name)
    return found


def _reading(result: ReadingResult) -> str:
    """Return the row of a reading that the study declares."""
    against = [f"uncertainty of {name}" for name in result.contradictions]
    against += ["means and deviations"] * result.is_rejected
    p = f"{result.moments.p:.2g}" if result.moments.p else "below 1e-05"
    agree = f"{result.same_responses} of {len(result.responses)}"
    return f"| {result.note} | {p} | {agree} | {', '.join(against) or '–'} |"


def draw(archives: Archives, path: Path) -> None:
    """Draw figures 2.1, 2.2 and 3.1 to 3.4 of the report from the archives."""
    from matplotlib.figure import Figure

    picture = Figure(figsize=(10, 10), layout="constrained")
    panels = picture.subplots(3, 2).ravel()
    _draw_geometry(panels[0])
    _draw_profiles(panels[1], archives)
    colours = {"original": "C0", "smoothed": "C3", "rigid": "C2"}
    names = {"original": "original", "smoothed": "smoothed, ε = 1", "rigid": "rigid"}
    for model, colour in colours.items():
        course = archives.course(model)
        depth = course["penetration_depth"].values
        if model != "rigid":
            panels[2].plot(depth, course["tail_velocity"], colour, ls="--")
            panels[2].plot(depth, course["nose_velocity"], colour, label=names[model])
            panels[3].plot(depth, 10 * course["length"], colour, label=names[model])
            panels[3].plot(depth, 1000 * course["plastic_extent"], colour, ls="--")
        if model != "smoothed":
            panels[4].plot(depth, course["nose_velocity"], colour, label=names[model])
    panels[2].set(title="3.1: u (lines), v (dashed)", xlabel="depth [m]", ylabel="velocity [m/s]")
    panels[3].set(title="3.2: L (lines, dm) and s (dashed, mm)", xlabel="depth [m]")
    panels[3].axhline(5, color="0.7", lw=1)  # the end of the report's axis of s, 0.005 m
    panels[4].set(title="3.3: rigid and eroding", xlabel="depth [m]", ylabel="u [m/s]")
    panels[4].axvline(1.0, color="0.7", lw=1)
    shares = np.linspace(0.001, 0.999, 400)
    for output, colour, scale, label in (
        ("penetration_depth", "C0", 1.0, "depth [m]"),
        ("projectile_residue", "C1", 10.0, "residue [0.1 m]"),
    ):
        values = scale * np.quantile(archives.runs[output].values, shares)
        panels[5].plot(values, shares, colour, label=label)
    panels[5].axvspan(0.2, 1.0, color="0.93")
    panels[5].set(title="3.4: distribution functions", xlim=(0, 1.4), ylim=(0, 1))
    for panel in panels[2:]:
        panel.legend(frameon=False)
    picture.savefig(path, metadata={"Date": None})


def _draw_geometry(panel: Any) -> None:
    """Draw the rod with its plastic zone, the crater of radius R and the plastic zone to S."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, 100)
    panel.fill_between([-60, 0], -5, 5, color="0.6")
    panel.fill_between([-12, 0], -5, 5, color="C3")
    for radius, colour, label in ((100, "#f4e3c8", "S"), (17, "white", "R")):
        x, y = radius * np.cos(angles) - 17, radius * np.sin(angles)
        is_in_target = x >= -17
        panel.fill(x[is_in_target], y[is_in_target], colour, ec="0.3", zorder=0)
        panel.annotate("", (-17, -radius), (-17, 0), arrowprops={"arrowstyle": "->"})
        panel.text(-28, -radius + 1, label)
    panel.text(-58, 8, "v, tail")
    panel.text(3, -3, "u, nose")
    panel.text(-10, 7, "s")
    panel.text(-10, 55, "plastic target")
    panel.set(
        title="2.1: geometry [mm], the rod not to scale", aspect="equal", xlabel="z − zi [mm]"
    )


def _draw_profiles(panel: Any, archives: Archives) -> None:
    """Draw the velocity along the axis through rod and target at the depth of 0.2 m."""
    for model, colour, epsilon in (("original", "C0", 0.0), ("smoothed", "C3", 1.0)):
        state = archives.course(model).interp(penetration_depth=0.2)
        u, v, s = (float(state[f]) for f in ("nose_velocity", "tail_velocity", "plastic_extent"))
        z = np.linspace(-3 * s, 0, 300)
        y = np.clip(-z / s, 0, 1)
        power = epsilon * y ** (2 / epsilon) if epsilon else 0.0 * y
        rod = u + (u - v) / (2 - epsilon) * (-2 * y + power)  # (2.4)
        r = R + np.linspace(0, 0.02, 300)
        target = u * ((S / r) ** 2 - 1) / ((S / R) ** 2 - 1)  # (2.6)
        panel.plot(1000 * np.r_[z, r - R], np.r_[rod, target], colour, label=f"ε = {epsilon:g}")
    panel.axvline(0, color="0.7", lw=1)
    panel.set(
        title="2.2: velocity along the axis, depth 0.2 m", xlabel="z − zi [mm]", ylabel="[m/s]"
    )
    panel.legend(frameon=False)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        archives = Archives(Path(made))
        text = page(archives)
        draw(archives, DOCS / "reproduction.svg")
    (DOCS / "reproduction.md").write_text(text, encoding="utf-8")
