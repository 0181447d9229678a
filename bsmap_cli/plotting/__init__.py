"""Pictures of maps and errors: matplotlib figures on the Agg canvas, no window, no clock.

Importing this room imports matplotlib.
"""

from bsmap_cli.plotting.error_plot import plot_error
from bsmap_cli.plotting.figures import save_figure
from bsmap_cli.plotting.map_plot import plot_map

__all__ = ["plot_error", "plot_map", "save_figure"]
