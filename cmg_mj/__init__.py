"""A bench for gyroscopic stabilisation: a six-body MuJoCo scissored pair, real sensors, velocity observers.

Names are imported when they are first used, so that the packages without physics (observers, sensors, the law) can be
used without MuJoCo. `__init__.pyi` lists them once.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
