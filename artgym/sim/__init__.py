"""The only code that imports the simulator."""

from artgym.sim.vulkan import offer_every_driver

# Before anything here imports sapien, which at its own import may hide drivers.
offer_every_driver()
