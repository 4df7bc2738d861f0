"""Supply of compressed air."""

from math import ceil

from fmus.pneumatic_cylinder.model import (
    AMBIENT,
    DENSITY_REFERENCE,
    GAS_CONSTANT,
    LAMINAR,
    flow_shape,
    mass_flow,
)

from twin.component import Boolean, Component, input, local, output, parameter

VALVES = 2


class AirSupply(Component):
    """Supply line, regulator with check valve, reservoir with its leak, and the pressure switch that reports loss of air.

    Flow by ISO 6358 as in the cylinders, isothermal. What cylinders take is deducted when their valves switch.
    """

    valve = input("", "valves that are fed", shape=(VALVES,), type=Boolean)
    line_pressure = input("Pa", "gauge pressure of the line, 0 if the compressor is lost", start=8e5, minimum=0.0,
                          display_unit="bar", nominal=1e5)

    supply_pressure = output("Pa", "gauge pressure at the valves", display_unit="bar")
    pressure_ok = output("", "state of the pressure switch", type=Boolean)

    regulator_pressure = parameter(6e5, "Pa", "gauge pressure that the regulator is set to", display_unit="bar",
                                   minimum=0.0, source="paper, section III.A: 6 bar")
    reservoir_volume = parameter(0.1e-3, "m^3", "between check valve and valves", display_unit="l", minimum=1e-6,
                                 source="estimate: filter bowl and some meters of hose")
    switched_volume = parameter(3.4e-6, "m^3", "that a switched valve fills: chamber, port and tube", minimum=0.0,
                                source="pneumatic cylinder: 0.79 and 0.1 ml, and 0.5 m of tube of 2.5 mm")
    conductance_supply = parameter(8e-9, "m^3/(s*Pa)", "sonic conductance of regulator and check valve", minimum=1e-12,
                                   maximum=1e-7, source="estimate: as one valve")
    conductance_leak = parameter(5e-12, "m^3/(s*Pa)", "sonic conductance of the leak; a burst hose raises it",
                                 minimum=0.0, maximum=1e-7, source="estimate: 0.2 l/min at 6 bar")
    critical_ratio = parameter(0.3, "", "critical pressure ratio of both", minimum=0.0, maximum=0.9,
                               source="estimate: 0.2 to 0.4")
    temperature = parameter(293.15, "K", "of the air", minimum=200.0, maximum=400.0, source="estimate: room")
    switch_off = parameter(4.5e5, "Pa", "falling gauge pressure at which the switch opens", display_unit="bar",
                           source="chosen: a quarter below the regulator")
    switch_on = parameter(5e5, "Pa", "rising gauge pressure at which it closes", display_unit="bar",
                          source="chosen: hysteresis of 0.5 bar")

    stored_pressure = local(0.0, "Pa", "absolute pressure of the reservoir", display_unit="bar")
    closed = local(False, "", "state of the switch", type=Boolean)
    valve_last = local(False, "", "valves of the step before", shape=(VALVES,), type=Boolean)

    def initialize(self) -> None:
        self.stored_pressure = AMBIENT + source_pressure(self)
        self.closed = source_pressure(self) >= self.switch_on
        for k in range(VALVES):
            self.valve_last[k] = self.valve[k]
        publish(self)

    def step(self, t: float, h: float) -> None:
        for k in range(VALVES):
            if self.valve[k] != self.valve_last[k]:
                gauge = max(self.stored_pressure - AMBIENT, 0.0)
                self.stored_pressure -= gauge * min(self.switched_volume / self.reservoir_volume, 1.0)
            self.valve_last[k] = self.valve[k]

        # rise of pressure per mass of air [Pa/kg]
        slope = GAS_CONSTANT * self.temperature / self.reservoir_volume
        steepest = flow_shape(LAMINAR, 0.0) / (1.0 - LAMINAR)
        rate = steepest * slope * DENSITY_REFERENCE * max(self.conductance_supply, self.conductance_leak)
        count = max(1, ceil(2.0 * h * rate))
        dt = h / count
        source = AMBIENT + source_pressure(self)
        for _ in range(count):
            flow = 0.0
            if source > self.stored_pressure:
                flow += mass_flow(
                    self.conductance_supply, self.critical_ratio, source, self.stored_pressure, self.temperature
                )
            if self.stored_pressure > AMBIENT:
                flow -= mass_flow(
                    self.conductance_leak, self.critical_ratio, self.stored_pressure, AMBIENT, self.temperature
                )
            self.stored_pressure += dt * slope * flow

        gauge = self.stored_pressure - AMBIENT
        if gauge < self.switch_off:
            self.closed = False
        elif gauge >= self.switch_on:
            self.closed = True
        publish(self)


def source_pressure(self: AirSupply) -> float:
    """Gauge pressure behind the regulator [Pa]."""
    return max(min(self.line_pressure, self.regulator_pressure), 0.0)


def publish(self: AirSupply) -> None:
    """Outputs are copies."""
    self.supply_pressure = max(self.stored_pressure - AMBIENT, 0.0)
    self.pressure_ok = self.closed
