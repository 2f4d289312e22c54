"""Forty recordings as laboratories and their programs leave them, with what each column really is.

Names, layouts and habits are those of public data sets, manuals and sample files; the motion is
that of `rig`. What a column is stands beside its file. None of it was taken from what the program
guesses by.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.importing import rig
from tests.importing.rig import Motion, rounded

DEG, RPM = 180 / np.pi, 30 / np.pi
TIME, INDEX, OTHER = "time", "index", "unknown"
ANGLE, RATE, TORQUE = "relative_angle", "relative_rate", "drive_torque"
CURRENT, REFERENCE, COMMAND = "motor_current", "reference", "command"
JOINT, LOAD, WARMTH = "joint_torque", "normal_load", "temperature"
MOTOR_ANGLE, MOTOR_RATE = "motor_angle", "motor_rate"

Truth = Mapping[str, tuple[str, str | None]]


@dataclass(frozen=True)
class Wild:
    """A file, and the role and the unit of each of its columns.

    A role may be several, apart by `|`, where people would not agree; a unit is None where the
    column has none that a mapping could name without being told.
    """

    name: str
    write: Callable[[Path], None]
    columns: Truth


def text(
    rows: Sequence[Sequence[object]] | np.ndarray,
    head: str = "",
    separator: str = ",",
    decimal: str = ".",
    *,
    form: str = "%.9g",
    end: str = "",
    codec: str = "utf-8",
    newline: str = "\n",
) -> Callable[[Path], None]:
    def cell(value: object) -> str:
        if isinstance(value, str):
            return value
        number = form % value
        return number.replace(".", decimal)

    def write(path: Path) -> None:
        lines = [separator.join(map(cell, row)) for row in rows]
        body = head + "\n".join(lines) + "\n" + end
        path.write_bytes(body.replace("\n", newline).encode(codec))

    return write


def together(*columns: np.ndarray) -> list[list[float]]:
    return np.column_stack(columns).tolist()


def franka(motions: Sequence[Motion]) -> Callable[[Path], None]:
    """Log of a Franka controller: commas with and without a blank, time in ms, joint by joint."""
    m = motions[0]
    names = ["state.q", "state.dq", "state.q_d", "state.tau_J"]
    head = "time," + ", ".join(f"{n}[{k}]" for n in names for k in range(len(motions)))
    head += ",cmd.tau_J_d[0]\n"
    columns = [m.t * 1000]
    for name in ("q", "v", "target", "tau"):
        columns += [getattr(each, name) for each in motions]
    return text(together(*columns, m.tau + 0.02), head)


def servo_amplifier(m: Motion) -> Callable[[Path], None]:
    """A drive's own trace: the row of units has the names, and a channel is stuck at its limit."""
    head = (
        "Sampling time interval(ms),0.667,,\n"
        "Time,Analog 1,Analog 2,Analog 3\n"
        "ms,Servo motor speed,Torque,Droop pulses\n"
    )
    n = 1024
    percent = rounded(m.tau[:n] / 40 * 100, 0.1)
    return text(
        together(np.arange(n) * 0.666666, rounded(m.v[:n] * RPM, 1), percent, np.full(n, -32768.0)),
        head,
        form="%.6g",
    )


def interval_pairs(m: Motion) -> Callable[[Path], None]:
    """A data logger's: a column of times beside each channel."""
    head = (
        "Interval,0.0005,Interval,0.0005\n"
        'Channel name,"Force",Channel name,"RMV"\nUnit,"V",Unit,"V"\n'
    )
    t = np.arange(len(m.t)) * 0.0005
    return text(together(t, m.tau / 200, t, m.i / 3), head, form="%.7g")


def scope_x(m: Motion) -> Callable[[Path], None]:
    """A scope that counts samples, and states start and step beside its names."""
    head = "X,CH1,CH2,Start,Increment,\nSequence,Volt,Volt,-1.0e-03,2.0e-04\n"
    rows = [[float(k), a, b] for k, (a, b) in enumerate(together(m.tau / 10, m.i / 5))]
    lines = [f"{k:.0f},{a:.4f},{b:.4f}," for k, a, b in rows]
    return lambda path: path.write_text(head + "\n".join(lines) + "\n") and None


def twincat(m: Motion, separator: str = "\t", decimal: str = ".") -> Callable[[Path], None]:
    s = separator
    names = ["ActPos", "ActTorque", "SetVelo"]
    units = ["deg (Angle)", "%", "(None)"]
    n = 1500
    columns = [m.q[:n] * DEG, rounded(m.tau[:n] / 30 * 100, 0.1), m.v[:n] * DEG]
    head = (
        f"Name{s}Scope Project\nFile{s}C:\\axis.tcscopex\n"
        f"Starttime of export{s}133500000000000000{s}Montag, 2. Mai 2024\n\n\n"
    )
    for row, cells in (
        ("Name", names),
        ("Data-Type", ["REAL64", "INT16", "REAL64"]),
        ("SampleTime[ms]", ["1", "1", "1"]),
        ("SymbolName", [f"Axis.{each}" for each in names]),
        ("Unit", units),
    ):
        head += s.join(x for each in cells for x in (row, each)) + "\n"
    times = m.t[:n] * 1000
    rows = [[x for each in row[1:] for x in (row[0], each)] for row in together(times, *columns)]
    return text(rows, head + "\n", s, decimal, end="EOF\n")


def labview(m: Motion, columns: str, decimal: str, units: bool) -> Callable[[Path], None]:
    labels = "N m\tdeg" if units else "\t"
    zero, step = (x.replace(".", decimal) for x in ("0.0", "0.001"))
    head = (
        f"LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t{decimal}\n"
        f"Multi_Headings\tNo\nX_Columns\t{columns}\nTime_Pref\tRelative\nOperator\tlab\n"
        f"***End_of_Header***\t\n\t\nChannels\t2\t\t\nSamples\t2000\t2000\t\n"
        f"Y_Unit_Label\t{labels}\t\nX0\t{zero}\t{zero}\t\nDelta_X\t{step}\t{step}\t\n"
        "***End_of_Header***\t\t\t\nX_Value\tDrehmoment\tWinkel\tComment\n"
    )
    rows = [
        [t if columns == "One" else "", tau, q]
        for t, tau, q in together(m.t, m.tau, m.q * DEG)[:2000]
    ]
    return text(rows, head, "\t", decimal, form="%.6f")


def robot_log(m: Motion) -> Callable[[Path], None]:
    """A middleware's topic as text: nanoseconds since 1970, and a column of names."""
    head = (
        "%time,field.header.seq,field.header.stamp,field.header.frame_id,field.name0,"
        "field.position0,field.velocity0,field.effort0\n"
    )
    rows = []
    for k, (t, q, v, tau) in enumerate(together(m.t, m.q, m.v, m.tau)[:3000]):
        stamp = f"{1700000000000000000 + int(t * 1e9)}"
        rows.append([stamp, f"{k}", stamp, "base", "joint_a1", q, v, tau])
    return text(rows, head)


def holed(m: Motion, share: float = 0.01) -> Motion:
    """With samples missing, as a busy host loses them."""
    kept = np.random.default_rng(9).uniform(size=len(m.t)) > share
    return Motion(*(getattr(m, name)[kept] for name in ("t", "q", "v", "tau", "i", "target")))


# fmt: off
def texts() -> list[Wild]:
    """Those that are text."""
    s = [rig.sines(k) for k in range(8)]
    z = [rig.trapezoids(k) for k in range(8)]
    slow = rig.trapezoids(20, rate=66.667, length=30)
    quick = rig.sines(21, rate=2500)
    stuck = rig.stick_slip(22)
    n = np.arange(8000.0)
    made: list[Wild] = []

    def put(name: str, write: Callable[[Path], None], columns: Truth) -> None:
        made.append(Wild(name, write, columns))

    put("franka.csv", franka(s[:2]), {
        "time": (TIME, "ms"),
        **{f"state.q[{k}]": (ANGLE, "rad") for k in (0, 1)},
        **{f"state.dq[{k}]": (RATE, "rad/s") for k in (0, 1)},
        **{f"state.q_d[{k}]": (REFERENCE, "rad") for k in (0, 1)},
        **{f"state.tau_J[{k}]": (JOINT, "N m") for k in (0, 1)},
        "cmd.tau_J_d[0]": (COMMAND, "N m"),
    })
    put("position_of_seven_joints.csv", text(together(*(each.q for each in s[:7]))),
        {f"column {k}": (OTHER, None) for k in range(1, 8)})
    put("rtde.csv", text(
        together(s[1].t + 4711.2, s[1].target, s[1].q, s[1].v, s[1].i, s[1].tau),
        "timestamp target_q_0 actual_q_0 actual_qd_0 actual_current_0 target_moment_0\n", " "),
        {"timestamp": (TIME, "s"), "target_q_0": (REFERENCE, "rad"), "actual_q_0": (ANGLE, "rad"),
         "actual_qd_0": (RATE, "rad/s"), "actual_current_0": (CURRENT, "A"),
         "target_moment_0": (COMMAND, "N m")})
    eight = rig.trapezoids(30, rate=125, length=20)
    put("ur_125.csv", text(together(eight.t, eight.q, eight.v, eight.i, eight.tau),
        "time,q_actual,qd_actual,i_actual,m_target\n"),
        {"time": (TIME, "s"), "q_actual": (ANGLE, "rad"), "qd_actual": (RATE, "rad/s"),
         "i_actual": (CURRENT, "A"), "m_target": (COMMAND, "N m")})
    x = rig.trapezoids(31, rate=100, length=20)
    put("xm430.csv", text(together(np.round(x.t * 1000), np.round(2048 + x.q * DEG / 0.088),
        np.round(x.v * RPM / 0.229), np.round(x.i * 1000 / 2.69),
        np.round(2048 + x.target * DEG / 0.088), np.round(31 + x.t / 10)),
        "t_ms,Present Position,Present Velocity,Present Current,Goal Position,"
        "Present Temperature\n"),
        {"t_ms": (TIME, "ms"), "Present Position": (ANGLE, "count"),
         "Present Velocity": (RATE, None), "Present Current": (CURRENT, None),
         "Goal Position": (REFERENCE, "count"), "Present Temperature": (WARMTH, "degC")})
    host = np.cumsum(np.random.default_rng(1).uniform(0.006, 0.012, len(x.t)))
    put("servo_model_data.csv", text(together(host, x.q, x.v, rounded(x.tau / 60 * 100, 0.1),
        12.1 + 0 * x.t, rounded(35 + x.t / 20, 1), x.target, 1 + 0 * x.t),
        "timestamp,position,speed,load,input_volts,temp,goal_position,torque_enable\n"),
        {"timestamp": (TIME, "s"), "position": (ANGLE, "rad"), "speed": (RATE, "rad/s"),
         "load": (f"{TORQUE}|{OTHER}", None), "input_volts": (OTHER, "V"),
         "temp": (WARMTH, "degC"), "goal_position": (REFERENCE, "rad"),
         "torque_enable": (OTHER, None)})
    put("amplifier_trace.csv", servo_amplifier(z[0]),
        {"Time": (TIME, "ms"), "Servo motor speed": (MOTOR_RATE, "rpm"),
         "Torque": (TORQUE, "%"), "Droop pulses": (OTHER, None)})
    put("logger.csv", interval_pairs(z[1]),
        {"time": (TIME, "s"), "Force": (f"{TORQUE}|{JOINT}", "V"), "RMV": (OTHER, "V")})
    put("pendulum.csv", text(together(s[2].t, s[2].q, s[2].v, s[2].i * 2)),
        {"column 1": (TIME, "s"), "column 2": (f"{ANGLE}|{OTHER}", "rad"),
         "column 3": (f"{RATE}|{OTHER}", "rad/s"), "column 4": (OTHER, None)})
    put("bench.lvm", labview(z[2], "One", ",", True),
        {"time": (TIME, "s"), "Drehmoment": (f"{TORQUE}|{JOINT}", "N m"),
         "Winkel": (ANGLE, "deg")})
    put("bench_no_times.lvm", labview(z[3], "No", ".", False),
        {"Drehmoment": (f"{TORQUE}|{JOINT}", "N m"), "Winkel": (ANGLE, "deg")})
    put("no_heading.lvm", text(together(z[4].t, z[4].q * DEG, z[4].tau), "", "\t", form="%.6f"),
        {"column 1": (TIME, "s"), "column 2": (OTHER, None), "column 3": (OTHER, None)})
    put("messung.csv", twincat(s[3], ";", ","),
        {"time": (TIME, "ms"), "ActPos": (ANGLE, "deg"), "ActTorque": (TORQUE, "%"),
         "SetVelo": (f"{COMMAND}|{OTHER}", "deg/s")})
    put("NewFile1.csv", scope_x(z[5]),
        {"X": (INDEX, None), "CH1": (OTHER, "V"), "CH2": (OTHER, "V")})
    put("scope_1.csv", text(together(z[5].t - 0.5, z[5].tau / 10, z[5].i / 5),
        "x-axis,1,2\nsecond,Volt,Volt\n", form="%+.6E"),
        {"x-axis": (TIME, "s"), "1": (OTHER, "V"), "2": (OTHER, "V")})
    put("pico.txt", text(together(z[6].t * 1e6, z[6].tau / 10, z[6].i / 5),
        "Time\tChannel A\tChannel B\n(us)\t(V)\t(mV)\n\n", "\t", newline="\r\n"),
        {"Time": (TIME, "us"), "Channel A": (OTHER, "V"), "Channel B": (OTHER, "mV")})
    put("T0001.CSV", text(together(z[7].t, z[7].tau / 10, z[7].i / 5),
        "Model,MDO3014\nFirmware Version,1.26\n\nWaveform Type,ANALOG\nHorizontal Units,s\n"
        "Sample Interval,1e-3\nRecord Length,8000\nVertical Units,V,V\n\nTIME,CH1,CH2\n"),
        {"TIME": (TIME, "s"), "CH1": (OTHER, "V"), "CH2": (OTHER, "V")})
    nn = holed(rig.sines(33, rate=800))
    put("joint2_models.csv", text(together(np.round(nn.t, 3), nn.q, nn.v, 0 * nn.t, nn.tau,
        3 * np.sign(nn.v), 3 * np.tanh(nn.v / 0.02), 1.5 * nn.v + 3 * np.tanh(nn.v / 0.05)),
        "time,q2,dq2,ddq2,q2_tau_J_compensate,CV,Dahl,LuGre\n"),
        {"time": (TIME, "s"), "q2": (ANGLE, "rad"), "dq2": (RATE, "rad/s"), "ddq2": (OTHER, None),
         "q2_tau_J_compensate": (f"{JOINT}|{TORQUE}", "N m"), "CV": (OTHER, None),
         "Dahl": (OTHER, None), "LuGre": (OTHER, None)})
    put("servo_experiment.csv", text(together(np.round(s[4].t * 1000), s[4].q * DEG, s[4].i),
        "Time (ms),Position (deg),Current (A)\n"),
        {"Time": (TIME, "ms"), "Position": (ANGLE, "deg"), "Current": (CURRENT, "A")})
    put("canopen.csv", text(together(n[:4000], np.round(s[5].q[:4000] * 1e5),
        np.round(s[5].v[:4000] * 1e5), np.round(s[5].tau[:4000] / 40 * 1000)),
        "sample;0x6064;0x606C;0x6077\n", ";"),
        {"sample": (INDEX, None), "0x6064": (ANGLE, "count"), "0x606C": (RATE, None),
         "0x6077": (TORQUE, None)})
    put("antrieb.csv", text(together(z[0].t * 1000, z[0].tau + 0.3, z[0].tau, z[0].v * RPM),
        "Zeit;r0080;r0031;r0063\n", ";", ",", codec="cp1252"),
        {"Zeit": (TIME, "ms"), "r0080": (TORQUE, "N m"), "r0031": (f"{TORQUE}|{OTHER}", "N m"),
         "r0063": (f"{MOTOR_RATE}|{RATE}|{OTHER}", "rpm")})
    put("joint_states.csv", robot_log(s[6]),
        {"%time": (TIME, "ns"), "time": (TIME, "ns"), "field.header.seq": (INDEX, None),
         "field.header.stamp": (TIME, "ns"), "field.header.frame_id": (OTHER, None),
         "field.name0": (OTHER, None), "field.position0": (ANGLE, "rad"),
         "field.velocity0": (RATE, "rad/s"),
         "field.effort0": (f"{TORQUE}|{JOINT}", "N m")})
    put("pruefstand.csv", text(together(z[1].t * 1000, z[1].v * RPM, z[1].tau, z[1].q * DEG),
        "Prüfstand 7\nDatum: 02.05.2024\nZeit [ms];Drehzahl [1/min];Moment (Nm);Lage [°]\n",
        ";", ",", codec="cp1252", newline="\r\n"),
        {"Zeit": (TIME, "ms"), "Drehzahl": (f"{MOTOR_RATE}|{RATE}", "rpm"),
         "Moment": (f"{TORQUE}|{JOINT}", "N m"), "Lage": (ANGLE, "deg")})
    put("export.csv", text(together(z[2].t, z[2].q * 1000, z[2].v * 1000, z[2].i),
        "\ufeffZeit;Position;Geschwindigkeit;Strom\n", ";", ","),
        {"Zeit": (TIME, "s"), "Position": (ANGLE, "mm"), "Geschwindigkeit": (RATE, "mm/s"),
         "Strom": (CURRENT, "A")})
    put("two_rows.csv", text(together(s[0].t, s[0].target, s[0].q, s[0].v, s[0].tau / 40 * 100),
        "Time,Position demand,Position feedback,Velocity feedback,Torque\ns,rad,rad,rad/s,%\n"),
        {"Time": (TIME, "s"), "Position demand": (REFERENCE, "rad"),
         "Position feedback": (ANGLE, "rad"), "Velocity feedback": (RATE, "rad/s"),
         "Torque": (TORQUE, "%")})
    put("two_joints_15ms.csv", text(together(slow.t, slow.q * DEG, slow.v * DEG, slow.tau,
        -0.5 * slow.q * DEG, -0.5 * slow.v * DEG, slow.tau / 2),
        "t,j1_pos_deg,j1_vel_deg_s,j1_tau,j2_pos_deg,j2_vel_deg_s,j2_tau\n"),
        {"t": (TIME, "s"), **{f"j{k}_pos_deg": (ANGLE, "deg") for k in (1, 2)},
         **{f"j{k}_vel_deg_s": (RATE, "deg/s") for k in (1, 2)},
         **{f"j{k}_tau": (f"{TORQUE}|{JOINT}", "N m") for k in (1, 2)}})
    put("multisine.txt", text(together(quick.t, quick.tau * 1.01, quick.i, quick.v * 50,
        quick.q * 50, quick.q), "t\ti_ref\ti_q\tomega_m\tphi_m\tphi_L\n", "\t"),
        {"t": (TIME, "s"), "i_ref": (COMMAND, "A"), "i_q": (CURRENT, "A"),
         "omega_m": (MOTOR_RATE, "rad/s"), "phi_m": (MOTOR_ANGLE, "rad"),
         "phi_L": (ANGLE, "rad")})
    put("tribometer.txt", text(together(stuck.t, 20 + 0.1 * stuck.i, np.abs(stuck.tau),
        np.abs(stuck.tau) / 20, np.cumsum(np.abs(stuck.v)) / 1000, 23 + stuck.t / 50),
        "Test,pin on disc\nTime (s),Normal load (N),Friction force (N),COF,Sliding distance (m),"
        "Temp (°C)\n"),
        {"Time": (TIME, "s"), "Normal load": (LOAD, "N"),
         "Friction force": (f"{JOINT}|{TORQUE}", "N"), "COF": (OTHER, None),
         "Sliding distance": (ANGLE, "m"), "Temp": (WARMTH, "degC")})
    put("encoder.csv", text(together(1.7e9 + s[7].t, np.mod(np.round(s[7].q * 1e4), 4096),
        s[7].v * 1e4, np.round(s[7].i * 20)), "timestamp,enc,vel_cps,pwm\n", form="%.12g"),
        {"timestamp": (TIME, "s"), "enc": (f"{ANGLE}|{MOTOR_ANGLE}", "count"),
         "vel_cps": (f"{RATE}|{MOTOR_RATE}", None), "pwm": (f"{COMMAND}|{OTHER}", None)})
    put("gear.csv", text(together(z[3].t, z[3].q * 50, z[3].q, z[3].v * 50 * RPM, z[3].tau / 50),
        "t;phi_mot;phi_load;n_mot [rpm];M_mot [Nm]\n", ";"),
        {"t": (TIME, "s"), "phi_mot": (MOTOR_ANGLE, "rad"), "phi_load": (ANGLE, "rad"),
         "n_mot": (MOTOR_RATE, "rpm"), "M_mot": (f"{TORQUE}|{OTHER}", "N m")})
    put("ENC_LOG.TXT", text(together(n, z[4].t, z[4].q, z[4].v, z[4].tau / 3),
        "# rig B, run 12\n# sampled at 1 kHz\n#idx TIME ENC1_POS ENC1_VEL DAC_OUT\n", " "),
        {"idx": (INDEX, None), "TIME": (TIME, "s"), "ENC1_POS": (ANGLE, "rad"),
         "ENC1_VEL": (RATE, "rad/s"), "DAC_OUT": (f"{COMMAND}|{OTHER}", None)})
    return made
# fmt: on
