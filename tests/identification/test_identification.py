"""Identification: known parameters come back, an independent optimiser agrees, bad records are refused."""

import dataclasses
import itertools
import json

import numpy as np
import pytest
from scipy.optimize import differential_evolution, lsq_linear

from scripts.identify import main
from scripts.import_log import main as import_log
from twin.hysteresis import MODELS, BoucWen, ColemanHodgdon, PrandtlIshlinskii, load_model
from twin.hysteresis.prandtl_ishlinskii import plays_along
from twin.identification import NEVER_REVERSES, identify, mean_square_error
from twin.identification.coleman_hodgdon import LOWER, UPPER
from twin.signals.excitation import SIGNALS, command

PAPER = (1.15, 22.38, 5.0)
OTHER = (0.4, 35.0, 21.0)
TIME = np.arange(300) * 0.1  # [s]


def records_of(parameters, noise_deg: float = 0.0) -> list[tuple[np.ndarray, np.ndarray]]:
    """Two strokes, by a loop over eq. 4 independent of the module. Noise spares the first sample."""
    a, b, c = parameters
    rng = np.random.default_rng(8)
    records = []
    for amplitude, period in ((1.0, 10.0), (0.5, 7.0)):
        pull = 3 + amplitude * np.sin(2 * np.pi * TIME / period)
        bend = [60.0]
        for before, now in itertools.pairwise(pull):
            bend.append(bend[-1] + a * abs(now - before) * (b * now - bend[-1]) + c * (now - before))
        noise = noise_deg * rng.standard_normal(len(pull))
        noise[0] = 0
        records.append((pull, np.array(bend) + noise))
    return records


def noisy_records(model, seed: int, stroke=(2.0, 4.0), each: int = 1) -> list[tuple[np.ndarray, np.ndarray]]:
    """Records of 60 s of every signal, reached from rest at zero, with the training noise R = 0.1 deg^2."""
    rng = np.random.default_rng(seed)
    low, high = (edge * 1e-3 for edge in stroke)
    records = []
    for kind in list(SIGNALS) * each:
        pull = command(kind, (low, high), 60.0, 0.1, rng) * 1e3
        approach = np.linspace(0, pull[0], 100)
        bend = model.response(np.concatenate([approach, pull]), 0.0)[100:]
        records.append((pull, bend + np.sqrt(0.1) * rng.standard_normal(600)))
    return records


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A folder with one measured log, as `endotwin import` makes it."""
    folder = tmp_path_factory.mktemp("measured")
    drive = 90 * np.sin(2 * np.pi * TIME / 7)
    angle = ColemanHodgdon(0.05, 0.8, 0.3).response(drive, 0.0)
    rows = [f"{t:.1f},{command:.4f},{bend:.4f}" for t, command, bend in zip(TIME, drive, angle, strict=True)]
    (folder / "log.csv").write_text("\n".join(["time_s,command_deg,angle_deg", *rows]))
    assert import_log(["--out", str(folder / "data"), str(folder / "log.csv")]) == 0
    return folder / "data"


def parameters_of(model) -> np.ndarray:
    return np.array(dataclasses.astuple(model))


@pytest.mark.parametrize("known", [PAPER, OTHER])
def test_genetic_algorithm_recovers_known_parameters(known):
    model, rmse = identify(records_of(known), seed=1)
    np.testing.assert_allclose(parameters_of(model), known, rtol=0.01)
    assert rmse < 0.05


def test_differential_evolution_finds_the_same_optimum_with_noise():
    records = records_of(PAPER, noise_deg=1.0)

    def cost(candidates: np.ndarray) -> np.ndarray:
        """Sum of squares of each column of (3, S) candidates, with its own forward simulation."""
        a, b, c = candidates
        total = np.zeros(candidates.shape[1:])
        for pull, measured in records:
            bend = np.full(candidates.shape[1:], measured[0])
            for k in range(1, len(pull)):
                move = pull[k] - pull[k - 1]
                bend = bend + a * abs(move) * (b * pull[k] - bend) + c * move
                total += (bend - measured[k]) ** 2
        return total

    other = differential_evolution(
        cost, list(zip(LOWER, UPPER, strict=True)), rng=0, vectorized=True, updating="deferred", maxiter=150
    )
    model, rmse = identify(records, seed=2)
    np.testing.assert_allclose(parameters_of(model), other.x, rtol=0.01)
    np.testing.assert_allclose(parameters_of(model), PAPER, rtol=0.02)
    assert rmse == pytest.approx(np.sqrt(other.fun / (2 * len(TIME))), rel=1e-3)
    assert rmse == pytest.approx(1.0, abs=4 / np.sqrt(2 * 2 * len(TIME)))  # four standard errors


def test_mean_square_error_pools_the_samples_of_unequal_records():
    records = records_of(PAPER)
    records[1] = tuple(values[:100] for values in records[1])
    (_, one), (_, two) = records
    shifted = [(records[0][0], one + 1), (records[1][0], two + 1)]  # the first sample moves along
    candidates = np.array([[1.15, 22.38, 5.0], [2.0, 10.0, 8.0]])
    model = ColemanHodgdon(*candidates.T[..., None])
    expected = []
    for candidate in candidates:
        single = ColemanHodgdon(*candidate)
        errors = [single.response(pull, bend[0]) - bend for pull, bend in shifted]
        expected.append(np.mean(np.concatenate(errors) ** 2))
    np.testing.assert_allclose(mean_square_error(model, shifted), expected, rtol=1e-12)
    assert mean_square_error(ColemanHodgdon(*PAPER), records) < 1e-20


def test_diverging_candidate_is_worse_than_any_other_and_finite():
    pull = np.tile([0.0, 4.0], 2000)
    error = mean_square_error(ColemanHodgdon(np.array([[6.0], [0.1]]), 20.0, 5.0), [(pull, pull)])
    assert np.isfinite(error).all()
    assert error[0] > error[1]


def test_monotone_constraint_holds_and_costs_accuracy_where_the_truth_is_not_monotone():
    records = records_of(PAPER)
    free, free_rmse = identify(records, seed=1, generations=40)
    bound, bound_rmse = identify(records, seed=1, generations=40, monotone=True)
    assert not free.monotone()
    assert bound.c_deg_per_mm >= bound.b_deg_per_mm / 2
    assert bound_rmse > 2 * free_rmse
    model, _ = identify(records_of(OTHER), seed=1, monotone=True)  # the truth lies inside the constraint
    np.testing.assert_allclose(parameters_of(model), OTHER, rtol=0.01)


def test_same_seed_gives_the_same_result_and_progress_never_gets_worse():
    told = []
    records = records_of(PAPER, noise_deg=0.5)

    def fit(seed, on_generation=None):
        return identify(records, seed, population=20, generations=15, on_generation=on_generation)

    model, rmse = fit(5, lambda generation, best: told.append((generation, best)))
    assert fit(5) == (model, rmse)
    assert fit(6) != (model, rmse)
    generations, best = zip(*told, strict=True)
    assert generations == tuple(range(1, 16))
    assert (np.diff(best) <= 0).all()
    assert best[0] > best[-1] == rmse


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_coleman_hodgdon_comes_back_from_noisy_signals_within_two_percent(seed):
    model, rmse = identify(noisy_records(ColemanHodgdon(*PAPER), seed), seed)
    np.testing.assert_allclose(parameters_of(model), PAPER, rtol=0.02)
    assert rmse == pytest.approx(np.sqrt(0.1), rel=0.05)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_bouc_wen_comes_back_from_noisy_signals_within_two_percent(seed):
    """Ten records: from five, sigma has a standard error of 1 % at best (Cramer and Rao)."""
    known = BoucWen(22.0, -15.0, 1.7, 0.9, 1.5)
    records = noisy_records(known, seed, each=2)
    model, rmse = identify(records, seed, "bouc-wen", population=24, generations=12)
    np.testing.assert_allclose(parameters_of(model), parameters_of(known), rtol=0.02)
    assert rmse == pytest.approx(np.sqrt(0.1), rel=0.05)


def test_bouc_wen_ends_where_no_direction_leads_further_down():
    """The gradient of the mean square error vanishes, by differences of its own."""
    records = noisy_records(BoucWen(20.0, 9.0, 2.5, 1.2, 2.0), 4)  # leads instead of lagging
    model, rmse = identify(records, 0, "bouc-wen", population=24, generations=12)
    best = parameters_of(model)
    assert rmse**2 == pytest.approx(mean_square_error(model, records))
    for i in range(5):
        ends = []
        for way in (1, -1):
            near = best.copy()
            near[i] *= 1 + way * 1e-3
            ends.append(float(mean_square_error(BoucWen(*near), records)))
        assert min(ends) > rmse**2
        assert abs(ends[0] - ends[1]) < 0.1 * (sum(ends) / 2 - rmse**2)


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize(("stroke", "thresholds"), [((2.0, 4.0), (0.0, 0.25, 0.5, 0.75)), ((-8.0, 8.0), ())])
def test_prandtl_ishlinskii_comes_back_from_noisy_signals_within_two_percent(seed, stroke, thresholds):
    """Neighbouring plays differ little: eight thresholds inside 2 mm would need hundreds of records."""
    truth = PrandtlIshlinskii((7.0, 5.0, 6.0, 5.0), thresholds)
    if not thresholds:  # those that are spread over the stroke: eight, up to half of it
        truth = PrandtlIshlinskii((5.0, 3.0, 4.0, 3.0, 3.0, 4.0, 3.0, 4.0), tuple(map(float, range(8))))
    records = noisy_records(truth, seed, stroke, each=6)
    model, rmse = identify(records, 0, "prandtl-ishlinskii", thresholds_mm=thresholds)
    np.testing.assert_allclose(model.thresholds_mm, truth.thresholds_mm, atol=2e-3)
    np.testing.assert_allclose(model.weights_deg_per_mm, truth.weights_deg_per_mm, rtol=0.02)
    assert rmse == pytest.approx(np.sqrt(0.2), rel=0.15)  # the noise, and that of the first angles


def test_weights_are_those_of_another_solver_with_the_level_of_each_record_free():
    records = [
        (pull, bend + 9 * i) for i, (pull, bend) in enumerate(noisy_records(ColemanHodgdon(*PAPER), 5))
    ]
    thresholds = (0.0, 0.1, 0.2, 0.4, 0.8)
    model, _ = identify(records, 0, "prandtl-ishlinskii", thresholds_mm=thresholds)
    design = np.concatenate([plays_along(pull, thresholds).T for pull, _ in records])
    levels = np.kron(np.eye(len(records)), np.ones((600, 1)))
    lower = np.repeat([0.0, -np.inf], [len(thresholds), len(records)])
    other = lsq_linear(
        np.hstack([design, levels]), np.concatenate([bend for _, bend in records]), (lower, np.inf), tol=1e-12
    ).x[: len(thresholds)]
    assert 0.0 in model.weights_deg_per_mm  # the bound is at work here
    np.testing.assert_allclose(model.weights_deg_per_mm, other, atol=1e-5)


@pytest.mark.parametrize("name", MODELS)
def test_records_that_cannot_identify_a_loop_are_refused(name):
    moving, bend = records_of(PAPER)[0]
    rising = np.linspace(2, 4, 50)
    with_gap = bend.copy()
    with_gap[7] = np.nan
    for records, rule in (
        ([], "no record"),
        ([(rising, 20 * rising)], "never reverses"),
        ([(rising, 20 * rising), (rising[::-1], 20 * rising)], "never reverses"),
        ([(np.full(50, 3.0), np.full(50, 60.0))], "record 0: the command never moves"),
        ([(moving, bend), (moving, with_gap)], "record 1: command and angle must be finite"),
        ([(np.where(TIME > 3, np.inf, moving), bend)], "record 0: command and angle must be finite"),
    ):
        with pytest.raises(ValueError, match=rule):
            identify(records, 0, name)
    assert "reversal" in NEVER_REVERSES


@pytest.mark.parametrize(
    ("options", "rule"),
    [
        (
            {"name": "preisach"},
            "unknown model 'preisach'; valid: coleman-hodgdon, bouc-wen, prandtl-ishlinskii",
        ),
        ({"name": "bouc-wen", "monotone": True}, "coleman-hodgdon models only, not bouc-wen"),
        ({"name": "prandtl-ishlinskii", "monotone": True}, "coleman-hodgdon models only"),
        ({"name": "bouc-wen", "thresholds_mm": (0.0, 1.0)}, "prandtl-ishlinskii models only"),
        ({"name": "prandtl-ishlinskii", "thresholds_mm": (0.0, -1.0)}, "not negative"),
        ({"name": "prandtl-ishlinskii", "thresholds_mm": (0.5, 0.5)}, "must be different"),
        ({"population": 3}, "population 3"),
        ({"name": "bouc-wen", "generations": 0}, "generations 0"),
    ],
)
def test_option_that_a_model_does_not_have_is_refused(options, rule):
    with pytest.raises(ValueError, match=rule):
        identify(records_of(PAPER), 0, **options)


@pytest.mark.parametrize("name", MODELS)
def test_command_writes_the_model_and_names_its_parameters(name, tmp_path, monkeypatch, capsys, recorded):
    monkeypatch.chdir(tmp_path)
    words = [str(recorded), "--model", name, "--population", "8", "--generations", "3"]
    assert main(words) == 0
    line = capsys.readouterr().out
    file = tmp_path / f"{name.replace('-', '_')}.json"
    values = json.loads(file.read_text())
    model = load_model(file)
    assert model.name == values["model"] == name
    assert line.startswith(f"{file.name}: ")
    assert f"RMSE {values['rmse_deg']:.3f} deg over 1 records" in line
    for parameter in (field.name for field in dataclasses.fields(model)):
        assert f"{parameter} = " in line
        assert parameter in values
    assert main([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"out": file.name, **values}


def test_command_refuses_a_constraint_that_the_model_does_not_have(tmp_path, monkeypatch, capsys, recorded):
    monkeypatch.chdir(tmp_path)
    assert main([str(recorded), "--model", "bouc-wen", "--monotone"]) == 2
    assert "coleman-hodgdon models only, not bouc-wen" in capsys.readouterr().err
    assert not list(tmp_path.glob("*.json"))
