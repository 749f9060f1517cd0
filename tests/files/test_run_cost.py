import contextlib
import os
import time

import pytest

from twin.files.run_folder import COST_FILE, counted_cost, read_cost


def work(seconds):
    until = time.process_time() + seconds
    while time.process_time() < until:
        pass


def test_processor_time_is_counted_and_waiting_is_not(tmp_path):
    assert read_cost(tmp_path) is None
    with counted_cost(tmp_path):
        work(0.2)
        time.sleep(0.5)
    assert 0.15 <= read_cost(tmp_path) < 0.6


def test_parts_of_a_run_that_was_stopped_add_up(tmp_path):
    with counted_cost(tmp_path):
        work(0.2)
    first = read_cost(tmp_path)
    with contextlib.suppress(KeyboardInterrupt), counted_cost(tmp_path):
        work(0.2)
        raise KeyboardInterrupt
    assert read_cost(tmp_path) >= first + 0.15


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("{}", "processor_s is missing"),
        ('{"processor_s": -1}', "processor_s = -1: must be"),
        ('{"processor_s": "1"}', "processor_s"),
        ('{"processor_s": NaN}', COST_FILE),
        ("[1]", "is not a JSON object"),
        ('{"processor_s": 1,', COST_FILE),
    ],
)
def test_a_file_of_that_name_that_is_something_else_is_named_and_stays(tmp_path, content, told):
    path = tmp_path / COST_FILE
    path.write_text(content)
    with pytest.raises(ValueError, match=COST_FILE) as refused, counted_cost(tmp_path):
        raise AssertionError("it was begun")
    assert told in str(refused.value)
    assert path.read_text() == content


def test_a_link_is_not_followed(tmp_path):
    (tmp_path / "elsewhere").write_text('{"processor_s": 1}')
    os.symlink(tmp_path / "elsewhere", tmp_path / COST_FILE)
    with pytest.raises(ValueError, match=COST_FILE), counted_cost(tmp_path):
        pass
    assert (tmp_path / "elsewhere").read_text() == '{"processor_s": 1}'
