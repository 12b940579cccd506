"""The catenary in the frame of the track, coupled to a pantograph: the reference for everything that is faster."""

from catenary_model.pantograph import Pantograph
from catenary_model.reference.model import Config, Reference
from catenary_model.reference.ride import Ride
from catenary_model.reference.train import Mounted

__all__ = ["Config", "Mounted", "Pantograph", "Reference", "Ride"]
