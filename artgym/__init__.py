"""Simulated articulated objects to open, close and grasp, as Gymnasium environments.

Importing this package registers the environments' ids and nothing more: the simulator is loaded
when an environment is made.
"""

from importlib.metadata import PackageNotFoundError, version

from artgym.registration import register_environments

try:
    __version__ = version("artgym")
except PackageNotFoundError:
    # A source tree that is on the path without having been installed.
    __version__ = "0+unknown"

register_environments()
