"""The bent tip on its wall: elastica, buckling, friction, tissue, each against what theory says."""

import numpy as np
import pytest
from fmus.tip_contact.model import TipContact
from scipy.integrate import solve_bvp

H = 1e-3
EI, L = 4.3e-4, 48e-3
HARD = {
    "indentation_force": 20.0,
    "exponent": 1.0,
    "layer_thickness": 1.0,
    "dissipation": 0.0,
    "curvature": 0.0,
    "slip_drag": 1e-2,
}


def pushed(part, way, seconds=0.5, points=5):
    """Force, friction and place at even parts of a way of the root [m] that begins where it touches."""
    part.tip_position = part.surface_position
    assert part.start() == 0
    rows = []
    steps = round(seconds / H)
    for i in range(1, steps + 1):
        part.tip_position = part.surface_position + way * i / steps
        assert part.advance(i * H, H) == 0
        if i % (steps // points) == 0:
            names = ("force", "normal_force", "friction_force", "indentation", "slip", "displacement", "clearance")
            rows.append({name: float(getattr(part, name)) for name in names})
    return rows


def elastica(along, across):
    """Tip of a clamped elastica under a load at its end, by collocation."""
    s = np.linspace(0.0, 1.0, 200)
    x, y = (one * L * L / EI for one in (along, across))
    guess = np.vstack((0.3 * s, 0.3 * (1 - s)))
    found = solve_bvp(
        lambda _, u: np.vstack((u[1], x * np.sin(u[0]) - y * np.cos(u[0]))),
        lambda a, b: np.array([a[0], b[1]]),
        s,
        guess,
        tol=1e-9,
    )
    fine = np.linspace(0.0, 1.0, 4001)
    angle = found.sol(fine)[0]
    return L * np.trapezoid(np.cos(angle), fine), L * np.trapezoid(np.sin(angle), fine)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("degrees", [20, 30, 45, 60])
def test_bends_as_the_elastica(native, degrees):
    part = native(TipContact, contact_angle=np.deg2rad(degrees), friction=0.0, **HARD)
    way = 12e-3
    for i, row in enumerate(pushed(part, way), 1):
        # without friction the load lies along the wall's normal: where theory puts the tip for it
        normal = row["normal_force"] * np.array([-np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))])
        x, y = elastica(*normal)
        assert -row["displacement"] == pytest.approx(y, rel=4e-3)
        touching = L + y * np.tan(np.deg2rad(degrees)) - x + row["indentation"] / np.cos(np.deg2rad(degrees))
        assert way * i / 5 == pytest.approx(touching, rel=4e-3)


def test_head_on_it_carries_the_load_of_a_column(native):
    part = native(TipContact, contact_angle=0.0, friction=0.0, **{**HARD, "curvature": 1e-3})
    euler = np.pi**2 * EI / (4 * L * L)
    rows = pushed(part, 0.5e-3, points=10)
    assert rows[-1]["force"] == pytest.approx(euler, rel=0.02)


def test_stuck_it_carries_eight_times_that(native):
    part = native(TipContact, contact_angle=0.0, friction=1.0, **HARD | {"curvature": 1e-3})
    assert pushed(part, 0.5e-3)[-1]["force"] == pytest.approx(20.19 * EI / L**2, rel=0.02)


def test_small_pushes_meet_the_cantilever(native):
    part = native(TipContact, contact_angle=np.deg2rad(45), friction=0.0, **HARD)
    assert pushed(part, 0.2e-3)[-1]["force"] == pytest.approx(3 * EI / L**3 * 0.2e-3, rel=0.01)


def test_friction_holds_it_until_it_slides(native):
    """The root goes on and back: the tip sticks until the friction has turned over, then slides back at its limit."""
    part = native(TipContact, friction=0.2, slip_drag=1e-2)
    last = pushed(part, 8e-3)[-1]
    assert last["friction_force"] == pytest.approx(0.2 * last["normal_force"], rel=2e-3)
    ratios, places = [], []
    for i in range(400):
        part.tip_position -= 1e-6
        assert part.advance(i * H, H) == 0
        ratios.append(float(part.friction_force / part.normal_force))
        places.append(float(part.slip))
    stuck = np.abs(np.array(places) - last["slip"]) < 1e-9
    assert 20 < stuck.sum() < 300
    assert np.all(np.diff(stuck.astype(int)) <= 0)
    assert np.all(np.diff(np.array(ratios)[stuck]) < 0)
    assert np.array(ratios)[~stuck][1:] == pytest.approx(-0.2, rel=2e-3)


def test_friction_makes_it_stiffer(native):
    forces = [pushed(native(TipContact, friction=one), 8e-3)[-1]["force"] for one in (0.0, 0.1, 0.3)]
    assert forces[0] < 0.9 * forces[1] < 0.81 * forces[2]


def test_hertz_and_the_layer(native):
    """Head on and stuck the section is rigid: indentation is the way, the force is Hertz's times the layer's."""
    part = native(TipContact, contact_angle=0.0, friction=1.0, curvature=0.0, dissipation=0.0)
    thick = native(TipContact, contact_angle=0.0, friction=1.0, curvature=0.0, dissipation=0.0, layer_thickness=1.0)
    for row, half_space in zip(pushed(part, 1e-3), pushed(thick, 1e-3), strict=True):
        hertz = 4 / 3 * 105e3 * np.sqrt(1.33e-3 * half_space["indentation"]) * half_space["indentation"]
        assert half_space["force"] == pytest.approx(hertz, rel=5e-3)
        q = np.sqrt(1.33e-3 * row["indentation"]) / 2e-3
        layer = 1 + 1.133 * q + 1.283 * q**2 + 0.769 * q**3 + 0.0975 * q**4
        assert row["force"] == pytest.approx(
            4 / 3 * 105e3 * np.sqrt(1.33e-3) * row["indentation"] ** 1.5 * layer, rel=5e-3
        )
    assert row["force"] > 1.8 * half_space["force"]


def test_relaxes_as_told(native):
    """After a quick push the force is 1 + sum of g_k exp(-t / tau_k) times the lasting one."""
    part = native(TipContact, contact_angle=0.0, friction=1.0, curvature=0.0, dissipation=0.0, relaxation=(0.3, 0.2))
    part.tip_position = part.surface_position
    part.start()
    part.tip_position = part.surface_position + 0.15e-3
    lasting = 0.161 * 0.15**1.5
    for i in range(1, 1501):
        assert part.advance(i * H, H) == 0
        t = (i - 0.5) * H  # it rose evenly within the first step
        if i in {1, 100, 500, 1500}:
            q = np.sqrt(1.33e-3 * part.indentation) / 2e-3
            lasting = 0.161 * (part.indentation / 1e-3) ** 1.5
            lasting *= 1 + 1.133 * q + 1.283 * q**2 + 0.769 * q**3 + 0.0975 * q**4
            assert part.normal_force == pytest.approx(
                lasting * (1 + 0.3 * np.exp(-t / 0.5) + 0.2 * np.exp(-t / 30)), rel=3e-3
            )


def test_leaves_the_wall_and_comes_back(native):
    part = native(TipContact, friction=0.3, relaxation=(0.3, 0.2))
    part.start()
    held = float(part.force)
    assert held == pytest.approx(0.28, abs=0.03)
    forces = []
    for i in range(1, 2001):
        part.heart_position = 12e-3 * (1 - np.cos(2 * np.pi * i * H)) / 2
        assert part.advance(i * H, H) == 0
        forces.append((float(part.force), float(part.displacement)))
    assert min(forces) == (0.0, pytest.approx(0.0, abs=1e-6))
    assert forces[-1][0] == pytest.approx(forces[999][0], rel=0.01)


def test_a_jump_too_far_is_an_error(native):
    part = native(TipContact)
    part.start()
    part.tip_position = 0.5
    assert part.advance(0.0, H) != 0


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("degrees", [0, 30, 60, 78])
@pytest.mark.parametrize("friction", [0.0, 0.1, 0.3])
def test_the_root_carries_what_the_wall_carries(native, degrees, friction):
    """Action and reaction over approach, press and retreat: the wall's normal and friction force, turned, are the force on the root.

    While the tip sticks, the section is in the wall's hands: then and at any other time neither pulls the other along the normal.
    """
    angle = np.deg2rad(degrees)
    part = native(TipContact, contact_angle=angle, friction=friction)
    off = part.surface_position - 3e-3
    part.tip_position = off
    assert part.start() == 0
    rows = []
    for step in range(1, 1501):
        part.tip_position = off + 11e-3 * 0.5 * (1.0 - np.cos(2.0 * np.pi * step / 1500))
        assert part.advance(step * H, H) == 0
        names = ("force", "normal_force", "friction_force", "indentation", "tip_position")
        rows.append([float(getattr(part, name)) for name in names])
    force, normal, along, depth, root = np.array(rows).T
    assert force.max() > 0.002
    assert normal.min() >= 0.0
    np.testing.assert_allclose(force, np.cos(angle) * normal + np.sin(angle) * along, atol=1e-7)
    assert not np.abs(along[normal == 0.0]).max() > 1e-7
    assert not normal[depth < 0.0].any()

    # along the axis friction alone can pull, at an angle at which it is steeper than the wall's normal
    assert (force.min() < -5e-4) == (friction * np.tan(angle) > 1.0)

    # what is put in at the root is never less than what comes back
    work = np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(root))
    assert work.min() > -1e-9
    assert work[-1] > 0.0
