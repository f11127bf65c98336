"""Simulates the collapse of a column of capsules with the discrete element method and writes frames for spherule.

    python grains.py OUT --grains 1e5

Contacts are linear springs with dampers (Cundall and Strack, Géotechnique 29 (1979), 47) and Coulomb friction without
memory, at the closest points of the axes (Ericson, "Real-Time Collision Detection" (2005), section 5.1.9). The unit
of length is the thickness of a grain, those of density and gravity are 1. It needs NumPy and Numba.
OUT/grains.NNNN.npz has the columns of LAMMPS dumps, and `layer`, the height of each grain in the column from 0 to 1.
"""

import argparse
import resource
import time
from pathlib import Path

import numpy as np
from numba import njit, prange

RADIUS, HALF = 0.5, 0.6  # of a grain, and half the length of its axis
STIFFNESS, DAMPING, FRICTION = 1000.0, 0.3, 0.5
SKIN = 0.35  # lists of neighbours hold until a grain has moved by half of it
NEIGHBOURS = 40
SETTLE, COLLAPSE = 4.0, 9.0  # durations; the wall around the column is there only at first

CYLINDER, BALL = 2 * np.pi * RADIUS**2 * HALF, 4 / 3 * np.pi * RADIUS**3
MASS = CYLINDER + BALL
SPIN = 0.5 * CYLINDER * RADIUS**2 + 0.4 * BALL * RADIUS**2  # moments of inertia: around the axis, and across it
TUMBLE = CYLINDER * (RADIUS**2 / 4 + HALF**2 / 3) + BALL * (0.4 * RADIUS**2 + HALF**2 + 0.75 * HALF * RADIUS)
STEP = 0.09 * np.pi * np.sqrt(0.5 * MASS / STIFFNESS)


@njit(inline="always", fastmath=True)
def closest(dx, dy, dz, ax, ay, az, bx, by, bz):
    """Places s and t on two axes of unit direction a and b, where they are closest; d is from b's centre to a's."""
    along = ax * bx + ay * by + az * bz
    da = ax * dx + ay * dy + az * dz
    db = bx * dx + by * dy + bz * dz
    square = 1.0 - along * along
    s = (along * db - da) / square if square > 1e-6 else 0.0
    s = min(max(s, -HALF), HALF)
    t = along * s + db
    if abs(t) > HALF:
        t = min(max(t, -HALF), HALF)
        s = min(max(along * t - da, -HALF), HALF)
    return s, t


@njit(parallel=True, fastmath=True, cache=True)
def list_neighbours(pos, axis, near, counts, order, start, cells, low, size):
    """Lists the grains around each grain that are closer than SKIN."""
    for i in prange(len(pos)):
        count = 0
        cx, cy = int((pos[i, 0] - low[0]) / size), int((pos[i, 1] - low[1]) / size)
        cz = int((pos[i, 2] - low[2]) / size)
        for x in range(max(cx - 1, 0), min(cx + 2, cells[0])):
            for y in range(max(cy - 1, 0), min(cy + 2, cells[1])):
                for z in range(max(cz - 1, 0), min(cz + 2, cells[2])):
                    cell = (x * cells[1] + y) * cells[2] + z
                    for n in range(start[cell], start[cell + 1]):
                        j = order[n]
                        if j == i:
                            continue
                        dx, dy, dz = pos[i, 0] - pos[j, 0], pos[i, 1] - pos[j, 1], pos[i, 2] - pos[j, 2]
                        if dx * dx + dy * dy + dz * dz > (2 * (HALF + RADIUS) + SKIN) ** 2:
                            continue
                        s, t = closest(
                            dx, dy, dz, axis[i, 0], axis[i, 1], axis[i, 2], axis[j, 0], axis[j, 1], axis[j, 2]
                        )
                        dx += s * axis[i, 0] - t * axis[j, 0]
                        dy += s * axis[i, 1] - t * axis[j, 1]
                        dz += s * axis[i, 2] - t * axis[j, 2]
                        if dx * dx + dy * dy + dz * dz < (2 * RADIUS + SKIN) ** 2 and count < NEIGHBOURS:
                            near[i, count] = j
                            count += 1
        counts[i] = count


@njit(inline="always", fastmath=True)
def contact(overlap, nx, ny, nz, vx, vy, vz, mass):
    """Force on a body that moves with v relative to the other one; n points towards it."""
    damper = 2 * DAMPING * np.sqrt(STIFFNESS * mass)
    normal = vx * nx + vy * ny + vz * nz
    push = max(STIFFNESS * overlap - damper * normal, 0.0)
    tx, ty, tz = vx - normal * nx, vy - normal * ny, vz - normal * nz
    slip = np.sqrt(tx * tx + ty * ty + tz * tz) + 1e-12
    drag = min(FRICTION * push, damper * slip) / slip
    return push * nx - drag * tx, push * ny - drag * ty, push * nz - drag * tz


@njit(parallel=True, fastmath=True, cache=True)
def forces(pos, vel, axis, omega, near, counts, force, torque, wall):
    for i in prange(len(pos)):
        fx, fy, fz = 0.0, 0.0, -MASS
        mx, my, mz = 0.0, 0.0, 0.0
        for n in range(counts[i]):
            j = near[i, n]
            dx, dy, dz = pos[i, 0] - pos[j, 0], pos[i, 1] - pos[j, 1], pos[i, 2] - pos[j, 2]
            s, t = closest(dx, dy, dz, axis[i, 0], axis[i, 1], axis[i, 2], axis[j, 0], axis[j, 1], axis[j, 2])
            dx += s * axis[i, 0] - t * axis[j, 0]
            dy += s * axis[i, 1] - t * axis[j, 1]
            dz += s * axis[i, 2] - t * axis[j, 2]
            square = dx * dx + dy * dy + dz * dz
            if square >= 4 * RADIUS**2 or square < 1e-12:
                continue
            distance = np.sqrt(square)
            nx, ny, nz = dx / distance, dy / distance, dz / distance
            # Arms from the centres to the middle of the contact
            ax, ay, az = s * axis[i, 0] - 0.5 * dx, s * axis[i, 1] - 0.5 * dy, s * axis[i, 2] - 0.5 * dz
            bx, by, bz = t * axis[j, 0] + 0.5 * dx, t * axis[j, 1] + 0.5 * dy, t * axis[j, 2] + 0.5 * dz
            vx = vel[i, 0] - vel[j, 0] + omega[i, 1] * az - omega[i, 2] * ay - omega[j, 1] * bz + omega[j, 2] * by
            vy = vel[i, 1] - vel[j, 1] + omega[i, 2] * ax - omega[i, 0] * az - omega[j, 2] * bx + omega[j, 0] * bz
            vz = vel[i, 2] - vel[j, 2] + omega[i, 0] * ay - omega[i, 1] * ax - omega[j, 0] * by + omega[j, 1] * bx
            gx, gy, gz = contact(2 * RADIUS - distance, nx, ny, nz, vx, vy, vz, 0.5 * MASS)
            fx, fy, fz = fx + gx, fy + gy, fz + gz
            mx, my, mz = mx + ay * gz - az * gy, my + az * gx - ax * gz, mz + ax * gy - ay * gx

        # Both ends touch the ground and the wall
        for side in range(2):
            end = HALF if side == 0 else -HALF
            ax, ay, az = end * axis[i, 0], end * axis[i, 1], end * axis[i, 2]
            x, y = pos[i, 0] + ax, pos[i, 1] + ay
            vx = vel[i, 0] + omega[i, 1] * az - omega[i, 2] * ay
            vy = vel[i, 1] + omega[i, 2] * ax - omega[i, 0] * az
            vz = vel[i, 2] + omega[i, 0] * ay - omega[i, 1] * ax
            overlap = RADIUS - pos[i, 2] - az
            if overlap > 0:
                # The ground touches below the end
                vx, vy = vx - omega[i, 1] * RADIUS, vy + omega[i, 0] * RADIUS
                gx, gy, gz = contact(overlap, 0.0, 0.0, 1.0, vx, vy, vz, MASS)
                fx, fy, fz = fx + gx, fy + gy, fz + gz
                mx += ay * gz - (az - RADIUS) * gy
                my += (az - RADIUS) * gx - ax * gz
                mz += ax * gy - ay * gx
            away = np.sqrt(x * x + y * y)
            if wall > 0 and away + RADIUS > wall:
                push = STIFFNESS * (away + RADIUS - wall) / away
                gx, gy, gz = -push * x - 3 * vx, -push * y - 3 * vy, 0.0
                fx, fy = fx + gx, fy + gy
                mx, my, mz = mx - az * gy, my + az * gx, mz + ax * gy - ay * gx
        force[i, 0], force[i, 1], force[i, 2] = fx, fy, fz
        torque[i, 0], torque[i, 1], torque[i, 2] = mx, my, mz


@njit(parallel=True, fastmath=True, cache=True)
def move(pos, vel, axis, omega, force, torque, fastest):
    """Semi-implicit Euler. The gyroscopic torque is left out: such short grains turn slowly."""
    for i in prange(len(pos)):
        along = 0.0
        for a in range(3):
            vel[i, a] += STEP * force[i, a] / MASS
            pos[i, a] += STEP * vel[i, a]
            along += torque[i, a] * axis[i, a]
        for a in range(3):
            omega[i, a] += STEP * ((torque[i, a] - along * axis[i, a]) / TUMBLE + along * axis[i, a] / SPIN)
        x, y, z = axis[i, 0], axis[i, 1], axis[i, 2]
        x += STEP * (omega[i, 1] * axis[i, 2] - omega[i, 2] * axis[i, 1])
        y += STEP * (omega[i, 2] * axis[i, 0] - omega[i, 0] * axis[i, 2])
        z += STEP * (omega[i, 0] * axis[i, 1] - omega[i, 1] * axis[i, 0])
        length = np.sqrt(x * x + y * y + z * z)
        axis[i, 0], axis[i, 1], axis[i, 2] = x / length, y / length, z / length
        turn = omega[i, 0] ** 2 + omega[i, 1] ** 2 + omega[i, 2] ** 2
        fastest[i] = np.sqrt(vel[i, 0] ** 2 + vel[i, 1] ** 2 + vel[i, 2] ** 2) + HALF * np.sqrt(turn)


def write(path, now, pos, vel, axis, omega, layer):
    """Writes the columns of a LAMMPS dump. The quaternions turn z to the axes."""
    up = np.where(axis[:, 2:] < 0, -axis, axis)
    quaternion = np.stack([1 + up[:, 2], -up[:, 1], up[:, 0], np.zeros(len(up))], axis=1)
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    columns = dict(zip(("quatw", "quati", "quatj", "quatk"), quaternion.T))
    columns |= dict(zip(("omegax", "omegay", "omegaz"), omega.T))
    columns |= dict.fromkeys(("shapex", "shapey"), np.full(len(pos), 2 * RADIUS))
    columns |= {"shapez": np.full(len(pos), 2 * (RADIUS + HALF)), "layer": layer}
    columns = {name: np.ascontiguousarray(column, dtype=np.float32) for name, column in columns.items()}
    np.savez(path, position=pos.astype(np.float32), velocity=vel.astype(np.float32), time=np.float64(now), **columns)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--grains", type=float, default=1e5, help="about this many (default: 1e5)")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    begin = time.time()

    # Layers of grains that lie side by side, each layer in another direction, in a wall of this radius
    wall = 0.62 * options.grains ** (1 / 3) + 2
    random = np.random.default_rng(5)
    line = np.arange(-wall, wall, 1)
    places, axes = [], []
    while sum(map(len, places)) < options.grains:
        along, across = np.meshgrid(line * (2 * (HALF + RADIUS) + 0.12), line * (2 * RADIUS + 0.1))
        along = along + random.uniform(0, 2, len(line))[:, None]  # rows are shifted
        angle = random.uniform(0, np.pi)
        x, y = np.cos(angle) * along - np.sin(angle) * across, np.sin(angle) * along + np.cos(angle) * across
        inside = np.hypot(x, y) < wall - RADIUS - HALF
        height = RADIUS + len(places) * (2 * RADIUS + 0.03)
        places.append(np.stack([x[inside], y[inside], np.full(inside.sum(), height)], axis=1))
        angle = angle + random.uniform(-0.06, 0.06, inside.sum())
        axes.append(np.stack([np.cos(angle), np.sin(angle), random.uniform(-0.01, 0.01, len(angle))], axis=1))
    pos, axis = np.concatenate(places), np.concatenate(axes)
    layers = len(places)
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    vel, omega, force, torque = np.zeros_like(pos), np.zeros_like(pos), np.zeros_like(pos), np.zeros_like(pos)
    vel[:, :2] = random.normal(scale=0.2, size=(len(pos), 2))
    count = len(pos)
    near, counts = np.empty((count, NEIGHBOURS), dtype=np.int32), np.empty(count, dtype=np.int32)
    fastest, layer = np.empty(count), np.zeros(count)
    settle, steps = round(SETTLE / STEP), round((SETTLE + COLLAPSE) / STEP)
    between = (steps - settle) // 9
    print(f"{count} grains, {layers} layers, radius {wall:.0f}, {steps} steps", flush=True)

    moved, size = np.inf, 2 * (HALF + RADIUS) + SKIN
    for step in range(steps + 1):
        if moved > SKIN / 2:
            low = pos.min(axis=0) - 1e-6
            cells = ((pos.max(axis=0) - low) / size).astype(np.int64) + 1
            key = ((pos - low) / size).astype(np.int64)
            key = (key[:, 0] * cells[1] + key[:, 1]) * cells[2] + key[:, 2]
            order = np.argsort(key, kind="stable").astype(np.int32)
            start = np.searchsorted(key[order], np.arange(np.prod(cells) + 1))
            list_neighbours(pos, axis, near, counts, order, start, cells, low, size)
            moved = 0.0
        if step == settle:
            layer = np.argsort(np.argsort(pos[:, 2])) / count
        if step >= settle and (step - settle) % between == 0:
            frame = (step - settle) // between
            write(options.out / f"grains.{frame:04d}.npz", (step - settle) * STEP, pos, vel, axis, omega, layer)
        forces(pos, vel, axis, omega, near, counts, force, torque, wall if step < settle else 0.0)
        move(pos, vel, axis, omega, force, torque, fastest)
        # All but a few grains in free flight
        moved += STEP * float(np.partition(fastest, -10)[-10])
        if step % 200 == 0:
            height = np.percentile(pos[:, 2], 99)
            print(f"  step {step}: height {height:.1f}, {time.time() - begin:.0f} s", flush=True)

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{count} grains, {steps} steps, {time.time() - begin:.0f} s, peak memory {peak:.0f} MiB")


if __name__ == "__main__":
    main()
