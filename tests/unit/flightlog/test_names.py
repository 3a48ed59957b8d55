"""Names of columns: which belong together, what they may be, what they are not."""

import numpy as np
import pytest

from cpfls_cli.flightlog.names import column_groups, height_columns, named_signals, only_of_airplanes, wished_signals
from cpfls_cli.flightlog.settings import UNITS_OF_SIGNAL
from cpfls_cli.flightlog.vocabulary import ALLOWED, IN_RADIANS, KNOWN, MEANINGS, RANGES, sizes
from cpfls_cli.units import KNOWN_UNITS


def first(names, signal, system=""):
    """Columns of the best candidate for a signal; None without one."""
    found = [named for named in named_signals(column_groups(tuple(names.split())), system) if named.signal == signal]
    return min(found, key=lambda named: named.rank, default=None)


@pytest.mark.parametrize(
    ("names", "signal", "columns"),
    [
        ("t phi theta psi", "attitude", "phi theta psi"),
        ("q_w q_x q_y q_z", "quaternion", "q_w q_x q_y q_z"),
        ("qx qy qz qw", "quaternion", "qw qx qy qz"),
        ("omega_x omega_y omega_z", "body_rate", "omega_x omega_y omega_z"),
        ("gyro.x gyro.y gyro.z", "body_rate", "gyro.x gyro.y gyro.z"),
        ("xacc yacc zacc xgyro ygyro zgyro", "body_rate", "xgyro ygyro zgyro"),
        (
            "rotating_speed.x rotating_speed.y rotating_speed.z",
            "body_rate",
            "rotating_speed.x rotating_speed.y rotating_speed.z",
        ),
        ("positions[0] positions[1] positions[2]", "position", "positions[0] positions[1] positions[2]"),
        ("ang_vel_x ang_vel_y ang_vel_z", "body_rate", "ang_vel_x ang_vel_y ang_vel_z"),
        ("angVelX angVelY angVelZ", "body_rate", "angVelX angVelY angVelZ"),
        ("px py pz", "position", "px py pz"),
        ("pose_rpy.x pose_rpy.y pose_rpy.z", "position", "pose_rpy.x pose_rpy.y pose_rpy.z"),
        ("pose_rpy.roll pose_rpy.pitch pose_rpy.yaw", "attitude", "pose_rpy.roll pose_rpy.pitch pose_rpy.yaw"),
        ("posX posY posZ", "position", "posX posY posZ"),
        ("ax ay az gx gy gz", "body_rate", "gx gy gz"),
        ("gx gy gz gyro_x gyro_y gyro_z", "body_rate", "gyro_x gyro_y gyro_z"),
        ("imuVAng[0] imuVAng[1] imuVAng[2]", "body_rate", "imuVAng[0] imuVAng[1] imuVAng[2]"),
        ("gyroADC[0] gyroADC[1] gyroADC[2]", "body_rate", "gyroADC[0] gyroADC[1] gyroADC[2]"),
        ("IMU.GyrX IMU.GyrY IMU.GyrZ", "body_rate", "IMU.GyrX IMU.GyrY IMU.GyrZ"),
        ("RATE.R RATE.P RATE.Y", "body_rate", "RATE.R RATE.P RATE.Y"),
        ("rollspeed pitchspeed yawspeed", "body_rate", "rollspeed pitchspeed yawspeed"),
        ("p q r", "body_rate", "p q r"),
        ("roll pitch yaw p q r", "body_rate", "p q r"),
        ("roll pitch yaw p q r", "attitude", "roll pitch yaw"),
        ("w0 w1 w2", "body_rate", "w0 w1 w2"),
        ("w1 w2 w3 w4", "rotor_speed", "w1 w2 w3 w4"),
        ("sfx sfy sfz", "acceleration", "sfx sfy sfz"),
        (
            "/imu.linear_acceleration.x /imu.linear_acceleration.y /imu.linear_acceleration.z",
            "acceleration",
            "/imu.linear_acceleration.x /imu.linear_acceleration.y /imu.linear_acceleration.z",
        ),
        (
            "stateEstimateZ_x stateEstimateZ_y stateEstimateZ_z",
            "position",
            "stateEstimateZ_x stateEstimateZ_y stateEstimateZ_z",
        ),
        ("XKF1.PN XKF1.PE XKF1.PD", "position", "XKF1.PN XKF1.PE XKF1.PD"),
        ("vx vy vz", "velocity", "vx vy vz"),
        ("m1_rads m2_rads m3_rads m4_rads", "rotor_speed", "m1_rads m2_rads m3_rads m4_rads"),
        ("om1 om2 om3 om4 omcmd1 omcmd2 omcmd3 omcmd4", "rotor_speed", "om1 om2 om3 om4"),
        ("om1 om2 om3 om4 omcmd1 omcmd2 omcmd3 omcmd4", "rotor_command", "omcmd1 omcmd2 omcmd3 omcmd4"),
        ("pwm.m1_pwm pwm.m2_pwm pwm.m3_pwm pwm.m4_pwm", "rotor_command", "pwm.m1_pwm pwm.m2_pwm pwm.m3_pwm pwm.m4_pwm"),
        ("u1 u2 u3 u4", "rotor_command", "u1 u2 u3 u4"),
        ("a/lab.m_1 a/lab.m_2 a/lab.m_3 a/lab.m_4", "rotor_command", "a/lab.m_1 a/lab.m_2 a/lab.m_3 a/lab.m_4"),
        ("w_des1 w_des2 w_des3 w_des4", "rotor_command", "w_des1 w_des2 w_des3 w_des4"),
        ("m1_ref m2_ref m3_ref m4_ref", "rotor_command", "m1_ref m2_ref m3_ref m4_ref"),
        ("own/r/cmd1 own/r/cmd2 own/r/cmd3", "rotor_command", "own/r/cmd1 own/r/cmd2 own/r/cmd3"),
        ("rpm_cmd/n[0] rpm_cmd/n[1] rpm_cmd/n[2]", "rotor_command", "rpm_cmd/n[0] rpm_cmd/n[1] rpm_cmd/n[2]"),
        # What holds numbers says nothing of them, and w of a command turns fast.
        ("own/u/Data[0] own/u/Data[1] own/u/Data[2]", "rotor_command", "own/u/Data[0] own/u/Data[1] own/u/Data[2]"),
        ("u/values[0] u/values[1] u/values[2]", "rotor_command", "u/values[0] u/values[1] u/values[2]"),
        ("cmd/w[0] cmd/w[1] cmd/w[2] cmd/w[3]", "rotor_command", "cmd/w[0] cmd/w[1] cmd/w[2] cmd/w[3]"),
        ("own/cmd/w1 own/cmd/w2 own/cmd/w3 own/cmd/w4", "rotor_command", "own/cmd/w1 own/cmd/w2 own/cmd/w3 own/cmd/w4"),
        ("orient_w orient_x orient_y orient_z", "quaternion", "orient_w orient_x orient_y orient_z"),
        # Named as keys of a config are, each with its unit.
        ("p_rad_s q_rad_s r_rad_s", "body_rate", "p_rad_s q_rad_s r_rad_s"),
        ("roll_rad pitch_rad yaw_rad p_rad_s q_rad_s r_rad_s", "attitude", "roll_rad pitch_rad yaw_rad"),
        ("x_m y_m z_m vx_m_s vy_m_s vz_m_s", "position", "x_m y_m z_m"),
        ("x_m y_m z_m vx_m_s vy_m_s vz_m_s", "velocity", "vx_m_s vy_m_s vz_m_s"),
        ("ax_m_s2 ay_m_s2 az_m_s2", "acceleration", "ax_m_s2 ay_m_s2 az_m_s2"),
        ("w1_rad_s w2_rad_s w3_rad_s w4_rad_s", "rotor_speed", "w1_rad_s w2_rad_s w3_rad_s w4_rad_s"),
        # By place, in any case; of a path any part may say pwm, and output is no command by itself.
        ("motor_fl motor_bl motor_fr motor_br", "rotor_command", "motor_fl motor_fr motor_bl motor_br"),
        ("rpmFL rpmFR rpmRL rpmRR", "rotor_speed", "rpmFL rpmFR rpmRL rpmRR"),
        (
            "frontLeftMotor frontRightMotor rearLeftMotor rearRightMotor",
            "rotor_command",
            "frontLeftMotor frontRightMotor rearLeftMotor rearRightMotor",
        ),
        ("output/esc[0] output/esc[1] output/esc[2]", "rotor_command", "output/esc[0] output/esc[1] output/esc[2]"),
        ("pwm/out[0] pwm/out[1] pwm/out[2]", "rotor_command", "pwm/out[0] pwm/out[1] pwm/out[2]"),
        ("n_ref1 n_ref2 n_ref3 n_ref4", "rotor_command", "n_ref1 n_ref2 n_ref3 n_ref4"),
        ("rpm_sp_1 rpm_sp_2 rpm_sp_3 rpm_sp_4", "rotor_command", "rpm_sp_1 rpm_sp_2 rpm_sp_3 rpm_sp_4"),
        ("duty_1 duty_2 duty_3 duty_4", "rotor_command", "duty_1 duty_2 duty_3 duty_4"),
        (
            "output/rotor_speed[0] output/rotor_speed[1] output/rotor_speed[2]",
            "rotor_speed",
            "output/rotor_speed[0] output/rotor_speed[1] output/rotor_speed[2]",
        ),
        ("M1 M2 M3 M4 M_ref1 M_ref2 M_ref3 M_ref4", "rotor_command", "M_ref1 M_ref2 M_ref3 M_ref4"),
        ("Phi Theta Psi", "attitude", "Phi Theta Psi"),
        ("ROLL PITCH YAW", "attitude", "ROLL PITCH YAW"),
        ("roll pitch heading", "attitude", "roll pitch heading"),
        ("euler_r euler_p euler_y", "attitude", "euler_r euler_p euler_y"),
        ("P Q R", "body_rate", "P Q R"),
        ("gyro_r gyro_p gyro_y", "body_rate", "gyro_r gyro_p gyro_y"),
        ("pos_n pos_e pos_d", "position", "pos_n pos_e pos_d"),
        ("curX curY curZ", "position", "curX curY curZ"),
        ("qi qx qy qz", "quaternion", "qi qx qy qz"),
        ("xvel yvel zvel", "velocity", "xvel yvel zvel"),
        ("xrate yrate zrate", "body_rate", "xrate yrate zrate"),
        ("motor_one motor_two motor_three motor_four", "rotor_command", "motor_one motor_two motor_three motor_four"),
        ("x_dot y_dot z_dot", "velocity", "x_dot y_dot z_dot"),
        ("roll_dot pitch_dot yaw_dot", "body_rate", "roll_dot pitch_dot yaw_dot"),
        ("phi_dot theta_dot psi_dot", "body_rate", "phi_dot theta_dot psi_dot"),
        ("phi_dot_cal theta_dot_cal psi_dot_cal", "body_rate", "phi_dot_cal theta_dot_cal psi_dot_cal"),
        ("xdot ydot zdot", "velocity", "xdot ydot zdot"),
        ("bat_volt", "voltage", "bat_volt"),
        # A structure of outputs holds what was measured; what is asked for is a command in volts too.
        ("out/roll out/pitch out/yaw", "attitude", "out/roll out/pitch out/yaw"),
        ("output/roll output/pitch output/yaw", "attitude", "output/roll output/pitch output/yaw"),
        ("/camera/gyro.x /camera/gyro.y /camera/gyro.z", "body_rate", "/camera/gyro.x /camera/gyro.y /camera/gyro.z"),
        ("volts_cmd_1 volts_cmd_2 volts_cmd_3", "rotor_command", "volts_cmd_1 volts_cmd_2 volts_cmd_3"),
        ("esc1 esc2 esc3 esc4", "rotor_command", "esc1 esc2 esc3 esc4"),
        ("R P Y", "attitude", "R P Y"),
        ("v_dot_x v_dot_y v_dot_z", "acceleration", "v_dot_x v_dot_y v_dot_z"),
        ("batV", "voltage", "batV"),
        # Axes in mixed case, a gyroscope of a structure, and words that are written as one.
        ("xGyro yGyro ZGyro", "body_rate", "xGyro yGyro ZGyro"),
        ("Roll pitch YAW", "attitude", "Roll pitch YAW"),
        ("imu.gx imu.gy imu.gz", "body_rate", "imu.gx imu.gy imu.gz"),
        ("att.gx_[deg/s] att.gy_[deg/s] att.gz_[deg/s]", "body_rate", "att.gx_[deg/s] att.gy_[deg/s] att.gz_[deg/s]"),
        ("motval_0 motval_1 motval_2 motval_3", "rotor_command", "motval_0 motval_1 motval_2 motval_3"),
        ("motorrpm1 motorrpm2 motorrpm3", "rotor_speed", "motorrpm1 motorrpm2 motorrpm3"),
        ("pwm_in_us_1 pwm_in_us_2 pwm_in_us_3", "rotor_command", "pwm_in_us_1 pwm_in_us_2 pwm_in_us_3"),
        # The first instance of a topic bears no number.
        ("ESC.RPM ESC[1].RPM ESC[2].RPM ESC[3].RPM", "rotor_speed", "ESC.RPM ESC[1].RPM ESC[2].RPM ESC[3].RPM"),
    ],
)
def test_columns_are_found_by_their_names(names, signal, columns):
    assert first(names, signal).group.columns == tuple(columns.split())


@pytest.mark.parametrize(
    ("names", "signal"),
    [
        ("ctrltarget_x ctrltarget_y ctrltarget_z", "position"),
        ("vx_r vy_r vz_r", "velocity"),
        ("rpydx rpydy rpydz", "attitude"),
        ("omegar_x omegar_y omegar_z", "body_rate"),
        ("qx_poses qy_poses qz_poses qw_poses", "position"),
        ("m1_rads2 m2_rads2 m3_rads2 m4_rads2", "rotor_speed"),
        ("ATT.DesRoll ATT.DesPitch ATT.DesYaw", "attitude"),
        ("gyro_bias_x gyro_bias_y gyro_bias_z", "body_rate"),
        ("w0 w1 w2", "rotor_speed"),
        # Of a structure only the last word says what drives rotors.
        ("log/output/lean[0] log/output/lean[1] log/output/lean[2]", "rotor_command"),
        ("rpm_cmd/n[0] rpm_cmd/n[1] rpm_cmd/n[2]", "rotor_speed"),
        ("acc_gx acc_gy acc_gz", "body_rate"),
        ("d1 d2 d3 d4", "rotor_command"),
        ("ref1 ref2 ref3 ref4", "rotor_command"),
        ("omega_cmd[0] omega_cmd[1] omega_cmd[2]", "rotor_command"),
        ("M1 M2 M3 M4 M_ref1 M_ref2 M_ref3 M_ref4", "rotor_speed"),
        ("fl fr rl rr", "rotor_command"),
        ("x_dot y_dot z_dot", "position"),
        ("x y z p q r", "attitude"),
        ("pid_roll pid_pitch pid_yaw", "attitude"),
        ("u_roll u_pitch u_yaw", "attitude"),
        ("phi_dot theta_dot psi_dot", "attitude"),
        ("roll pitch yaw", "body_rate"),
        ("p_dot q_dot r_dot", "body_rate"),
        ("gyro_x_dot gyro_y_dot gyro_z_dot", "body_rate"),
        ("roll_ddot pitch_ddot yaw_ddot", "body_rate"),
        ("phi_velocity theta_velocity psi_velocity", "attitude"),
        ("gimbal_roll gimbal_pitch gimbal_yaw", "attitude"),
        ("angular_acceleration_x angular_acceleration_y angular_acceleration_z", "body_rate"),
        ("batt_pct", "voltage"),
        ("battery_w", "voltage"),
        ("motor_temp_1 motor_temp_2 motor_temp_3 motor_temp_4", "rotor_command"),
        ("bat", "voltage"),
        ("battery_percentage", "voltage"),
        ("battery_remaining", "voltage"),
        ("esc1_voltage esc2_voltage esc3_voltage esc4_voltage", "rotor_command"),
        ("esc_curr_1 esc_curr_2 esc_curr_3 esc_curr_4", "rotor_command"),
        ("motor_power_1 motor_power_2 motor_power_3 motor_power_4", "rotor_command"),
        ("roll_out pitch_out yaw_out", "attitude"),
        ("X Y Z P Q R", "attitude"),
        ("kp_r kp_p kp_y", "attitude"),
        ("v_dot_x v_dot_y v_dot_z", "velocity"),
        ("pwm_in[0] pwm_in[1] pwm_in[2] pwm_in[3]", "rotor_command"),
        ("GyroIntegration[0] GyroIntegration[1] GyroIntegration[2]", "body_rate"),
        ("ang_vel_cmds[0] ang_vel_cmds[1] ang_vel_cmds[2]", "body_rate"),
    ],
)
def test_what_is_wished_estimated_or_squared_is_no_measurement(names, signal):
    assert first(names, signal) is None


def test_what_is_there_in_small_letters_and_in_capitals_is_two_things():
    names = ("roll", "pitch", "yaw", "Roll", "Pitch")
    assert [own.columns for own in column_groups(names) if len(own.columns) > 1] == [names[:3]]


def test_a_number_in_a_name_may_be_long():
    assert [own.columns for own in column_groups(("m" + 5000 * "1",))] == [("m" + 5000 * "1",)]


def test_a_letter_alone_is_of_another_thing_in_capitals():
    names = ("p[0]", "q[0]", "R[0]", "w[0]", "w[1]", "w[2]", "x", "y", "Z")
    found = [
        own.group.columns for own in named_signals(column_groups(names)) if own.signal in ("body_rate", "position")
    ]
    assert found == [("w[0]", "w[1]", "w[2]")]


@pytest.mark.parametrize(
    ("names", "signal"),
    [
        ("p_cmd q_cmd r_cmd", "setpoint_body_rate"),
        ("omega_cmd[0] omega_cmd[1] omega_cmd[2]", "setpoint_body_rate"),
        ("cmd_x cmd_y cmd_z", "setpoint_position"),
        ("x_ref y_ref z_ref", "setpoint_position"),
    ],
)
def test_what_is_commanded_may_be_a_setpoint(names, signal):
    assert [named.signal for named in wished_signals(column_groups(tuple(names.split())))] == [signal]


@pytest.mark.parametrize(
    ("names", "angle", "found"),
    [
        ("airspeed aoa_deg", [40.0, 4.0, 8.0, -3.0], True),
        ("true_airspeed angle_of_attack", [2.0, 0.1, 0.2, 0.0], True),
        ("va alpha", [0.0, 0.1, 0.2, 0.0], True),
        # From any side, or another thing.
        ("airspeed sideslip", [0.0, 150.0, -60.0, 5.0], False),
        ("airspeed aoa", [0.1, 0.9, 0.5, 0.4], False),
        ("airspeed aoa", [np.nan] * 4, False),
        ("va alpha_x", [0.0, 0.1, 0.2, 0.0], False),
        ("airspeed yaw", [0.0, 0.1, 0.2, 0.0], False),
    ],
)
def test_an_airplane_flies_where_its_nose_points(names, angle, found):
    columns = dict(zip(names.split(), np.array([[0.0, 15.0, 14.0, 16.0], angle]), strict=True))
    assert only_of_airplanes({"t": np.arange(4.0), **columns}) == (names.split() if found else [])


def test_a_height_is_one_column_in_its_unit():
    assert list(height_columns(("t", "Alt", "gps_altitude", "altitude(ft)", "pressure_alt"))) == [
        (("Alt",), 1.0),
        (("altitude(ft)",), 0.3048),
        (("pressure_alt",), 1.0),
    ]


def test_what_a_kind_of_log_asks_for_counts_as_one_of_its_names():
    """One measured name alone has many authors; two of a topic's own have one."""
    rates, asked = (f"controller.{own}roll controller.{own}pitch controller.{own}yaw" for own in ("r_", "cmd_"))
    assert first(rates, "body_rate") is None
    assert first(f"{rates} {asked}", "body_rate").known == "Crazyflie"
    # Any controller has axes.
    axes, motors = "controller.roll controller.pitch controller.yaw", "motor.m1 motor.m2 motor.m3 motor.m4"
    assert not first(f"{axes} {motors}", "rotor_command").known


def test_a_kind_of_log_knows_its_columns_before_their_words_are_read():
    names = "vehicle_angular_velocity.xyz[0] vehicle_angular_velocity.xyz[1] vehicle_angular_velocity.xyz[2]"
    named = first(f"{names} sensor_gyro.x sensor_gyro.y sensor_gyro.z", "body_rate", "PX4 1.14.0")
    assert (named.group.columns, named.unit, named.frame, named.known) == (tuple(names.split()), "rad/s", "FRD", "PX4")


def test_of_an_autopilot_only_known_columns_drive_rotors():
    names = " ".join(f"vehicle_command.param{number}" for number in range(1, 8))
    named = f"control_allocator_status.actuator_saturation[{{}}] {names}"
    saturation = " ".join(named.format(number) for number in range(4))
    assert first(saturation, "rotor_command", "PX4 1.15") is None


def test_events_of_a_card_stand_before_the_names_of_a_crazyflie():
    named = first("fixedFrequency.gyro.x fixedFrequency.gyro.y fixedFrequency.gyro.z", "body_rate", "Crazyflie uSD")
    assert (named.unit, named.frame) == ("deg/s", "FLU")


@pytest.mark.parametrize("signal", ["velocity", "acceleration"])
def test_what_turns_is_no_translation(signal):
    assert first("ang_vel_x ang_vel_y ang_vel_z ang_acc_x ang_acc_y ang_acc_z", signal) is None


def test_rows_of_the_table_fit_their_signals():
    """A slip in `columns.toml` is found before a log meets it: units of another kind, signs or words that are none."""
    for row in (own for own in KNOWN if own.signal in UNITS_OF_SIGNAL):
        assert row.unit is None or KNOWN_UNITS[row.unit].si in UNITS_OF_SIGNAL[row.signal], row
        assert row.sign is None or len(row.sign) in (len(row.columns), 3), row
        assert row.frame in (None, "FLU", "FRD", "ENU", "NED"), row
    assert {own.signal for own in MEANINGS} | set(ALLOWED) | {
        signal for own in IN_RADIANS.values() for signal in own
    } <= set(UNITS_OF_SIGNAL)
    assert {kind for own in MEANINGS for kind in own.kinds} <= {"xyz", "wxyz", "angles", "numbers", "one"}
    assert {own.clear for own in RANGES} == {"always", "of commands", "never"}
    assert all(sizes(of) for of in ("body_rate", "attitude", "sensed", "over_ground"))
