"""Simulates a dam break that floods a model of a town and writes frames for spherule.

    python splash.py OUT --particles 5e6

The method is FLIP on a staggered grid: Zhu and Bridson, "Animating sand as a fluid" (SIGGRAPH 2005), with the
pressure solve of Bridson, "Fluid Simulation for Computer Graphics" (2nd edition, 2015). It needs NumPy and Numba.
OUT/water.NNNN.npz has positions (metres) and velocities (metres per second); OUT/houses.stl has the houses.
"""

import argparse
import resource
import time
from pathlib import Path

import numpy as np
from numba import njit, prange

TANK = (3.2, 1.28, 1.3)  # metres; z is up
WATER = (0.8, 1.28, 0.75)  # upper corner of the block of water
HOUSE, STREET = 0.16, 0.16  # widths of a house and of a street
HEIGHTS = ((30, 14, 22, 38), (18, 46, 26), (40, 20, 54, 24), (34, 20, 44), (28, 12, 36, 18))  # rows, centimetres
BOXES = [  # lower and upper corners of the houses; rows of four and of three stand in each other's gaps
    ((x, y, 0.0), (x + HOUSE, y + HOUSE, height / 100))
    for x, row in zip(1.2 + (HOUSE + STREET) * np.arange(5), HEIGHTS)
    for y, height in zip(0.72 + (HOUSE + STREET) * np.arange(4) - HOUSE * len(row), row)
]
GRAVITY = 9.81
PER_CELL = 8  # particles of a full cell
FLIP = 0.97  # the rest is PIC, which damps noise
CFL = 1.5  # cells that the fastest water may move in a step
SLAB = 4  # cells; see `particles_to_grid`
ONE = np.float32(1.0)


@njit(parallel=True, cache=True)
def sort_by_cell(pos, vel, new_pos, new_vel, key, shape, start):
    """Sorts particles by cell; `start[c]` becomes the first particle of cell c."""
    nx, ny, nz = shape
    for p in prange(len(pos)):
        key[p] = (int(pos[p, 0]) * ny + int(pos[p, 1])) * nz + int(pos[p, 2])
    start[:] = 0
    for p in range(len(pos)):
        start[key[p] + 1] += 1
    for c in range(len(start) - 1):
        start[c + 1] += start[c]
    cursor = start[:-1].copy()
    for p in range(len(pos)):
        q = cursor[key[p]]
        cursor[key[p]] = q + 1
        for a in range(3):
            new_pos[q, a] = pos[p, a]
            new_vel[q, a] = vel[p, a]


@njit(parallel=True, cache=True)
def particles_to_grid(pos, vel, start, shape, axis, field, weight):
    """Adds one velocity component to the faces. Slabs of the same parity never write to the same face."""
    nx, ny, nz = shape
    field[:] = 0
    weight[:] = 0
    ox = np.float32(0.0 if axis == 0 else 0.5)
    oy = np.float32(0.0 if axis == 1 else 0.5)
    oz = np.float32(0.0 if axis == 2 else 0.5)
    slabs = (nx + SLAB - 1) // SLAB
    for parity in range(2):
        for half in prange((slabs + 1) // 2):
            slab = 2 * half + parity
            if slab >= slabs:
                continue
            first = start[slab * SLAB * ny * nz]
            last = start[min((slab + 1) * SLAB, nx) * ny * nz]
            for p in range(first, last):
                x, y, z = pos[p, 0] - ox, pos[p, 1] - oy, pos[p, 2] - oz
                i, j, k = int(x), int(y), int(z)
                fx, fy, fz = x - np.float32(i), y - np.float32(j), z - np.float32(k)
                value = vel[p, axis]
                for a in range(2):
                    wx = fx if a == 1 else ONE - fx
                    for b in range(2):
                        wxy = wx * (fy if b == 1 else ONE - fy)
                        low, high = wxy * (ONE - fz), wxy * fz
                        field[i + a, j + b, k] += low * value
                        weight[i + a, j + b, k] += low
                        field[i + a, j + b, k + 1] += high * value
                        weight[i + a, j + b, k + 1] += high
    for i in prange(field.shape[0]):
        for j in range(field.shape[1]):
            for k in range(field.shape[2]):
                if weight[i, j, k] > 0:
                    field[i, j, k] /= weight[i, j, k]


@njit(inline="always")
def sample(field, weight, axis, px, py, pz, fallback):
    """Interpolates among the faces that have a velocity."""
    x = px - np.float32(0.0 if axis == 0 else 0.5)
    y = py - np.float32(0.0 if axis == 1 else 0.5)
    z = pz - np.float32(0.0 if axis == 2 else 0.5)
    i, j, k = int(x), int(y), int(z)
    fx, fy, fz = x - np.float32(i), y - np.float32(j), z - np.float32(k)
    total = np.float32(0.0)
    result = np.float32(0.0)
    for a in range(2):
        wx = fx if a == 1 else ONE - fx
        for b in range(2):
            wxy = wx * (fy if b == 1 else ONE - fy)
            low = wxy * (ONE - fz) if weight[i + a, j + b, k] > 0 else np.float32(0.0)
            high = wxy * fz if weight[i + a, j + b, k + 1] > 0 else np.float32(0.0)
            total += low + high
            result += low * field[i + a, j + b, k] + high * field[i + a, j + b, k + 1]
    return result / total if total > np.float32(1e-4) else fallback


@njit(parallel=True, cache=True)
def grid_to_particles(pos, vel, u, v, w, old_u, old_v, old_w, wu, wv, ww, shape, dt, boxes):
    """Updates velocities and moves the particles with the midpoint rule; `dt` is in cells per (metre per second)."""
    nx, ny, nz = shape
    flip = np.float32(FLIP)
    for p in prange(len(pos)):
        x, y, z = pos[p, 0], pos[p, 1], pos[p, 2]
        pu = sample(u, wu, 0, x, y, z, vel[p, 0])
        pv = sample(v, wv, 1, x, y, z, vel[p, 1])
        pw = sample(w, ww, 2, x, y, z, vel[p, 2])
        du = pu - sample(old_u, wu, 0, x, y, z, vel[p, 0])
        dv = pv - sample(old_v, wv, 1, x, y, z, vel[p, 1])
        dw = pw - sample(old_w, ww, 2, x, y, z, vel[p, 2])
        vel[p, 0] = flip * (vel[p, 0] + du) + (ONE - flip) * pu
        vel[p, 1] = flip * (vel[p, 1] + dv) + (ONE - flip) * pv
        vel[p, 2] = flip * (vel[p, 2] + dw) + (ONE - flip) * pw
        half = np.float32(0.5) * dt
        mx = min(max(x + half * pu, np.float32(1.01)), np.float32(nx - 1.01))
        my = min(max(y + half * pv, np.float32(1.01)), np.float32(ny - 1.01))
        mz = min(max(z + half * pw, np.float32(1.01)), np.float32(nz - 1.01))
        x += dt * sample(u, wu, 0, mx, my, mz, pu)
        y += dt * sample(v, wv, 1, mx, my, mz, pv)
        z += dt * sample(w, ww, 2, mx, my, mz, pw)

        # Push particles out of the boxes through the nearest side, and keep them in the tank
        for b in range(len(boxes)):
            low, high = boxes[b, 0], boxes[b, 1]
            if low[0] < x < high[0] and low[1] < y < high[1] and z < high[2]:
                out = min(min(x - low[0], high[0] - x), min(min(y - low[1], high[1] - y), high[2] - z))
                if out == high[2] - z:
                    z, vel[p, 2] = high[2], max(vel[p, 2], np.float32(0.0))
                elif out == x - low[0]:
                    x, vel[p, 0] = low[0], min(vel[p, 0], np.float32(0.0))
                elif out == high[0] - x:
                    x, vel[p, 0] = high[0], max(vel[p, 0], np.float32(0.0))
                elif out == y - low[1]:
                    y, vel[p, 1] = low[1], min(vel[p, 1], np.float32(0.0))
                else:
                    y, vel[p, 1] = high[1], max(vel[p, 1], np.float32(0.0))
        pos[p, 0] = min(max(x, np.float32(1.02)), np.float32(nx - 1.02))
        pos[p, 1] = min(max(y, np.float32(1.02)), np.float32(ny - 1.02))
        pos[p, 2] = min(max(z, np.float32(1.02)), np.float32(nz - 1.02))


@njit(cache=True)
def number_cells(start, solid, shape, index, cells):
    """Marks the cells with particles as fluid and numbers them."""
    nx, ny, nz = shape
    count = 0
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                c = (i * ny + j) * nz + k
                index[i, j, k] = -1
                if solid[i, j, k]:
                    index[i, j, k] = -2
                elif start[c + 1] > start[c]:
                    index[i, j, k] = count
                    cells[count] = c
                    count += 1
    return count


@njit(parallel=True, cache=True)
def apply_walls(u, v, w, wu, wv, ww, solid, gravity):
    """Adds gravity. Nothing flows through the faces of solid cells; faces inside of solids have no velocity."""
    nx, ny, nz = solid.shape
    for i in prange(nx):
        for j in range(ny):
            for k in range(nz):
                w[i, j, k] -= gravity
                here = solid[i, j, k]
                left, front, below = solid[max(i - 1, 0), j, k], solid[i, max(j - 1, 0), k], solid[i, j, max(k - 1, 0)]
                if here or left:
                    u[i, j, k] = 0
                    wu[i, j, k] = 0 if here and left else 1
                if here or front:
                    v[i, j, k] = 0
                    wv[i, j, k] = 0 if here and front else 1
                if here or below:
                    w[i, j, k] = 0
                    ww[i, j, k] = 0 if here and below else 1


@njit(parallel=True, cache=True)
def assemble(u, v, w, index, cells, start, neighbours, diagonal, rhs, correction):
    """Builds the Poisson equation of the fluid cells. Air has pressure 0."""
    nx, ny, nz = index.shape
    for n in prange(len(rhs)):
        c = cells[n]
        i, j, k = c // (ny * nz), c // nz % ny, c % nz
        rhs[n] = -(u[i + 1, j, k] - u[i, j, k] + v[i, j + 1, k] - v[i, j, k] + w[i, j, k + 1] - w[i, j, k])
        # Cells that are too full expand, so that the water keeps its volume
        crowd = (start[c + 1] - start[c]) / np.float32(PER_CELL) - np.float32(1.0)
        rhs[n] += correction * min(max(crowd, np.float32(0.0)), np.float32(1.0))
        walls = 0
        around = (index[i - 1, j, k], index[i + 1, j, k], index[i, j - 1, k],
                  index[i, j + 1, k], index[i, j, k - 1], index[i, j, k + 1])
        for a in range(6):
            neighbours[n, a] = max(around[a], -1)
            if around[a] == -2:
                walls += 1
        diagonal[n] = max(6 - walls, 1)


@njit(parallel=True, cache=True)
def multiply(neighbours, diagonal, x, out):
    """out = A x; returns x . out"""
    total = 0.0
    for n in prange(len(x)):
        value = diagonal[n] * x[n]
        for a in range(6):
            m = neighbours[n, a]
            if m >= 0:
                value -= x[m]
        out[n] = value
        total += value * x[n]
    return total


@njit(parallel=True, cache=True)
def descend(p, r, d, ad, diagonal, alpha):
    """One step along d; returns r . r / diagonal, and r . r"""
    scaled, plain = 0.0, 0.0
    for n in prange(len(p)):
        p[n] += alpha * d[n]
        r[n] -= alpha * ad[n]
        scaled += r[n] * r[n] / diagonal[n]
        plain += r[n] * r[n]
    return scaled, plain


@njit(parallel=True, cache=True)
def turn(d, r, diagonal, beta):
    for n in prange(len(d)):
        d[n] = r[n] / diagonal[n] + beta * d[n]


def solve(neighbours, diagonal, p, rhs, tolerance=2e-3, limit=400):
    """Conjugate gradients with the diagonal as preconditioner; starts from the pressure of the last step."""
    ad = np.empty_like(p)
    multiply(neighbours, diagonal, p, ad)
    r = rhs - ad
    goal = tolerance**2 * max(float(np.vdot(rhs, rhs)), 1e-12)
    d = r / diagonal
    scaled = float(np.vdot(r, d))
    for iteration in range(limit):
        alpha = scaled / max(multiply(neighbours, diagonal, d, ad), 1e-30)
        new, plain = descend(p, r, d, ad, diagonal, np.float32(alpha))
        if plain < goal:
            return iteration + 1
        turn(d, r, diagonal, np.float32(new / scaled))
        scaled = new
    return limit


@njit(parallel=True, cache=True)
def subtract_gradient(u, v, w, index, pressure):
    nx, ny, nz = index.shape
    for i in prange(1, nx):
        for j in range(1, ny):
            for k in range(1, nz):
                here = index[i, j, k]
                if here == -2:
                    continue
                for axis in range(3):
                    there = index[i - (axis == 0), j - (axis == 1), k - (axis == 2)]
                    if there == -2 or (here < 0 and there < 0):
                        continue
                    jump = (pressure[here] if here >= 0 else 0) - (pressure[there] if there >= 0 else 0)
                    if axis == 0:
                        u[i, j, k] -= jump
                    elif axis == 1:
                        v[i, j, k] -= jump
                    else:
                        w[i, j, k] -= jump


def write_boxes(path):
    """Writes the obstacles as binary STL."""
    triangles = []
    for corners in BOXES:
        corner = [np.array([corners[n >> a & 1][a] for a in range(3)]) for n in range(8)]
        for a, b, c, d in ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)):
            triangles += [(corner[a], corner[b], corner[c]), (corner[a], corner[c], corner[d])]
    record = np.zeros(len(triangles), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("unused", "<u2")])
    record["corners"] = triangles
    path.write_bytes(bytes(80) + np.uint32(len(triangles)).tobytes() + record.tobytes())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--particles", type=float, default=5e6, help="about this many (default: 5e6)")
    parser.add_argument("--time", type=float, default=0.6, help="seconds of the simulation (default: 0.6)")
    parser.add_argument("--frame-time", type=float, default=0.02, help="seconds between frames (default: 0.02)")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)

    # The volume of the water gives the size of a cell
    cell = (np.prod(WATER) * PER_CELL / options.particles) ** (1 / 3)
    shape = tuple(int(round(length / cell)) + 2 for length in TANK)  # one layer of solid cells around
    nx, ny, nz = shape
    solid = np.ones(shape, dtype=np.bool_)
    solid[1:-1, 1:-1, 1:-1] = False
    boxes = (np.array(BOXES) / cell + 1).astype(np.float32)
    for low, high in boxes.round().astype(int):
        solid[tuple(map(slice, low, high))] = True
    write_boxes(options.out / "houses.stl")

    # Eight particles in each cell of the water, each moved at random
    random = np.random.default_rng(1)
    axes = [np.arange(2.5, 2 * min(size / cell + 1, cells - 1)) / 2 for size, cells in zip(WATER, shape)]
    pos = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    pos = (pos + random.uniform(-0.12, 0.12, pos.shape)).astype(np.float32)
    vel = np.zeros_like(pos)
    count = len(pos)
    print(f"{count} particles, cells of {cell * 1000:.1f} mm, grid {nx} x {ny} x {nz}", flush=True)

    new_pos, new_vel = np.empty_like(pos), np.empty_like(vel)
    key = np.empty(count, dtype=np.int32)
    start = np.zeros(nx * ny * nz + 1, dtype=np.int32)
    fields = [np.zeros((nx + 1, ny + 1, nz + 1), dtype=np.float32) for _ in range(3)]
    weights = [np.zeros_like(fields[0]) for _ in range(3)]
    index = np.empty(shape, dtype=np.int32)
    cells = np.empty(nx * ny * nz, dtype=np.int32)
    pressure_grid = np.zeros(nx * ny * nz, dtype=np.float32)
    previous_dt = 1.0

    begin, now, frame, steps = time.time(), 0.0, 0, 0
    while True:
        if now >= frame * options.frame_time - 1e-9:
            position = (pos - np.float32(1)) * np.float32(cell)
            np.savez(options.out / f"water.{frame:04d}.npz", position=position, velocity=vel, time=np.float64(now))
            print(f"frame {frame}: {now:.3f} s, {steps} steps, {time.time() - begin:.0f} s", flush=True)
            frame += 1
            if now >= options.time - 1e-9:
                break
        # A few drops may move farther than CFL cells
        speeds = np.sqrt((vel[:: max(count // 500_000, 1)] ** 2).sum(axis=1))
        fastest = max(float(np.percentile(speeds, 99.9)), 1.0)
        dt = min(CFL * cell / fastest, 0.005, frame * options.frame_time - now)

        # To the grid
        sort_by_cell(pos, vel, new_pos, new_vel, key, shape, start)
        pos, new_pos, vel, new_vel = new_pos, pos, new_vel, vel
        for axis in range(3):
            particles_to_grid(pos, vel, start, shape, axis, fields[axis], weights[axis])
        old = [field.copy() for field in fields]

        # Forces and pressure; the pressure is in units of velocity
        apply_walls(*fields, *weights, solid, np.float32(GRAVITY * dt))
        unknowns = number_cells(start, solid, shape, index, cells)
        neighbours = np.empty((unknowns, 6), dtype=np.int32)
        diagonal, rhs = np.empty(unknowns, dtype=np.float32), np.empty(unknowns, dtype=np.float32)
        correction = np.float32(0.05 * cell / dt)
        assemble(*fields, index, cells, start, neighbours, diagonal, rhs, correction)
        pressure = pressure_grid[cells[:unknowns]] * np.float32(dt / previous_dt)
        iterations = solve(neighbours, diagonal, pressure, rhs)
        pressure_grid[:] = 0
        pressure_grid[cells[:unknowns]] = pressure
        subtract_gradient(*fields, index, pressure)

        # Back to the particles
        grid_to_particles(pos, vel, *fields, *old, *weights, shape, np.float32(dt / cell), boxes)
        now, steps, previous_dt = now + dt, steps + 1, dt
        if steps % 20 == 0:
            print(f"  step {steps}: dt {dt * 1000:.2f} ms, {fastest:.1f} m/s, {iterations} iterations", flush=True)

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{count} particles, {steps} steps, {time.time() - begin:.0f} s, peak memory {peak:.0f} MiB")


if __name__ == "__main__":
    main()
