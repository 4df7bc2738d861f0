"""Parameter sets of motors, named in a hardware file by `motor`: what a drive that is set up for each of them holds."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import pi
from typing import TYPE_CHECKING

from hw_bridge.profiles.motor import MotorModel
from twin.errors import DeclarationError, nearest

if TYPE_CHECKING:
    from collections.abc import Mapping

    from hw_bridge.profiles.description import Profile

PER_PITCH = 3000  # increments of one magnetic pitch of a linear motor with analog Hall sensors
PULSES = 500  # of the EC-i 40's encoder, four increments each
GEAR = 5.0  # turns of the EC-i 40 for one of the rig's frame
RPM = 2.0 * pi / 60.0  # [rad/s]


@dataclass(frozen=True)
class MotorParameters:
    """One motor. `pitch`: magnetic pitch [m] of a linear one, else 0.

    `scaling`: by profile, the objects that scale lengths or angles, as a drive holds them that is set up for this motor;
    a run stops where a drive holds others. `settings`: what else a drive comes with that is set up for it: those of a
    simulated drive; a real one is not written.
    """

    name: str
    title: str
    model: MotorModel
    pitch: float = 0.0
    scaling: Mapping[str, Mapping[tuple[int, int], int]] = field(default_factory=dict)
    settings: Mapping[str, Mapping[tuple[int, int], int]] = field(default_factory=dict)


def linear(name: str, title: str, pitch: int, stroke: int, **parameters: float) -> MotorParameters:
    """A linear motor of FAULHABER. `pitch`, `stroke` [mm]."""
    half = 500 * stroke  # [um], what an MCLM counts
    return MotorParameters(
        name,
        title,
        MotorModel("servomotor", "m", resolution=1e-3 * pitch / PER_PITCH, index=1e-3 * pitch, parameters=parameters),
        1e-3 * pitch,
        scaling={"mclm": {(0x2350, 4): pitch}, "faulhaber_v3": {(0x6092, 1): 1000 * pitch, (0x608F, 1): PER_PITCH}},
        settings={
            "faulhaber_v3": {(0x6096, 1): 1, (0x6096, 2): 60_000},
            "mclm": {(0x607D, 1): -half, (0x607D, 2): half},
        },
    )


MOTORS = {
    motor.name: motor
    for motor in (
        linear("lm2070", "FAULHABER LM 2070-080-11", 24, 80),
        # 6.43 N/A, 13.17 ohm, 3.6 and 10.7 N, recalled. Assumed: the stroke, and gains for the moved mass of the rig
        linear(
            "lm1247", "FAULHABER LM 1247-080-11", 18, 80,
            force_constant=6.43, resistance=13.17, current_continuous=0.56, current_maximum=1.66,
            position_resolution=6e-6, velocity_gain=25.3, velocity_integral=1580.0,
        ),
        MotorParameters(
            "ec_i_40",
            "maxon EC-i 40 (488607) with the rig's gear and frame",
            MotorModel(  # the drive counts at the motor
                "rotary_drive",
                "rad",
                resolution=2.0 * pi / (4 * PULSES),
                index=2.0 * pi,
                parameters={
                    "gear_ratio": GEAR,
                    "encoder_counts": 4.0 * PULSES,
                    "current_maximum": 15.0,  # the drive's output limit 3001h.2
                    "velocity_maximum": 8000.0 * RPM / GEAR,
                },
                position="angle",
                load="load_torque",
                ratio=GEAR,
            ),
            scaling={"epos4": {(0x3010, 1): PULSES}, "epos2": {(0x2210, 1): PULSES}},
        ),
    )
}  # fmt: skip
NAMED_BY_MEMBER = ("profile", "member")  # values of `motor` that name no parameter set


def motor_parameters(profile: Profile, name: str) -> MotorParameters:
    """The parameter set of this name; of the profile's own motor where a hardware file names none."""
    if name in NAMED_BY_MEMBER:
        return MOTORS[profile.motor_name]
    if name not in MOTORS:
        raise DeclarationError(f"There is no motor {name!r}. {nearest(name, list(MOTORS))}")
    return MOTORS[name]


def magnetic_pitch(name: str) -> float | None:
    """Magnetic pitch of the motor with this name [m], 0 of a rotary one; None where the name is that of no motor."""
    return MOTORS[name].pitch if name in MOTORS else None


def disagreement(profile: Profile, motor: MotorParameters, stored: Mapping[tuple[int, int], int]) -> str:
    """Objects of a drive that are not those of the motor, or nothing. `held`: what the drive holds."""
    differing = [
        f"{index:04X}h.{sub} is {stored[index, sub]}, {value} with this motor"
        for (index, sub), value in motor.scaling.get(profile.name, {}).items()
        if (index, sub) in stored and stored[index, sub] != value
    ]
    return "; ".join(differing)
