"""`auvnn remove`: what is left is told, and what of it does nothing any more."""

from auvnn.models import load


def test_what_does_nothing_without_the_effect_that_is_removed_is_said(auvnn, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    water = {"ocean_current": {"v_north": 0.1}, "drag_only_current": {"share": 0.5}}
    load("rov95").with_effects(water).save("with")
    status, out, _ = auvnn("remove", "model=with", "effect=ocean_current", "out=without")
    assert status == 0
    assert (
        "drag_only_current does nothing without ocean_current, current_shear or waves: remove it too" in out
    )
    status, out, _ = auvnn("remove", "model=with", "effect=drag_only_current", "out=still")
    assert status == 0 and "does nothing" not in out
