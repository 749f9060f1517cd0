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
# # Compensate hysteresis in closed loop
#
# The tip is to follow a sine: first by a straight line from angle to pull, which ignores hysteresis, then by the inverse of a twin, then by that inverse
# with feedback.

# %%
import numpy as np
import twin

T = 0.05  # seconds between two commands
time = np.arange(0, 12, T)
wanted = np.radians(8 * np.sin(2 * np.pi * time / 8))
preset = twin.load_preset("ureteroscope")


def follow(pull: np.ndarray) -> np.ndarray:
    """Error of the tip along a command, in MuJoCo [deg]; the first four seconds are left out."""
    bend = twin.simulate(preset, pull, sample_time=T).bend
    return np.degrees(bend - wanted)[time >= 4]


def rmse(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(error**2)))


# %% [markdown]
# ## A straight line
#
# Some 1 mm of pull bends the tip by 12 degrees, so 8 degrees are two thirds of a millimetre. The line uses neither the position of the tip nor its direction.

# %%
line = wanted * 1e-3 / np.radians(12)
print(f"straight line: {rmse(follow(line)):.1f} deg RMSE")
# > straight line: 3.7 deg RMSE

# %% [markdown]
# ## The inverse of a twin
#
# The reduced twin determines the pull that brings a wanted bend at the next sample. Its state contains the friction, so it depends on the direction of motion: at each
# reversal the command moves quickly, until the friction has reversed everywhere in the sheath.

# %%
model = twin.ReducedTwins([preset], sample_time=T)
pull = np.empty(len(time))
for k, angle in enumerate(wanted):
    pull[k] = model.inverse(angle, stroke=(-4e-3, 4e-3)).pull[0, 0]
    model.step(pull[k])
print(f"inverse of the twin: {rmse(follow(pull)):.1f} deg RMSE")
# > inverse of the twin: 0.0 deg RMSE

# %%
twin.simulate(preset, pull, sample_time=T).plot()
# > ![Episode of ureteroscope](../images/tutorials/compensate_hysteresis_0.png)

# %% [markdown]
# ## Another endoscope than the model
#
# No twin is exact. Here the endoscope is stiffer and has more friction than the model knows. The inverse is off, and feedback is needed.

# %%
preset = preset.replace(sheath_friction_floor=2.0, section_stiffness=1.3 * preset.section_stiffness)
print(f"inverse, another endoscope: {rmse(follow(pull)):.1f} deg RMSE")
# > inverse, another endoscope: 2.7 deg RMSE

# %% [markdown]
# ## With feedback
#
# A camera measures the angle. Each sample adds a share of the measured error to the reference (an integral controller around the inverse).

# %%
endoscope = twin.ReducedTwins([preset], sample_time=T)  # stands for the device
model = twin.ReducedTwins([twin.load_preset("ureteroscope")], sample_time=T)
added, errors = 0.0, []
for angle in wanted:
    command = model.inverse(angle + added, stroke=(-4e-3, 4e-3)).pull[0, 0]
    model.step(command)
    error = angle - endoscope.step(command)[0]
    added += 5.0 * T * error
    errors.append(np.degrees(error))
print(f"inverse with feedback: {rmse(np.array(errors)[time >= 4]):.1f} deg RMSE")
# > inverse with feedback: 0.6 deg RMSE

# %% [markdown]
# `endotwin control` compares controllers on randomised endoscopes, with a noisy sensor: [closed loop](../control.md). A short run (a minute):
#
# ```sh
# endotwin control --physics reduced --twins 2 --seconds 5 --candidates 2 --controller linear pid twin-inverse --out results/control
# ```
