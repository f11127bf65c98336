"""Makes the USD files of this directory with OpenUSD, and expected.tsv and moved.tsv with what OpenUSD reads from them.

    pip install usd-core==26.11 numpy==2.4.6
    python tests/data/usd/make.py
"""

import pathlib
import sys

import numpy
from pxr import Gf, Sdf, Usd, UsdGeom, UsdUtils, Vt

HERE = pathlib.Path(__file__).parent
sys.path.insert(0, str(HERE.parent))
import reference  # noqa: E402

rng = numpy.random.default_rng(26)
lines, moved = [], []


def new(name, up="Z", metres=1.0, rate=24.0):
    path = HERE / name
    path.unlink(missing_ok=True)
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, up)
    UsdGeom.SetStageMetersPerUnit(stage, metres)
    stage.SetTimeCodesPerSecond(rate)
    return stage


def vec3f(count, scale=1.0):
    return Vt.Vec3fArray.FromNumpy((scale * rng.normal(size=(count, 3))).astype("f4"))


def set_all(prim, count, time=Usd.TimeCode.Default()):
    """Values of all kinds for `count` points."""
    prim.CreatePointsAttr().Set(vec3f(count), time)
    prim.CreateVelocitiesAttr().Set(vec3f(count, 10), time)
    prim.CreateIdsAttr().Set(Vt.Int64Array.FromNumpy(rng.permutation(count) + (1 << 40)), time)
    widths = rng.choice([0.1, 0.2, 0.35], size=count)  # few values: stored as a table
    prim.CreateWidthsAttr().Set(Vt.FloatArray.FromNumpy(widths.astype("f4")), time)
    primvars = UsdGeom.PrimvarsAPI(prim)
    color = rng.uniform(size=(count, 3)).astype("f4")
    primvars.CreatePrimvar("displayColor", Sdf.ValueTypeNames.Color3fArray, "vertex").Set(
        Vt.Vec3fArray.FromNumpy(color), time)
    density = rng.integers(990, 1010, size=count).astype("f4")  # integers: stored as such
    primvars.CreatePrimvar("density", Sdf.ValueTypeNames.FloatArray, "vertex").Set(Vt.FloatArray.FromNumpy(density), time)


def drops(name):
    """Two parts with samples at three times, and other values than the first part has."""
    stage = new(name, up="Y", metres=0.01, rate=30.0)
    UsdGeom.Xform.Define(stage, "/World")
    water = UsdGeom.Points.Define(stage, "/World/Water")
    oil = UsdGeom.Points.Define(stage, "/World/Oil")
    for time in (1, 2, 3):
        set_all(water, 20 + 5 * time, time)
        oil.CreatePointsAttr().Set(vec3f(17), time)
        oil.CreateIdsAttr().Set(Vt.Int64Array(range(17)), time)
    oil.CreateWidthsAttr().Set([0.25])
    oil.SetWidthsInterpolation("constant")
    viscosity = UsdGeom.PrimvarsAPI(oil).CreatePrimvar("viscosity", Sdf.ValueTypeNames.DoubleArray, "vertex")
    viscosity.Set(Vt.DoubleArray.FromNumpy(rng.normal(size=17)))
    stage.Save()


def types(name):
    """Numbers of all types, at no time; widths that are all the same; a primvar with indices."""
    stage = new(name)
    prim = UsdGeom.Points.Define(stage, "/Points")
    count = 24
    set_all(prim, count)
    prim.GetWidthsAttr().Set(Vt.FloatArray(count, 0.5))
    numbers = rng.integers(-1000, 1000, size=count)
    names = Sdf.ValueTypeNames
    whole = [
        ("halves", names.HalfArray, Vt.HalfArray([float(v) for v in rng.normal(size=count)])),
        ("half_table", names.HalfArray, Vt.HalfArray([0.5, 1.25] * (count // 2))),
        ("half_integers", names.HalfArray, Vt.HalfArray([float(v % 64) for v in numbers])),
        ("doubles", names.DoubleArray, Vt.DoubleArray.FromNumpy(rng.normal(size=count))),
        ("double_table", names.DoubleArray, Vt.DoubleArray([0.1, -3.7] * (count // 2))),
        ("double_integers", names.DoubleArray, Vt.DoubleArray.FromNumpy(numbers.astype("f8"))),
        ("ints", names.IntArray, Vt.IntArray.FromNumpy(numbers.astype("i4"))),
        ("uints", names.UIntArray, Vt.UIntArray.FromNumpy((numbers + 3_000_000_000).astype("u4"))),
        ("int64s", names.Int64Array, Vt.Int64Array.FromNumpy(numbers * (1 << 33))),
        ("uint64s", names.UInt64Array, Vt.UInt64Array.FromNumpy(numbers.astype("u8") * 3)),
        ("bytes", names.UCharArray, Vt.UCharArray.FromNumpy((numbers % 256).astype("u1"))),
        ("flags", names.BoolArray, Vt.BoolArray([bool(v % 2) for v in numbers])),
        ("pairs", names.Float2Array, Vt.Vec2fArray.FromNumpy(rng.normal(size=(count, 2)).astype("f4"))),
        ("axis", names.Vector3dArray, Vt.Vec3dArray.FromNumpy(rng.normal(size=(count, 3)))),
        ("short", names.Half3Array, Vt.Vec3hArray([Gf.Vec3h(*map(float, v)) for v in rng.normal(size=(count, 3))])),
        ("cells", names.Int3Array, Vt.Vec3iArray.FromNumpy(rng.integers(0, 9, size=(count, 3)).astype("i4"))),
        ("turn", names.QuatfArray, Vt.QuatfArray([Gf.Quatf(*map(float, v)) for v in rng.normal(size=(count, 4))])),
    ]
    primvars = UsdGeom.PrimvarsAPI(prim)
    for name_, type_, value in whole:
        primvars.CreatePrimvar(name_, type_, "vertex").Set(value)
    phase = primvars.CreatePrimvar("phase", names.FloatArray, "vertex")
    phase.Set([1.5, 2.5, 3.5])
    phase.SetIndices(Vt.IntArray([i % 3 for i in range(count)]))
    primvars.CreatePrimvar("material", names.StringArray, "vertex").Set(["a"] * count)
    primvars.CreatePrimvar("lone", names.Float).Set(7.25)
    special = [float("inf"), float("-inf"), float("nan"), 1e-42] + [0.1] * (count - 4)
    primvars.CreatePrimvar("special", names.FloatArray, "vertex").Set(special)
    stage.Save()


def between(name):
    """Parts with samples at other times: values between two samples."""
    stage = new(name)
    one, other = (UsdGeom.Points.Define(stage, f"/{part}") for part in ("One", "Other"))
    for time in (0.0, 1.5, 4.0):
        set_all(one, 18, time)
    for time in (1.0, 3.0, 4.0):
        count = 21 if time < 4 else 22
        set_all(other, count, time)
    gone = UsdGeom.Points.Define(stage, "/Gone")
    gone.CreatePointsAttr().Set(vec3f(2), 0.0)
    gone.GetPointsAttr().Set(Sdf.ValueBlock(), 1.5)
    stage.Save()


def transformed(name):
    """Transforms of ancestors, some of which change; compared in moved.tsv."""
    stage = new(name)
    root = UsdGeom.Xform.Define(stage, "/Root")
    root.AddTranslateOp().Set(Gf.Vec3d(100, -20, 3))
    root.AddRotateXYZOp().Set(Gf.Vec3f(30, -45, 60))
    root.AddScaleOp().Set(Gf.Vec3f(2, 2, 2))
    moving = UsdGeom.Xform.Define(stage, "/Root/Moving")
    translate = moving.AddTranslateOp(UsdGeom.XformOp.PrecisionFloat)
    pivot = moving.AddTranslateOp(opSuffix="pivot")
    turn = moving.AddOrientOp()
    moving.AddTranslateOp(opSuffix="pivot", isInverseOp=True)
    pivot.Set(Gf.Vec3d(1, 2, 3))
    turn.Set(Gf.Quatf(0.5, 0.5, -0.5, 0.5))
    matrix = moving.AddTransformOp(opSuffix="shear")
    matrix.Set(Gf.Matrix4d(1, 0.5, 0, 0, 0, 1, 0, 0, 0.25, 0, 1, 0, -1, 2, 5, 1))
    points = UsdGeom.Points.Define(stage, "/Root/Moving/Points")
    points.AddRotateZYXOp().Set(Gf.Vec3f(10, 20, 30))
    points.AddRotateYOp(UsdGeom.XformOp.PrecisionDouble).Set(-70.0)
    for time in (0, 10):
        translate.Set(Gf.Vec3f(time, 0, 1), time)
    for time in (0, 4, 10):
        points.CreatePointsAttr().Set(vec3f(5), time)
        points.CreateVelocitiesAttr().Set(vec3f(5), time)
    alone = UsdGeom.Points.Define(stage, "/Root/Moving/Reset")
    alone.CreatePointsAttr().Set(vec3f(2))
    alone.CreateVelocitiesAttr().Set(vec3f(2))
    alone.AddTranslateOp().Set(Gf.Vec3d(0, 0, 7))
    alone.SetResetXformStack(True)
    stage.Save()


def instancer(name):
    """Instances, whose prototype has points of its own."""
    stage = new(name)
    prim = UsdGeom.PointInstancer.Define(stage, "/Grains")
    prim.CreatePositionsAttr().Set(vec3f(16))
    prim.CreateProtoIndicesAttr().Set(Vt.IntArray([i % 2 for i in range(16)]))
    prim.CreateIdsAttr().Set(Vt.Int64Array(range(100, 116)))
    prim.CreateScalesAttr().Set(vec3f(16))
    prim.CreateVelocitiesAttr().Set(vec3f(16))
    points = UsdGeom.Points.Define(stage, "/Grains/Prototypes/Cloud")
    points.CreatePointsAttr().Set(vec3f(3))
    prim.CreatePrototypesRel().SetTargets([points.GetPath()])
    hidden = UsdGeom.Points.Define(stage, "/Hidden")
    hidden.CreatePointsAttr().Set(vec3f(4))
    hidden.CreateVisibilityAttr().Set("invisible")
    stage.Save()


def attributes(prim, time):
    """The arrays of a prim by the names that spherule gives them."""
    schema = UsdGeom.PointInstancer(prim) if prim.IsA(UsdGeom.PointInstancer) else UsdGeom.Points(prim)
    is_points = not prim.IsA(UsdGeom.PointInstancer)
    positions = (schema.GetPointsAttr() if is_points else schema.GetPositionsAttr()).Get(time)
    count = 0 if positions is None else len(positions)
    arrays = {"positions": numpy.zeros((0, 3), "f4") if positions is None else numpy.asarray(positions)}

    def add(name, value):
        if value is None:
            return
        array = numpy.asarray(value)
        if array.dtype.kind not in "fiub":
            return
        if isinstance(value, Vt.QuatfArray):
            array = numpy.asarray([[q.GetReal(), *q.GetImaginary()] for q in value], "f4")
        if array.ndim == 0:
            array = array[None].astype("f4")
        if array.dtype == numpy.float16:
            array = array.astype("f4")
        if array.dtype == bool:
            array = array.astype("u1")
        if len(array) == 1 and count != 1:
            array = numpy.repeat(array, count, axis=0)
        if len(array) == count:
            arrays[name] = array

    for name in ["velocities", "ids", "accelerations"] + (["widths"] if is_points else ["protoIndices", "scales"]):
        attribute = prim.GetAttribute(name)
        add("diameter" if name == "widths" else name, attribute.Get(time) if attribute else None)
    for primvar in UsdGeom.PrimvarsAPI(prim).GetPrimvars():
        if primvar.HasValue() and "String" not in str(type(primvar.Get(time))):
            add(primvar.GetPrimvarName(), primvar.ComputeFlattened(time))
    return arrays


def prims_of(stage):
    """Prims that are drawn, by path."""
    found = []
    every = iter(Usd.PrimRange(stage.GetPseudoRoot()))
    for prim in every:
        if prim.IsA(UsdGeom.PointInstancer):
            every.PruneChildren()
            found.append(prim)
        elif prim.IsA(UsdGeom.Points):
            found.append(prim)
    return sorted(found, key=lambda prim: str(prim.GetPath()))


def is_visible(prim, time):
    return UsdGeom.Imageable(prim).ComputeVisibility(time) != "invisible"


def expect(name, only_moved=False):
    stage = Usd.Stage.Open(str(HERE / name))
    rate = stage.GetTimeCodesPerSecond()
    prims = prims_of(stage)
    times = sorted({t for prim in prims for a in ("points", "positions") if prim.GetAttribute(a)
                    for t in prim.GetAttribute(a).GetTimeSamples()})
    are_whole = all(t == int(t) for t in times)
    for index, time in enumerate(times or [None]):
        code = Usd.TimeCode.Default() if time is None else Usd.TimeCode(time)
        parts = []
        for number, prim in enumerate(prims):
            arrays = attributes(prim, code)
            if is_visible(prim, code) and len(arrays["positions"]):
                parts.append((number, prim, arrays))
        if only_moved:
            cache = UsdGeom.XformCache(code)
            for _, prim, arrays in parts:
                matrix = cache.GetLocalToWorldTransform(prim)
                for which, transform in [("positions", matrix.TransformAffine), ("velocities", matrix.TransformDir)]:
                    for row in arrays.get(which, []):
                        out = transform(Gf.Vec3d(*map(float, row)))
                        moved.append("\t".join([name, str(index), which, *(repr(v) for v in out)]) + "\n")
            continue
        names = list(dict.fromkeys(key for _, _, arrays in parts for key in arrays))
        columns = {}
        for key in names:
            have = [arrays.get(key) for _, _, arrays in parts]
            there = [array for array in have if array is not None]
            is_scalar = there[0].ndim == 1 and there[0].dtype.kind == "f" and key != "diameter"
            if len(there) < len(have) and not is_scalar:
                continue
            filled = [numpy.full(len(arrays["positions"]), numpy.nan, there[0].dtype) if array is None else array
                      for array, (_, _, arrays) in zip(have, parts)]
            columns[key] = numpy.concatenate(filled)
        if len(prims) > 1:
            columns["part"] = numpy.concatenate(
                [numpy.full(len(arrays["positions"]), number, "u4") for number, _, arrays in parts])
        for key, array in columns.items():
            number = time if are_whole and time is not None else index
            at = None if time is None else time / rate
            lines.append(reference.line(name, index, int(number) if times else None, at, key, array))


for end in ("usda", "usdc"):
    drops(f"drops.{end}")
    types(f"types.{end}")
    between(f"between.{end}")
    transformed(f"moved.{end}")
    instancer(f"instances.{end}")
UsdUtils.CreateNewUsdzPackage(str(HERE / "drops.usdc"), str(HERE / "drops.usdz"))
for name in ["drops.usda", "drops.usdc", "drops.usdz", "types.usda", "types.usdc", "between.usda", "between.usdc",
             "instances.usda", "instances.usdc"]:
    expect(name)
for name in ["moved.usda", "moved.usdc"]:
    expect(name, only_moved=True)
(HERE / "expected.tsv").write_text("".join(lines))
(HERE / "moved.tsv").write_text("".join(moved))
