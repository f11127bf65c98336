//! What figures contain.

use std::sync::Arc;

use flate2::read::ZlibDecoder;

use super::*;
use crate::overlay::{
    Axes, ColorBar, ColorBarKind, Content, Corner, FrameView, Image, Layout, Orientation, Overlay,
    Page, Placement, RgbaPixels, Template, marks,
};
use crate::scene::ColorScale;

/// A bar, a text, axes and a logo on a page of 80 mm at 300 dots per inch, with text of 7 points.
fn figure(has_alpha: bool) -> Figure {
    let page = Page { size: [945, 600], at: [0, 0], picture: [800, 600] };
    let pixels = 7.0 / 72.0 * 300.0;
    let overlay = |content: Content, layout: Layout| Overlay {
        content,
        layout,
        corner: None,
        placement: Placement { corner: Corner::TopLeft, offset: [0.05; 2] },
        size: pixels / 600.0,
        color: [0.0; 3],
        halo: [1.0; 3],
    };
    let bar = ColorBar {
        title: "Speed".to_owned(),
        unit: "m/s".to_owned(),
        length: 0.8,
        orientation: Orientation::Vertical,
        kind: ColorBarKind::Numbers {
            colors: vec![[0.0, 0.0, 1.0], [1.0, 1.0, 0.0]],
            range: [0.0, 4.0],
            scale: ColorScale::Linear,
            is_discrete: false,
        },
        ticks: None,
        format: None,
        factor: 1.0,
    };
    let logo = RgbaPixels::new(2, vec![[255, 0, 0, 255], [0, 0, 255, 0]]);
    let overlays = [
        overlay(Content::ColorBar(bar), Layout::Beside),
        overlay(Content::Text(Template::parse("(a) <ρ & µ>").unwrap()), Layout::Over),
        overlay(Content::Axes(Axes { names: ["x", "y", "z"].map(str::to_owned) }), Layout::Over),
        overlay(Content::Image(Image { source: Arc::new(logo), height: 0.1 }), Layout::Over),
    ];
    let frame = FrameView {
        axes: [[0.8, 0.1, 0.5], [-0.5, 0.4, 0.7], [0.1, 0.9, -0.3]],
        ..FrameView::default()
    };
    let pixel: &[u8] = if has_alpha { &[10, 20, 30, 128] } else { &[10, 20, 30] };
    let picture = FigurePicture {
        size: [80, 60],
        bytes: pixel.repeat(80 * 60),
        has_alpha,
        at: [0, 0],
        shown: [800, 600],
    };
    Figure {
        size: page.size,
        dpi: Some(300),
        paper: (!has_alpha).then_some([255; 3]),
        pictures: vec![picture],
        drawings: marks(&overlays, &page, &frame),
    }
}

/// The streams of a PDF file that can be inflated, one after the other, as text.
fn streams(pdf: &[u8]) -> Vec<String> {
    let find = |from: usize, text: &[u8]| {
        pdf[from..].windows(text.len()).position(|found| found == text).map(|at| from + at)
    };
    let (mut all, mut at) = (Vec::new(), 0);
    while let Some(start) = find(at, b"stream\n") {
        let mut bytes = Vec::new();
        let mut decoder = ZlibDecoder::new(&pdf[start + 7..]);
        if io::copy(&mut decoder, &mut bytes).is_ok() {
            all.push(String::from_utf8_lossy(&bytes).into_owned());
        }
        at = find(start, b"endstream").map_or(pdf.len(), |end| end + 9);
    }
    all
}

#[test]
fn text_of_pdf_files_has_its_size_in_points() {
    let pdf = figure(false).to_pdf().unwrap();
    let text = String::from_utf8_lossy(&pdf);
    // 945 pixels are 80 mm
    let page: Vec<f32> = text
        .split("/MediaBox [")
        .nth(1)
        .and_then(|s| s.split(']').next())
        .unwrap()
        .split(' ')
        .filter_map(|number| number.parse().ok())
        .collect();
    let expected = [0.0, 0.0, 80.01 / 25.4 * 72.0, 50.8 / 25.4 * 72.0];
    assert!(
        page.len() == 4 && page.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.01),
        "{page:?}"
    );
    assert!(text.contains("/BaseFont /SPHRLE+DejaVuSans") && text.contains("/FontFile2"));
    let streams = streams(&pdf);
    let content = streams.iter().find(|stream| stream.contains("BT\n")).expect("text");
    let sizes: Vec<f32> = content
        .lines()
        .filter_map(|line| line.strip_prefix("/F1 ")?.strip_suffix(" Tf")?.parse().ok())
        .collect();
    // The title, five labels, the text and the names of the axes
    assert_eq!(sizes.len(), 10, "{content}");
    assert!(sizes.iter().all(|size| (size - 7.0).abs() < 1e-3), "{sizes:?}");
    // Glyphs have their characters
    let map = streams
        .iter()
        .find(|stream| stream.contains("beginbfchar"))
        .cloned()
        .or_else(|| Some(text.clone().into_owned()))
        .unwrap();
    for character in "Speed(m/s)01234aρµxyz".chars() {
        let code = format!("<{:04X}>", u32::from(character));
        assert!(map.contains(&code), "{character} {code}");
    }
}

#[test]
fn pictures_are_kept_without_loss() {
    let opaque = figure(false).to_pdf().unwrap();
    let pixels = String::from_utf8_lossy(&[10, 20, 30].repeat(80 * 60)).into_owned();
    assert!(streams(&opaque).contains(&pixels));
    let clear = figure(true).to_pdf().unwrap();
    assert!(String::from_utf8_lossy(&clear).contains("/SMask"));
    let alpha = String::from_utf8_lossy(&[128; 80 * 60]).into_owned();
    assert!(streams(&clear).contains(&alpha));
    assert_eq!(clear, figure(true).to_pdf().unwrap(), "the same bytes");
}

#[test]
fn svg_files_have_outlines_with_their_words() {
    let svg = String::from_utf8(figure(false).to_svg().unwrap()).unwrap();
    assert!(svg.starts_with("<svg xmlns=") && svg.trim_end().ends_with("</svg>"));
    assert!(
        svg.contains("width=\"80.01mm\" height=\"50.8mm\" viewBox=\"0 0 945 600\""),
        "{}",
        &svg[..200]
    );
    assert!(
        svg.contains("aria-label=\"(a) &lt;ρ &amp; µ&gt;\"")
            && svg.contains("aria-label=\"Speed (m/s)\"")
    );
    assert!(svg.contains("<linearGradient") && svg.contains("data:image/png;base64,iVBOR"));
    // Text of 7 points has 29.17 pixels
    let path = svg
        .split("aria-label=\"Speed (m/s)\"")
        .nth(1)
        .and_then(|s| s.split(" d=\"").nth(1))
        .unwrap()
        .split('"')
        .next()
        .unwrap();
    let numbers: Vec<f32> = path
        .split(|c: char| c.is_ascii_alphabetic() || c == ' ')
        .filter_map(|number| number.parse().ok())
        .collect();
    let ys = || numbers.iter().skip(1).step_by(2).copied();
    let (top, bottom) = (ys().fold(f32::MAX, f32::min), ys().fold(f32::MIN, f32::max));
    // Parentheses reach 0.76 above the baseline, and p 0.208 below it
    assert!((bottom - top - 0.968 * 29.17).abs() < 0.1, "{}", bottom - top);
}

#[test]
fn figures_without_overlays_have_no_font() {
    let mut plain = figure(false);
    plain.drawings.clear();
    let pdf = plain.to_pdf().unwrap();
    assert!(!String::from_utf8_lossy(&pdf).contains("/Font"));
    assert!(pdf.len() < 5000, "{}", pdf.len());
}
