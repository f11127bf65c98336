//! Figures for print: overlays beside the picture, PDF and SVG files, and sheets of several panels.

use std::fs;
use std::io::Read;
use std::path::Path;

use flate2::read::ZlibDecoder;

use crate::harness::{Ran, Workshop};
use crate::picture::Picture;

/// Frames of balls whose speed rises from frame to frame.
fn shop() -> Workshop {
    let shop = Workshop::new();
    fs::create_dir_all(shop.join("in")).expect("a directory");
    for frame in 1..=4 {
        let rows = (0..4).map(|i| format!("{i},0,{},{frame},{i},0\n", i % 2));
        let text = format!("x,y,z,vx,vy,vz\n{}", rows.collect::<String>());
        fs::write(shop.join(format!("in/p_{frame}.csv")), text).expect("a file");
    }
    shop
}

const QUICK: [&str; 6] = ["--samples", "1", "--radius", "0.3", "--threads", "1"];

fn still(shop: &Workshop, name: &str, options: &[&str]) -> Ran {
    shop.run(&[&["still", "in", "-o", name][..], &QUICK, options].concat())
}

fn picture(path: &Path) -> image::RgbImage {
    image::open(path).expect("a picture").into_rgb8()
}

/// Pixels per metre of a PNG file.
fn density(path: &Path) -> Option<u32> {
    let file = std::io::BufReader::new(fs::File::open(path).expect("a file"));
    let reader = png::Decoder::new(file).read_info().expect("a PNG file");
    reader.info().pixel_dims.map(|dims| dims.xppu)
}

/// The sizes of text in a PDF file, points.
fn text_sizes(path: &Path) -> Vec<f32> {
    let pdf = fs::read(path).expect("a file");
    let mut sizes = Vec::new();
    for (at, _) in pdf.windows(7).enumerate().filter(|(_, found)| *found == b"stream\n") {
        let mut text = Vec::new();
        if ZlibDecoder::new(&pdf[at + 7..]).read_to_end(&mut text).is_ok() {
            let text = String::from_utf8_lossy(&text).into_owned();
            let size =
                |line: &str| line.strip_prefix("/F1 ")?.strip_suffix(" Tf")?.parse::<f32>().ok();
            sizes.extend(text.lines().filter_map(size));
        }
    }
    sizes
}

#[test]
fn overlays_beside_the_picture_leave_it_alone() {
    let shop = shop();
    let size = ["--width", "320", "--height", "240", "--axes"];
    let render = |out: &str, options: &[&str]| {
        let pattern = format!("{out}/f.####.exr");
        let arguments = ["render", "in", "-o", &pattern, "--frames", "1-2"];
        shop.run(&[&arguments[..], &QUICK, &size, options].concat()).expect(0);
    };
    render("beside", &["--layout", "beside"]);
    let png = picture(&shop.join("beside/f.0001.png"));
    assert_eq!(png.dimensions(), (320, 240));
    let exr = Picture::open(&shop.join("beside/f.0001.exr"));
    assert!(exr.width < 320 - 20 && exr.height == 240, "{}x{}", exr.width, exr.height);
    // The pixels of the picture are those of a picture of its size without overlays
    let (width, height) = (exr.width.to_string(), exr.height.to_string());
    let alone = ["--width", &width, "--height", &height, "--no-legend"];
    let arguments = ["render", "in", "-o", "alone/f.####.exr", "--frames", "1-2"];
    shop.run(&[&arguments[..], &QUICK, &alone].concat()).expect(0);
    let own = picture(&shop.join("alone/f.0001.png"));
    assert!(own.enumerate_pixels().all(|(x, y, pixel)| png.get_pixel(x, y) == pixel));
    assert_eq!(Picture::open(&shop.join("alone/f.0001.exr")).planes, exr.planes);
    // Beside it are the colour bar and the axes
    let is_ink = |x: u32| (0..240).any(|y| png.get_pixel(x, y).0.iter().any(|v| *v < 100));
    assert!((own.width()..320).any(is_ink));
    shop.run(&["verify", "beside"]).expect(0);
    shop.run(&["movie", "beside", "-o", "a.gif"]).expect(0);
}

#[test]
fn the_legend_moves_beside_a_picture_full_of_particles() {
    let shop = Workshop::new();
    let numbers = (0..1000).map(|i| [i % 10, i / 10 % 10, i / 100]);
    let rows = numbers.map(|[x, y, z]| format!("{x},{y},{z},{x},0,0\n"));
    let text = format!("x,y,z,vx,vy,vz\n{}", rows.collect::<String>());
    fs::write(shop.join("p_1.csv"), text).expect("a file");
    for (out, zoom, is_full) in [("far", "0.4", false), ("near", "3", true)] {
        let pattern = format!("{out}/f.####.exr");
        let size = ["--width", "320", "--height", "240", "--zoom", zoom];
        let arguments = ["render", "p_1.csv", "-o", &pattern];
        shop.run(&[&arguments[..], &QUICK, &size].concat()).expect(0);
        let width = Picture::open(&shop.join(format!("{out}/f.0001.exr"))).width;
        assert_eq!(width < 300, is_full, "{out}: {width}");
        assert_eq!(picture(&shop.join(format!("{out}/f.0001.png"))).dimensions(), (320, 240));
        shop.run(&["verify", out]).expect(0);
        // Pages have the channels of images that fit their pictures
        let page = shop.run(&["view", out, "-o", &format!("{out}.html")]).expect(0);
        assert_eq!(page.errors().contains("the page has none"), is_full, "{out}");
    }
}

#[test]
fn the_legend_stays_beside_other_overlays() {
    let shop = shop();
    let size = ["--width", "320", "--height", "240"];
    let bytes = |name: &str, options: &[&str]| {
        still(&shop, name, &[&size[..], options].concat()).expect(0);
        picture(&shop.join(name))
    };
    let plain = bytes("plain.png", &["--no-legend"]);
    let (legend, axes) = (bytes("legend.png", &[]), bytes("axes.png", &["--axes"]));
    assert!(plain != legend && legend != axes);
    let changed = |a: &image::RgbImage, b: &image::RgbImage| {
        a.pixels().zip(b.pixels()).filter(|(a, b)| a != b).count()
    };
    let only_axes = bytes("only.png", &["--axes", "--no-legend"]);
    let both = changed(&plain, &axes);
    assert!(both > changed(&plain, &only_axes) + changed(&plain, &legend) / 2, "{both}");
}

#[test]
fn text_of_a_figure_for_a_column_has_seven_points() {
    let shop = shop();
    let column = ["--width", "80mm", "--height", "50mm", "--dpi", "300", "--layout", "beside"];
    for name in ["a.pdf", "a.svg", "a.png"] {
        still(&shop, name, &[&column[..], &["--axes"]].concat()).expect(0);
    }
    let sizes = text_sizes(&shop.join("a.pdf"));
    assert!(sizes.len() > 5 && sizes.iter().all(|size| (size - 7.0).abs() < 1e-3), "{sizes:?}");
    let pdf = fs::read(shop.join("a.pdf")).expect("a file");
    let text = String::from_utf8_lossy(&pdf).into_owned();
    let page: Vec<f32> = text
        .split("/MediaBox [")
        .nth(1)
        .and_then(|s| s.split(']').next())
        .expect("a page")
        .split(' ')
        .filter_map(|number| number.parse().ok())
        .collect();
    // 945 x 591 pixels
    let millimetres = [page[2], page[3]].map(|points| points / 72.0 * 25.4);
    assert!(
        (millimetres[0] - 80.0).abs() < 0.05 && (millimetres[1] - 50.0).abs() < 0.05,
        "{page:?}"
    );
    let svg = fs::read_to_string(shop.join("a.svg")).expect("a file");
    let sizes: Vec<f32> = svg
        .split("data-size=\"")
        .skip(1)
        .filter_map(|s| s.split('"').next()?.parse().ok())
        .collect();
    assert!(sizes.iter().all(|size| (size * 72.0 / 300.0 - 7.0).abs() < 1e-3), "{sizes:?}");
    // A file of another program is not replaced, an own one is
    still(&shop, "a.pdf", &column).expect(0);
    fs::write(shop.join("b.svg"), "<svg>").expect("a file");
    still(&shop, "b.svg", &column).expect(2).prints("is not an image");
}

/// A job of four frames in `out`.
fn job(shop: &Workshop, out: &str, options: &[&str]) {
    let pattern = format!("{out}/f.####.png");
    let size = ["--width", "240", "--height", "160", "--dpi", "300", "--no-legend"];
    let arguments = ["render", "in", "-o", &pattern];
    shop.run(&[&arguments[..], &QUICK, &size, options].concat()).expect(0);
}

const PANELS: [&str; 7] =
    ["--columns", "2", "--gap", "6", "--letters", "--colorbar", "--title=Speed"];

#[test]
fn panels_have_letters_and_one_colour_bar() {
    let shop = shop();
    job(&shop, "out", &[]);
    for name in ["fig.png", "fig.pdf", "fig.svg"] {
        let figure = ["sheet", "out", "-o", name, "--width", "60mm", "--unit", "m/s"];
        shop.run(&[&figure[..], &PANELS].concat()).expect(0).prints("");
    }
    let png = picture(&shop.join("fig.png"));
    assert!(png.width() <= 709 && png.width() > 560, "{}", png.width());
    assert_eq!(density(&shop.join("fig.png")), Some(11811));
    // Letters and bar as text: four letters, the title, at least the labels of both ends
    let sizes = text_sizes(&shop.join("fig.pdf"));
    assert!(sizes.len() >= 7 && sizes.iter().all(|size| (size - 7.0).abs() < 1e-3), "{sizes:?}");
    let svg = fs::read_to_string(shop.join("fig.svg")).expect("a file");
    for label in ["(a)", "(b)", "(c)", "(d)", "Speed (m/s)"] {
        assert!(svg.contains(&format!("aria-label=\"{label}\"")), "{label}");
    }
    assert_eq!(svg.matches("<image ").count(), 4);
    // Another range, another attribute, no map
    job(&shop, "wide", &["--range", "0", "9"]);
    job(&shop, "other", &["--color-by", "x"]);
    job(&shop, "red", &["--color", "red"]);
    for (jobs, text) in [
        (&["out", "wide"][..], "out and wide have different ranges"),
        (&["out", "other"], "out and other have different titles: speed and x"),
        (&["out", "red"], "red: the colours of the particles do not follow a colour map"),
        (&["out", "out/f.0001.png"], "pictures from files do not say what their colours mean"),
    ] {
        let arguments = [&["sheet"][..], jobs, &["-o", "bad.png", "--colorbar"]].concat();
        shop.run(&arguments).expect(2).prints(text);
        assert!(!shop.join("bad.png").exists());
    }
}

#[test]
fn stills_are_panels_and_keep_their_density() {
    let shop = shop();
    for (name, size) in
        [("a.png", ["160", "90"]), ("b.png", ["160", "90"]), ("c.png", ["90", "90"])]
    {
        let options = ["--width", size[0], "--height", size[1], "--dpi", "600", "--no-legend"];
        still(&shop, name, &options).expect(0);
    }
    let sheet = |inputs: &[&str], options: &[&str]| {
        let arguments = [&["sheet"][..], inputs, &["-o", "s.png", "--gap", "0"], options];
        shop.run(&arguments.concat())
    };
    sheet(&["a.png", "b.png"], &["--columns", "2"]).expect(0).prints("");
    let both = picture(&shop.join("s.png"));
    assert_eq!(both.dimensions(), (320, 90));
    let a = picture(&shop.join("a.png"));
    assert!(a.enumerate_pixels().all(|(x, y, pixel)| both.get_pixel(x, y) == pixel));
    assert_eq!(density(&shop.join("s.png")), Some(23622));
    // A picture of another shape is in the middle of its place, unchanged
    sheet(&["a.png", "c.png"], &["--columns", "2"])
        .expect(0)
        .prints("c.png has another aspect ratio than the first picture");
    let (both, c) = (picture(&shop.join("s.png")), picture(&shop.join("c.png")));
    assert!(c.enumerate_pixels().all(|(x, y, pixel)| both.get_pixel(160 + 35 + x, y) == pixel));
    sheet(&["a.png", "none.png"], &[]).expect(2).prints("none.png");
    let own = ["sheet", "a.png", "b.png", "-o", "a.png", "--force"];
    shop.run(&own).expect(2).prints("a.png: is an input and would be overwritten");
    // Thirty panels
    let many: Vec<&str> = vec!["a.png"; 30];
    let arguments = [&["sheet"][..], &many, &["-o", "many.svg", "--letters=A"]].concat();
    shop.run(&arguments).expect(0);
    let svg = fs::read_to_string(shop.join("many.svg")).expect("a file");
    assert!(svg.contains("aria-label=\"Z\"") && svg.contains("aria-label=\"AD\""));
}

#[test]
fn impossible_figures_are_refused_or_noted() {
    let shop = shop();
    let small = ["--width", "100", "--height", "60", "--dpi", "300"];
    let bar = |keys: &str| format!("overlay=[{{ type = \"colorbar\", {keys} }}]");
    let refused = |options: &[&str], text: &str| {
        still(&shop, "x.png", options).expect(2).prints(text);
        assert!(!shop.join("x.png").exists());
    };
    // Text of 8 points on 100 pixels is smaller, which is noted, and text without room is refused
    let large = bar("size = \"8pt\", layout = \"beside\"");
    let noted = still(&shop, "w.png", &[&small[..], &["--set", &large]].concat()).expect(0);
    noted.prints("text is 3.6 points high on paper");
    let long = bar("title = \"A very long title\", layout = \"beside\"");
    refused(&[&small[..], &["--set", &long]].concat(), "image.layout: the overlays beside the");
    let size = ["--width", "320", "--height", "240"];
    let with = |keys: &str| [&size[..], &["--set", &bar(keys)]].concat().join("\u{1}");
    for (keys, text) in [
        ("factor = nan", "overlay.0.factor: expected a number from"),
        ("factor = 0", "overlay.0.factor: expected a number from"),
        ("format = \"%s\"", "overlay.0.format: expected a format such as"),
        ("ticks = 10000", "overlay.0.ticks: expected a number of labels from 2 to 20"),
    ] {
        let options = with(keys);
        let options: Vec<&str> = options.split('\u{1}').collect();
        refused(&options, text);
    }
    refused(&["--zoom", "0"], "--zoom: expected a number above 0");
    let crop = ["--layout", "beside", "--crop", "0,0,50,50", "--colorbar"];
    refused(&[&size[..], &crop].concat(), "overlay: has overlays beside the picture (layout)");
    // Ticks outside of the range are left out
    let outside = bar("ticks = [2, 900, -900]");
    let noted = still(&shop, "y.png", &[&size[..], &["--set", &outside]].concat()).expect(0);
    noted.prints("overlay.ticks: 900, -900 not drawn: outside of the range");
    shop.run(&["sheet", "y.png", "-o", "z.png", "--letters=1"]).expect(2).prints("is no style");
    let narrow = ["sheet", "y.png", "-o", "z.png", "--width", "2000mm", "--dpi", "4800"];
    shop.run(&narrow).expect(0);
}
