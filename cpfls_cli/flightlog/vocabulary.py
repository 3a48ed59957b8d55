"""What names of columns and sizes of numbers mean: the tables that logs are recognised by.

A new log usually takes one row more: of `KNOWN`, what kinds of logs call their columns, in which unit and axes; of
`MEANINGS`, the words for each signal; of `SPELLINGS`, the ways to write a unit into a name; of `RATES`, `ANGLES` and
`SENSED`, what numbers a unit makes; or of `RANGES`, what numbers a command of rotors may be.
"""

from collections.abc import Mapping
from fractions import Fraction
from math import inf, pi, tau
from typing import Final, Literal, NamedTuple, get_args

from cpfls_cli.flightlog.settings import ROTORS, SignalName
from cpfls_cli.units import STANDARD_GRAVITY, UnitName


def _each(words: str) -> frozenset[str]:
    return frozenset(words.split())


SPELLINGS: Final[Mapping[UnitName, Mapping[float, str]]] = {
    # Of each unit how names write it, by the factor that makes it of what is written; "_" and "per" are read as "/",
    # and words in full as their symbols.
    "rad/s": {1.0: "rad/s rads radps rads-1", 0.001: "mrad/s mrads mradps", tau: "hz rps rev/s"},
    "deg/s": {1.0: "deg/s degs degps dps degs-1", 0.001: "mdeg/s mdps"},
    "rpm": {1.0: "rpm", 1000.0: "krpm"},
    "rad": {1.0: "rad", 0.001: "mrad"},
    "deg": {1.0: "deg", 0.01: "cdeg centideg"},
    "m/s^2": {1.0: "m/s2 m/s/s mps2 ms2 ms-2"},
    "g": {1.0: "g", 0.001: "mg"},
    "m/s": {1.0: "m/s mps ms-1", 0.01: "cm/s cmps", 1 / 3.6: "km/h kmh kph"},
    "mm/s": {1.0: "mm/s mmps"},
    "m": {1.0: "m", 0.01: "cm", 0.3048: "ft feet"},
    "mm": {1.0: "mm"},
    "N m": {1.0: "nm n/m"},
    "N mm": {1.0: "nmm n/mm"},
    "N": {1.0: "n"},
    "V": {1.0: "v", 0.001: "mv"},
    "1": {0.01: "pct percent %"},
    "us": {1.0: "us usec"},
}
IN_FULL: Final = {"radians?": "rad", "degrees?": "deg", "met(er|re)s?": "m", "sec(onds?)?": "s", "volts?": "v"}
# Spellings that state a unit wherever they stand as a word of a name.
A_WORD: Final = _each("rad rads deg degs dps rpm mm g radps degps mps rads-1")
IN_RADIANS: Final[Mapping[str, tuple[SignalName, ...]]] = {
    # An angular frequency by its letter.
    "w": ("body_rate",),
    "om": ("body_rate", "rotor_speed", "rotor_command"),
    "omega": ("body_rate", "rotor_speed", "rotor_command"),
    "omcmd": ("rotor_command",),
}


PX4, ARDUPILOT, BETAFLIGHT, CRAZYFLIE = "PX4", "ArduPilot", "Betaflight", "Crazyflie"
KIN: Final = {ARDUPILOT: ("Ardu",), BETAFLIGHT: ("INAV", "Cleanflight", "EmuFlight")}


class Known(NamedTuple):
    """Columns in which a kind of log holds a signal."""

    system: str
    signal: str  # One that `import.signals` takes, or one that `look` alone asks for.
    columns: tuple[str, ...]  # Each of them, or one pattern with ``*`` for the axes or numbers of a group.
    unit: UnitName | None  # Of ``scale * column + offset``; None where numbers or the log tell it.
    frame: str | None  # None where it has none, and for a setpoint, which is in the axes of what is measured.
    scale: float
    offset: float
    sign: tuple[float, ...] | None  # Of each column in that frame; None for +1 everywhere.


_KNOWN: Final = """
    # system, signal, columns, unit, axes, factor (and offset) that make the unit of what is logged, signs.
    # Of the rows of one signal the first that a log holds is preferred.
    PX4        quaternion         vehicle_attitude.q[*]                             1     FRD 1        +
    PX4        body_rate          vehicle_angular_velocity.xyz[*]                   rad/s FRD 1        +
    PX4        body_rate          sensor_combined.gyro_rad[*]                       rad/s FRD 1        +
    PX4        body_rate          vehicle_attitude.*speed                           rad/s FRD 1        +
    PX4        acceleration       sensor_combined.accelerometer_m_s2[*]             m/s^2 FRD 1        +
    PX4        acceleration       vehicle_acceleration.xyz[*]                       m/s^2 FRD 1        +
    PX4        position           vehicle_local_position.*                          m     NED 1        +
    PX4        velocity           vehicle_local_position.v*                         m/s   NED 1        +
    PX4        rotor_speed        esc_status.esc[*].esc_rpm                         rpm   -   1        +
    PX4        rotor_command      actuator_motors.control[*]                        1     -   1        +
    PX4        rotor_command      actuator_outputs.output[*]                        -     -   1        +
    PX4        rotor_command      actuator_outputs[1].output[*]                     -     -   1        +
    PX4        voltage            battery_status.voltage_v                          V     -   1        +
    # What was asked for: what a controller is given comes before what it makes of it.
    PX4        setpoint_position  trajectory_setpoint.position[{0,1,2}]             m     -   1        +
    PX4        setpoint_position  trajectory_setpoint.{x,y,z}                       m     -   1        +
    PX4        setpoint_position  vehicle_local_position_setpoint.{x,y,z}           m     -   1        +
    PX4        setpoint_velocity  trajectory_setpoint.velocity[{0,1,2}]             m/s   -   1        +
    PX4        setpoint_velocity  trajectory_setpoint.v{x,y,z}                      m/s   -   1        +
    PX4        setpoint_velocity  vehicle_local_position_setpoint.v{x,y,z}          m/s   -   1        +
    PX4        setpoint_attitude  vehicle_attitude_setpoint.q_d[{0,1,2,3}]          1     -   1        +
    PX4        setpoint_attitude  vehicle_attitude_setpoint.{roll,pitch,yaw}_body   rad   -   1        +
    PX4        setpoint_body_rate vehicle_rates_setpoint.{roll,pitch,yaw}           rad/s FRD 1        +
    # Along z, which points down.
    PX4        setpoint_thrust    vehicle_rates_setpoint.thrust_body[{2}]           1     -   1        -
    PX4        setpoint_thrust    vehicle_attitude_setpoint.thrust_body[{2}]        1     -   1        -
    PX4        sticks             manual_control_setpoint.{roll,pitch,yaw,throttle} 1     -   1        +
    PX4        sticks             manual_control_setpoint.{y,x,r,z}                 1     -   1        +
    # What only `look` asks for: what moves the vehicle, its filters, its battery.
    PX4        rate               vehicle_angular_velocity.xyz[{0,1,2}]             rad/s FRD 1        +
    PX4        rate               vehicle_attitude.{roll,pitch,yaw}speed            rad/s FRD 1        +
    PX4        raw                sensor_gyro.{x,y,z}                               rad/s FRD 1        +
    PX4        raw                sensor_combined.gyro_rad[{0,1,2}]                 rad/s FRD 1        +
    PX4        output             vehicle_torque_setpoint.xyz[{0,1,2}]              1     FRD 1        +
    PX4        output             actuator_controls_0.control[{0,1,2}]              1     FRD 1        +
    PX4        collective         vehicle_thrust_setpoint.xyz[{2}]                  1     -   1        -
    PX4        collective         actuator_controls_0.control[{3}]                  1     -   1        +
    PX4        current            battery_status.{current_a}                        -     -   1        +
    PX4        battery_voltage    battery_status.{voltage_filtered_v}               V     -   1        +
    ArduPilot  attitude           ATT.*                                             deg   FRD 1        +
    ArduPilot  body_rate          IMU.Gyr*                                          rad/s FRD 1        +
    ArduPilot  body_rate          RATE.*                                            deg/s FRD 1        +
    ArduPilot  acceleration       IMU.Acc*                                          m/s^2 FRD 1        +
    ArduPilot  position           XKF1.P*                                           m     NED 1        +
    ArduPilot  position           NKF1.P*                                           m     NED 1        +
    ArduPilot  velocity           XKF1.V*                                           m/s   NED 1        +
    ArduPilot  velocity           NKF1.V*                                           m/s   NED 1        +
    ArduPilot  rotor_command      RCOU.C*                                           -     -   1        +
    # To Copter 3.3, and to 3.2.
    ArduPilot  rotor_command      RCOU.Ch*                                          -     -   1        +
    ArduPilot  rotor_command      RCOU.Chan*                                        -     -   1        +
    ArduPilot  rotor_speed        ESC[*].RPM                                        rpm   -   1        +
    ArduPilot  rotor_speed        ESC*.RPM                                          rpm   -   1        +
    ArduPilot  voltage            BAT.Volt                                          V     -   1        +
    ArduPilot  setpoint_position  PSC{N.DPN,E.DPE,D.DPD}                            m     -   1        +
    ArduPilot  setpoint_position  PSC{N.TPN,E.TPE,D.TPD}                            m     -   1        +
    ArduPilot  setpoint_velocity  PSC{N.DVN,E.DVE,D.DVD}                            m/s   -   1        +
    ArduPilot  setpoint_velocity  PSC{N.TVN,E.TVE,D.TVD}                            m/s   -   1        +
    ArduPilot  setpoint_attitude  ATT.Des{Roll,Pitch,Yaw}                           deg   -   1        +
    ArduPilot  setpoint_body_rate RATE.{R,P,Y}Des                                   deg/s FRD 1        +
    # Pulses of 1500 us and 500 to each side.
    ArduPilot  sticks             RCIN.C{1,2,4,3}                                   1     -   1/500,-3 +
    ArduPilot  rate               RATE.{R,P,Y}                                      deg/s FRD 1        +
    ArduPilot  rate               RATE.{Rll,Pit,Yaw}                                deg/s FRD 1        +
    ArduPilot  raw                GYR.Gyr{X,Y,Z}                                    rad/s FRD 1        +
    ArduPilot  output             RATE.{R,P,Y}Out                                   1     FRD 1        +
    ArduPilot  output             RATE.{Rll,Pit,Yaw}Out                             1     FRD 1        +
    ArduPilot  collective         RATE.{AOut}                                       1     -   1        +
    ArduPilot  collective         CTUN.{ThO}                                        1     -   1        +
    ArduPilot  collective         CTUN.{ThrOut}                                     1     -   1/1000   +
    ArduPilot  setpoint           RATE.{Rll,Pit,Yaw}Des                             deg/s FRD 1        +
    ArduPilot  current            BAT.{Curr}                                        -     -   1        +
    ArduPilot  current            CURR.{Curr}                                       -     -   1        +
    ArduPilot  battery_voltage    CURR.{Volt}                                       V     -   1        +
    ArduPilot  height             CTUN.{Alt}                                        m     -   1        +
    ArduPilot  height             BARO.{Alt}                                        m     -   1        +
    ArduPilot  height             CTUN.{BAlt}                                       m     -   1        +
    ArduPilot  height             CTUN.{BarAlt}                                     m     -   1        +
    Betaflight body_rate          gyroADC[*]                                        deg/s FLU 1        +
    Betaflight acceleration       accSmooth[*]                                      -     FLU 1        +
    Betaflight rotor_command      motor[*]                                          -     -   1        +
    Betaflight rotor_speed        rpm[*]                                            rpm   -   1        +
    Betaflight rotor_speed        eRPM[*]                                           -     -   1        +
    Betaflight voltage            vbatLatest                                        V     -   1        +
    Betaflight setpoint_body_rate setpoint[{0,1,2}]                                 deg/s FLU 1        +
    Betaflight setpoint_thrust    setpoint[{3}]                                     1     -   1/1000   +
    # The throttle counts from 1000, and so in another way.
    Betaflight sticks             rcCommand[{0,1,2}]                                1     -   1/500    +
    Betaflight raw                gyroUnfilt[{0,1,2}]                               deg/s FLU 1        +
    Betaflight setpoint           axisRate[{0,1,2}]                                 deg/s FLU 1        +
    Betaflight current            {amperageLatest}                                  -     -   1/100    +
    Betaflight current            {amperage}                                        -     -   1/100    +
    Betaflight height             {baroAlt}                                         m     -   1/100    +
    Crazyflie  quaternion         stateEstimate.q*                                  1     FLU 1        +
    Crazyflie  attitude           stabilizer.*                                      deg   FLU 1        +
    Crazyflie  attitude           stateEstimate.*                                   deg   FLU 1        +
    Crazyflie  body_rate          gyro.*                                            deg/s FLU 1        +
    # The controller takes a pitch for positive with the nose up: r_pitch = -gyro.y in the firmware.
    Crazyflie  body_rate          controller.r_*                                    -     FLU 1        +-+
    Crazyflie  acceleration       acc.*                                             g     FLU 1        +
    Crazyflie  acceleration       stateEstimate.a*                                  g     ENU 1        +
    Crazyflie  position           stateEstimate.*                                   m     ENU 1        +
    Crazyflie  velocity           stateEstimate.v*                                  m/s   ENU 1        +
    # The compressed state counts in thousandths.
    Crazyflie  position           stateEstimateZ.*                                  mm    ENU 1        +
    Crazyflie  velocity           stateEstimateZ.v*                                 mm/s  ENU 1        +
    Crazyflie  rotor_speed        rpm.m*                                            rpm   -   1        +
    # The pwm columns are these after the firmware's compensation of the battery.
    Crazyflie  rotor_command      motor.m*                                          1     -   1/65536  +
    Crazyflie  rotor_command      pwm.m*_pwm                                        1     -   1/65536  +
    Crazyflie  voltage            pm.vbat                                           V     -   1        +
    Crazyflie  voltage            pm.vbatMV                                         V     -   1e-3     +
    Crazyflie  setpoint_position  ctrltarget.{x,y,z}                                m     -   1        +
    Crazyflie  setpoint_position  ctrltargetZ.{x,y,z}                               mm    -   1        +
    Crazyflie  setpoint_velocity  ctrltarget.v{x,y,z}                               m/s   -   1        +
    Crazyflie  setpoint_velocity  ctrltargetZ.v{x,y,z}                              mm/s  -   1        +
    # A pitch is positive with the nose up, as in stabilizer.pitch. What is asked for in each mode stands in controller;
    # in ctrltarget only in the mode that asks for an attitude, and of yaw a rate.
    Crazyflie  setpoint_attitude  controller.{roll,pitch,yaw}                       deg   -   1        +-+
    Crazyflie  setpoint_attitude  ctrltarget.{roll,pitch,yaw}                       deg   -   1        +-+
    Crazyflie  setpoint_body_rate controller.{roll,pitch,yaw}Rate                   deg/s FLU 1        +-+
    # A pitch is positive with the nose up here, unlike in the gyroscope's axes.
    Crazyflie  output             controller.cmd_{roll,pitch,yaw}                   1     FRD 1/65536  +
    Crazyflie  collective         controller.{cmd_thrust}                           1     -   1/65536  +
"""


def _known(row: str) -> Known:
    system, signal, pattern, unit, frame, factor, signs = row.split()
    before, _, rest = pattern.partition("{")
    axes, _, after = rest.partition("}")
    scale, _, offset = factor.partition(",")
    return Known(
        system,
        signal,
        tuple(f"{before}{axis}{after}" for axis in axes.split(",")),
        next((own for own in get_args(UnitName) if own == unit), None),
        None if frame == "-" else frame,
        float(Fraction(scale)),
        float(offset or 0),
        None if signs == "+" else tuple(1.0 if own == "+" else -1.0 for own in signs),
    )


KNOWN: Final = tuple(_known(row) for row in _KNOWN.splitlines() if row.strip() and "#" not in row)
# Words of a name that say: what was asked for.
WISHED: Final = _each("des desired sp setpoint setpoints ref reference target goal ctrltarget")


class Meaning(NamedTuple):
    """What words of a name mean a signal."""

    signal: SignalName
    words: str  # One of them has to stand in the name.
    kinds: str  # In what its columns differ, and how many there are; of rotors at least.
    number: int
    last: int = 0  # Only so many words at the end of the name count; 0: all of them.
    never: str = ""  # Words that rule it out, with those of `NOT_MEASURED`.


# Words of a name that mean together what neither does, as a pattern, and the one word that means it.
ONE_WORD: Final = {r"\bang vel(ocity)?\b": "angvel"}
RATE_WORDS: Final = "gyro gyr gyroscope gyros omega om w rate rates angular angvel pqr"
MEANINGS: Final = (
    Meaning(
        "position",
        "pos position p translation point poses pose mocap local state estimate v",
        "xyz",
        3,
        never="vel velocity linear twist acc accel accelerometer acceleration a sf f imu torque tau moment rpy euler"
        " attitude att angle angles ypr q quat quaternion orientation rpm erpm rads rotor speed motor m cmd command"
        " pwm u control output throttle omcmd esc thrust lift voltage vbat volt vbatt battery batt home global"
        f" {RATE_WORDS}",
    ),
    # Of a matrix, whose columns have no axes in their names.
    Meaning("position", "pos position xyz", "numbers", 3, 1, "rotor motor imu angular home global axis nav"),
    Meaning("velocity", "vel velocity v linear twist", "xyz numbers", 3, 2, "angular acc acceleration a"),
    Meaning("acceleration", "acc accel accelerometer acceleration a sf f", "xyz numbers", 3, 2, "angular ang"),
    Meaning("body_rate", RATE_WORDS, "xyz angles numbers", 3),
    Meaning("body_torque", "torque tau moment", "xyz angles numbers", 3),
    Meaning("attitude", "rpy euler attitude att angle angles ypr", "xyz angles numbers", 3),
    Meaning("quaternion", "q quat quaternion orientation att attitude pose", "wxyz", 4),
    Meaning("quaternion", "q quat quaternion orientation", "numbers", 4, 1),
    Meaning("rotor_speed", "", "numbers", 3),
    Meaning("rotor_command", "", "numbers", 3),
    Meaning("thrust", "thrust lift", "one", 1),
    Meaning("voltage", "voltage vbat volt vbatt battery batt", "one", 1),
)
FAST: Final = _each("rpm erpm rads rotor om omega speed speeds velocities angular")
ASKED: Final = _each("cmd command commands pwm u control output outputs throttle omcmd ref des d r")
# Words of what is wished, estimated of a sensor or something else; a name with one of them is no measurement.
NOT_MEASURED: Final = _each(
    "des desired d sp setpoint ref reference target goal r cmd command ctrltarget controller cov covariance var"
    " variance bias noise std err error integral reset delta innov innovation offset mag magnetometer rc gps status"
    " temperature current thrust thrusts jerk snap stamp timestamp counter padding derivative test ratio ratios clip"
)
SECOND_HAND: Final = _each("raw groundtruth mocap poses estimator filtered filt unfilt backup")
ALLOWED: Final = {"thrust": frozenset({"thrust"}), **dict.fromkeys(ROTORS, _each("cmd command status r ref des d"))}
_DEGREES = 180 / pi
_ANGLES: Final[tuple[tuple[UnitName, float], ...]] = (("rad", 1.0), ("deg", 1 / _DEGREES))
# Size that speaks for a unit, the unit, and the factor that makes it of what is logged.
Row = tuple[float, UnitName, float]
# Sizes of a gyroscope over that of the attitude's derivative.
RATES: Final[tuple[Row, ...]] = ((1.0, "rad/s", 1.0), (_DEGREES, "deg/s", 1.0), (1000.0, "rad/s", 1e-3))
# Sizes of an acceleration over ground, in m or mm, over that which gravity and a lean in rad make.
ANGLES: Final[tuple[Row, ...]] = tuple((mm * one, unit, 1.0) for unit, one in _ANGLES for mm in (1.0, 1000.0))
# Sizes of an accelerometer at hover.
SENSED: Final[tuple[Row, ...]] = (
    (STANDARD_GRAVITY, "m/s^2", 1.0),
    *((size, "g", 1 / size) for size in (1.0, 1000.0, 2048.0, 4096.0)),
)


class Range(NamedTuple):
    """Numbers of a command that is no speed by its name, and what they are taken for: a share of the largest."""

    low: float  # No number is below the first or above the last; the largest lies above the second.
    high_from: float
    high: float
    scale: float
    offset: float
    words: str
    # Whether the range alone shows it: of commands it does where the name is that of one.
    clear: Literal["always", "of commands", "never"]
    rivals: tuple[tuple[str, str], ...] = ()  # Other readings of such numbers, but for speeds, and where they hold.


_OLD_PX4 = ("scale: 0.00114286, offset: -1.22857", "if the range is 1075 to 1950, as in older PX4")
RANGES: Final = (
    Range(-1.05, -inf, 1.05, 1.0, 0.0, "shares of the largest", "always"),
    Range(0.0, -inf, 101.0, 0.01, 0.0, "per cent", "of commands"),
    Range(800.0, -inf, 2300.0, 1e-3, -1.0, "pulses of 1000 to 2000 us", "never", (_OLD_PX4,)),
    Range(0.0, 32768.0, 65536.0, 1 / 65536, 0.0, "16 bits", "of commands"),
    # Less than an eighth of 16 bits flies nothing.
    Range(0.0, 2300.0, 8191.5, 1 / 8191, 0.0, "13 bits of UAVCAN", "never"),
    Range(0.0, 2300.0, 32768.0, 1 / 65536, 0.0, "16 bits", "never"),
    Range(0.0, -inf, 2048.0, 1 / 2000, -48 / 2000, "48 to 2047 of DShot", "never"),
)
