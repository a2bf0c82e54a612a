"""Whether exciters stay synchronized, by the phase differences of a measured part."""

import math

import numpy as np

from vibroplat.config.scene import Scene
from vibroplat.kernels.compiled import FloatArray
from vibroplat.observe.measures import Accumulators
from vibroplat.observe.section import section_rows

#: Turns of exciter 1 that show whether exciters stay synchronized. This and the limits below are from 1507 random
#: scenes in runs of 2 to 40 s. 426 scenes never synchronize, half of them barely, and none had a time. With 32 turns
#: one had.
STAYING_TURNS = 48
#: Changes of the phase difference (rad) up to which it is constant: round-off and noise of the integrators.
STILL = 1e-6
#: Lower limit of the logarithm of the ratio of successive changes, and of its square divided by its decrease. Where
#: synchronization is barely lost, the phase difference x obeys x' = e + k x^2, and the second value is below 2. With
#: the limit 4, one scene that drifts after 50 s had a time, with 6 none.
CONVERGING, BENDING = 0.05, 8.0
#: Largest distance (rad) of a phase difference from its limit.
REMAINING = 0.05
#: Standard errors within which a fluctuating phase difference has no trend, and number of blocks for it. The trend and
#: two standard errors, extrapolated over HORIZON measured parts, may change the last value by TREND_CHANGE (rad).
TREND, TREND_BLOCKS, HORIZON, TREND_CHANGE = 3.0, 8, 20.0, 0.5


def stays_synchronized(ms: Accumulators, scene: Scene) -> bool:
    """Whether the section points kept of the measured part show that the exciters stay synchronized.

    Their phase difference at whole turns of exciter 1 either converges or fluctuates without a trend. It converges if
    its ranges in thirds of the measured part and the changes between its means in quarters do.
    """
    phases = section_rows(ms)["state"][:, 3:5] @ scene.phase_weights
    if len(phases) < STAYING_TURNS:
        return False
    spread, drift = np.ptp(_parts(phases, 3), axis=1), np.abs(np.diff(_parts(phases, 4).mean(axis=1)))
    return (converges(spread) and converges(drift)) or fluctuates(_parts(phases, TREND_BLOCKS).mean(axis=1))


def _parts(values: FloatArray, count: int) -> FloatArray:
    """Cut the last values into equal parts, shape (count, length)."""
    length = len(values) // count
    return values[len(values) - count * length :].reshape(count, length)


def converges(changes: FloatArray) -> bool:
    """Whether a value that changes by three successive amounts in equal times converges, and is near its limit.

    A slow passage has no limit: the logarithm of the ratio of its changes decreases to 0 and below.
    """
    first, second, third = changes.tolist()
    if third <= STILL:
        return True
    if not first > second > third:
        return False
    before, now = math.log(first / second), math.log(second / third)
    steady = min(before, now) >= CONVERGING and BENDING * (before - now) <= now * now
    return steady and third / math.expm1(now) <= REMAINING


def fluctuates(means: FloatArray) -> bool:
    """Whether means of successive blocks have no trend, and any trend within their errors is small over the horizon."""
    times = np.linspace(-0.5, 0.5, len(means))
    trend = float(times @ means / (times @ times))
    left = means - means.mean() - trend * times
    error = math.sqrt(float(left @ left / (times @ times)) / (len(means) - 2))
    return abs(trend) <= TREND * error and HORIZON * (abs(trend) + 2.0 * error) <= TREND_CHANGE
