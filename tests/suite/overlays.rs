//! Colour bars and text over previews: where they are drawn, and where they are not.

use std::fs;

use crate::harness::{Workshop, images};
use crate::picture::{Picture, Plane};

/// Options of small pictures of balls in the middle.
const OPTIONS: [&str; 10] =
    ["--width", "160", "--height", "90", "--samples", "2", "--radius", "0.3", "--threads", "1"];

fn shop() -> Workshop {
    let shop = Workshop::new();
    fs::create_dir_all(shop.join("in")).expect("a directory");
    for frame in 1..=3 {
        let rows = (0..4).map(|i| format!("{i},0,0,{frame},{i},0\n"));
        let text = format!("x,y,z,vx,vy,vz\n{}", rows.collect::<String>());
        fs::write(shop.join(format!("in/p_{frame}.csv")), text).expect("a file");
    }
    shop
}

fn render(shop: &Workshop, out: &str, options: &[&str]) -> crate::harness::Ran {
    let pattern = format!("{out}/f.####.exr");
    let arguments = ["render", "in", "-o", &pattern];
    shop.run(&[&arguments[..], &OPTIONS, options].concat())
}

/// The pixels of a preview.
fn preview(shop: &Workshop, out: &str, frame: u32) -> image::RgbImage {
    let path = shop.join(format!("{out}/f.{frame:04}.png"));
    image::open(path).expect("a preview").into_rgb8()
}

/// Columns and rows of the pixels in which two previews differ.
fn differences(a: &image::RgbImage, b: &image::RgbImage) -> Vec<(u32, u32)> {
    let pixels = a.enumerate_pixels();
    pixels.filter(|(x, y, p)| *p != b.get_pixel(*x, *y)).map(|(x, y, _)| (x, y)).collect()
}

#[test]
fn overlays_change_previews_but_no_image() {
    let shop = shop();
    render(&shop, "plain", &[]).expect(0);
    let bar_and_text = r#"overlay=[{ type = "colorbar", corner = "bottom-right" }, { type = "text", corner = "top-left" }]"#;
    render(&shop, "drawn", &["--set", bar_and_text]).expect(0);
    let exr = |out: &str, frame: u32| {
        let picture = Picture::open(&shop.join(format!("{out}/f.{frame:04}.exr")));
        picture.planes
    };
    for frame in 1..=3 {
        assert_eq!(exr("plain", frame), exr("drawn", frame));
        let (plain, drawn) = (preview(&shop, "plain", frame), preview(&shop, "drawn", frame));
        let changed = differences(&plain, &drawn);
        assert!(changed.len() > 200, "{}", changed.len());
        // The stamp is at the top left, the bar at the right, and nothing in the middle
        let has = |inside: &dyn Fn(u32, u32) -> bool| changed.iter().any(|(x, y)| inside(*x, *y));
        assert!(has(&|x, y| x < 50 && y < 20));
        assert!(has(&|x, _| x > 110));
        assert!(!has(&|x, y| (60..100).contains(&x) && (30..60).contains(&y)));
    }
    // The bar is the same in all frames
    let bars = [1, 2, 3].map(|frame| {
        let (plain, drawn) = (preview(&shop, "plain", frame), preview(&shop, "drawn", frame));
        let changed = differences(&plain, &drawn).into_iter();
        changed.filter(|(x, _)| *x > 110).collect::<Vec<_>>()
    });
    let left = |bar: &[(u32, u32)]| bar.iter().map(|(x, _)| *x).min();
    assert_eq!(left(&bars[0]), left(&bars[1]));
    assert_eq!(left(&bars[0]), left(&bars[2]));
}

#[test]
fn the_channel_has_the_overlay_alone() {
    let shop = shop();
    let channels = ["--channels", "RGBA,Z,id,overlay", "--frames", "2"];
    render(&shop, "plain", &channels).expect(0);
    let text = r#"overlay=[{ type = "text", text = "■", color = [1, 0, 0], size = 0.2, corner = "bottom-left" }]"#;
    render(&shop, "drawn", &[&channels[..], &["--set", text]].concat()).expect(0);
    let open = |out: &str| Picture::open(&shop.join(format!("{out}/f.0002.exr"))).planes;
    let (plain, mut drawn) = (open("plain"), open("drawn"));
    let planes = ["overlay.R", "overlay.G", "overlay.B", "overlay.A"].map(|name| {
        assert!(matches!(&plain[name], Plane::Float(v) if v.iter().all(|v| *v == 0.0)), "{name}");
        match drawn.insert(name.to_owned(), plain[name].clone()) {
            Some(Plane::Float(values)) => values,
            other => panic!("{name}: {other:?}"),
        }
    });
    assert_eq!(plain, drawn);
    // The square is red and opaque, in the corner
    let solid: Vec<usize> =
        (0..160 * 90).filter(|at| planes[0][*at] == 1.0 && planes[3][*at] == 1.0).collect();
    assert!(solid.len() > 10, "{}", solid.len());
    for at in solid {
        assert!(at % 160 < 40 && at / 160 > 60, "{at}");
        assert_eq!((planes[1][at], planes[2][at]), (0.0, 0.0));
    }
}

// Renders three frames twice, on one thread and on four.
#[test]
fn previews_do_not_depend_on_threads() {
    let shop = shop();
    render(&shop, "one", &["--colorbar", "--time-stamp"]).expect(0);
    let base: Vec<&str> =
        OPTIONS.iter().filter(|o| !["--threads", "1"].contains(o)).copied().collect();
    let more = ["--threads", "4", "--colorbar", "--time-stamp"];
    let arguments = ["render", "in", "-o", "four/f.####.exr"];
    shop.run(&[&arguments[..], &base, &more].concat()).expect(0);
    let files = |out: &str| images(&shop.join(out));
    assert_eq!(files("one"), files("four"));
}

#[test]
fn text_shows_values_of_the_frame() {
    let shop = shop();
    let set = |text: &str| {
        format!(
            r#"overlay=[{{ type = "text", text = "{text}", corner = "top-left", size = 0.1 }}]"#
        )
    };
    for (out, text) in [
        ("variables", "{frame} {particles} {file} {velocity.max:.2f}"),
        ("written", "2 4 p_2.csv 3.61"),
    ] {
        let set = set(text);
        render(&shop, out, &["--frames", "2", "--set", &set]).expect(0);
    }
    // The halos differ slightly: they have the colour of the backdrop in the middle of the text as it is known before
    let (a, b) = (preview(&shop, "variables", 2), preview(&shop, "written", 2));
    let bytes = a.as_raw().iter().zip(b.as_raw());
    let most = bytes.map(|(a, b)| a.abs_diff(*b)).max();
    assert!(most <= Some(12), "{most:?}");
}

#[test]
fn impossible_overlays_are_refused_or_noted() {
    let shop = shop();
    for (text, part) in [
        (
            "{velocty.max}",
            "overlay.text: no attribute `velocty` in the sampled frames (did you mean `velocity`?)",
        ),
        ("{height.max}", "height is no attribute"),
        ("{tim}", "unknown variable `{tim}`"),
    ] {
        let set = format!(r#"overlay=[{{ type = "text", text = "{text}" }}]"#);
        render(&shop, "out", &["--set", &set]).expect(2).prints(part);
    }
    let constant = ["--colorbar", "--set", "material.color=[1,0,0]"];
    render(&shop, "out", &constant).expect(2).prints("there is no colour bar");
    let set = r#"overlay=[{ type = "text", text = "漢字 a" }]"#;
    render(&shop, "out", &["--set", set])
        .expect(0)
        .prints("no glyph for `字`, `漢`; boxes are drawn");
}

/// A logo of 4 by 2 pixels: red at the left, clear at the right.
fn write_logo(shop: &Workshop) {
    let pixel = |x: u32, _| image::Rgba(if x < 2 { [255, 0, 0, 255] } else { [0, 0, 255, 0] });
    let logo = image::RgbaImage::from_fn(4, 2, pixel);
    logo.save(shop.join("logo.png")).expect("a logo");
}

#[test]
fn a_logo_is_drawn_with_its_alpha() {
    let shop = shop();
    write_logo(&shop);
    render(&shop, "plain", &["--frames", "1"]).expect(0);
    let logo = r#"overlay=[{ type = "image", path = "logo.png", height = 0.2, corner = "top-left", offset = [0, 0] }]"#;
    render(&shop, "logo", &["--frames", "1", "--set", logo]).expect(0);
    let (plain, drawn) = (preview(&shop, "plain", 1), preview(&shop, "logo", 1));
    // 0.2 of 90 rows, twice as wide as high, of which the left half is seen
    let changed = differences(&plain, &drawn);
    assert_eq!(changed.len(), 18 * 18);
    assert!(changed.iter().all(|(x, y)| *x < 18 && *y < 18));
    assert!(changed.iter().all(|(x, y)| drawn.get_pixel(*x, *y).0 == [255, 0, 0]));
    // The manifest of the job names the file from where it is
    let manifest = fs::read_to_string(shop.join("logo/job.toml")).expect("a manifest");
    assert!(manifest.contains("path = \"../logo.png\""), "{manifest}");
    shop.run(&["render", "logo/job.toml"]).expect(0);
}

#[test]
fn a_logo_that_cannot_be_read_is_named() {
    let shop = shop();
    let logo = r#"overlay=[{ type = "text" }, { type = "image", path = "logo.png" }]"#;
    for (content, part) in [(None, "No such file"), (Some(&b"GIF89a"[..]), "cannot be decoded")] {
        if let Some(content) = content {
            fs::write(shop.join("logo.png"), content).expect("a file");
        }
        let ran = render(&shop, "out", &["--set", logo]);
        let messages = ran.expect(2).errors();
        assert!(
            messages.contains("overlay.1.path: ") && messages.contains("logo.png"),
            "{messages}"
        );
        assert!(messages.contains(part), "{messages}");
    }
}
