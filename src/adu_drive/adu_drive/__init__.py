"""Antenna drive unit (ADU): two axes, each with two motors that remove the lash of one bull gear.

    drive_unit    two axes over one control period T: commands in, encoders out (function `step`)
    drive_state   enable, brakes and faults: the state machine of both axes
    stow_pins     pins that hold the stowed axes: their motion and their failure
    axis          one axis: sensors, speed loop, two current loops, plant, trip conditions
    unit          unit of the drive: input messages, law, output messages; adu_node runs it
    timekeeper_node   node that owns the time of the drive
    params, injected, state_file    parameters; injected faults; file for the state of the plant over a restart
    lanes         many drives at once, computed by vector instructions, for trials
    controller    laws of the controller: loops (travel, speed, bias, disturbance observer, current), encoder, faults
    motors        a motor and its brake: currents, speed, cogging, heat; this and the next four are in the folder plant
    mechanics     meshes, friction of the bearing, end stops and flexible structure of an axis
    wind          torques of the wind: those of time only, and those of one wind over both axes
    gimbal            rigid bodies that turn about two axes on a moving deck
    mount             direction of the beam from the angles of the axes
    angle_drive                   base of the units of drives that follow angles
    electronic_beam, beam_unit    law and unit of a beam of a phased array, which takes the place of the drive

Angles, rates and torques of the load are deck angles: azimuth clockwise from the bow seen from above
(it turns opposite to a REP 103 yaw), elevation up from the deck. Motor quantities are on the motor shaft.

Symbols
    theta, omega      angle [rad], rate [rad/s] of a motor shaft (index 1, 2) or of the load (no index)
    T                 torque [Nm]: per motor on its shaft; T_1,2 = T +- T_b
    T_b               bias torque that keeps the two pinions on opposite flanks [Nm]
    N                 ratio motor : load = planetary reducer x pinion on bull gear
    J_m, J            inertia of rotor + reducer + pinion on the motor shaft; of the load [kg m2]
    i_d, i_q          phase currents in rotor coordinates, amplitude invariant [A]
    v_d, v_q          phase voltages in rotor coordinates [V]
    R, L, psi, p      phase resistance [ohm], inductance [H], flux linkage [Wb], pole pairs
    K_t               torque constant 1.5 p psi [Nm/A]; psi_hat, K_t_hat: values in the controller
    K_p, K_i          proportional and integral gain of a PI controller
    K_d               gain of the damping between the motors [Nms/rad]
    w_o, d            bandwidth of the disturbance observer [rad/s]; disturbance torque on a motor shaft [Nm]
    omega_hat, d_hat  estimates of the disturbance observer; l_1, l_2: its gains
    J_dish            part of J that swings on a spring k_dish [Nm/rad] and a damper c_dish [Nms/rad]
    k, c, delta       mesh stiffness [Nm/rad], damping [Nms/rad], deflection [rad], all on the load axis
    z                 LuGre bristle deflection [rad]; sigma_0, sigma_1 its stiffness and damping
    T_c, T_s, v_s     Coulomb and breakaway friction [Nm], Stribeck rate [rad/s]
    x, tau            thermal load of a motor (1: steady state at T_rated), time constant of its winding [s]
    alpha, dT         temperature coefficient of copper [1/K], rise of the winding at x = 1 [K]
    A, E              angles of the azimuth and the elevation axis [rad]
    v, V              turbulence along the mean wind, and the mean wind [m/s]
    h                 sub-step of the plant, 50 us; the current loops have 100 us, the speed loop 0.5 ms
"""
