"""A scene as a mapping: a ball falls on the ground; the rebound of three values of damping."""
import supple

DESCRIPTION = {
    "duration": "0.8 s",
    "frame_rate": 30,
    "gravity": [0, 0, -9.81],
    "objects": [{
        "name": "ball",
        "particles": {"arrange": "single", "at": [0, 0, 0.6], "mass": 1},
        "skeleton": [{"shape": "point", "kernel": {"type": "wyvill", "radius": 0.5}}],
        "contact": {"modulus": "40 kPa", "dissipation": 0},
    }],
    "ground": {"height": 0},
}


def rebound(dissipation):
    """Height of the first rebound [m]."""
    simulation = supple.Simulation(supple.Scene(DESCRIPTION, {"objects.ball.contact.dissipation": dissipation}))
    heights = [simulation.particles.position[0, 2] for _ in simulation.frames()]
    lowest = heights.index(min(heights))
    return max(heights[lowest:])


previous = 1.0
for dissipation in (0, 0.2, 1.0):
    height = rebound(dissipation)
    print(f"dissipation {dissipation:3.1f} s/m: rebound to {height:.3f} m")
    assert height < previous
    previous = height
