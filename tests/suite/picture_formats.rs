//! Pictures as PNG alone, and as JPEG and TIFF.

use std::fs;

use crate::harness::{JOB, SMALL, Workshop, dam_break, files, no_leftovers};

/// Three frames in `in`.
fn workshop() -> Workshop {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=3);
    workshop
}

// Starts the program twelve times: to render PNG in several ways, and for each command that reads it.
#[test]
fn jobs_write_png_alone() {
    let workshop = workshop();
    let png = |options: &[&str]| {
        let render = ["render", "in", "-o", "png/f.####.png", "--transparent"];
        workshop.run(&[&render[..], &JOB, options].concat())
    };
    // Two of three frames, then the rest
    png(&["--frames", "1-2"]).expect(0);
    let ran = png(&[]).expect(0);
    assert_eq!(ran.rendered(), [3]);
    assert!(png(&[]).expect(0).rendered().is_empty());
    no_leftovers(&workshop.join("png"));
    let pictures = files(&workshop.join("png"));
    assert!(!pictures.keys().any(|name| name.ends_with(".exr")));
    // They are the previews of the same job with EXR files
    workshop.render(&["--transparent"]).expect(0);
    for number in 1..=3 {
        let name = format!("f.{number:04}.png");
        let preview = fs::read(workshop.join("out").join(&name)).expect("a preview");
        assert!(pictures[&name] == preview, "{name}");
    }
    // Isolated frames, too
    let isolated = [
        &["render", "in", "-o", "own/f.####.png", "--transparent"][..],
        &JOB,
        &["--isolate", "--frames", "2"],
    ];
    workshop.run(&isolated.concat()).expect(0);
    assert!(files(&workshop.join("own"))["f.0002.png"] == pictures["f.0002.png"]);
    // Other commands read them
    workshop.run(&["verify", "png"]).expect(0);
    for command in [
        &["movie", "png", "-o", "movie.gif"][..],
        &["sheet", "png", "-o", "sheet.png"],
        &["view", "png", "-o", "view.html"],
    ] {
        workshop.run(command).expect(0);
    }
    let check = workshop.run(&["check", "png/job.toml"]).expect(0).text();
    let images = "f.####.png: 64x36, 1 sample per pixel, RGBA\n";
    assert!(check.contains(images), "{check}");
    // A damaged one is found, and rendered again
    let file = workshop.join("png/f.0002.png");
    let bytes = fs::read(&file).expect("a picture");
    fs::write(&file, &bytes[..bytes.len() / 2]).expect("a file");
    workshop.run(&["verify", "png"]).expect(1);
    assert_eq!(png(&[]).expect(0).rendered(), [2]);
    assert!(fs::read(&file).expect("a picture") == bytes);
}

#[test]
fn jobs_write_no_other_formats() {
    let workshop = workshop();
    for name in ["f.####.jpg", "f.####.tif"] {
        workshop
            .run(&["render", "in", "-o", name])
            .expect(2)
            .prints("--output: must end in .exr or .png");
    }
}

// Starts the program twelve times: each extension, for a new file and for one that is replaced.
#[test]
fn still_writes_jpeg_and_tiff() {
    let workshop = workshop();
    let still = |name: &str, options: &[&str]| {
        workshop.run(&[&["still", "in", "-o", name][..], &SMALL, options].concat())
    };
    for name in ["a.png", "a.jpg", "a.JPEG", "a.tif", "a.tiff"] {
        still(name, &["--dpi", "300"]).expect(0);
        // An image is replaced
        still(name, &["--dpi", "300"]).expect(0);
    }
    let png = image::open(workshop.join("a.png")).expect("PNG").into_rgb8();
    let jpeg = image::open(workshop.join("a.jpg")).expect("JPEG").into_rgb8();
    assert_eq!(jpeg.dimensions(), png.dimensions());
    let pairs = jpeg.as_raw().iter().zip(png.as_raw());
    let error: u64 = pairs.map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    assert!(error < 6 * jpeg.as_raw().len() as u64, "{error}");
    let file = fs::File::open(workshop.join("a.tif")).expect("a file");
    let mut tiff = tiff::decoder::Decoder::new(file).expect("TIFF");
    let tiff::decoder::DecodingResult::U8(bytes) = tiff.read_image().expect("pixels") else {
        panic!("not 8 bits");
    };
    assert_eq!(&bytes, png.as_raw());

    still("b.tif", &["--transparent"]).expect(0);
    still("b.jpg", &["--transparent"])
        .expect(2)
        .prints("JPEG files have no alpha for a transparent background; choose .png, .tif or .pdf");
    assert!(!workshop.join("b.jpg").exists());
}
