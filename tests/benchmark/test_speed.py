"""Jobs that take turns: by which clock, and what does not count."""

from scripts.benchmarks.harness import in_turn


def test_two_jobs_take_turns_and_the_first_turn_does_not_count():
    done, now = [], [0.0]
    costs = {"a": iter([100, 1, 5, 2]), "b": iter([100, 20, 10, 90])}

    def job(name):
        done.append(name)
        now[0] += next(costs[name])

    assert in_turn(lambda: job("a"), lambda: job("b"), repeats=3, clock=lambda: now[0]) == (2, 20)
    assert done == ["a", "b"] * 4
