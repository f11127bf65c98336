//! `--crop` and `image.overscan`: parts of images, and their windows.

use std::path::Path;

use exr::meta::MetaData;
use exr::prelude::{IntegerBounds, Vec2};

use crate::harness::{Workshop, dam_break};
use crate::picture::Picture;

/// Data window and display window.
#[track_caller]
fn windows(path: &Path) -> [IntegerBounds; 2] {
    let meta = MetaData::read_from_file(path, true).expect("an EXR");
    let header = &meta.headers[0];
    [header.data_window(), header.shared_attributes.display_window]
}

// Starts the program eight times: four windows of an image, and the commands that tell of them.
#[test]
fn a_crop_equals_its_part_of_the_whole_image() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 2..=2);
    let render = |out: &str, options: &[&str]| {
        let output = format!("{out}/f.####.exr");
        let mut all = vec![
            "render",
            "in",
            "--width",
            "96",
            "--height",
            "54",
            "--samples",
            "3",
            "--set",
            "render.denoise=false",
        ];
        all.extend(["-o", output.as_str()]);
        all.extend(options);
        workshop.run(&all).expect(0);
        workshop.join(out).join("f.0002.exr")
    };
    let whole = render("whole", &[]);
    let crop = render("crop", &["--crop", "17,5,61,40"]);
    let wide = render("wide", &["--set", "image.overscan=7"]);
    let corner = render("corner", &["--set", "image.overscan=7", "--crop", "-7,-7,10,10"]);

    let options = ["check", "in", "--width", "96", "--height", "54", "--crop", "17,5,61,40"];
    let text = workshop.run(&options).expect(0).text();
    assert!(text.contains(": 96x54, part [17, 5, 61, 40], "), "{text}");

    // The windows
    let display = IntegerBounds::from_dimensions((96, 54));
    let bounds = |x, y, width, height| IntegerBounds::new(Vec2(x, y), Vec2(width, height));
    assert_eq!(windows(&whole), [display, display]);
    assert_eq!(windows(&crop), [bounds(17, 5, 44, 35), display]);
    assert_eq!(windows(&wide), [bounds(-7, -7, 110, 68), display]);
    assert_eq!(windows(&corner), [bounds(-7, -7, 17, 17), display]);

    // The pixels, in the EXR and in the preview
    let pictures = [&whole, &crop, &wide, &corner].map(|path| Picture::open(path));
    let [whole_picture, crop_picture, wide_picture, corner_picture] = &pictures;
    for name in ["R", "A", "Z"] {
        let value = |picture: &Picture, x: usize, y: usize| {
            picture.floats(name)[y * picture.width + x].to_bits()
        };
        for (x, y) in (0..54).flat_map(|y| (0..96).map(move |x| (x, y))) {
            let expected = value(whole_picture, x, y);
            assert_eq!(value(wide_picture, x + 7, y + 7), expected, "{x} {y}");
            if (17..61).contains(&x) && (5..40).contains(&y) {
                assert_eq!(value(crop_picture, x - 17, y - 5), expected, "{x} {y}");
            }
            if x < 10 && y < 10 {
                assert_eq!(value(corner_picture, x + 7, y + 7), expected, "{x} {y}");
            }
        }
    }
    let preview = |path: &Path| {
        let image = image::open(path.with_extension("png")).expect("a preview");
        image.into_rgb8()
    };
    let (whole, crop) = (preview(&whole), preview(&crop));
    assert_eq!(crop.dimensions(), (44, 35));
    for (x, y, pixel) in crop.enumerate_pixels() {
        assert_eq!(pixel, whole.get_pixel(x + 17, y + 5), "{x} {y}");
    }
    assert_eq!(preview(&wide).dimensions(), (110, 68));
    for job in ["crop", "wide", "corner"] {
        let ran = workshop.run(&["verify", job]).expect(0);
        assert_eq!(ran.text(), "sound              1 (2)\n");
    }
}

#[test]
fn crops_without_pixels_or_beyond_the_image_are_errors() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 2..=2);
    for (crop, what) in [
        ("5,5,5,9", "has no pixels"),
        ("0,0,1921,9", "reaches beyond the image"),
        ("-1,0,9,9", "reaches beyond the image"),
        ("0,0,9", "expected four whole numbers"),
        ("left", "expected four whole numbers"),
    ] {
        let ran = workshop.run(&["check", "in", "--crop", crop]).expect(2);
        let errors = ran.errors();
        assert!(errors.contains("--crop") && errors.contains(what), "{errors}");
    }
}
