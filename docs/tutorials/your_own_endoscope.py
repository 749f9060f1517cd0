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
# # Your own endoscope: from a CSV file to a deployed policy
#
# You will read a log, fit a twin to it, train an estimator on twins like it, and run that estimator sample by sample. The log here is a sample that
# ships with EndoTwin; it is simulated. Put your own in its place.

# %%
import subprocess

import twin
from twin.live import load_runtime


def endotwin(words: str) -> None:
    """Run a command as it would be typed, and print its last line."""
    done = subprocess.run(f"endotwin {words}", shell=True, check=True, capture_output=True, text=True)
    print(done.stdout.strip().splitlines()[-1])


# %% [markdown]
# ## Measure
#
# Pull slowly to and fro over the whole stroke, turn around at several places, and write time, pull and angle into a CSV file.

# %%
endotwin("samples --out .")
with open("bench.csv") as log:
    print(*[next(log).strip() for _ in range(3)], sep="\n")
# > .: 15 files, all simulated: none was measured on a real endoscope
# > time_s,pull_mm,angle_deg
# > 0,0,-0.2336
# > 0.1,0.0333,-0.2353

# %% [markdown]
# ## Import
#
# The columns are named; a unit is what a name ends in. What is odd about the log is said in a line.

# %%
endotwin("import bench.csv --command-column pull_mm --angle-column angle_deg --out data/measured")
(log,) = twin.read_dataset("data/measured")
print(log)
# > data/measured/bench.mcap: 600 samples, 59.9 s at 10 Hz, pulled from -3 to 3 mm, bent from -53.5 to 50.0 deg
# > Episode 'bench', measured, signal measured
# >   600 samples every 0.1 s, 59.9 s; pull -3.00 to 3.00 mm, bend -53.5 to 50.0 deg
# >   recorded: time, pull, bend, measured_bend

# %% [markdown]
# ## Calibrate
#
# The physical parameters of a twin are fitted to the log, with their uncertainty. One start and three parameters are enough for a look;
# leave `--starts` and `--free` out for your own endoscope, and give it some minutes.

# %%
endotwin(
    "calibrate data/measured --preset ureteroscope --starts 1 --free section_stiffness pretension sheath_friction_floor --out preset.yaml"
)
# > preset.yaml: bench RMSE 0.75 deg

# %% [markdown]
# ## Train
#
# Twins are drawn from the ranges of the calibrated preset, noise of every kind is put on their angles, and the estimator learns on these. One episode
# is enough to have a file; the whole training (`--episodes` left out) takes some six minutes.

# %%
endotwin(
    "train --agent ram --protocol twins --preset preset.yaml --stroke -3 3 --episodes 1 --seed 1 --out runs/ram_twins"
)
# > runs/ram_twins/policy.onnx: ram-twins trained on simulated twins of preset

# %% [markdown]
# ## Go or no-go
#
# Before it is deployed, the gate tries it on twins that no training has seen, on your log, and under planted faults (some minutes):
#
# ```sh
# endotwin gate runs/ram_twins/policy.onnx data/measured --preset preset.yaml --out gate.html
# ```
#
# Of an estimator that has hardly been trained it says no-go.
#
# ## Run
#
# The runtime takes one sample at a time, beside a trusted fallback. It needs neither MuJoCo nor PyTorch.

# %%
runtime = load_runtime("runs/ram_twins/policy.onnx", noise_variance=0.2)
for k in range(50):
    reading = runtime.push(
        time_s=float(log.time[k]),
        pull_mm=float(log.pull_mm[k]),
        measurement_deg=float(log.measured_deg[k]),
    )
print(f"after 5 s: {reading.bend_deg:.0f} deg, made by {reading.source}")
# > after 5 s: 23 deg, made by Source.ADVANCED

# %% [markdown]
# From another language, send JSON lines to `endotwin run --policy runs/ram_twins/policy.onnx`, and read one answer for each:
# [deployment](../deployment.md).
