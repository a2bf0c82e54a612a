"""Properties that hold for whatever Hypothesis draws; it is loaded when the first of them is tested."""

import functools
import inspect


def given(*, examples=100, **strategies):
    """Test with arguments that Hypothesis draws; each strategy is a function of ``hypothesis.strategies``."""

    def decorate(test):
        @functools.wraps(test)
        def run(**fixtures):
            import hypothesis

            @hypothesis.settings(
                max_examples=examples,
                derandomize=True,
                deadline=None,
                database=None,
                suppress_health_check=list(hypothesis.HealthCheck),
            )
            @hypothesis.given(**{name: make(hypothesis.strategies) for name, make in strategies.items()})
            def holds(**drawn):
                test(**fixtures, **drawn)

            holds()

        parameters = inspect.signature(test).parameters
        run.__signature__ = inspect.Signature([p for name, p in parameters.items() if name not in strategies])
        return run

    return decorate
