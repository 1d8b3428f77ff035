"""Files for ROS and Spot against their messages: committed tables of fields, and the makers' own where
installed."""

from __future__ import annotations

import json
from dataclasses import fields, is_dataclass

import numpy as np
import pytest

from robots.formats import export_trajectory
from tests.makers.robots import planned_motions
from tests.makers.robots.messages import BOSDYN, ROS, ROS_FILES, SPOT_FILES, faults

# packages of the messages that ROS' own definitions have; MoveIt's are registered from the table
PACKAGES = ("builtin_interfaces", "std_msgs", "geometry_msgs", "trajectory_msgs", "moveit_msgs")


@pytest.fixture(scope="module", params=planned_motions.SOURCES)
def handed(request, tmp_path_factory):
    """A source, and the folder with its files."""
    source, out = planned_motions.SOURCES[request.param](), tmp_path_factory.mktemp("handed")
    export_trajectory(source, ["ros2", "moveit", "spot"], out)
    return source, out


def ros_files(source, folder):
    expected = {n for n in ROS_FILES if n != "base_trajectory.yaml" or source.robot.planar}
    found = {p.name: planned_motions.read_yaml(p) for p in folder.glob("*.yaml")}
    assert set(found) == expected
    return found


def spot_files(source, folder):
    found = {p.stem: p.read_text(encoding="utf-8") for p in (folder / "spot").iterdir()}
    kinds = ("arm_impedance", "body") if source.robot.planar else ("arm_impedance",)
    legs = ["1_approach", "3_move", "5_retreat"]
    if source.robot.planar:  # the hand moves while its claw closes and opens
        legs += ["2_close", "4_open"]
    assert set(found) == {f"{kind}_{leg}" for kind in kinds for leg in legs}
    return {name: (SPOT_FILES[name.rsplit("_", 2)[0]], text) for name, text in found.items()}


def test_files_have_the_fields_of_their_messages(handed):
    for name, message in ros_files(*handed).items():
        assert faults(message, ROS_FILES[name], ROS) == []
    for kind, text in spot_files(*handed).values():
        assert faults(json.loads(text), kind, BOSDYN, complete=False) == []


# --- ROS, by the definitions that rosbags carries


@pytest.fixture(scope="module")
def ros():
    """ROS 2's types, with MoveIt's three from our table, which is written from moveit_msgs' branch ros2."""
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    for name in ("CartesianPoint", "CartesianTrajectoryPoint", "CartesianTrajectory"):
        text = "\n".join(f"{full(store, kind)} {field}" for field, kind in ROS[name].items())
        store.register(typesys.get_types_from_msg(text, f"moveit_msgs/msg/{name}"))
    return store


def full(store, kind):
    """Name of a type of our table with its package, as a .msg file has it."""
    plain, array = kind.removesuffix("[]"), "[]" if kind.endswith("[]") else ""
    found = [f"{p}/msg/{plain}" for p in PACKAGES if f"{p}/msg/{plain}" in store.types]
    return (found[0] if found else plain) + array


def built(store, kind, value):
    """The typed message of plain values; a field that is missing or unknown is a KeyError."""
    definition = store.get_msgdef(kind)
    unknown = set(value) - {name for name, _ in definition.fields}
    if unknown:
        raise KeyError(unknown)
    typed = {name: _value(store, field, value[name]) for name, field in definition.fields}
    return store.types[kind](**typed)


def _value(store, field, value):
    node, inner = field
    if node.name == "BASE":
        return value
    if node.name == "NAME":
        return built(store, inner, value)
    element = inner[0]
    if element[0].name == "BASE" and element[1][0] == "float64":
        return np.array(value, dtype=np.float64)
    return [_value(store, element, v) for v in value]


def plain(message):
    """A typed message as plain values."""
    if is_dataclass(message):
        return {f.name: plain(getattr(message, f.name)) for f in fields(message) if f.name != "__msgtype__"}
    if isinstance(message, np.ndarray):
        return message.tolist()
    return [plain(m) for m in message] if isinstance(message, list) else message


def test_ros_takes_the_files_and_gives_back_the_same(handed, ros):
    for name, message in ros_files(*handed).items():
        kind = full(ros, ROS_FILES[name])
        assert "/" in kind
        binary = ros.serialize_cdr(built(ros, kind, message), kind)
        assert plain(ros.deserialize_cdr(binary, kind)) == message
        broken = {**message, "points": [{**message["points"][0], "velocity": []}]}
        with pytest.raises(KeyError):
            built(ros, kind, broken)


def test_our_table_of_ros_messages_is_ros_own(ros):
    for name, table in ROS.items():
        kind = full(ros, name)
        found = {}
        for field, (node, inner) in ros.get_msgdef(kind).fields:
            array = "[]" if node.name == "SEQUENCE" else ""
            base, label = inner[0] if array else (node, inner)
            found[field] = (label[0] if base.name == "BASE" else label.split("/")[-1]) + array
        assert list(found.items()) == list(table.items()), name


# --- Spot, by bosdyn-api


def bosdyn_kind(name):
    module = {"ArmImpedanceCommand": "arm_command_pb2", "SE2TrajectoryCommand": "basic_command_pb2"}
    command = name.split(".")[0]
    api = pytest.importorskip(f"bosdyn.api.{module[command]}")
    return getattr(api, command).Request


def test_spots_own_library_takes_the_files_and_gives_back_the_same(handed):
    json_format = pytest.importorskip("google.protobuf.json_format")
    for kind, text in spot_files(*handed).values():
        message = json_format.Parse(text, bosdyn_kind(kind)(), ignore_unknown_fields=False)
        binary = bosdyn_kind(kind).FromString(message.SerializeToString())
        again = json_format.MessageToDict(binary, always_print_fields_with_no_presence=True)
        assert same(json.loads(text), again) == []
        with pytest.raises(json_format.ParseError):
            json_format.Parse('{"stiffness": 1}', bosdyn_kind(kind)())


def same(ours, theirs, where=""):
    """Where a value of ours is not the library's; seconds are compared as numbers, it drops trailing
    zeros."""
    if isinstance(ours, dict):
        return [f for k, v in ours.items() for f in same(v, theirs.get(k), f"{where}.{k}")]
    if isinstance(ours, list):
        if len(ours) != len(theirs or ()):
            return [f"{where}: {len(ours)} elements"]
        return [f for k, v in enumerate(ours) for f in same(v, theirs[k], f"{where}[{k}]")]
    if where.endswith("timeSinceReference"):
        ours, theirs = float(ours[:-1]), float(theirs[:-1])
    return [] if ours == theirs else [f"{where}: {ours!r} is not {theirs!r}"]


def test_our_table_of_spots_messages_is_the_librarys():
    left, seen = [bosdyn_kind(kind).DESCRIPTOR for kind in SPOT_FILES.values()], {}
    while left:
        kind = left.pop()
        name = kind.full_name.removeprefix("bosdyn.api.")
        if name in BOSDYN and name not in seen:
            seen[name] = {f.json_name for f in kind.fields}
            left += [f.message_type for f in kind.fields if f.message_type]
    assert seen == {name: set(fields) for name, fields in BOSDYN.items()}
