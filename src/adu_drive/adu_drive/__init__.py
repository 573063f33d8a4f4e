"""Antenna drive unit (ADU): two axes, each with two motors that remove the lash of one bull gear.

drive_law contains its controllers, up to the torque of each motor; this package contains its current loops, its
sensors and the plant.

    drive_unit    two axes over one control period T: commands in, encoders out (function `step`)
    axis          one axis: sensors, speed loop of drive_law.axis_control, two current loops, plant
    unit          unit of the drive: input messages, law, output messages; adu_node runs it
    injected      injected faults
    lanes         many drives at once, computed by vector instructions, for trials
    motors        a motor and its brake: currents, speed, cogging; this and the next four are in the folder plant
    mechanics     meshes, friction of the bearing, end stops and flexible structure of an axis
    wind          torques of the wind: those of time only, and those of one wind over both axes
    gimbal        rigid bodies that turn about two axes on a moving deck
    mount         direction of the beam from the angles of the axes
    array         a beam of a phased array, which takes the place of the drive

Symbols, beside those of drive_law
    J_m, J            inertia of rotor + reducer + pinion on the motor shaft; of the load [kg m2]
    J_dish            part of J that swings on a spring k_dish [Nm/rad] and a damper c_dish [Nms/rad]
    k, c, delta       mesh stiffness [Nm/rad], damping [Nms/rad], deflection [rad], all on the load axis
    z                 LuGre bristle deflection [rad]; sigma_0, sigma_1 its stiffness and damping
    T_c, T_s, v_s     Coulomb and breakaway friction [Nm], Stribeck rate [rad/s]
    alpha, dT         temperature coefficient of copper [1/K], rise of the winding at x = 1 [K]
    v, V              turbulence along the mean wind, and the mean wind [m/s]
    h                 sub-step of the plant, 50 us; the current loops have 100 us, the speed loop 0.5 ms
"""
