"""SDF files against what SDFormat 1.11 and gz-sim's systems document: names, places, counts, references, inertias.

The simulator itself is not needed: the tables below hold of the specification (http://sdformat.org/spec, version 1.11)
and of the systems' reference pages (https://gazebosim.org/api/sim) the parts that an exported vehicle may use.
"""

from __future__ import annotations

from itertools import product
from xml.etree import ElementTree as xml

import numpy as np
import pytest

from auvnn.exports import export
from tests.exports.cases import VEHICLES, model

NUMBER, NAME, FLAG = "number", "name", "flag"
FLUID = {a + b: (NUMBER, "?") for i, a in enumerate("xyzpqr") for b in "xyzpqr"[i:]}
INERTIA = {"i" + a + b: (NUMBER, "1") for a, b in ("xx", "xy", "xz", "yy", "yz", "zz")}
LIMIT = {"lower": (NUMBER, "1"), "upper": (NUMBER, "1"), "effort": (NUMBER, "?"), "velocity": (NUMBER, "?")}
# Element to what may stand in it: its own content, and how often: "1" once, "?" at most once, "*" any number of times.
MODEL = {
    "pose": ("6 numbers", "?"),
    "static": (FLAG, "?"),
    "link": (
        {
            "pose": ("6 numbers", "?"),
            "inertial": (
                {
                    "pose": ("6 numbers", "?"),
                    "mass": (NUMBER, "?"),
                    "inertia": (INERTIA, "?"),
                    "fluid_added_mass": (FLUID, "?"),
                },
                "?",
            ),
            "collision": (
                {
                    "pose": ("6 numbers", "?"),
                    "geometry": ({"box": ({"size": ("3 numbers", "1")}, "?")}, "1"),
                },
                "*",
            ),
        },
        "*",
    ),
    "joint": (
        {
            "parent": (NAME, "1"),
            "child": (NAME, "1"),
            "axis": ({"xyz": ("3 numbers", "1"), "limit": (LIMIT, "1")}, "?"),
        },
        "*",
    ),
    "plugin": ("a system", "*"),
}
ATTRIBUTES = {"sdf": {"version"}, "model": {"name"}, "link": {"name"}, "collision": {"name"},
              "joint": {"name", "type"}, "plugin": {"filename", "name"}}  # fmt: skip
FORCES, SPEEDS = "xyzkmn", "UVWPQR"
SYSTEMS = {
    "Hydrodynamics": (
        {"link_name"},
        {"link_name", "water_density", "namespace", "default_current", "disable_coriolis", "disable_added_mass"}
        | {a + b for a, b in product(FORCES, SPEEDS)}
        | {a + b + c for a, b, c in product(FORCES, SPEEDS, SPEEDS)}
        | {f"{a}{b}abs{c}" for a, b, c in product(FORCES, SPEEDS, SPEEDS)}
        | {f"{a}Dot{b}" for a, b in product(FORCES, SPEEDS)},
    ),
    "Thruster": (
        {"joint_name"},
        {"namespace", "topic", "joint_name", "use_angvel_cmd", "fluid_density", "propeller_diameter",
         "thrust_coefficient", "velocity_control", "p_gain", "i_gain", "d_gain", "max_thrust_cmd", "min_thrust_cmd",
         "deadband", "wake_fraction", "alpha_1", "alpha_2"},
    ),
    "LiftDrag": (
        {"link_name"},
        {"link_name", "air_density", "area", "a0", "cla", "cda", "cp", "forward", "upward", "alpha_stall", "cla_stall",
         "cda_stall", "control_joint_name", "cm_delta"},
    ),
    "JointPositionController": (
        {"joint_name"},
        {"joint_name", "joint_index", "use_velocity_commands", "topic", "sub_topic", "cmd_max", "cmd_min", "cmd_offset",
         "p_gain", "i_gain", "d_gain", "i_max", "i_min", "initial_position"},
    ),
}  # fmt: skip
FILES = {
    "Hydrodynamics": "gz-sim-hydrodynamics-system",
    "Thruster": "gz-sim-thruster-system",
    "LiftDrag": "gz-sim-lift-drag-system",
    "JointPositionController": "gz-sim-joint-position-controller-system",
}
CASES = [*VEHICLES, "networks", "everything"]


@pytest.fixture(scope="module", params=CASES)
def root(request, tmp_path_factory) -> xml.Element:
    folder = tmp_path_factory.mktemp("sdf") / "out"
    export(model(request.param), "sdf", folder)
    return xml.parse(folder / "model.sdf").getroot()


def plain(element: xml.Element) -> list[xml.Element]:
    """Return the children but those of another namespace, which SDFormat lets stand anywhere."""
    return [child for child in element if not child.tag.startswith("{urn:auvnn}")]


def check(element: xml.Element, allowed: object, where: str) -> None:
    assert set(element.attrib) == ATTRIBUTES.get(element.tag, set()), where
    assert all(element.attrib.values()), where
    if isinstance(allowed, dict):
        count = dict.fromkeys(allowed, 0)
        for child in plain(element):
            assert child.tag in allowed, f"{where}: <{child.tag}>"
            count[child.tag] += 1
            check(child, allowed[child.tag][0], f"{where}/{child.tag}")
        for name, (_, often) in allowed.items():
            assert often == "*" or count[name] <= 1, f"{where}: {name} twice"
            assert often != "1" or count[name] == 1, f"{where}: no {name}"
        return
    if allowed == "a system":
        return
    assert not plain(element) and element.text, where
    words = element.text.split()
    if allowed == FLAG:
        assert element.text in ("true", "false", "0", "1"), where
    elif allowed != NAME:
        wanted = 1 if allowed == NUMBER else int(str(allowed)[0])
        assert len(words) == wanted and np.isfinite([float(w) for w in words]).all(), where


def test_elements_stand_where_the_specification_has_them(root):
    assert root.tag == "sdf" and root.get("version") == "1.11"
    [main] = plain(root)
    check(main, MODEL, "model")


def test_names_are_unique_and_refer_to_what_is_there(root):
    main = root.find("model")
    names = [e.get("name") for e in plain(main) if e.tag in ("link", "joint")]
    assert len(set(names)) == len(names) and not {"world", "__model__"} & set(names)
    links = {e.get("name") for e in main.iter("link")}
    joints = {e.get("name"): e for e in main.iter("joint")}
    for name, joint in joints.items():
        parent, child = joint.findtext("parent"), joint.findtext("child")
        assert {parent, child} <= links and parent != child, name
        assert joint.get("type") in ("revolute", "continuous", "prismatic", "fixed"), name
        axis = np.array([float(v) for v in joint.findtext("axis/xyz").split()])
        assert np.linalg.norm(axis) == pytest.approx(1.0, abs=1e-9), name
        assert float(joint.findtext("axis/limit/lower")) < float(joint.findtext("axis/limit/upper")), name
    for plugin in main.iter("plugin"):
        assert plugin.findtext("link_name", "base_link") in links
        assert plugin.findtext("joint_name", next(iter(joints), None)) in {*joints, None}


def test_systems_are_given_what_they_know(root):
    for plugin in root.iter("plugin"):
        kind = plugin.get("name").removeprefix("gz::sim::systems::")
        needed, known = SYSTEMS[kind]
        assert plugin.get("filename") == FILES[kind]
        given = [child.tag for child in plain(plugin)]
        assert needed <= set(given) <= known, sorted(set(given) - known)
        assert len(set(given)) == len(given)


def test_every_link_has_a_mass_and_an_inertia_that_a_body_can_have(root):
    """Positive definite, and of the principal moments none larger than the sum of the others: gz refuses else."""
    for link in root.iter("link"):
        inertial = link.find("inertial")
        assert float(inertial.findtext("mass")) > 0.0
        i = {name: float(inertial.findtext(f"inertia/{name}")) for name in INERTIA}
        tensor = np.array(
            [[i["ixx"], i["ixy"], i["ixz"]], [i["ixy"], i["iyy"], i["iyz"]], [i["ixz"], i["iyz"], i["izz"]]]
        )
        moments = np.linalg.eigvalsh(tensor)
        assert moments[0] > 0.0 and moments[2] <= (moments[0] + moments[1]) * (1 + 1e-6), link.get("name")
        added = inertial.find("fluid_added_mass")
        if added is not None:
            upper = np.zeros((6, 6))
            for (a, b), child in (((("xyzpqr".index(c.tag[0])), "xyzpqr".index(c.tag[1])), c) for c in added):
                upper[a, b] = upper[b, a] = float(child.text)
            assert np.linalg.eigvalsh(upper)[0] >= -1e-9 * np.abs(upper).max()
