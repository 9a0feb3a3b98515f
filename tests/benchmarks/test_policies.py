"""Names of policies, and policies from elsewhere."""

import re

import pytest

from artgym.errors import DamagedFileError, InvalidArgumentError, UnknownNameError
from benchmarks.policies import POLICIES, policy_entry


def test_unknown_policy_names_the_nearest():
    with pytest.raises(UnknownNameError) as caught:
        policy_entry("exprt")
    assert caught.value.nearest == "expert"
    assert all(name in str(caught.value) for name in POLICIES)


@pytest.mark.parametrize("name", ["nowhere:Policy", "benchmarks.policies:Nothing", ":", "..a:B"])
def test_what_cannot_be_imported_is_named(name):
    with pytest.raises(InvalidArgumentError, match=re.escape(repr(name))):
        policy_entry(name)


def test_a_class_without_the_methods_is_refused():
    with pytest.raises(InvalidArgumentError, match=r"no method reset\(\)"):
        policy_entry("pathlib:Path")


def test_only_policies_that_look_need_a_renderer():
    modes = {name: entry.obs_mode for name, entry in POLICIES.items()}
    assert modes == {
        "zero": "state",
        "random": "state",
        "surface_normal": "rgbd",
        "icaf4": "rgbd",
        "expert": "state",
    }


def test_missing_weights_are_named(tmp_path):
    from benchmarks.policies import load_perception

    with pytest.raises(DamagedFileError, match=r"drawer\.json"):
        load_perception("drawer", tmp_path)
