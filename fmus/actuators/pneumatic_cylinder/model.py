"""Pneumatic cylinder with its valve and tubes."""

from math import cbrt, ceil, exp, pi, sqrt

from fmus.dead_zone import dead_zone
from twin.component import Boolean, Component, Int32, input, local, output, parameter, terminal

GAS_CONSTANT = 287.06  # [J/(kg K)], dry air
HEAT_VOLUME = 2.5 * GAS_CONSTANT  # [J/(kg K)], specific heat at constant volume
HEAT_PRESSURE = 3.5 * GAS_CONSTANT  # [J/(kg K)], at constant pressure
AMBIENT = 101325.0  # [Pa]

# reference state of ISO 6358: density [kg/m3], temperature [K]
DENSITY_REFERENCE = 1.185
TEMPERATURE_REFERENCE = 293.15

# pressure ratio above which the flow is taken as laminar, which keeps the slope at ratio 1 finite
LAMINAR = 0.995

SUBSTEP = 1e-4  # [s], longest
SPEED_OF_SOUND = 343.0  # [m/s]


class PneumaticCylinder(Component):
    """Double-acting cylinder ADVC-10-10-A-P between the sleeve's holders, with 5/2 valve and a tube to each port.

    Flow by ISO 6358, mass and energy balance in each chamber. The braid is part of the moving mass's equation, since
    it is too stiff for a connection: the sleeve tells its stiffness and where it closes.
    """

    valve = input("", "5/2 valve: true extends, false retracts", start=False, type=Boolean)
    supply_pressure = input("Pa", "gauge pressure of the supply, 0 if the air is lost", start=6e5, minimum=0.0,
                            maximum=1e6, display_unit="bar", nominal=1e5)
    contact_extension = input("m", "extension at which the braid has closed", start=3.7e-3, minimum=0.0,
                              display_unit="mm", nominal=1e-3)
    contact_stiffness = input("N/m", "stiffness of the closed braid", start=5e4, minimum=0.0, nominal=1e4)
    relaxed_stiffness = input("N/m", "stiffness of the open braid", start=500.0, minimum=0.0, nominal=100.0)

    extension = output("m", "extension of piston and moving holder, 0 on the cushion of the retracted end",
                       display_unit="mm")
    velocity = output("m/s", "speed of the piston, positive extends", display_unit="mm/s")
    pressure_extend = output("Pa", "gauge pressure in the chamber that extends", display_unit="bar")
    pressure_retract = output("Pa", "gauge pressure in the chamber that retracts", display_unit="bar")
    tension = output("N", "axial tension in the braid")
    recoil_force = output("N", "of the moving mass on the carriage, positive distal, mean over the last step")

    holder = terminal(
        "moving holder, on the piston", extension=extension, tension=tension, contact_extension=contact_extension,
        contact_stiffness=contact_stiffness, relaxed_stiffness=relaxed_stiffness,
    )
    control = terminal("valve, and where the piston is", valve=valve, extension=extension)

    bore = parameter(10e-3, "m", "diameter of the piston", display_unit="mm", minimum=1e-3, source="type code -10-")
    rod = parameter(4e-3, "m", "diameter of the rod", display_unit="mm", minimum=0.0, source="datasheet, recalled")
    stroke = parameter(10e-3, "m", "travel between the cushions", display_unit="mm", minimum=1e-3,
                       source="type code -10-A")
    mass = parameter(0.03, "kg", "piston, rod and moving sleeve holder", minimum=1e-3,
                     source="estimate: cylinder 6 to 10 g, printed holder and link 15 to 30 g")
    orientation = parameter(1, "", "+1: the piston extends distally (gripper 1); -1: proximally (gripper 2)", type=Int32,
                            minimum=-1, maximum=1, fixed=True, source="paper, section III.A, as braided_sleeve")
    friction_coulomb = parameter(1.5, "N", "seal friction in motion", minimum=0.0, source="estimate: 1 to 2 N")
    friction_static = parameter(3.0, "N", "seal friction at rest", minimum=0.0,
                                source="estimate: 2 to 4 N; less than 7.9 N, since 1 bar suffices to move it")
    stribeck_velocity = parameter(15e-3, "m/s", "speed at which static friction has faded", display_unit="mm/s",
                                  minimum=1e-4, source="estimate: 10 to 20 mm/s")
    friction_viscous = parameter(2.0, "N*s/m", "viscous friction of seals and holder", minimum=0.0,
                                 source="estimate: 1 N at the speed limit of 0.5 m/s")
    braid_damping = parameter(
        20.0, "N*s/m", "damping of the closed braid", minimum=0.0,
        source="estimate: damping ratio 0.25 of 30 g on 50 N/mm, yarns slide on instrument and yarns",
    )
    cushion_stiffness = parameter(2e5, "N/m", "elastic cushions at both ends", minimum=1e3, display_unit="N/mm",
                                  source="estimate: 47 N press the rings in by 0.24 mm")
    cushion_damping = parameter(30.0, "N*s/m", "damping of the cushions", minimum=0.0,
                                source="estimate: damping ratio 0.2")
    dead_volume = parameter(0.1e-6, "m^3", "chamber volume at the end of travel, with port", minimum=1e-8,
                            source="estimate: about an eighth of the swept volume")
    tube_length = parameter(0.5, "m", "length of each tube", minimum=0.0, source="estimate: valve beside the rig")
    tube_bore = parameter(2.5e-3, "m", "bore of the tubes", display_unit="mm", minimum=1e-3,
                          source="estimate: tube 4 x 0.75 fits port M5")
    conductance_supply = parameter(
        8e-9, "m^3/(s*Pa)", "sonic conductance of the valve, supply to port", minimum=1e-11, maximum=1e-7,
        source="estimate: nominal flow 200 l/min, valve VUVG-L10 with M5; the paper names no valve",
    )
    conductance_exhaust = parameter(8e-9, "m^3/(s*Pa)", "sonic conductance of the valve, port to atmosphere",
                                    minimum=1e-11, maximum=1e-7, source="estimate: as conductance_supply")
    ratio_supply = parameter(0.3, "", "critical pressure ratio, supply to port", minimum=0.0, maximum=0.9,
                             source="estimate: 0.2 to 0.4")
    ratio_exhaust = parameter(0.3, "", "critical pressure ratio, port to atmosphere", minimum=0.0, maximum=0.9,
                              source="estimate: 0.2 to 0.4")
    delay_on = parameter(10e-3, "s", "valve command true to flow", display_unit="ms", minimum=0.0,
                         source="VUVG-L10 datasheet, recalled: 7 to 12 ms")
    delay_off = parameter(18e-3, "s", "valve command false to flow, by spring", display_unit="ms", minimum=0.0,
                          source="VUVG-L10 datasheet, recalled: 15 to 25 ms")
    heat_conductance = parameter(0.15, "W/K", "air to wall, each tube and chamber", minimum=0.0,
                                 source="estimate: laminar in the tube, 38 W/(m2 K) on 39 cm2")
    temperature = parameter(293.15, "K", "of ambient, walls and supply", minimum=200.0, maximum=400.0,
                            source="estimate: room")

    piston_position = local(0.0, "m", "position of the piston", display_unit="mm")
    piston_velocity = local(0.0, "m/s", "speed of the piston")
    gas_mass = local(0.0, "kg", "air in extending and retracting chamber with their tubes", shape=(2,))
    gas_energy = local(0.0, "J", "internal energy of the same", shape=(2,))
    per_energy = local(0.0, "1/m^3", "pressure per internal energy of each chamber, of its present volume", shape=(2,))
    switched = local(False, "", "where the spool is", type=Boolean)
    waited = local(0.0, "s", "age of a command that the spool has not followed yet")

    def initialize(self) -> None:
        """At rest, both chambers in equilibrium, the braid as the extending piston left it."""
        supply = max(self.supply_pressure, 0.0)
        self.switched = self.valve
        self.waited = 0.0
        self.piston_velocity = 0.0
        self.recoil_force = 0.0
        force = supply * piston_area(self, 0 if self.valve else 1) - self.friction_coulomb
        self.piston_position = (
            resting_position(self, force) if self.valve else -max(force, 0.0) / self.cushion_stiffness
        )
        for side in range(2):
            measure(self, side)
            pressure = AMBIENT + (supply if self.valve == (side == 0) else 0.0)
            v = volume(self, side)
            self.gas_energy[side] = 2.5 * pressure * v
            self.gas_mass[side] = pressure * v / (GAS_CONSTANT * self.temperature)
        publish(self)

    def step(self, t: float, h: float) -> None:
        tube = tube_conductance(self.tube_length, self.tube_bore)
        tube_ratio = min(474.0 * tube / (self.tube_bore * self.tube_bore), 0.9)
        fill, fill_ratio = in_series(self.conductance_supply, self.ratio_supply, tube, tube_ratio)
        vent, vent_ratio = in_series(self.conductance_exhaust, self.ratio_exhaust, tube, tube_ratio)

        fill_slope, vent_slope = laminar_slope(fill_ratio), laminar_slope(vent_ratio)

        # rate of the smaller chamber near pressure ratio 1 [1/s], the fastest that there is
        least = self.dead_volume + tube_volume(self)
        conductance = laminar_slope(0.0) * max(fill, vent)
        rate = 1.4 * conductance * DENSITY_REFERENCE * GAS_CONSTANT * self.temperature / least
        count = ceil(h * max(1.0 / SUBSTEP, 2.0 * rate))
        dt = h / count

        # mass flow per upstream pressure [kg/(s Pa)], of air at room temperature
        room = DENSITY_REFERENCE * sqrt(TEMPERATURE_REFERENCE / self.temperature)
        supply = AMBIENT + max(self.supply_pressure, 0.0)
        measure(self, 0)
        measure(self, 1)
        before = self.piston_velocity
        for _ in range(count):
            switch(self, dt)
            fed = 0 if self.switched else 1
            exchange(self, dt, fed, supply, fill, room, fill_ratio, fill_slope)
            exchange(self, dt, 1 - fed, AMBIENT, vent, room, vent_ratio, vent_slope)
            move(self, dt)

        # the mean over the step, so that the carriage gets the whole momentum of an impact that is shorter than a step
        self.recoil_force = -self.orientation * self.mass * (self.piston_velocity - before) / h
        publish(self)


def publish(self: PneumaticCylinder) -> None:
    """Copy the state to the outputs, so that overriding an output does not move the piston."""
    self.extension = self.piston_position
    self.velocity = self.piston_velocity
    self.pressure_extend = pressure(self, 0) - AMBIENT
    self.pressure_retract = pressure(self, 1) - AMBIENT
    self.tension = braid_tension(self, self.piston_position)


def piston_area(self: PneumaticCylinder, side: int) -> float:
    """Area that the pressure of a chamber works on [m2]; side 0 extends, 1 retracts."""
    area = 0.25 * pi * self.bore * self.bore
    return area if side == 0 else area - 0.25 * pi * self.rod * self.rod


def tube_volume(self: PneumaticCylinder) -> float:
    """Volume of one tube [m3]."""
    return 0.25 * pi * self.tube_bore * self.tube_bore * self.tube_length


def volume(self: PneumaticCylinder, side: int) -> float:
    """Volume of a chamber with port and tube [m3]."""
    travel = self.piston_position if side == 0 else self.stroke - self.piston_position

    # the cushions give a little beyond the ends of travel
    return tube_volume(self) + self.dead_volume + piston_area(self, side) * max(travel, 0.0)


def pressure(self: PneumaticCylinder, side: int) -> float:
    """Absolute pressure of a chamber [Pa]."""
    return self.per_energy[side] * self.gas_energy[side]


def measure(self: PneumaticCylinder, side: int) -> None:
    """Take over the volume of a chamber: internal energy is p V / (gamma - 1)."""
    self.per_energy[side] = 1.0 / (2.5 * volume(self, side))


def tube_conductance(length: float, bore: float) -> float:
    """Sonic conductance of a tube [m3/(s Pa)]: the usual empirical formula of Eckersten; its ratio is 474 C / bore2."""
    return 0.029 * bore * bore / sqrt(length / (bore * sqrt(sqrt(bore))) + 510.0)


def in_series(c1: float, b1: float, c2: float, b2: float) -> tuple[float, float]:
    """Conductance [m3/(s Pa)] and critical ratio of two resistances in series, as VDI 3290 has it."""
    c = c1 * c2 / cbrt(c1 * c1 * c1 + c2 * c2 * c2)
    b = 1.0 - c * c * ((1.0 - b1) / (c1 * c1) + (1.0 - b2) / (c2 * c2))
    return c, max(b, 0.0)


def flow_shape(ratio: float, critical: float) -> float:
    """Flow over choked flow at a ratio of downstream to upstream pressure: ISO 6358, and linear above `LAMINAR`."""
    return flow(1.0, critical, laminar_slope(critical), 1.0, ratio)


def flow_shape_subsonic(ratio: float, critical: float) -> float:
    """The ellipse of ISO 6358."""
    part = (ratio - critical) / (1.0 - critical)
    return sqrt(1.0 - part * part)


def laminar_slope(critical: float) -> float:
    """Flow over choked flow per difference of the pressures over the upstream one, above `LAMINAR`."""
    return flow_shape_subsonic(LAMINAR, critical) / (1.0 - LAMINAR)


def flow(choked: float, critical: float, slope: float, upstream: float, downstream: float) -> float:
    """Flow between two absolute pressures, of which `choked` is that per upstream pressure where it is choked."""
    if downstream <= critical * upstream:
        return choked * upstream
    if downstream > LAMINAR * upstream:
        return choked * slope * (upstream - downstream)
    return choked * upstream * flow_shape_subsonic(downstream / upstream, critical)


def mass_flow(conductance: float, critical: float, upstream: float, downstream: float, temperature: float) -> float:
    """Mass flow [kg/s] from absolute upstream pressure [Pa] and temperature [K] to downstream pressure [Pa]."""
    choked = conductance * DENSITY_REFERENCE * sqrt(TEMPERATURE_REFERENCE / temperature)
    return flow(choked, critical, laminar_slope(critical), upstream, downstream)


def switch(self: PneumaticCylinder, dt: float) -> None:
    """The spool follows a command that has lasted for its delay; the pressure wave then runs through the tube."""
    if self.valve == self.switched:
        self.waited = 0.0
        return
    self.waited += dt
    delay = self.delay_on if self.valve else self.delay_off
    if self.waited >= delay + self.tube_length / SPEED_OF_SOUND - 0.5 * dt:
        self.switched = self.valve
        self.waited = 0.0


def exchange(
    self: PneumaticCylinder, dt: float, side: int, outside: float, conductance: float, room: float, critical: float,
    slope: float,
) -> None:
    """Mass and energy that a chamber gets over a substep, through the valve and from the walls."""
    inside = pressure(self, side)
    temperature = self.gas_energy[side] / (HEAT_VOLUME * self.gas_mass[side])
    heat = self.heat_conductance * (self.temperature - temperature)
    if outside >= inside:
        temperature = self.temperature
        mass = flow(conductance * room, critical, slope, outside, inside)
    else:
        choked = conductance * DENSITY_REFERENCE * sqrt(TEMPERATURE_REFERENCE / temperature)
        mass = -flow(choked, critical, slope, inside, outside)
    self.gas_mass[side] += dt * mass
    self.gas_energy[side] += dt * (mass * HEAT_PRESSURE * temperature + heat)


def braid_tension(self: PneumaticCylinder, x: float) -> float:
    """Tension of the braid at an extension [N]."""
    closed = self.contact_stiffness * max(x - self.contact_extension, 0.0)
    return self.relaxed_stiffness * max(x, 0.0) + closed


def resting_position(self: PneumaticCylinder, force: float) -> float:
    """Extension at which braid and cushion carry a force [m], by bisection of a function that only rises."""
    low, high = 0.0, self.stroke + max(force, 0.0) / self.cushion_stiffness
    for _ in range(60):
        middle = 0.5 * (low + high)
        held = braid_tension(self, middle) + self.cushion_stiffness * max(middle - self.stroke, 0.0)
        if held < force:
            low = middle
        else:
            high = middle
    return low


def move(self: PneumaticCylinder, dt: float) -> None:
    """Piston over a substep: linearly implicit in springs and dampers, with an exact test for sticking."""
    x, v = self.piston_position, self.piston_velocity
    p0, p1 = pressure(self, 0), pressure(self, 1)
    force = (p0 - AMBIENT) * piston_area(self, 0) - (p1 - AMBIENT) * piston_area(self, 1) - braid_tension(self, x)
    stiffness, damping = 0.0, self.friction_viscous
    if x > 0.0:
        stiffness += self.relaxed_stiffness
    if x > self.contact_extension:
        stiffness += self.contact_stiffness
        damping += self.braid_damping
    if x < 0.0 or x > self.stroke:
        force -= self.cushion_stiffness * (x if x < 0.0 else x - self.stroke)
        stiffness += self.cushion_stiffness
        damping += self.cushion_damping

    friction = self.friction_static
    if v == 0.0 and abs(force) <= friction:
        return
    if v != 0.0:
        excess = self.friction_static - self.friction_coulomb
        ratio = v / self.stribeck_velocity
        friction = self.friction_coulomb + excess * exp(-ratio * ratio)

    # momentum that friction can take away in this substep, of what the other forces would give
    v = dead_zone(self.mass * v + dt * force, dt * friction) / (self.mass + dt * damping + dt * dt * stiffness)
    self.piston_velocity = v
    if v == 0.0:
        return

    # the piston's work on the gas is isentropic: exact for the change of volume of a substep
    self.piston_position = x + dt * v
    for side in range(2):
        before = self.per_energy[side]
        measure(self, side)
        self.gas_energy[side] *= (self.per_energy[side] / before) ** 0.4
