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
# # Write an estimator
#
# You will write an estimator of your own, compare it with the others, and run it on a live stream. It is one class: constant parameters, and a function from state to state.

# %%
import dataclasses

import numpy as np
import twin
from twin.estimation.estimator import Estimator

# %% [markdown]
# ## A complementary filter
#
# The model of hysteresis predicts by how much the angle moves; the measurement shows where it is. Each sample corrects the prediction by a constant share of their difference:
#
# $$\theta_k = F(\theta_{k-1}, l_k, l_{k-1}) + g\,(y_k - F(\theta_{k-1}, l_k, l_{k-1}))$$
#
# Arrays are `(B,)`: B records are filtered side by side. A measurement that is NaN is missing: predict, do not update.


# %%
@dataclasses.dataclass(frozen=True)
class Complementary(Estimator[np.ndarray]):
    """A model of hysteresis, corrected by a constant share of each innovation."""

    model: twin.ColemanHodgdon
    share: float = 0.2

    def start(self, pull_mm, bend_deg):
        return bend_deg.copy()

    def step(self, state, pull_mm, previous_pull_mm, measurement_deg):
        predicted, _ = self.model.step(state, np.empty((0, len(state))), pull_mm, previous_pull_mm)
        return predicted + self.share * np.nan_to_num(measurement_deg - predicted)

    def bend_deg(self, state):
        return state


# %% [markdown]
# ## Compare it
#
# The tiny dataset that ships with EndoTwin is enough for a first look (`endotwin samples` copies it).

# %%
from twin.files.assets import assets_folder

data = assets_folder() / "samples" / "dataset"
twin.read_dataset(data)[0].plot()
# > ![Episode of ureteroscope, signal sine, seed 0, episode 0](../images/tutorials/write_an_estimator_0.png)

# %%
model = twin.ColemanHodgdon(1.15, 22.38, 5.0)  # the paper's
filters = {"complementary": Complementary(model), "active model": twin.ActiveModel(model, sample_time=0.1)}
for score in twin.evaluate(data, filters, suite="paper-only", seeds=5):
    if score.noise == "gaussian":
        print(f"R = {score.level:g}: {score.method} {score.rmse_deg:.2f} deg RMSE")
# > R = 1: complementary 2.47 deg RMSE
# > R = 1: active model 6.06 deg RMSE
# > R = 5: complementary 2.59 deg RMSE
# > R = 5: active model 7.40 deg RMSE

# %% [markdown]
# The active model relies on its wrong first estimate, and has hardly corrected it after ten seconds; the constant gain has within two.
#
# ## Run it on a stream
#
# `OnlineEstimator` protects any estimator from late, missing and implausible samples.

# %%
live = twin.OnlineEstimator(Complementary(model), sample_time=0.1, initial_bend_deg=0.0)
for time, pull, seen in ((0.0, 0.0, 0.2), (0.1, 0.1, 1.4), (0.2, 0.2, float("nan"))):
    print(f"{live.push(time_s=time, pull_mm=pull, measurement_deg=seen):.2f}")
# > 0.00
# > 0.89
# > 1.80

# %% [markdown]
# ## Put it into the tables
#
# A file of your own that ends with
#
# ```python
# register_method(
#     MethodSpec(
#         name="Complementary",
#         build=lambda known: Complementary(known.reference),
#         given=(),
#         models=(ColemanHodgdon.name,),
#     )
# )
# ```
#
# enters it in every table, figure and ranking; nothing of EndoTwin is edited. [my_filter.py](../examples/my_filter.py) is such a file:
#
# ```sh
# endotwin evaluate data/test --train data/train --model coleman_hodgdon.json --methods C-H AM AM-tuned Complementary --method-file my_filter.py --out results
# ```
#
# `results/tables.md`, `tables.tex` and `ranks.png` compare the methods; `endotwin report results` shows all of it on one page. `--suite full` has more noises.
# An estimator for EndoTwin itself goes into `twin/estimation/` and its table of methods ([Contributing](../../CONTRIBUTING.md#adding-an-estimator)).
