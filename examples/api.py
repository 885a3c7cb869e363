# %% [markdown]
# # A drive replayed, read and drawn from Python
#
# Run this file from the checkout (`python examples/api.py`), or cell by cell in an editor that
# knows `# %%`. It replays 20 frames of the demo drive; all that it writes lands in `reports/api/`.

# %%
from pathlib import Path

import matplotlib.pyplot as plt

import roadeval
from roadeval.data import colours

DRIVE = Path("recordings", "demo.mcap")
OUT = Path("reports", "api")

# %% [markdown]
# ## Replay
#
# The first ten frames train the two variants and are never evaluated; the next ten are scored. A
# configuration has the shape of a TOML file: `roadeval config` prints all that can stand in it.

# %%
config = roadeval.configure({"preset": "paper", "frames": {"max_frames": 20}})
outcome = roadeval.replay(DRIVE, config, save=OUT / "demo.rrd", reports=OUT)
for variant, stages in outcome.summary["totals"].items():
    print(f"{variant:10} ERR of the final mask: {stages['post']['ERR']:.1%}")

# %% [markdown]
# ## Tables
#
# The recording carries the tables of the results folder as pandas frames: a row per frame, variant
# and stage. Rates are fractions.

# %%
recording = roadeval.Recording(OUT / "demo.rrd")
final = recording.frames.query("stage == 'post'")
errors = final.pivot(index="frame", columns="variant", values="ERR")
print(errors.describe().loc[["mean", "min", "max"]])

# %%
palette = {"filtered": colours.FILTERED, "unfiltered": colours.UNFILTERED, "blind": colours.BLIND}
shades = [colours.hex_of(palette[variant]) for variant in errors]
axes = errors.mul(100).plot(marker="o", color=shades, ylabel="ERR, %", figsize=(7, 3))
axes.figure.savefig(OUT / "errors.png", bbox_inches="tight")

# %% [markdown]
# ## Layers
#
# Everything that a stage computed on a frame is an array: here the compensated image of the frame
# that the filtered variant gets worst, and the road mask on it.

# %%
worst = int(errors["filtered"].idxmax())
panels = {
    "as logged": recording.image(worst),
    "NDI": recording.layer("filtered", "ndi", worst),
    "compensated": recording.layer("filtered", "compensated", worst),
    "road mask": recording.layer("filtered", "post", worst),
}
figure, all_axes = plt.subplots(2, 2, figsize=(8, 6), layout="constrained")
for axes, (title, pixels) in zip(all_axes.flat, panels.items(), strict=True):
    axes.imshow(pixels, cmap="gray")
    axes.set_title(f"{title}, frame {worst}")
    axes.set_axis_off()
figure.savefig(OUT / "layers.png")

# %% [markdown]
# ## One image through one variant
#
# A model that was trained before runs on any image of the same camera; no log is needed.

# %%
model = roadeval.train([DRIVE], OUT / "demo.model", config)
result = roadeval.run_frame(recording.image(worst), model, variant="unfiltered")
for stage in result.stages:
    names = ", ".join(layer.spec.name for layer in stage.output.layers)
    print(f"{stage.stage:10} {1000 * stage.seconds:6.2f} ms: {names}")
