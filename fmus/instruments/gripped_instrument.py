"""Connectors of an instrument between two grippers."""

from __future__ import annotations

from twin.component import Component, input, output, terminal

GRIPPERS = 2


class GrippedInstrument(Component):
    """An instrument that two sleeves on carriages hold in turns, in a frame that turns."""

    gripper_position = input(
        "m",
        "positions of the grippers from mid-stroke, positive distal",
        shape=(GRIPPERS,),
        display_unit="mm",
        nominal=0.01,
    )
    gripper_velocity = input("m/s", "speeds of the grippers", shape=(GRIPPERS,), display_unit="mm/s", nominal=0.05)
    limit_distal = input(
        "N", "largest distal force of a gripper on the instrument", shape=(GRIPPERS,), minimum=0.0, nominal=10.0
    )
    limit_proximal = input(
        "N", "largest proximal force of a gripper on the instrument", shape=(GRIPPERS,), minimum=0.0, nominal=10.0
    )
    torque_limit = input(
        "N*m",
        "largest torque of a gripper on the instrument",
        shape=(GRIPPERS,),
        minimum=0.0,
        display_unit="mN*m",
        nominal=0.02,
    )
    grip_stiffness = input(
        "N/m",
        "stiffness between carriage and instrument, 0 if open",
        shape=(GRIPPERS,),
        minimum=0.0,
        display_unit="N/mm",
        nominal=4.4e3,
    )
    grip_torsional_stiffness = input(
        "N*m/rad",
        "torsional stiffness between carriage and instrument, 0 if open",
        shape=(GRIPPERS,),
        minimum=0.0,
        nominal=0.1,
    )
    gripper_angle = input("rad", "angle of the frame with both grippers", display_unit="deg", nominal=1.0)
    gripper_angular_velocity = input("rad/s", "its speed", display_unit="deg/s", nominal=1.0)

    gripper_force = output("N", "force of the instrument on each gripper, positive distal", shape=(GRIPPERS,))
    gripper_torque = output("N*m", "torque of the instrument on the frame", display_unit="mN*m")

    grip = terminal(
        "grips of the sleeves",
        limit_distal=limit_distal,
        limit_proximal=limit_proximal,
        torque_limit=torque_limit,
        stiffness=grip_stiffness,
        torsional_stiffness=grip_torsional_stiffness,
    )
    carriage = terminal(
        "carriages of the grippers", position=gripper_position, velocity=gripper_velocity, force=gripper_force
    )
    frame = terminal(
        "frame with both grippers",
        angle=gripper_angle,
        angular_velocity=gripper_angular_velocity,
        torque=gripper_torque,
    )
