"""Made-up logs with true poses and true surfaces.

`simulation.simulate` drives a robot through one of `scenes.SCENES` with one of `lidar.LIDARS`.
"""
