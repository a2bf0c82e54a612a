"""Springs where they sit: against another laboratory's conveyor, numpy's eigenvalues, exact motions and old keys."""

import numpy as np
import pytest
from common.places import ROOT
from scipy.linalg import expm

from vibroplat import Scene, load_config, orbit, simulate, variation
from vibroplat.config.suspension import natural_modes
from vibroplat.inspection.linear import receptances
from vibroplat.model.balances import GROUNDED
from vibroplat.model.systems import GAP, GAP_RATE
from vibroplat.report.data_sheet import _capturing_axis  # noqa: F401

CONVEYOR = ROOT / "configs/machines/conveyor.yaml"
ENGINES = ("taylor", "native")
#: t (s), x, y (m), φ, φ₁, φ₂ (rad) of its start by Lagrange's equations, exact in the rotation (DOP853, 1e-10).
START = [
    (0.1, -0.00032142566, -0.0360503122, -0.000954995608, 0.0283675214, 2.95119343),
    (0.2, -0.00177634557, -0.0582632165, -0.000799398165, -11.789683, 13.1347854),
    (0.3, 0.00111128383, -0.0115266227, 0.00904853734, -26.6752613, 28.9260983),
    (0.4, -0.000986213142, -0.0138530191, 0.0182477811, -42.4584629, 44.5263244),
    (0.5, 0.00170161903, -0.0533980665, 0.0201274068, -58.1507865, 60.2270053),
    (0.7, 0.00119745543, -0.000878803137, 0.0144111734, -89.5625659, 91.6068972),
    (1.0, -0.00138423808, -0.0160943786, -0.00887423234, -136.625937, 138.742849),
    (1.5, 0.00112914738, -0.0336166282, -0.00241785731, -215.121463, 217.239876),
    (2.0, -0.00103920515, -0.0386080248, 0.00672018739, -293.640566, 295.742479),
    (3.0, -0.00107625988, -0.0537790243, 0.00258391092, -450.656539, 452.764564),
    (4.0, -0.00110411029, -0.0518034625, -0.00183055724, -607.67343, 609.788113),
]
COLUMNS = ["x_m", "y_m", "phi_rad", "phi1_rad", "phi2_rad"]
#: Largest of the whole start, tolerances relative to them, and of the angles (rad).
LARGEST, ERRORS = np.array([2.618e-3, 60.55e-3, 26.49e-3, 1.0, 1.0]), np.array([1e-3, 1e-4, 1e-3, 5e-3, 5e-3])


def conveyor(engine="taylor", **changes):
    return load_config(CONVEYOR, {"solver.engine": engine, "solver.tolerance": 1e-10} | changes)


@pytest.mark.parametrize("engine", ENGINES)
def test_conveyor_starts_as_lagrange_says(engine):
    run = simulate(conveyor(engine, **{"run.duration_s": 4.0}))
    start = np.array(START)
    error = np.abs(run(start[:, 0])[COLUMNS].to_numpy() - start[:, 1:]).max(axis=0)
    assert (error < ERRORS * LARGEST).all(), error / LARGEST
    phases = np.pi - run(np.linspace(0.0, 4.0, 20_001))[["phi1_rad", "phi2_rad"]].sum(axis=1)
    assert phases.max() == pytest.approx(1.958, abs=5e-3)
    assert phases[10_000:].mean() == pytest.approx(1.0472, abs=5e-3)
    assert run.summary["energy_residual"] < 1e-7


def spring(x, y, **more):
    return {"position_m": [x, y], "stiffness_y_n_per_m": 1e4, "stiffness_x_n_per_m": 8e3} | more


@pytest.mark.parametrize("engine", ENGINES)
def test_springs_around_the_centre_are_those_of_the_machine(engine):
    """Four of them, whose couplings cancel."""
    near = load_config(ROOT / "configs/quickstart.yaml", {"solver.engine": engine, "run.duration_s": 0.5})
    (x, y), a, b = near.body.centre, 0.125, 0.0625
    each = {"stiffness_y_n_per_m": 1e5, "stiffness_x_n_per_m": 1.5e5, "damping_x_n_s_per_m": 75.0}
    each["damping_y_n_s_per_m"] = 10.0
    places = {"a": (-a, -b), "b": (a, -b), "c": (-a, b), "d": (a, b)}
    placed = near.replace({"springs": {n: spring(x + p, y + q, **each) for n, (p, q) in places.items()}})
    sums = {name: 4.0 * value for name, value in each.items()}
    sums["stiffness_phi_n_m_per_rad"] = sums["stiffness_y_n_per_m"] * a**2 + sums["stiffness_x_n_per_m"] * b**2
    sums["damping_phi_n_m_s_per_rad"] = sums["damping_y_n_s_per_m"] * a**2 + sums["damping_x_n_s_per_m"] * b**2
    first, second = simulate(near.replace({f"machine.{name}": value for name, value in sums.items()})), simulate(placed)
    numbers = [run.trajectory.select_dtypes("number").to_numpy() for run in (first, second)]
    assert np.abs(numbers[1] - numbers[0]).max() <= 1e-13 * np.abs(numbers[0]).max()
    assert first.events["kind"].tolist() == second.events["kind"].tolist()
    assert len(first.events) > 10
    assert first.summary["damping_phi_work_j"] == pytest.approx(second.summary["damping_phi_work_j"], rel=1e-12)


def random_machine(draw):
    """Springs anywhere, rotors that nothing turns, and no gravity: a linear one."""
    size = lambda low, high: float(np.exp(draw.uniform(np.log(low), np.log(high))))  # noqa: E731
    springs = {
        f"s{i}": {
            "position_m": draw.uniform(-1.0, 1.0, 2).tolist(),
            "stiffness_x_n_per_m": size(1e4, 1e6),
            "stiffness_y_n_per_m": size(1e4, 1e6),
            "damping_x_n_s_per_m": size(10.0, 1e3),
            "damping_y_n_s_per_m": size(10.0, 1e3),
            "count": int(draw.integers(1, 4)),
        }
        for i in range(draw.integers(2, 7))
    }
    machine = {"platform_mass_kg": size(50.0, 500.0), "platform_inertia_kg_m2": size(5.0, 200.0)}
    machine |= {"rotor_inertia_kg_m2": 1e9, "gravity_m_per_s2": 0.0, "exciter_distance_m": 0.1}
    state = {"x_m": 1e-3, "y_m": -2e-3, "phi_rad": 3e-3, "x_rate_m_per_s": 0.01}
    run = {"duration_s": 0.15, "perturbation": 0.0, "initial": {"state": state}}
    motor = {"critical_torque_n_m": 0.0, "friction_radius_m": 0.0}
    return Scene.from_tree({"machine": machine, "springs": springs, "motor": motor, "run": run})


def matrices(scene):
    """M, K and B by the displacements of the places of springs."""
    k, b = np.zeros((2, 3, 3))
    for one in scene.springs.values():
        x, y = np.subtract(one.position_m, scene.body.centre)
        moves = np.array([[1.0, 0.0, -y], [0.0, 1.0, x]])
        k += one.count * moves.T @ np.diag([one.stiffness_x_n_per_m, one.stiffness_y_n_per_m]) @ moves
        b += one.count * moves.T @ np.diag([one.damping_x_n_s_per_m, one.damping_y_n_s_per_m]) @ moves
    return np.diag([scene.body.mass, scene.body.mass, scene.body.inertia]), k, b


def test_matrices_modes_and_receptances_of_random_machines():
    draw = np.random.default_rng(1)
    for _ in range(100):
        scene = random_machine(draw)
        (m, k, b), modes = matrices(scene), natural_modes(scene)
        for found, expected in zip(scene.suspension, (k, b), strict=True):
            assert np.abs(found - expected).max() <= 1e-12 * np.abs(expected).max()
        squares = np.sort(np.linalg.eigvals(np.linalg.solve(m, k)).real)
        assert np.sort(modes.speeds**2) == pytest.approx(squares, rel=1e-10, abs=1e-12 * squares[-1])
        left = k @ modes.shapes - m @ modes.shapes * modes.speeds**2
        assert np.abs(left / np.abs(k @ modes.shapes).max(axis=0)).max() < 1e-10
        w = float(draw.uniform(1.0, 300.0))
        inverse = np.linalg.inv(k - m * w * w + 1j * w * b)
        assert np.abs(receptances(scene, np.array(w)) - inverse).max() <= 1e-10 * np.abs(inverse).max()


def check_linear_motion(scene, engine):
    m, k, b = matrices(scene)
    rates = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.linalg.solve(m, k), -np.linalg.solve(m, b)]])
    run, times = (
        simulate(scene.replace({"solver.engine": engine, "solver.tolerance": 1e-10})),
        np.linspace(0.0, 0.15, 31),
    )
    begin = np.array([1e-3, -2e-3, 3e-3, 0.01, 0.0, 0.0])
    exact = np.array([expm(rates * t) @ begin for t in times])[:, :3]
    found = run(times)[COLUMNS[:3]].to_numpy()
    assert np.abs((found - exact) / np.abs(exact).max(axis=0)).max() < 1e-6
    assert run.summary["energy_residual"] < 1e-7


@pytest.mark.parametrize("engine", ENGINES)
def test_free_vibration_is_that_of_linear_equations(engine):
    draw = np.random.default_rng(2)
    for _ in range(2):
        check_linear_motion(random_machine(draw), engine)


@pytest.mark.long
@pytest.mark.parametrize("engine", ENGINES)
def test_free_vibrations_of_many_machines(engine):
    draw = np.random.default_rng(3)
    for _ in range(100):
        check_linear_motion(random_machine(draw), engine)


@pytest.fixture(scope="module")
def lame():
    """A damped conveyor with a soft spring, after its start."""
    dampers = {f"springs.{n}.damping_{axis}_n_s_per_m": 400.0 for n in ("left", "right") for axis in "xy"}
    more = {"run.initial.state": {"x_m": 0.0, "y_m": -0.03, "phi2_rad": 2.09, "phi1_rate_rad_per_s": -156.0}}
    more["run.initial.state"]["phi2_rate_rad_per_s"] = 156.0
    return simulate(conveyor(**dampers, **more, **{"springs.left.stiffness_y_n_per_m": 7e3, "run.duration_s": 6.0}))


def test_loads_are_those_of_dense_samples(lame):
    scene, s = lame.scene, lame.summary
    at = lame(np.linspace(s["measured_from_s"], s["measured_to_s"], 100_001))
    x, y, phi = (at[name].to_numpy() for name in COLUMNS[:3])
    _, k, b = matrices(scene)
    rates = at[["x_rate_m_per_s", "y_rate_m_per_s", "phi_rate_rad_per_s"]].to_numpy()
    pulls = np.stack([x, y, phi], axis=1) @ k + rates @ b
    for name, pull in zip(("force_x_{}_n", "force_y_{}_n", "moment_{}_n_m"), pulls.T, strict=True):
        assert s[f"foundation_{name.format('amplitude')}"] == pytest.approx(0.5 * np.ptp(pull), rel=1e-6)
        assert s[f"foundation_{name.format('rms')}"] == pytest.approx(pull.std(), rel=1e-4)
    assert pulls[:, 1].mean() == pytest.approx(s["foundation_force_y_mean_n"], rel=1e-4)
    for name, one in scene.springs.items():
        p, q = np.subtract(one.position_m, scene.body.centre)
        along_y, along_x = one.stiffness_y_n_per_m * (y + phi * p), one.stiffness_x_n_per_m * (x - phi * q)
        assert s[f"spring_force_mean_{name}_n"] == pytest.approx(along_y.mean(), rel=1e-4)
        assert s[f"spring_force_amplitude_{name}_n"] == pytest.approx(0.5 * np.ptp(along_y), rel=1e-6)
        assert s[f"spring_force_max_{name}_n"] == pytest.approx(np.abs(along_y).max(), rel=1e-6)
        assert s[f"spring_force_x_amplitude_{name}_n"] == pytest.approx(0.5 * np.ptp(along_x), rel=1e-6)
    assert s["energy_residual"] < 1e-8
    assert s["momentum_residual"] < 1e-8


@pytest.mark.long
def test_inspection_knows_the_modes_and_the_motion(lame):
    found, s = lame.scene.inspect(), lame.summary
    assert [found[f"mode_{axis}"] for axis in GROUNDED] == ["x with y and rotation", "y with x", "rotation with x"]
    for name in ("stroke_x_m", "stroke_y_m"):
        assert found[name] == pytest.approx(s[name], rel=0.05)
    assert found["dynamic_force_y_n"] == pytest.approx(s["foundation_force_y_amplitude_n"], rel=0.05)
    assert found["motor_power_w"] == pytest.approx(s["motor_power_w"], rel=0.05)
    assert found["spring_sags"] == "30.4 mm (right) … 44.1 mm (left)"
    assert "x with y and rotation" in str(found)


def test_multipliers_are_those_of_motions_beside_the_orbit():
    scene = load_config(ROOT / "configs/quickstart.yaml", {"solver.engine": "taylor", "solver.tolerance": 1e-11})
    each = {"stiffness_x_n_per_m": 290e3, "damping_x_n_s_per_m": 150.0, "damping_y_n_s_per_m": 100.0}
    springs = {"left": spring(-0.1, -0.05, stiffness_y_n_per_m=200e3, **each)}
    springs["right"] = spring(0.1, -0.04, stiffness_y_n_per_m=260e3, **each)
    found = orbit(scene.replace({"springs": springs, "run.perturbation": 0.0}), tolerance=1e-9)
    key = "springs.left.position_m.0"
    varied = variation(found.scene, found.state, found.period_s, keys=key)
    sizes, numerical = np.array(scene.state_scales), np.zeros((14, 14))

    def end(state, scene):
        return variation(scene, state, found.period_s).state.to_numpy()

    for j in range(14):
        step = 1e-6 * sizes * (np.arange(14) == j)
        ends = [end(np.array(found.state) + side * step, found.scene) for side in (1.0, -1.0)]
        numerical[:, j] = (ends[0] - ends[1]) / (2e-6 * sizes[j])
    derivative = varied.derivative.to_numpy()
    scaled, expected = (matrix * sizes / sizes[:, np.newaxis] for matrix in (derivative[:, :14], numerical))
    expected[:, [GAP, GAP_RATE]] = 0.0  # it begins in contact
    assert np.abs(scaled - expected).max() < 1e-5 * np.abs(expected).max()
    ends = [end(found.state, found.scene.replace({key: -0.1 + change})) for change in (1e-6, -1e-6)]
    by_key = (ends[0] - ends[1]) / 2e-6 / sizes
    assert np.abs(derivative[:, 14] / sizes - by_key).max() < 1e-5 * np.abs(by_key).max()
    sizes = np.sort(np.abs(np.linalg.eigvals(expected)))[::-1]
    assert np.sort(np.abs(found.multipliers))[::-1] == pytest.approx(sizes[1:12], abs=1e-6)  # the first one is 1
