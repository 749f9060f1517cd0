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
# ships with EndoTwin; it is simulated: a camera of 30 Hz that is 2 deg off and 66 ms late. Put your own in its place.

# %%
import math
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
# Pull slowly back and forth over the full stroke, reverse at several places, and write time, pull and angle into a CSV file.

# %%
endotwin("samples --out .")
with open("bench.csv") as log:
    print(*[next(log).strip() for _ in range(3)], sep="\n")
# > .: 16 files, all simulated: none was measured on a real endoscope
# > time_s,pull_mm,angle_deg
# > 0,0,1.8339
# > 0.0333,0.0111,1.831

# %% [markdown]
# ## Import
#
# Flags name the columns; the ending of a name is its unit. Warnings state what is unusual about the log.

# %%
endotwin("import bench.csv --command-column pull_mm --angle-column angle_deg --out data/measured")
(log,) = twin.read_dataset("data/measured")
print(log)
# > data/measured/bench.mcap: 2700 samples (153 without a measurement), 89.9667 s at 30 Hz, pulled from -3 to 3 mm, bent from -52.5 to 53.8 deg
# > Episode 'bench', measured, signal measured
# >   2700 samples every 0.0333 s, 89.9667 s; pull -3.00 to 3.00 mm, bend -52.5 to 53.8 deg
# >   recorded: time, pull, bend, measured_bend (153 missing)

# %%
log.plot()
# > ![Episode 'bench', measured, signal measured](../images/tutorials/your_own_endoscope_0.png)

# %% [markdown]
# ## Calibrate
#
# The physical parameters of a twin are fitted to the log, with their uncertainty, and with them the zero, the lag and the noise of the sensor. Three starts are enough
# for a look; leave `--starts` out for your own endoscope.

# %%
endotwin("calibrate data/measured --preset ureteroscope --starts 3 --out preset.yaml")
# > preset.yaml: bench RMSE 0.48 deg

# %%
sensor = twin.load_preset("preset.yaml")
print(
    f"the sensor is off by {math.degrees(sensor.sensor_zero):.1f} deg and late by {sensor.sensor_latency * 1e3:.0f} ms"
)
# > the sensor is off by 2.0 deg and late by 64 ms

# %% [markdown]
# ## Train
#
# Twins are drawn from the ranges of the calibrated preset, noise of every kind is put on their angles, and the estimator learns on these. One episode
# is enough for a file; the full training (without `--episodes`) takes some six minutes.

# %%
endotwin(
    "train --agent ram --protocol twins --preset preset.yaml --stroke -3 3 --episodes 1 --seed 1 --out runs/ram_twins"
)
# > runs/ram_twins/policy.onnx: ram-twins trained on simulated twins of preset

# %% [markdown]
# ## Go or no-go
#
# Before it is deployed, the gate tries it on twins that no training has seen, on your log, and under simulated faults (some minutes):
#
# ```sh
# endotwin gate runs/ram_twins/policy.onnx data/measured --preset preset.yaml --out gate.html
# ```
#
# For this short training it returns no-go.
#
# ## Run
#
# The runtime takes one sample at a time, alongside a trusted fallback, and corrects it for the sensor that was found. It needs neither MuJoCo nor PyTorch.

# %%
runtime = load_runtime("runs/ram_twins/policy.onnx")
for k in range(150):
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
