"""Those of the forty recordings that are not text."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import scipy.io

from tests.importing import rig
from tests.importing.wild import (
    ANGLE,
    COMMAND,
    CURRENT,
    DEG,
    JOINT,
    LOAD,
    MOTOR_RATE,
    OTHER,
    RATE,
    REFERENCE,
    RPM,
    TIME,
    TORQUE,
    WARMTH,
    Wild,
    texts,
)


def dspace(path: Path) -> None:
    m = rig.trapezoids(40)
    signals = [
        {"Name": f'"{name}"', "Path": "Model Root/Axis/Out1", "Data": data, "XIndex": 1.0}
        for name, data in (("q", m.q), ("w", m.v), ("tau", m.tau), ("u", m.i * 2))
    ]
    scipy.io.savemat(path, {"rec1_001": {"X": [{"Name": "", "Data": m.t}], "Y": signals}})


def bearing(path: Path) -> None:
    """Three rates, whose clocks only their lengths tell apart."""
    slow, fast = np.arange(4001) / 4000, np.arange(64001) / 64000
    chance = np.random.default_rng(4)
    own = {
        "force": 1000 + chance.normal(0, 3, 4001),
        "phase_current_1": 2 * np.sin(300 * fast),
        "phase_current_2": 2 * np.sin(300 * fast + 2.1),
        "speed": 1500 + chance.normal(0, 2, 4001),
        "temp_2_bearing_module": np.linspace(45, 45.3, 5),
        "torque": 0.7 + chance.normal(0, 0.05, 4001),
        "vibration_1": chance.normal(0, 1, 64001),
    }
    clocks = [{"Name": "", "Data": each} for each in (slow, fast, np.arange(5.0))]
    signals = [{"Name": name, "Data": data} for name, data in own.items()]
    scipy.io.savemat(path, {"rec": {"X": clocks, "Y": signals}})


def positioning(path: Path, pulses: bool = False) -> None:
    m = rig.sines(41)
    own = {"t": m.t, "qm": 0.1 * m.q, "qg": 0.1 * m.target, "vir": m.tau / 35.15}
    own |= {"gtau": 35.15, "kp": 160.18, "kv": 243.45}
    if pulses:
        own["pulses_N"] = (5 * (np.sin(3 * m.t) > 0.9)).astype(np.uint8)
    scipy.io.savemat(path, own, oned_as="column")


def one_matrix(path: Path) -> None:
    m = rig.sines(42)
    scipy.io.savemat(path, {"theta": np.vstack([m.t, m.target, m.q])})


def structure(path: Path) -> None:
    m = rig.trapezoids(43)
    signals = [
        {"values": data, "label": name}
        for name, data in (("theta", m.q), ("omega", m.v), ("T_motor", m.tau))
    ]
    scipy.io.savemat(path, {"out": {"time": m.t, "signals": signals}})


def version_73(path: Path) -> None:
    m = rig.trapezoids(44)
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, data in (("t", m.t), ("pos", m.q * DEG), ("vel", m.v * DEG), ("trq", m.tau)):
            file.create_dataset(name, data=data[None, :]).attrs["MATLAB_class"] = np.bytes_(
                "double"
            )
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def with_units(path: Path) -> None:
    m = rig.sines(45)
    own = {
        "time": (m.t, "s"),
        "motor_speed": (m.v * 30 * RPM, "rpm"),
        "encoder_angle": (m.q * 1000, "mrad"),
        "friction_load_cell": (m.tau, "N m"),
        "normal_force": (50 + m.i, "N"),
        "bearing_temperature": (30 + m.t, "degC"),
    }
    with h5py.File(path, "w") as file:
        for name, (data, unit) in own.items():
            file[f"run1/{name}"] = data
            file[f"run1/{name}"].attrs["units"] = unit


def robot_joint(path: Path) -> None:
    m = rig.sines(46)
    own = {"time": m.t, "q": m.q, "qd": m.v, "qdd": np.gradient(m.v, 1e-3), "tau": m.tau}
    own |= {"i_q": m.i, "T_winding": 40 + m.t, "q_ref": m.target}
    scipy.io.savemat(path, {"data": own})


AXIS = {"qm": (ANGLE, "m"), "qg": (REFERENCE, "m"), "vir": (f"{TORQUE}|{COMMAND}|{OTHER}", "V")}

BINARY = [
    Wild("rec1_001.mat", dspace, {
        "time": (TIME, "s"), "q": (ANGLE, "rad"), "w": (RATE, "rad/s"), "tau": (TORQUE, "N m"),
        "u": (f"{COMMAND}|{OTHER}", "V"),
        **{f'"{name}"': each for name, each in (
            ("q", (ANGLE, "rad")), ("w", (RATE, "rad/s")), ("tau", (TORQUE, "N m")),
            ("u", (f"{COMMAND}|{OTHER}", "V")))},
    }),
    Wild("0113_3_3.mat", bearing, {
        "time": (TIME, "s"), "force": (f"{LOAD}|{JOINT}|{TORQUE}|{OTHER}", "N"),
        "phase_current_1": (f"{CURRENT}|{OTHER}", "A"),
        "phase_current_2": (f"{CURRENT}|{OTHER}", "A"), "speed": (f"{RATE}|{MOTOR_RATE}", "rpm"),
        "temp_2_bearing_module": (WARMTH, "degC"), "torque": (f"{TORQUE}|{JOINT}", "N m"),
        "vibration_1": (OTHER, None),
    }),
    Wild("DATA_AXIS.mat", positioning, {"t": (TIME, "s"), **AXIS}),
    Wild("DATA_AXIS_PULSES.mat", lambda path: positioning(path, True),
         {"t": (TIME, "s"), **AXIS, "pulses_N": (OTHER, "V")}),
    Wild("quarc.mat", one_matrix, {
        "theta(1,:)": (TIME, "s"), "theta(2,:)": (f"{REFERENCE}|{ANGLE}|{OTHER}", "rad"),
        "theta(3,:)": (f"{ANGLE}|{OTHER}", "rad"),
    }),
    Wild("simout.mat", structure, {
        "time": (TIME, "s"), "theta": (ANGLE, "rad"), "omega": (RATE, "rad/s"),
        "T_motor": (TORQUE, "N m"),
    }),
    Wild("measurement73.mat", version_73, {
        "t": (TIME, "s"), "pos": (ANGLE, "deg"), "vel": (RATE, "deg/s"),
        "trq": (f"{TORQUE}|{JOINT}", "N m"),
    }),
    Wild("rig.h5", with_units, {
        "run1.time": (TIME, "s"), "run1.motor_speed": (MOTOR_RATE, "rpm"),
        "run1.encoder_angle": (ANGLE, "mrad"), "run1.friction_load_cell": (JOINT, "N m"),
        "run1.normal_force": (LOAD, "N"), "run1.bearing_temperature": (WARMTH, "degC"),
    }),
    Wild("joint.mat", robot_joint, {
        "data.time": (TIME, "s"), "data.q": (ANGLE, "rad"), "data.qd": (RATE, "rad/s"),
        "data.qdd": (OTHER, None), "data.tau": (f"{TORQUE}|{JOINT}", "N m"),
        "data.i_q": (CURRENT, "A"), "data.T_winding": (WARMTH, "degC"),
        "data.q_ref": (REFERENCE, "rad"),
    }),
]  # fmt: skip


def all_of_them() -> list[Wild]:
    return texts() + BINARY
