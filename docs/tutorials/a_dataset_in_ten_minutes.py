# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#       format_version: '1.3'
#       jupytext_version: 1.19.6
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # A dataset in ten minutes
#
# You will make a small dataset of simulated episodes, read it, and convert it to a LeRobot dataset. The episodes are short, so that the page
# runs in seconds; the last section makes a larger one.

# %%
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import twin

# %% [markdown]
# ## A recipe
#
# A recipe states the endoscope, how far its wires are pulled, and for how long. Everything else has a default.

# %%
recipe = twin.Recipe(
    preset=twin.load_preset("ureteroscope"),
    strokes_mm=((-1.0, 1.0), (2.0, 4.0)),  # lowest and highest pull
    signals=("sine", "random-steps"),
    seconds=10.0,
    episodes=4,  # each combination of signal and stroke once
    seeds=(7,),
)

# %% [markdown]
# ## Generate the dataset
#
# Each episode is one MCAP file, complete or absent. A program that was stopped continues with the same call.

# %%
folder = Path("data/tutorial")
with ThreadPoolExecutor(1) as executor:
    twin.write_dataset(recipe, folder, executor)
print(*sorted(path.name for path in folder.iterdir()), sep="\n")
# > README.md
# > dataset.json
# > episode_0000.mcap
# > episode_0001.mcap
# > episode_0002.mcap
# > episode_0003.mcap
# > loops.png
# > recipe.yaml

# %% [markdown]
# `README.md` is the card of the dataset; `dataset.json` has the hash and the statistics of each file.
#
# ## Read the dataset

# %%
episodes = twin.read_dataset(folder)
for episode in episodes:
    print(
        f"{episode.metadata['signal']:>12}: {episode.pull_mm.min():.1f} to {episode.pull_mm.max():.1f} mm bend the tip "
        f"by {np.ptp(episode.truth_deg):.0f} deg"
    )
# >         sine: -0.3 to 1.0 mm bend the tip by 12 deg
# > random-steps: 0.0 to 0.3 mm bend the tip by 2 deg
# >         sine: 2.6 to 4.0 mm bend the tip by 22 deg
# > random-steps: 2.4 to 3.0 mm bend the tip by 1 deg

# %% [markdown]
# An episode contains the truth and what a sensor measured: here the angle at one pull, once while the pull rises and once while it falls.

# %%
loop = episodes[0]
rising = np.gradient(loop.pull_mm) > 0
near = np.abs(loop.pull_mm) < 0.05
there, back = loop.truth_deg[near & rising].mean(), loop.truth_deg[near & ~rising].mean()
print(f"near a pull of zero: {there:.1f} deg while it rises, {back:.1f} deg while it falls")
# > near a pull of zero: 0.0 deg while it rises, 9.2 deg while it falls

# %% [markdown]
# A notebook shows the loop, and the time course. `loop.to_dataframe()` has the same numbers and all hidden state for pandas, and
# `episodes.to_dataframe()` the parameters of each episode.

# %%
loop.plot()
# > ![Episode of ureteroscope, signal sine, seed 7, episode 0](../images/tutorials/a_dataset_in_ten_minutes_0.png)

# %% [markdown]
# It also contains the hidden state: the tension in each length of each wire, from the pulley to the tip. Friction in the sheath leaves less of it
# at the tip.

# %%
k = int(loop.pull_mm.argmax())
print("tension of wire a from pulley to tip [N]:", np.round(loop.wire_tension[k, 0], 1))
# > tension of wire a from pulley to tip [N]: [16.4 15.1 13.8 12.5 11.3 10. ]

# %% [markdown]
# ## Verify and export
#
# The first command verifies every hash and number; the second writes a dataset that LeRobot, pandas and PyTorch read:
#
# ```sh
# endotwin generate --verify --out data/tutorial
# endotwin export data/tutorial --format parquet --out data/tutorial_lerobot
# ```
#
# ## A larger dataset
#
# A recipe can be a YAML file. `endotwin samples` copies one, `mixed.yaml`: forty endoscopes with other friction, two strokes, and a sheath that is
# bent during the episode. `endotwin generate mixed.yaml --out data/mixed` makes its forty minutes in less than one on two cores.
# [Datasets](../dataset.md) describes every key and every field.
