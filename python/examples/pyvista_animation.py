"""The frames of a run as an animation by PyVista, drawn without a window: Burgers' front as a relief over its mesh.

The height and the colour are u. Prints the errors of the run against the exact front, and how many frames are drawn.
The run is a study, which may be any other one in the plane. GIF files need imageio beside PyVista.
"""

import sys
from pathlib import Path

import driftmesh
import numpy as np
import pyvista

STUDY = {
    "study": {"name": "relief", "kind": "moving-mesh"},
    "grid": {"cells": [30, 30]},
    "time": {"start": 0.25, "end": 1.25, "report": [0.75, 1.25]},
    "pde": {"kind": "burgers", "viscosity": 0.005},
    "output": {"report": False},
}
BAR = {"vertical": True, "position_x": 0.88, "fmt": "%.2f"}  # with room for its numbers


def animate(run, path, name="u", height=0.3, window=(640, 480)):
    """Writes the frames of a run as a GIF, and returns how many there are."""
    plotter = pyvista.Plotter(off_screen=True, window_size=window)
    plotter.open_gif(str(path), fps=10)
    limits = np.quantile([frame[name] for frame in run.frames], (0, 1))  # the same colours in all frames
    for frame in run.frames:
        relief = frame.mesh.to_pyvista(**{name: frame[name]}).warp_by_scalar(name, factor=height)
        # what has the name of something in the frame before replaces it
        plotter.add_mesh(relief, name="relief", clim=limits, show_edges=True, scalar_bar_args=BAR)
        plotter.add_text(f"t = {frame.t:.2f}", name="time", font_size=12)
        plotter.write_frame()
    plotter.close()
    return len(run.frames)


if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/relief")
    run = driftmesh.run(STUDY, out=out)
    for report in run.summary["reports"]:
        print(f"t = {report['t']:.2f}  largest error {report['error']['linf']:.1e}")
    print(f"{animate(run, out / 'relief.gif')} frames in {out / 'relief.gif'}")
