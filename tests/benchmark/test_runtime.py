"""The measurement of one deployed sample, at small size: both are really called, in turn."""

from twin.benchmark import runtime


def test_it_times_the_runtime_and_its_peer(ram_policy, monkeypatch):
    monkeypatch.setattr(runtime, "SAMPLES", 20)
    monkeypatch.setattr(runtime, "AT_ONCE", 10)
    found = runtime.one_sample(ram_policy)
    sample, latest = found["runtime_sample"], found["runtime_latest"]
    assert 0 < sample.value <= latest.value
    assert sample.holds == (sample.value <= sample.peer_value)
    assert latest.peer_value == sample.value


def test_blocks_take_turns_and_the_first_is_not_counted(monkeypatch):
    monkeypatch.setattr(runtime, "SAMPLES", 6)
    monkeypatch.setattr(runtime, "AT_ONCE", 3)
    called = []
    times = runtime._in_turn(lambda: called.append("a"), lambda: called.append("b"))
    assert called == list("aaabbb" * 3)
    assert [len(of) for of in times] == [6, 6]
