"""Which multistep method integrates which mode."""

from __future__ import annotations

from vibroplat.scene import Mode, Scene

#: Ratio of the fastest decay rate to the synchronous speed above which stability limits the steps of Adams' method.
#: With raised damping on a bare platform it needs as much time as IDA at 4 to 6 and more steps at 10.
STIFF = 5.0


def adams_modes(scene: Scene) -> frozenset[Mode]:
    """Return the modes of a scene that Adams' method integrates; contact always needs IDA."""
    choice = scene.solver.smooth_modes
    if not scene.has_contact:
        # a motor is stiff at low supply frequencies, which a program passes through
        steep = scene.drive.program is not None or scene.fastest_decay > STIFF * scene.speed_scale
        stiff = choice == "auto" and steep
        return frozenset() if choice == "ida" or stiff else frozenset({Mode.BARE})
    return frozenset({Mode.FLIGHT}) if choice == "adams" else frozenset()
