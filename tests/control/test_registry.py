"""The controller table: one call adds one, and a name that is none says which there are."""

import pytest
from controlled import knowledge

from twin.control import controller as registry
from twin.control.controller import ControllerSpec, Setting, controller_specs, find_controllers
from twin.control.controllers.feedback import LINEAR, LinearMap

SETTINGS = {"gain": Setting(2.0, 1.0, 9.0), "rate_per_s": Setting(0.5, 0.1, 1.0)}


@pytest.fixture
def new(monkeypatch) -> ControllerSpec:
    """A controller between two others, registered for one test."""
    controller_specs()  # all files are imported before the table is copied
    monkeypatch.setattr(registry, "_SPECS", dict(registry._SPECS))

    def build(known, settings):
        made = LinearMap(known, {})
        made.settings = settings
        return made

    return registry.register_controller(ControllerSpec("my-law", 1.5, "nothing", build, SETTINGS))


def test_a_new_one_is_found_by_its_name_and_among_all_in_its_place(new):
    assert find_controllers(["my-law"]) == (new,)
    names = [spec.name for spec in find_controllers(["all"])]
    assert names == [spec.name for spec in controller_specs()]
    assert names[names.index("my-law") - 1 : names.index("my-law") + 2] == [
        "model-inverse",
        "my-law",
        "twin-inverse",
    ]
    assert len(names) == len(set(names))


def test_it_is_made_with_what_was_tuned_for_it_and_defaults_elsewhere(new):
    tuned = knowledge(settings={"my-law": {"gain": 7.0}, "pid": {"rate_per_s": 9.0}})
    assert new.make(tuned).settings == {"gain": 7.0, "rate_per_s": 0.5}
    assert new.make(knowledge()).settings == {"gain": 2.0, "rate_per_s": 0.5}
    assert new.make(tuned) is not new.make(tuned)


def test_a_second_one_of_a_name_is_refused_and_the_first_stays(new):
    with pytest.raises(ValueError, match="controller 'linear' is registered already"):
        registry.register_controller(ControllerSpec("linear", 9, "all", new.build))
    assert find_controllers(["linear"]) == (LINEAR,)


def test_defaults_are_within_their_search():
    for spec in controller_specs():
        for setting in spec.settings.values():
            assert 0 < setting.low < setting.default < setting.high
