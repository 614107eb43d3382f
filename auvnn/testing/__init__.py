"""Contract checks that ship with the package, so that other authors' parts inherit them.

    @pytest.mark.parametrize("check", testing.EFFECT_CHECKS)
    def test_my_effect(check):
        testing.EFFECT_CHECKS[check](MyEffect)

Each check is a function of a class that raises an `AssertionError` which says what is broken.
"""

from auvnn.testing.damping_checks import DAMPING_CHECKS, check_damping_form
from auvnn.testing.effect_checks import EFFECT_CHECKS, check_effect
from auvnn.testing.scene import Scene, example_vehicle, make_scene, plain_vehicle

__all__ = [
    "DAMPING_CHECKS",
    "EFFECT_CHECKS",
    "Scene",
    "check_damping_form",
    "check_effect",
    "example_vehicle",
    "make_scene",
    "plain_vehicle",
]
