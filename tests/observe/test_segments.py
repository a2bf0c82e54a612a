"""Tables and dense output of a run."""

from vibroplat import simulate


def test_the_gap_is_zero_at_events_and_open_between_them(quickstart):
    """Tables say so exactly: rows at events have what the automaton has there, not what is interpolated."""
    changes = {"contact.restitution": 0.5, "drive.supply_frequency_hz": 57.5, "run.duration_s": 1.0}
    for engine in ("native", "sundae", "taylor"):
        run = simulate(quickstart.replace({**changes, "solver.engine": engine}))
        table = run.trajectory
        at_events = table["t_s"].isin(run.events["t_s"])
        assert at_events.sum() >= 2 * run.events["t_s"].nunique() > 20
        assert (table["gap_m"][at_events] == 0.0).all()
        assert (table["gap_m"] >= 0.0).all()
        assert (run(run.events["t_s"])["gap_m"] == 0.0).all()


def test_output_rate_does_not_touch_the_integration(quickstart):
    runs = [simulate(quickstart.replace({"run.duration_s": 0.3, "output.sample_rate_hz": r})) for r in (50.0, 5000.0)]
    assert runs[0].summary["steps"] == runs[1].summary["steps"]
    assert runs[0].events.equals(runs[1].events)
