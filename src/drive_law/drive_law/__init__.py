"""Laws of a drive of two axes with two motors each, which real and simulated drives run.

drive_state is the drive, axis_control an axis of it, and loops contains their laws. The units and nodes of a drive
derive from rate_drive and rate_drive_node, those of a drive that follows angles from angle_drive.

Angles, rates and torques of the load are deck angles: azimuth clockwise from the bow seen from above
(it turns opposite to a REP 103 yaw), elevation up from the deck. Motor quantities are on the motor shaft.

Symbols
    theta, omega      angle [rad], rate [rad/s] of a motor shaft (index 1, 2) or of the load (no index)
    T                 torque [Nm]: per motor on its shaft; T_1,2 = T +- T_b
    T_b               bias torque that keeps the two pinions on opposite flanks [Nm]
    N                 ratio motor : load = planetary reducer x pinion on bull gear
    J                 inertia per motor on its shaft [kg m2]
    i_d, i_q          phase currents in rotor coordinates, amplitude invariant [A]
    v_d, v_q          phase voltages in rotor coordinates [V]
    R, L, psi, p      phase resistance [ohm], inductance [H], flux linkage [Wb], pole pairs
    K_t               torque constant 1.5 p psi [Nm/A]; psi_hat, K_t_hat: values in the controller
    K_p, K_i          proportional and integral gain of a PI controller
    K_d               gain of the damping between the motors [Nms/rad]
    w_o, d            bandwidth of the disturbance observer [rad/s]; disturbance torque on a motor shaft [Nm]
    omega_hat, d_hat  estimates of the disturbance observer; l_1, l_2: its gains
    x, tau            thermal load of a motor (1: steady state at T_rated), time constant of its winding [s]
    A, E              angles of the azimuth and the elevation axis [rad]
"""
