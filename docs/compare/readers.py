"""Compares what spherule reads with what the reference readers of the field read, file by file.

    pip install numpy h5py laspy lazrs laszip open3d parmed pye57 pynbody rdkit spherule
    python docs/compare/readers.py FOLDER --spherule target/release/spherule

FOLDER has one folder for each format: charmm, e57, gadget, geo, hdf5, las, pts, sdf, tipsy. Prints a line for each
file: format, file, reference reader, particles, largest difference, compared arrays. A difference of 0 means that all
numbers are equal; NaN equals NaN. Where the reference reader has single precision, so has the comparison. Names are
compared one to one: equal names have equal codes. The program counts the bonds, which Python frames do not have.

Files of public repositories and packages, and a few written by pynbody and laspy, compared in November 2026:

| format | reference reader | files | equal | others |
|---|---|---|---|---|
| CHARMM coordinates, normal and extended | ParmEd 4.3.1 | 7 | 7 | |
| E57 | pye57 0.4.19 | 42 | 34 | 1 by 2e-16, 7 refused by one or both: damage, no scans or points |
| GADGET-1 and 2, both byte orders | pynbody 2.8.0 | 22 | 19 | 3: pynbody guesses the name of a block |
| HDF5 of AREPO, GADGET and SWIFT | h5py 3.16.0 | 11 | 11 | |
| Houdini text, versions 13 to 16.5 | json | 120 | 82 | 37 have packed primitives, 1 is damaged |
| LAS and LAZ, points of formats 0 to 4, 6 to 10 | laspy 2.7.0 | 109 | 107 | 2 are cut short |
| PTS | Open3D 0.20.0 | 5 | 3 | 1 has more points than stated, 1 is no point cloud |
| MDL, V2000 and V3000 | RDKit 2026.9.1 | 631 | 575 | 50 RDKit does not read, 6 are unusual or damaged |
| Tipsy, standard and native | pynbody 2.8.0 | 12 | 12 | |
"""

import argparse
import json
import subprocess
import warnings
from importlib.metadata import version
from pathlib import Path

import numpy as np
import spherule


def charmm(path):
    """ParmEd: positions, residues, weights and names."""
    from parmed.charmm import CharmmCrdFile
    file = CharmmCrdFile(str(path))
    names = {"atom_name": file.atname, "residue_name": file.resname, "segment": file.segid}
    found = {"positions": np.reshape(file.coordinates, (-1, 3)), "residue": np.array(file.resid, int)}
    yield found | {"weight": np.array(file.weighting)} | {name: np.array(text, str) for name, text in names.items()}


def e57(path):
    """pye57: positions in the places of the scanners, colours and indices. Points without a place are NaN."""
    import pye57
    pye57.e57.SUPPORTED_POINT_FIELDS.update(colorRed="H", colorGreen="H", colorBlue="H")  # 16 bits, not 8
    file = pye57.E57(str(path))
    scans = []
    for index in range(file.scan_count):
        raw, header = file.read_scan_raw(index, ignore_unsupported_fields=True), file.get_header(index)
        axes = [raw.get("cartesian" + axis) for axis in "XYZ"]
        if "sphericalRange" in raw:
            r, azimuth, up = (raw["spherical" + name].astype(float) for name in ("Range", "Azimuth", "Elevation"))
            axes = [r * np.cos(up) * np.cos(azimuth), r * np.cos(up) * np.sin(azimuth), r * np.sin(up)]
        points = np.array(axes, float).T
        if header.has_pose():
            points = points @ header.rotation_matrix.T + header.translation
        for name in {"cartesianInvalidState", "sphericalInvalidState"} & set(raw):
            points[raw[name] != 0] = np.nan
        scan = {"positions": points}
        if "colorRed" in raw:
            scan["color"] = np.array([raw["color" + name] for name in ("Red", "Green", "Blue")]).T
        names = {"intensity": "intensity", "rowIndex": "row_index", "columnIndex": "column_index"}
        scans.append(scan | {names[name]: raw[name] for name in set(names) & set(raw)})
    common = set(scans[0]).intersection(*scans) if scans else set()
    yield {name: np.concatenate([scan[name] for scan in scans]) for name in common}


def cell(size):
    """The edges of a simulation cell of this size, or of three sizes; nothing if the file has none."""
    sizes = np.ravel(size) * np.ones(3)
    return {"cell": np.diag(sizes)} if sizes.all() else {}


def snapshot(path, names):
    """pynbody: all arrays in the file; NaN for families without them. Types of particles may be in another order."""
    import pynbody
    file = pynbody.load(str(path))
    found = {}
    for theirs, ours in names.items():
        own = [file[family] for family in file.families()]
        parts = [np.array(o[theirs]) if theirs in o.loadable_keys() else np.full(len(o), np.nan) for o in own]
        if not all(np.isnan(part).all() for part in parts):
            found[ours] = np.concatenate(parts)
    header = getattr(file, "header", None)
    time = header.time if header else file._header_t  # pynbody has no other way to the number
    yield found | {"time": time} | cell(getattr(header, "BoxSize", 0))


def gadget(path):
    return snapshot(path, {"pos": "positions", "vel": "Velocities", "iord": "ParticleIDs", "mass": "Masses",
                           "rho": "Density", "u": "InternalEnergy", "smooth": "SmoothingLength", "pot": "Potential",
                           "acce": "Acceleration"})


def tipsy(path):
    return snapshot(path, {"pos": "positions", "vel": "velocity", "mass": "mass", "rho": "density", "phi": "phi",
                           "temp": "temperature", "metals": "metals", "tform": "tform"})


def geo(path):
    """The JSON of Houdini: public numbers of points, as a list of each component or of each point."""
    def pairs(items):
        return dict(zip(items[::2], items[1::2]))

    found = {}
    for head, body in pairs(pairs(json.loads(path.read_text()))["attributes"]).get("pointattributes", []):
        head, values = pairs(head), pairs(pairs(body).get("values", []))
        numbers = values.get("tuples") or values.get("arrays")
        if head["type"] != "numeric" or head["scope"] != "public" or numbers is None:
            continue
        rows = np.array(numbers, {"fpreal32": np.float32, "int32": np.int32}.get(values["storage"], float))
        rows = rows if "tuples" in values else rows.T
        name = "positions" if head["name"] == "P" else head["name"]
        found[name] = rows[:, :3] if name == "positions" else rows.squeeze(1) if rows.shape[1] == 1 else rows
    yield found


def hdf5(path):
    """h5py: the arrays of all types of particles; NaN where a type does not have one; masses of the header."""
    import h5py
    with h5py.File(path) as file:
        types = sorted(name for name in file if name.startswith("PartType") and "Coordinates" in file[name])
        counts = [len(file[name]["Coordinates"]) for name in types]
        names = {name for part in types for name, data in file[part].items() if isinstance(data, h5py.Dataset)}
        found = {"part": np.repeat([int(name[8:]) for name in types], counts)}
        for name in names:
            rows = [file[part].get(name) for part in types]
            shape = next(r.shape[1:] for r in rows if r is not None)
            rows = [np.full((n, *shape), np.nan) if r is None else r[()] for r, n in zip(rows, counts)]
            found["positions" if name == "Coordinates" else name] = np.concatenate(rows)
        header = file["Header"].attrs
        if np.any(header.get("MassTable", 0)):
            masses = found.get("Masses", np.full(sum(counts), np.nan)).astype(float)
            found["Masses"] = np.where(np.isnan(masses), header["MassTable"][found["part"]], masses)
        yield found | {"time": np.ravel(header["Time"])[0]} | cell(header.get("BoxSize", 0))


def las(path):
    """laspy: positions and the attributes that spherule reads. LASzip reads what lazrs does not."""
    import laspy
    try:
        file = laspy.read(path)
    except BaseException:  # a panic of lazrs is no Exception
        file = laspy.read(path, laz_backend=laspy.LazBackend.Laszip)
    there = set(file.point_format.dimension_names)
    same = there & {"intensity", "classification", "point_source_id", "gps_time", "nir"}
    found = {"positions": np.array(file.xyz)} | {name: np.array(file[name]) for name in same}
    yield found | ({"color": np.array([file.red, file.green, file.blue]).T} if "red" in there else {})


def pts(path):
    """Open3D: positions; and colours, which it has as fractions of 255."""
    import open3d
    open3d.utility.set_verbosity_level(open3d.utility.VerbosityLevel.Error)
    cloud = open3d.io.read_point_cloud(str(path))
    colors = {"color": np.rint(np.asarray(cloud.colors) * 255)} if cloud.has_colors() else {}
    yield {"positions": np.asarray(cloud.points)} | colors


def sdf(path):
    """RDKit: positions, elements and the number of bonds of each record; none for records that it refuses."""
    from rdkit import Chem, RDLogger
    RDLogger.DisableLog("rdApp.*")
    for molecule in Chem.SDMolSupplier(str(path), sanitize=False, removeHs=False):
        if molecule is None:
            yield None
            continue
        positions = molecule.GetConformer().GetPositions() if molecule.GetNumAtoms() else np.zeros((0, 3))
        numbers = np.array([0 if atom.HasQuery() else atom.GetAtomicNum() for atom in molecule.GetAtoms()])
        yield {"positions": positions, "element": numbers, "bonds": molecule.GetNumBonds()}


READERS = {charmm: "parmed", e57: "pye57", gadget: "pynbody", geo: None, hdf5: "h5py", las: "laspy", pts: "open3d",
           sdf: "rdkit", tipsy: "pynbody"}


def difference(ours, theirs):
    """The largest difference of two arrays; infinite if the shapes differ or names are not one to one."""
    ours, theirs = np.asarray(ours), np.asarray(theirs)
    if theirs.dtype.kind == "U":
        pairs = len(set(zip(ours.tolist(), theirs.tolist())))
        return 0.0 if pairs == len(set(ours.tolist())) == len(set(theirs.tolist())) else np.inf
    ours = ours.astype(np.float32) if theirs.dtype == np.float32 else ours
    if ours.shape != theirs.shape:
        return np.inf
    different = (ours != theirs) & ~(np.isnan(ours.astype(float)) & np.isnan(theirs.astype(float)))
    gaps = np.abs(ours[different].astype(float) - theirs[different].astype(float))
    return float(np.nan_to_num(gaps, nan=np.inf).max(initial=0.0))


def in_order(arrays):
    """Arrays of particles in the order of their ids."""
    order = np.argsort(arrays["ParticleIDs"], kind="stable")
    return {name: array if name in ("cell", "time") else array[order] for name, array in arrays.items()}


def compare(path, reader, program):
    """Particles, the largest difference and the arrays compared."""
    references, frames, bonds = list(reader(path)), spherule.sequence(path), None
    assert any(found is not None for found in references), "the reference reader reads nothing"
    assert len(frames) == len(references), f"{len(frames)} frames, reference {len(references)}"
    if program and reader is sdf:
        command = [program, "-q", "inspect", "--json", path]
        lines = subprocess.run(command, capture_output=True, text=True, check=False).stdout.splitlines()
        bonds = [json.loads(line).get("bonds") for line in lines]
    count, gaps, missing = 0, {}, set()
    for index, theirs in enumerate(references):
        if theirs is None:
            continue
        frame = frames[index]
        count += len(frame)
        ours = frame.attributes | {"positions": frame.positions, "time": frame.time}
        ours |= {"cell": frame.cell.vectors} if frame.cell else {}
        if reader is sdf:  # symbols of queries have codes above those of elements
            ours["element"] = np.where((ours["element"] > 118) | (theirs["element"] == 0), 0, ours["element"])
            ours["bonds"] = bonds[index] if bonds and index < len(bonds) else theirs["bonds"]
        if "ParticleIDs" in theirs:
            ours, theirs = in_order(ours), in_order(theirs)
        missing |= set(theirs) - set(ours)
        for name in set(theirs) & set(ours):
            gaps[name] = max(gaps.get(name, 0.0), difference(ours[name], theirs[name]))
    texts = [f"{name} {gap:.3g}" for name, gap in gaps.items() if gap] + [f"{name} not read" for name in missing]
    return count, ", ".join(texts) or 0, ", ".join(sorted(gaps))


def main():
    warnings.simplefilter("ignore")
    parser = argparse.ArgumentParser(description="what spherule and reference readers read")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--spherule", help="the program, for the numbers of bonds")
    options = parser.parse_args()
    for reader, package in READERS.items():
        reference = f"{package} {version(package)}" if package else "json"
        for path in sorted((options.folder / reader.__name__).glob("*")):
            try:
                row = compare(path, reader, options.spherule)
            except Exception as error:  # one of the readers refuses the file
                row = "-", f"{type(error).__module__.split('.')[0]}: {str(error).strip().splitlines()[0][-120:]}", "-"
            print("|", " | ".join(map(str, (reader.__name__, path.name, reference, *row))), "|", flush=True)


main()
