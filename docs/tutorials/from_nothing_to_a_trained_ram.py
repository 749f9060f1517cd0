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
# # From nothing to a trained RAM
#
# You will simulate records, identify a model of their hysteresis, train the paper's estimator (reinforcement active modeling, RAM) on it,
# and compare it with a plain Kalman filter. The training here has a five-hundredth of the paper's episodes, so that the page runs in a minute.

# %%
import subprocess

import twin


def endotwin(words: str) -> None:
    """Run a command as it would be typed, and print its last line."""
    done = subprocess.run(f"endotwin {words}", shell=True, check=True, capture_output=True, text=True)
    print(done.stdout.strip().splitlines()[-1])


# %% [markdown]
# ## Records
#
# The paper trains on strokes of [2, 4] mm and tests on [-1, 1] mm, which the training has never seen.

# %%
endotwin("generate --stroke 2 4 --episodes 2 --seconds 20 --seed 1 --out data/train")
endotwin("generate --stroke -1 1 --episodes 2 --seconds 20 --seed 2 --out data/test")
# > data/train: 2 episodes, 40 s of ureteroscope
# > data/test: 2 episodes, 40 s of ureteroscope

# %%
twin.read_dataset("data/train")[0].plot()
# > ![Episode of ureteroscope, signal sine, seed 1, episode 0](../images/tutorials/from_nothing_to_a_trained_ram_0.png)

# %% [markdown]
# ## A model of hysteresis
#
# Coleman and Hodgdon's model has three numbers. A genetic algorithm finds them from the noisy measurements of the training records.

# %%
endotwin("identify data/train --out coleman_hodgdon.json")
model = twin.load_model("coleman_hodgdon.json")
print(
    f"a = {model.a_per_mm:.2f} / mm, b = {model.b_deg_per_mm:.1f} deg / mm, c = {model.c_deg_per_mm:.1f} deg / mm"
)
# > coleman_hodgdon.json: a_per_mm = 1.259, b_deg_per_mm = 22.36, c_deg_per_mm = 4.733, c_over_b = 0.2116, monotone = no, RMSE 0.858 deg over 2 records
# > a = 1.26 / mm, b = 22.4 deg / mm, c = 4.7 deg / mm

# %% [markdown]
# ## Training
#
# The active model is a Kalman filter that predicts by this model and keeps its error as a second state. A policy learns, by PPO, a further correction in
# proportion to the residual. The paper trains for 2000 episodes: `--episodes 2000` takes some minutes.

# %%
endotwin(
    "train data/train --model coleman_hodgdon.json --agent ram --protocol strict --episodes 4 --out runs/ram"
)
# > runs/ram/policy.onnx: ram trained on 2 records

# %% [markdown]
# ## Comparison
#
# Both start 20 degrees off, and filter the test records under noise that the training has not seen.

# %%
filters = {
    "active model": twin.ActiveModel(model, sample_time=0.1),
    "RAM": twin.load_estimator("runs/ram/policy.onnx"),
}
scores = twin.evaluate("data/test", filters, suite="paper-only", seeds=2)
for score in scores:
    if (score.noise, score.level) == ("gaussian", 1.0):
        print(f"{score.method}: {score.rmse_deg:.1f} deg RMSE under Gaussian noise of R = 1")
# > active model: 4.0 deg RMSE under Gaussian noise of R = 1
# > RAM: 1.0 deg RMSE under Gaussian noise of R = 1

# %% [markdown]
# Even this short training removes the initial error sooner than the filter alone. The [results](../results/paper_protocol.md) are those of the full training. `endotwin evaluate` compares more methods and writes tables and figures,
# and `endotwin report` shows all of it on one page:
#
# ```sh
# endotwin evaluate data/test --train data/train --model coleman_hodgdon.json --policy runs/ram/policy.onnx --methods C-H AM AM-tuned RAM --seeds 5 --out results
# endotwin report .
# ```
#
# [RAM with the physics inside](../ram_twins.md) is another estimator of EndoTwin; it needs no training records.
