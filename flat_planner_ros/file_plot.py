"""matplotlib's pyplot, drawing into files: a terminal without a display is enough."""

import matplotlib as mpl

mpl.use('Agg')
from matplotlib import pyplot as plt  # noqa: E402  The backend is chosen before.

__all__ = ['plt']
