"""Contact without a scene: a ball is pressed into a ring, at which it is not convex; force and area over depth."""
import numpy as np

import supple

ring = supple.Field({
    "particles": {"arrange": "single", "mass": 1},
    "skeleton": [{"shape": "ring", "radius": 0.4, "kernel": {"type": "wyvill", "radius": 0.25}}],
    "contact": {"modulus": "20 kPa"},
})
ball = supple.Field({
    "particles": {"arrange": "single", "mass": 1},
    "skeleton": [{"shape": "point", "kernel": {"type": "wyvill", "radius": 0.8}}],
    "contact": {"modulus": "20 kPa"},
})

last = 0.0
for height in np.linspace(0.34, 0.22, 5):
    ball.move(position=[[0, 0, height]])
    contact = supple.contact(ball, ring, error=1e-4)
    lift = contact.elastic_force[2] if contact.touching else 0.0
    print(f"{height:.2f} m  {lift:9.3f} N  {contact.area:.5f} m^2  within {contact.error_estimate:.0e}")
    assert lift >= last
    last = lift
assert last > 0
