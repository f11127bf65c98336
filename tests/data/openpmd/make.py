"""Two iterations of two species in JSON and in HDF5, written by openPMD-api: pip install openpmd-api numpy"""

import pathlib

import numpy as np
import openpmd_api as io

HERE = pathlib.Path(__file__).parent


def write(path):
    """The same particles in the format that the extension tells."""
    series = io.Series(str(path), io.Access.create)
    series.author = "CC0"
    rng = np.random.default_rng(1)
    for number in (0, 100):
        iteration = series.iterations[number]
        iteration.time, iteration.dt, iteration.time_unit_SI = number * 1e-3, 1e-3, 2.0
        for species, count in (("electrons", 5), ("ions", 3)):
            particles = iteration.particles[species]
            doubles = io.Dataset(np.dtype("float64"), [count])
            for axis in "xyz":
                values = rng.random(count) * 10
                component = particles["position"][axis]
                component.reset_dataset(doubles)
                component.unit_SI = 1e-6
                component.store_chunk(values)
                offset = particles["positionOffset"][axis]
                offset.reset_dataset(doubles)
                offset.make_constant(0.5 if species == "ions" else 0.0)
                momentum = particles["momentum"][axis]
                momentum.reset_dataset(io.Dataset(np.dtype("float32"), [count]))
                momentum.store_chunk(values.astype("f4") * 3)
            ids = particles["id"][io.Record_Component.SCALAR]
            ids.reset_dataset(io.Dataset(np.dtype("uint64"), [count]))
            numbers = (np.arange(count) + 2**60).astype("u8")
            ids.store_chunk(numbers)
            charge = particles["charge"][io.Record_Component.SCALAR]
            charge.reset_dataset(doubles)
            charge.make_constant(-1.6e-19)
            if species == "ions":
                weighting = particles["weighting"][io.Record_Component.SCALAR]
                weighting.reset_dataset(doubles)
                weights = rng.random(count)
                weighting.store_chunk(weights)
            series.flush()
        iteration.close()
    series.close()


for extension in ("json", "h5"):  # the latter is packed with gzip
    write(HERE / f"species.{extension}")
