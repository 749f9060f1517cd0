"""Small results of every kind, in the form in which their commands leave them, for the pages about them."""

import dataclasses
import json
from pathlib import Path

import numpy as np
from PIL import Image
from scores import SCORE, track
from small_dataset import SMALL, changed, make

from twin.episode import Record
from twin.evaluation.paper import paper_value
from twin.evaluation.protocol import Condition
from twin.evaluation.ranking import MethodRank, Ranking
from twin.evaluation.results import save_tracks
from twin.files.origin import origin_of
from twin.gate.check import Check, GateVerdict
from twin.gate.run import CHECKS, write_verdict
from twin.recording import write_episode
from twin.rendering.video import write_video
from twin.report.report import write_report
from twin.simulation import simulate

METHODS = ("C-H", "AM", "LSTM", "Direct RL", "RAM")
EVERY_KIND = ("run", "dataset", "evaluation", "training", "calibration", "gate", "control")
CONDITIONS = (("gaussian", 1.0), ("gaussian", 5.0), ("poisson", 0.1), ("poisson", 1.0), ("poisson", 2.0))


def make_pages(folder: Path) -> dict[str, Path]:
    """Write a small result of every kind, and its page; returns the pages by kind."""
    made = {
        "run": make_run(folder / "run"),
        "dataset": make_dataset(folder / "dataset"),
        "evaluation": make_evaluation(folder / "evaluation"),
        "training": make_training(folder / "training"),
        "calibration": make_calibration(folder / "calibration"),
        "gate": make_gate(folder / "gate"),
        "control": make_control(folder / "control"),
    }
    return {kind: write_report(path, folder / f"{kind}.html") for kind, path in made.items()}


def make_rows() -> list[dict]:
    """Rows of `evaluation.json` in which every method is better than the one before it."""
    return [
        dataclasses.replace(
            SCORE,
            noise=noise,
            level=level,
            stroke_mm=(),
            method=method,
            rmse_deg=5.0 - rank,
            rmse_ci95_deg=(4.9 - rank, 5.1 - rank),
            paper_rmse_deg=paper_value(noise, level, method, "rmse_deg"),
            is_best=method == METHODS[-1],
        ).to_dict()
        for noise, level in CONDITIONS
        for rank, method in enumerate(METHODS)
    ]


def make_tracks() -> dict[Condition, Record]:
    """A track under each noise of the paper's figures."""
    time = np.arange(0, 10, 0.1)
    truth = 20 * np.sin(time)
    estimates = {method: truth + 0.5 for method in METHODS}
    return dict.fromkeys(CONDITIONS, track(time, truth, truth, estimates))


def make_run(folder: Path, tracks: int = len(CONDITIONS)) -> Path:
    """Write a run folder with everything that a report can show."""
    for name in ("data/train", "data/test", "runs/ram", "runs/direct", "results"):
        (folder / name).mkdir(parents=True)
    for name in ("train", "test"):
        episode = simulate(SMALL, 1e-3 * np.sin(np.arange(0, 6, 0.2)), sample_time=0.1)
        write_episode(folder / "data" / name / "episode_000.mcap", episode)
    model = {"a_per_mm": 1.15, "b_deg_per_mm": 22.38, "c_deg_per_mm": 5.0, "monotone": False, "seed": 17}
    (folder / "coleman_hodgdon.json").write_text(json.dumps(model))
    for name in ("ram", "direct"):
        make_training(folder / "runs" / name, name)
    make_evaluation(folder / "results", tracks)
    Image.fromarray(np.full((20, 40, 3), 200, np.uint8)).save(folder / "bend.png")
    frames = [np.full((64, 128, 3), 30 * level, np.uint8) for level in range(8)]
    write_video(folder / "bend.mp4", frames, 10, 128, 64)
    return folder


def make_dataset(folder: Path) -> Path:
    """Write a dataset of one short episode."""
    make(folder, changed(episodes=1, seconds=2.0))
    return folder


def make_evaluation(folder: Path, tracks: int = 1) -> Path:
    """Write the results of an evaluation."""
    folder.mkdir(parents=True, exist_ok=True)
    protocol = {"initial_error_deg": 15, "test_stroke_mm": [-1, 1]}
    ranked = [MethodRank(name, 5.0 - k, None, 5 - k, None, None) for k, name in enumerate(METHODS)]
    contents = {"protocol": protocol, "rows": make_rows(), "origin": origin_of("endotwin evaluate a", [])}
    contents["ranks"] = [Ranking(SCORE.sample_time_s, (), "", tuple(ranked)).to_dict()]
    (folder / "evaluation.json").write_text(json.dumps(contents))
    save_tracks(folder / "tracks.npz", dict(list(make_tracks().items())[:tracks]))
    return folder


def make_training(folder: Path, agent: str = "ram") -> Path:
    """Write the folder of a training."""
    folder.mkdir(parents=True, exist_ok=True)
    text = f"training:\n  agent: {agent}\n  learning_rate: 0.00025\n  horizon: 1024\n"
    (folder / "config.yaml").write_text(text)
    (folder / "progress.csv").write_text("samples,mean_reward\n1024,-3.0\n2048,-1.5\n")
    return folder


def make_calibration(folder: Path) -> Path:
    """Write the report of a calibration of two logs, one of them only predicted."""
    folder.mkdir(parents=True, exist_ok=True)
    fitted = {"name": "log 0", "sheath_bend_deg": 0.0, "rmse_deg": 0.25, "held_out_rmse_deg": None}
    fitted |= {"coleman_hodgdon_rmse_deg": 1.5, "coleman_hodgdon_held_out_rmse_deg": None}
    unseen = {"name": "log 1", "sheath_bend_deg": None, "rmse_deg": None, "held_out_rmse_deg": 0.75}
    unseen |= {"coleman_hodgdon_rmse_deg": None, "coleman_hodgdon_held_out_rmse_deg": 2.5}
    tension = {"tension_a_rmse_percent_of_range": 4.0, "tension_b_rmse_percent_of_range": None}
    values = {
        "optimizer": "least squares",
        "seed": 3,
        "logs": [fitted | tension, unseen],
        "parameters": {"pretension": {"value": 4.4, "standard_deviation": None}},
        "warnings": ["the logs hardly determine pretension"],
        "origin": origin_of("endotwin calibrate a --predict b", []),
    }
    (folder / "rig_fit.json").write_text(json.dumps(values))
    (folder / "rig.yaml").write_text("pretension: 4.4\n")
    Image.fromarray(np.full((20, 40, 3), 200, np.uint8)).save(folder / "rig_fit.png")
    return folder


def make_gate(folder: Path) -> Path:
    """Write the verdict of a gate that one check speaks against."""
    folder.mkdir(parents=True, exist_ok=True)
    checks = [
        Check(said=f"{spec.claim} Yes.", figure=0.5, bar=1.0, holds=True, name=spec.name) for spec in CHECKS
    ]
    rows = ({"what": "Gaussian", "rival_deg": 1.0, "low_deg": -0.1, "difference_deg": 0.1, "high_deg": 0.2},)
    place = next(k for k, spec in enumerate(CHECKS) if "held-out" in spec.name)
    no = {"said": "it is worse", "figure": 2.0, "bar": 1.0, "holds": False, "rows": rows}
    checks[place] = Check(name=CHECKS[place].name, remedy=CHECKS[place].remedy, **no)
    subject = {"policy": "policy.onnx", "sha256": "0" * 64, "agent": "ram-twins", "preset": "a & b"}
    subject |= {"stroke_mm": [-4.0, 4.0], "sample_time_s": 0.1, "logs": [], "seed": 0, "quick": True}
    origin = origin_of("endotwin gate policy.onnx --quick", [])
    verdict = GateVerdict(checks=tuple(checks), subject=subject | {"version": "1.2.3"})
    write_verdict(verdict, folder / "gate.json", origin)
    return folder


def make_control(folder: Path) -> Path:
    """Write the results of a comparison of three controllers, an oracle among them."""
    folder.mkdir(parents=True, exist_ok=True)
    errors = {"pid": 1.0, "ours": 0.25, "oracle": 0.1}
    totals = [control_total(name, rmse, oracle=name == "oracle") for name, rmse in errors.items()]
    (folder / "control.json").write_text(json.dumps(control_results(*totals)))
    Image.fromarray(np.full((20, 40, 3), 200, np.uint8)).save(folder / "errors.png")
    return folder


def control_total(controller: str, rmse: float, condition: str = "R = 1", **others: object) -> dict:
    """Errors of a controller under a condition, as `control.json` holds them."""
    errors = {"rmse_deg": rmse, "worst_twin_rmse_deg": 2 * rmse, "late_rmse_deg": 3 * rmse}
    errors |= {"late_worst_deg": 4 * rmse, "travel_mm": 11.0, "fallback_share": 0.0}
    errors |= {"percent_of_uncompensated": 100 * rmse, "holding_reversals_per_s": None}
    return {"controller": controller, "oracle": False, "condition": condition} | errors | others


def control_results(*totals: dict, comparisons: tuple[dict, ...] = ()) -> dict:
    """Contents of `control.json`."""
    control = {"version": "1.2.3", "policy_sha256": None, "preset": "a & b", "physics": "mujoco", "twins": 7}
    control |= {"seconds": 40.0, "limits": [{"low_mm": -4.0, "high_mm": 4.0, "speed_mm_s": 5.0}], "seed": 3}
    control |= {"sensor_latency_s": 0.0, "preview_s": 1.0, "candidates": 16, "tuning_seconds": 12.0}
    tuned = {
        "controller": "pid",
        "noise_variance_deg2": 1.0,
        "sample_time_s": 0.02,
        "rmse_deg": 0.7,
        "tried": 16,
    }
    return {
        "control": control,
        "totals": list(totals),
        "comparisons": list(comparisons),
        "tuned": [tuned | {"settings": {"gain": 0.123456}}],
        "origin": origin_of("endotwin control --controller pid ours", []),
    }
