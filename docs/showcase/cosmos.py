"""Simulates cold dark matter in a periodic box with a particle-mesh code and writes its last step for spherule.

    python cosmos.py OUT.npz --particles 1e7

Particles start on a lattice, displaced by the Zel'dovich approximation (Zel'dovich, Astronomy and Astrophysics 5
(1970), 84) with the power spectrum of Bardeen, Bond, Kaiser and Szalay (Astrophysical Journal 304 (1986), 15). The
forces are those of Hockney and Eastwood, "Computer Simulation Using Particles" (1988), with clouds in cells, and the
time steps follow Klypin and Holtzman (arXiv:astro-ph/9712217). It needs NumPy, SciPy and Numba. OUT.npz has positions
(Mpc/h), peculiar velocities (km/s) and the density at each particle, in units of the mean.
"""

import argparse
import resource
import time

import numpy as np
import scipy.fft
from numba import njit, prange

MATTER, LAMBDA, HUBBLE, SIGMA8, TILT = 0.31, 0.69, 0.68, 0.81, 0.965  # about those of Planck 2018
FIRST, STEPS = 0.02, 80  # scale factor at the start; the last one is 1


def expansion(a):
    """The Hubble rate in units of H0."""
    return np.sqrt(MATTER / a**3 + LAMBDA + (1 - MATTER - LAMBDA) / a**2)


def growth(a):
    """Growth factor of small perturbations (Heath, 1977), not normalised."""
    steps = np.linspace(1e-4, a, 4000)
    return expansion(a) * np.trapezoid((steps * expansion(steps)) ** -3.0, steps)


def power(k):
    """Power spectrum, not normalised; k in h/Mpc."""
    q = np.maximum(k, 1e-6) / (MATTER * HUBBLE)
    transfer = np.log(1 + 2.34 * q) / (2.34 * q)
    transfer *= (1 + 3.89 * q + (16.1 * q) ** 2 + (5.46 * q) ** 3 + (6.71 * q) ** 4) ** -0.25
    return k**TILT * transfer**2


def spectrum_scale():
    """Factor that gives the spectrum the variance SIGMA8 in spheres of 8 Mpc/h."""
    k = np.geomspace(1e-4, 20, 20000)
    window = 3 * (np.sin(8 * k) - 8 * k * np.cos(8 * k)) / (8 * k) ** 3
    return SIGMA8**2 / np.trapezoid(power(k) * window**2 * k**3 / (2 * np.pi**2), np.log(k))


@njit(cache=True)
def deposit(pos, density):
    """Adds clouds in cells; positions are in cells."""
    n = density.shape[0]
    density[:] = 0
    for p in range(len(pos)):
        i, j, k = int(pos[p, 0]), int(pos[p, 1]), int(pos[p, 2])
        x, y, z = pos[p, 0] - np.float32(i), pos[p, 1] - np.float32(j), pos[p, 2] - np.float32(k)
        i, j, k = i % n, j % n, k % n
        i1, j1, k1 = (i + 1) % n, (j + 1) % n, (k + 1) % n
        for a, wx in ((i, np.float32(1) - x), (i1, x)):
            for b, wy in ((j, np.float32(1) - y), (j1, y)):
                w = wx * wy
                density[a, b, k] += w * (np.float32(1) - z)
                density[a, b, k1] += w * z


@njit(parallel=True, cache=True)
def interpolate(pos, field, out, factor):
    """out += factor * field at the particles"""
    n = field.shape[0]
    for p in prange(len(pos)):
        i, j, k = int(pos[p, 0]), int(pos[p, 1]), int(pos[p, 2])
        x, y, z = pos[p, 0] - np.float32(i), pos[p, 1] - np.float32(j), pos[p, 2] - np.float32(k)
        i, j, k = i % n, j % n, k % n
        i1, j1, k1 = (i + 1) % n, (j + 1) % n, (k + 1) % n
        value = np.float32(0)
        for a, wx in ((i, np.float32(1) - x), (i1, x)):
            for b, wy in ((j, np.float32(1) - y), (j1, y)):
                value += wx * wy * (field[a, b, k] * (np.float32(1) - z) + field[a, b, k1] * z)
        out[p] += factor * value


@njit(parallel=True, cache=True)
def drift(pos, momentum, factor, n):
    for p in prange(len(pos)):
        for a in range(3):
            pos[p, a] = (pos[p, a] + factor * momentum[a, p]) % n
            if pos[p, a] >= n:
                pos[p, a] = 0


@njit(parallel=True, cache=True)
def difference(potential, axis, force):
    """force = - gradient of the potential"""
    n = potential.shape[0]
    for i in prange(n):
        for j in range(n):
            for k in range(n):
                if axis == 0:
                    jump = potential[(i + 1) % n, j, k] - potential[i - 1, j, k]
                elif axis == 1:
                    jump = potential[i, (j + 1) % n, k] - potential[i, j - 1, k]
                else:
                    jump = potential[i, j, (k + 1) % n] - potential[i, j, k - 1]
                force[i, j, k] = np.float32(-0.5) * jump


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out")
    parser.add_argument("--particles", type=float, default=1e7, help="about this many (default: 1e7)")
    parser.add_argument("--box", type=float, default=100.0, help="edge of the box, Mpc/h (default: 100)")
    parser.add_argument("--mesh", type=float, default=1.25, help="cells for a particle along an edge (default: 1.25)")
    options = parser.parse_args()
    begin = time.time()
    side = scipy.fft.next_fast_len(round(options.particles ** (1 / 3)), real=True)
    n = scipy.fft.next_fast_len(round(options.mesh * side), real=True)

    # White noise with the power spectrum gives the displacements of a lattice
    random = np.random.default_rng(7)
    noise = scipy.fft.rfftn(random.standard_normal((side,) * 3, dtype=np.float32), workers=2)
    unit = 2 * np.pi / options.box
    wave = [(np.fft.fftfreq(side, 1 / side) * unit).astype(np.float32)] * 2
    wave.append((np.fft.rfftfreq(side, 1 / side) * unit).astype(np.float32))
    wave = np.meshgrid(*wave, indexing="ij", sparse=True)
    square = wave[0] ** 2 + wave[1] ** 2 + wave[2] ** 2
    square[0, 0, 0] = 1
    cell_volume = (options.box / side) ** 3
    noise *= np.sqrt(spectrum_scale() * power(np.sqrt(square)) / cell_volume) / square
    noise[0, 0, 0] = 0
    start = growth(FIRST) / growth(1.0)
    rate = FIRST * (growth(FIRST * 1.001) - growth(FIRST * 0.999)) / (0.002 * FIRST * growth(FIRST))
    lattice = np.arange(side, dtype=np.float32) * (n / side)
    pos = np.stack(np.meshgrid(lattice, lattice, lattice, indexing="ij"), -1).reshape(-1, 3)
    momentum = np.empty((3, len(pos)), dtype=np.float32)
    # Lengths are in cells, times in 1/H0; the momentum is a^2 dx/dt
    for axis in range(3):
        shift = scipy.fft.irfftn(1j * wave[axis] * noise, s=(side,) * 3, workers=2).astype(np.float32).ravel()
        shift *= start * n / options.box
        pos[:, axis] += shift
        momentum[axis] = shift * (rate * FIRST**2 * expansion(FIRST))
    pos %= n
    del noise, square, shift
    print(f"{len(pos)} particles, mesh of {n}^3 cells, {time.time() - begin:.0f} s", flush=True)

    density, force = np.empty((n, n, n), dtype=np.float32), np.empty((n, n, n), dtype=np.float32)
    sine = (2 * np.sin(np.pi * np.fft.fftfreq(n))).astype(np.float32) ** 2
    half = (2 * np.sin(np.pi * np.fft.rfftfreq(n))).astype(np.float32) ** 2
    mean = len(pos) / n**3
    edges = np.geomspace(FIRST, 1.0, STEPS + 1)
    for step, (a, after) in enumerate(zip(edges[:-1], edges[1:])):
        # Kick and drift over equal steps of the logarithm of a
        middle = np.sqrt(a * after)
        deposit(pos, density)
        field = scipy.fft.rfftn(density, workers=2)
        laplace = sine[:, None, None] + sine[None, :, None] + half[None, None, :]
        laplace[0, 0, 0] = 1
        field *= (-1.5 * MATTER / a / mean) / laplace
        field[0, 0, 0] = 0
        potential = scipy.fft.irfftn(field, s=(n,) * 3, workers=2)
        del field, laplace
        before = np.sqrt(edges[step - 1] * a) if step > 0 else a
        kick = np.log(middle / before) / expansion(a)
        for axis in range(3):
            difference(potential, axis, force)
            interpolate(pos, force, momentum[axis], np.float32(kick))
        drift(pos, momentum, np.float32(np.log(after / a) / (middle**2 * expansion(middle))), np.float32(n))
        if step % 10 == 9:
            print(f"  step {step + 1} of {STEPS}: a = {after:.3f}, {time.time() - begin:.0f} s", flush=True)

    deposit(pos, density)
    density /= np.float32(mean)
    around = np.zeros(len(pos), dtype=np.float32)
    interpolate(pos, density, around, np.float32(1))
    pos *= np.float32(options.box / n)
    velocity = np.ascontiguousarray(momentum.T) * np.float32(100 * options.box / n)
    np.savez(options.out, position=pos, velocity=velocity, density=around)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{len(pos)} particles, {STEPS} steps, {time.time() - begin:.0f} s, peak memory {peak:.0f} MiB")


if __name__ == "__main__":
    main()
