"""People's density the plain way with numpy: everybody's window of cells, the greatest kept.

Arguments: cells to a side, a cell's side (m), the least density, runs. Standard input: x y heading of each.
Prints the median seconds of a run and the sum of all cells.
"""
import sys
import time

import numpy as np

cells, cell, least, runs = int(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3]), int(sys.argv[4])
people = np.loadtxt(sys.stdin, ndmin=2)
reach = np.sqrt(-2 * np.log(least))
front, side, rear = 1.0, 0.75, 0.5
axis = (np.arange(cells) + 0.5) * cell


def draw():
    out = np.zeros((cells, cells))
    for x, y, t in people:
        c, s = np.cos(t), np.sin(t)
        ex, ey = reach * np.hypot(front * c, side * s), reach * np.hypot(front * s, side * c)
        i0, i1 = max(int((x - ex) / cell), 0), min(int((x + ex) / cell) + 1, cells)
        j0, j1 = max(int((y - ey) / cell), 0), min(int((y + ey) / cell) + 1, cells)
        dx, dy = axis[None, i0:i1] - x, axis[j0:j1, None] - y
        ahead, left = c * dx + s * dy, c * dy - s * dx
        width = np.where(ahead >= 0, 1 / front, 1 / rear)
        density = np.exp(-0.5 * ((ahead * width) ** 2 + (left / side) ** 2))
        window = out[j0:j1, i0:i1]
        np.maximum(window, density, out=window)
    out[out < least] = 0
    return out


times = []
for _ in range(runs):
    start = time.perf_counter()
    out = draw()
    times.append(time.perf_counter() - start)
print(sorted(times)[len(times) // 2], float(out.sum()))
