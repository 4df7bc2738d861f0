"""Members that copies of a model share, by their shortest loops; and how long a value takes through a member."""

from __future__ import annotations

from types import SimpleNamespace

from tests.every_case import every_case
from twin.follow.influence import distances, period, shared_members, uncorrected_inputs

STEP = 10


def member(period_ns=None, communication_ns=None, component="a:B", made=0):
    return SimpleNamespace(
        period_ns=period_ns,
        communication_ns=communication_ns,
        component=component,
        made=SimpleNamespace(period_ns=made),
    )


@every_case(
    ("spec", "time"),
    [
        (member(), STEP),
        (member(made=30), 30),
        (member(made=30, period_ns=20), 20),
        (member(period_ns=20), STEP),  # a continuous component has no period to set
        (member(communication_ns=40, made=30), 40),
        (member(component="a.fmu", made=30), STEP),
    ],
)
def test_the_least_time_from_an_input_to_the_outputs(spec, time):
    assert period(spec, STEP) == time


def test_shortest_distances():
    lengths = {("a", "b"): 5, ("a", "c"): 1, ("c", "b"): 2, ("b", "d"): 1}
    neighbors = {"a": ["b", "c"], "b": ["d"], "c": ["b"], "d": ["a"], "e": []}
    lengths["d", "a"] = 1
    assert distances(["a"], neighbors, lengths) == {"a": 0.0, "c": 1.0, "b": 3.0, "d": 4.0}
    assert distances(["b", "c"], neighbors, lengths) == {"b": 0.0, "c": 0.0, "d": 1.0, "a": 2.0}


def case(algorithm="jacobi"):
    """A plant whose sensor is measured; a controller acts back with a period of 50, a logger does not."""
    pairs = ["plant.y -> sensor.u", "sensor.y -> controller.u", "controller.y -> plant.u", "plant.y -> logger.u"]
    connections = [
        SimpleNamespace(**dict(zip(("source", "target"), pair.split(" -> "), strict=True))) for pair in pairs
    ]
    connections.append(SimpleNamespace(source="drive.y", target="plant.f"))
    members = {
        "plant": member(),
        "sensor": member(),
        "controller": member(made=50),
        "logger": member(),
        "drive": member(),
    }
    return SimpleNamespace(
        members=members, connections=connections, algorithm=SimpleNamespace(name=algorithm), step_ns=STEP
    )


@every_case(
    ("algorithm", "interval", "shared"),
    [
        ("jacobi", float("inf"), set()),  # copies that are never equal share nothing
        ("jacobi", 1e12, {"drive", "logger"}),  # nothing comes to the one, nothing from the other
        ("jacobi", 70, {"drive", "logger"}),  # sensor 10, controller 50, plant 10: just in time
        ("jacobi", 69, {"drive", "logger", "controller"}),
        ("gauss_seidel", 50, {"drive", "logger"}),  # what is just computed is seen at once
        ("gauss_seidel", 49, {"drive", "logger", "controller"}),
    ],
)
def test_what_cannot_come_back_in_time_is_shared(algorithm, interval, shared):
    assert shared_members(case(algorithm), ["plant"], ["sensor"], interval) == shared


def test_what_is_measured_or_corrected_is_never_shared():
    assert shared_members(case(), ["plant", "controller"], ["sensor"], 1e9) == {"drive", "logger"}
    assert shared_members(case(), ["plant"], ["sensor", "logger"], 1e9) == {"drive"}
    assert "drive" not in shared_members(case(), ["drive"], ["sensor"], 1e9)


@every_case(
    ("source", "estimated", "interval", "inputs"),
    [
        ("spring.y", ["plant.x"], 50, ["spring.u"]),
        ("spring.y", ["plant.x"], 51, []),  # it samples again, later than the correction
        ("spring.y", ["plant.x", "spring.u"], 50, []),
        ("spring.y", ["spring.k"], 50, []),  # the spring itself is evaluated when it is corrected
        ("plant.y", ["spring.k"], 50, []),  # the position does not depend on the force at once
    ],
)
def test_inputs_that_a_sample_sees_uncorrected(source, estimated, interval, inputs):
    pairs = [("plant.y", "spring.u"), ("spring.y", "plant.u"), (source, "sampler.u")]
    connections = [SimpleNamespace(source=source, target=target) for source, target in pairs]
    members = {
        name: SimpleNamespace(component=f"tests.follow.parts:{part}", made=None, period_ns=None, communication_ns=None)
        for name, part in (("plant", "VanDerPol"), ("spring", "Spring"), ("sampler", "Sampler"))
    }
    spring = SimpleNamespace(members=members, connections=connections, step_ns=10)
    rows = list(uncorrected_inputs(spring, estimated, 1e6 * interval))
    assert rows == [("sampler", source, name) for name in inputs]
