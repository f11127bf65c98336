//! Colours of values through maps: which value, its range, scale and map.
//!
//! The program is started for each value, scale, map and name.

use std::fmt::Write as _;
use std::fs;

use glam::Vec3;
use spherule::scene::{ColorMap, ColorScale};

use crate::harness::{Ran, SMALL, Workshop, sample};
use crate::picture::Picture;

/// Balls next to each other in a row along x, seen from -y. Ball `i` has the speed `i` along y, the mass `10^(i - 2)`,
/// the charge `i - 2` and the type `1 + i % 3`.
const COUNT: u8 = 5;

fn row(shop: &Workshop) {
    let mut text = "x,y,z,vx,vy,vz,mass,charge,type,size\n".to_owned();
    for i in 0..COUNT {
        let mass = 10_f64.powi(i32::from(i) - 2);
        let (charge, kind) = (i32::from(i) - 2, 1 + i % 3);
        let size = 0.2 + 0.05 * f64::from(i);
        writeln!(text, "{i},0,0,0,{i},0,{mass},{charge},{kind},{size}").expect("a line");
    }
    fs::create_dir_all(shop.join("in")).expect("a directory");
    fs::write(shop.join("in/p_1.csv"), text).expect("a file");
}

fn render(shop: &Workshop, input: &str, options: &[&str]) -> Ran {
    let arguments = [
        "render",
        input,
        "-o",
        "f.exr",
        "--force",
        "--channels",
        "RGBA,albedo,P",
        "--integrator",
        "whitted",
        "--set",
        "camera.mode=fixed",
        "--set",
        "camera.eye=[2,-8,0]",
        "--set",
        "camera.look_at=[2,0,0]",
    ];
    shop.run(&[&arguments[..], &SMALL, options].concat())
}

/// The base colour of each ball.
#[track_caller]
fn albedos(shop: &Workshop) -> [Vec3; COUNT as usize] {
    let picture = Picture::open(&shop.join("f.exr"));
    let [r, g, b] = ["albedo.R", "albedo.G", "albedo.B"].map(|name| picture.floats(name));
    let (alpha, x) = (picture.floats("A"), picture.floats("P.X"));
    std::array::from_fn(|i| {
        let is_on = |at: usize| alpha[at] == 1.0 && (x[at] - i as f32).abs() < 0.1;
        let at = (0..alpha.len()).find(|at| is_on(*at)).expect("the ball");
        Vec3::new(r[at], g[at], b[at])
    })
}

#[track_caller]
fn assert_colors(shop: &Workshop, options: &[&str], map: &ColorMap, values: [f32; COUNT as usize]) {
    let radius: &[&str] =
        if options.contains(&"input.radius.attribute=size") { &[] } else { &["--radius", "0.3"] };
    for input in ["in", "native"] {
        render(shop, input, &[radius, options].concat()).expect(0);
        for (found, value) in albedos(shop).into_iter().zip(values) {
            let expected = map.color(value);
            let error = (found - expected).abs().max_element();
            assert!(error < 2e-3, "{input} {options:?} {value}: {found} instead of {expected}");
        }
    }
}

fn shop() -> Workshop {
    let shop = Workshop::new();
    row(&shop);
    shop.run(&["convert", "in", "-o", "native", "--bits", "none"]);
    if !shop.join("native").exists() {
        shop.run(&["convert", "in", "-o", "native"]).expect(0);
    }
    shop
}

#[test]
fn values_that_colour_particles() {
    let shop = shop();
    let linear = |low, high| ColorMap::new("viridis", low, high).expect("a map");
    let index = [0.0, 1.0, 2.0, 3.0, 4.0];
    assert_colors(&shop, &["--color-by", "velocity.y"], &linear(0.0, 4.0), index);
    let other = ["--color-by", "velocity[0]", "--range", "-1", "1"];
    assert_colors(&shop, &other, &linear(-1.0, 1.0), [0.0; 5]);
    assert_colors(&shop, &["--color-by", "index"], &linear(0.0, 4.0), index);
    let height = ["--color-by", "height", "--up", "x"];
    assert_colors(&shop, &height, &linear(0.0, 4.0), index);
    // The distance along the view axis is that of the plane of the balls
    let depth = ["--color-by", "depth", "--range", "7", "9"];
    assert_colors(&shop, &depth, &linear(7.0, 9.0), [8.0; 5]);
    let radius = ["--color-by", "radius", "--set", "input.radius.attribute=size"];
    let sizes = index.map(|i| 0.2 + 0.05 * i);
    assert_colors(&shop, &radius, &linear(0.2, 0.4), sizes);
}

#[test]
fn scales_and_ranges() {
    let shop = shop();
    let index: [f32; 5] = [0.0, 1.0, 2.0, 3.0, 4.0];
    let mass = [1e-2, 1e-1, 1.0, 10.0, 100.0];
    let scaled = |name, range, scale| ColorMap::with_scale(name, range, scale).expect("a map");
    let log = ["--color-by", "mass", "--color-scale", "log"];
    let map = scaled("viridis", [1e-2, 1e2], ColorScale::Log);
    assert_colors(&shop, &log, &map, mass);
    let symlog =
        [&log[..3], &["symlog", "--set", "material.color.threshold=1", "--map", "batlow_r"]]
            .concat();
    let map = scaled("batlow_r", [1e-2, 1e2], ColorScale::SymLog { threshold: 1.0 });
    assert_colors(&shop, &symlog, &map, mass);
    let charge = index.map(|i| i - 2.0);
    let symmetric = ["--color-by", "charge", "--set", "material.color.range=symmetric"];
    let vik = ColorMap::new("vik", -2.0, 2.0).expect("a map");
    assert_colors(&shop, &symmetric, &vik, charge);
    // numpy.percentile([0, 1, 2, 3, 4], [10, 75])
    let percentiles = ["--color-by", "velocity", "--set", "material.color.range=10%-75%"];
    let map = ColorMap::new("viridis", 0.4, 3.0).expect("a map");
    assert_colors(&shop, &percentiles, &map, index);
    let steps = [
        "--color-by",
        "index",
        "--set",
        "material.color.steps=2",
        "--set",
        "material.color.reverse=true",
    ];
    let map = ColorMap::new("viridis_r", 0.0, 1.0).expect("a map");
    assert_colors(&shop, &steps, &map, [0.0, 0.0, 1.0, 1.0, 1.0]);
}

#[test]
fn categories() {
    let shop = shop();
    let types = ["--color-by", "type", "--color-scale", "categorical"];
    render(&shop, "in", &[&types[..], &["--radius", "0.3"]].concat())
        .prints("colour by `type`, 3 categories");
    let map = ColorMap::of_categories("okabe-ito", &[1, 2, 3]).expect("a palette");
    assert_colors(&shop, &types, &map, [1.0, 2.0, 3.0, 1.0, 2.0]);
    let named =
        [&types[..], &["--map", "tol-bright", "--set", "material.color.names.7=walls"]].concat();
    let map = ColorMap::of_categories("tol-bright", &[1, 2, 3, 7]).expect("a palette");
    assert_colors(&shop, &named, &map, [1.0, 2.0, 3.0, 1.0, 2.0]);
}

#[test]
fn impossible_colours_are_refused() {
    let shop = shop();
    for (options, part) in [
        (&["--color-by", "charge", "--color-scale", "log"][..], "`charge` has values of 0 or less"),
        (&["--color-by", "mas"], "did you mean `mass`?"),
        (&["--color-by", "hight"], "did you mean `height`?"),
        (&["--color-by", "velocity.w"], "no attribute `velocity.w`"),
        (&["--color-by", "mass", "--color-scale", "categorical"], "values that are not integers"),
        (&["--range", "3", "3"], "two rising numbers"),
        (&["--color-by", "mass", "--color-scale", "log", "--range", "0", "1"], "has no logarithm"),
    ] {
        let ran = render(&shop, "in", &[options, &["--radius", "0.3"]].concat());
        ran.expect(2).prints(part);
    }
    // With a range, values that have no logarithm have the first colour
    let log = ["--color-by", "charge", "--color-scale", "log", "--range", "1", "2"];
    let map = ColorMap::with_scale("viridis", [1.0, 2.0], ColorScale::Log).expect("a map");
    assert_colors(&shop, &log, &map, [-2.0, -1.0, 0.0, 1.0, 2.0]);
}

/// Balls of `row` from `range` as XML, with `Vel` of 1 and more along y if `has_velocity`.
fn vtu(range: std::ops::Range<u8>, has_velocity: bool) -> String {
    let list = |text: &dyn Fn(u8) -> String| range.clone().map(text).collect::<String>();
    let velocity = format!(
        "<DataArray type=\"Float32\" Name=\"Vel\" NumberOfComponents=\"3\">{}</DataArray>",
        list(&|i| format!("0 {} 0 ", i + 1))
    );
    format!(
        "<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid><Piece NumberOfPoints=\"{}\"><PointData>{}</PointData>\
         <Points><DataArray type=\"Float32\" NumberOfComponents=\"3\">{}</DataArray></Points></Piece>\
         </UnstructuredGrid></VTKFile>",
        range.len(),
        if has_velocity { &velocity } else { "" },
        list(&|i| format!("{i} 0 0 ")),
    )
}

#[test]
fn parts_without_the_value_are_grey() {
    let shop = Workshop::new();
    fs::create_dir_all(shop.join("in")).expect("a directory");
    fs::write(shop.join("in/fluid_1.vtu"), vtu(0..3, true)).expect("a file");
    fs::write(shop.join("in/wall_1.vtu"), vtu(3..5, false)).expect("a file");
    for name in ["Vel", "Vel.y", "speed"] {
        let options = ["--radius", "0.4", "--parts", "fluid,wall", "--color-by", name];
        let ran = render(&shop, "in", &options).expect(0);
        ran.prints("part `wall` without `Vel`: NaN there");
        let [slow, _, fast, wall, other] = albedos(&shop);
        let is_grey = |color: Vec3| color.x == color.y && color.y == color.z;
        assert!(is_grey(wall) && wall == other, "{name}: {wall} {other}");
        assert!(!is_grey(slow) && !is_grey(fast) && slow != fast, "{name}: {slow} {fast}");
    }
}

#[test]
fn names_of_values_work_everywhere() {
    let shop = Workshop::new();
    let time = "<UnstructuredGrid><FieldData><DataArray type=\"Float64\" Name=\"TimeValue\" NumberOfTuples=\"1\">2.5\
                </DataArray></FieldData>";
    let text = vtu(0..5, true).replace("<UnstructuredGrid>", time);
    fs::create_dir_all(shop.join("in")).expect("a directory");
    fs::write(shop.join("in/p_1.vtu"), &text).expect("a file");
    let radius =
        "<PointData><DataArray type=\"Float32\" Name=\"radius\">.3 .3 .3 .3 .3</DataArray>";
    fs::write(shop.join("p.vtu"), text.replace("<PointData>", radius)).expect("a file");
    shop.run(&["convert", "in", "-o", "native"]).expect(0);
    let all = ["x", "z", "speed", "vy", "vel.y", "vel[1]", "height", "index", "id", "time"];
    for name in all {
        let is_all = format!("{name} > -9");
        let options = ["--radius", "0.3", "--where", &is_all, "--color-by", name];
        for input in ["in", "native"] {
            let ran = render(&shop, input, &options).expect(0);
            assert!(!ran.errors().contains("NaN"), "{}", ran.errors());
        }
        let opacity = ["--radius", "0.3", "--set", "material.opacity.range=[-9,-8]"];
        let by = format!("material.opacity.attribute={name}");
        render(&shop, "in", &[&opacity[..], &["--set", &by]].concat()).expect(0);
    }
    render(&shop, "p.vtu", &["--where", "radius > 0.2", "--color-by", "radius"]).expect(0);
    // Each name is listed once, in their order
    let list = "available: `height`, `id`, `index`, `speed`, `time`, `Vel`, `vx`, `vy`, `vz`, `x`, `y`, `z`";
    let unknown = ["--radius", "0.3", "--where", "sped > 1"];
    render(&shop, "in", &unknown).expect(2).prints("(did you mean `speed`?)").prints(list);
    let unknown = ["--radius", "0.3", "--color-by", "sped"];
    let list =
        list.replace("`height`", "`depth`, `height`").replace("`speed`", "`radius`, `speed`");
    render(&shop, "in", &unknown).expect(2).prints("(did you mean `speed`?)").prints(&list);
}

#[test]
fn parts_are_selected_by_name() {
    let shop = Workshop::new();
    fs::create_dir_all(shop.join("in")).expect("a directory");
    fs::write(shop.join("in/fluid_1.vtu"), vtu(0..3, true)).expect("a file");
    fs::write(shop.join("in/rock_1.vtu"), vtu(3..5, true)).expect("a file");
    fs::copy(sample("join/parts.h5"), shop.join("parts.h5")).expect("a file");
    let none = "particles is selected";
    for (input, condition, is_empty) in [
        ("in", "part == rock && x > 2.5", false),
        ("in", "part == 'rock' && x < 2.5", true),
        ("in", "part in (fluid, rock) && part != fluid && x < 2.5", true),
        ("parts.h5", "part == wall && y > 0.5", false),
        ("parts.h5", "part == wall && y < 0.5", true),
    ] {
        let ran = render(&shop, input, &["--radius", "0.3", "--where", condition]).expect(0);
        assert_eq!(ran.errors().contains(none), is_empty, "{condition}: {}", ran.errors());
    }
    let unknown = ["--radius", "0.3", "--where", "part == rok"];
    let message =
        "character 9: `part` has no value `rok` (did you mean `rock`?); it has `fluid`, `rock`";
    render(&shop, "in", &unknown).expect(2).prints(message);
    // A file alone has the same note
    let both = vtu(0..3, true).replace("</Piece>", "</Piece>@");
    let other = vtu(3..5, false);
    let piece = other.find("<Piece").expect("a piece")..other.find("</Unst").expect("an end");
    fs::write(shop.join("both.vtu"), both.replace('@', &other[piece])).expect("a file");
    let ran = shop.run(&["inspect", "both.vtu"]).expect(0);
    assert!(ran.text().contains("note: part `piece 1` without `Vel`: NaN there"), "{}", ran.text());
}
