"""Central differences of a simulated robot's motion, against which tests hold what it says of its velocities."""

import pinocchio as pin

FRAME = 1.0 / 60.0  # [s]


def central_differences(simulated):
    """Step three frames; return the state at the second, and v and a (nv,) there by the first and the third."""
    states = []
    for _ in range(3):
        simulated.world.step()
        states.append(simulated.state())
    before, middle, after = states
    rate = pin.difference(simulated.actual.model, before.q, after.q) / (2 * FRAME)
    return middle, rate, (after.v - before.v) / (2 * FRAME)
