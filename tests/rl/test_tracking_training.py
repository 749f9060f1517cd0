"""Training of a tracking policy: the file is the actor that was trained, and a seed is a policy."""

import numpy as np
import pytest
import torch
from small_tracking import write_tiny
from stable_baselines3 import PPO

from rl import tracking_training
from rl.tracking import TrackingEnvironment
from rl.tracking_training import export_actor
from twin.control.controllers.ppo import load_tracking_policy
from twin.errors import InputError

SEEN = np.random.default_rng(0).normal(0, 3, (200, 6)).astype(np.float32)


def said(path) -> list[float]:
    policy = load_tracking_policy(path)
    return [policy(seen) for seen in SEEN]


def test_the_file_is_the_deterministic_actor_within_its_bounds(tmp_path):
    ppo = PPO("MlpPolicy", TrackingEnvironment(physics="reduced"), seed=0, device="cpu", n_steps=64)
    with torch.no_grad():
        ppo.policy.action_net.weight *= 300
    export_actor(ppo, {"sample_time": 0.02, "speed_mm_s": 5.0}, tmp_path / "ppo.onnx")
    expected = [ppo.predict(seen, deterministic=True)[0].item() for seen in SEEN]
    np.testing.assert_allclose(said(tmp_path / "ppo.onnx"), expected, atol=1e-5)
    assert min(expected) == -1.0
    assert max(expected) == 1.0
    assert any(-0.9 < action < 0.9 for action in expected)


def test_environments_take_the_strokes_in_turn_and_draw_endoscopes(tmp_path, monkeypatch):
    made = []

    class Witness(TrackingEnvironment):
        def __init__(self, *given, **settings):
            super().__init__(*given, **settings)
            made.append(self)

    monkeypatch.setattr("rl.tracking.TrackingEnvironment", Witness)
    write_tiny(tmp_path / "ppo.onnx", environments=3)
    strokes = [(-1.0, 1.0), (2.0, 4.0), (-1.0, 1.0)]
    lines = [TrackingEnvironment(physics="reduced", stroke_mm=stroke).line for stroke in strokes]
    assert [environment.line for environment in made] == lines
    assert all(environment.plant.preset != environment.nominal for environment in made)
    assert made[0].plant.preset != made[2].plant.preset


def test_a_file_of_before_stays_where_a_training_fails(tmp_path, monkeypatch):
    path = tmp_path / "ppo.onnx"
    path.write_text("of before")

    def fail(*_):
        raise OSError("disk is full")

    monkeypatch.setattr(tracking_training, "export_actor", fail)
    with pytest.raises(OSError, match="full"):
        write_tiny(path)
    assert path.read_text() == "of before"


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"samples": 0}, "samples = 0: must be from 1 to"),
        ({"environments": 1}, "environments = 1: must be from 2 to 1000"),
        ({"seed": -1}, "seed = -1: must be from 0 to"),
        ({"strokes_mm": ((1.0, -1.0), (0.0, 1.0))}, r"stroke \[1, -1\] mm"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(tmp_path, wrong, message):
    with pytest.raises(InputError, match=message) as refused:
        write_tiny(tmp_path / "ppo.onnx", **wrong)
    assert "\n" not in str(refused.value)
