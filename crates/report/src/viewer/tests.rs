//! Pages of small pictures.

use std::io::Read;

use spherule_images::output::view::DisplayView;
use spherule_images::picture::PlaneSamples;

use flate2::read::ZlibDecoder;

use super::*;

fn settings() -> ViewerSettings {
    ViewerSettings {
        title: "a </script><b> page".to_owned(),
        rate: 10.0,
        embed: false,
        width: None,
        view: DisplayView::default(),
        data: false,
        attributes: vec!["density".to_owned()],
    }
}

fn frames(dir: &Path) -> Vec<ViewerFrame> {
    let frame = |number: i64| {
        let picture = dir.join(format!("f #{number}.png"));
        let red = u8::try_from(10 * number).unwrap();
        fs::write(&picture, Picture::filled(8, 4, [red, 0, 0]).png("test").unwrap()).unwrap();
        ViewerFrame { number, image: picture.clone(), picture }
    };
    [3, 4].map(frame).to_vec()
}

fn data(html: &str) -> Value {
    let (_, after) = html.split_once("id=\"viewer-data\">").unwrap();
    serde_json::from_str(after.split_once("</script>").unwrap().0).unwrap()
}

#[test]
fn pictures_are_linked_or_embedded() {
    let dir = tempfile::tempdir().unwrap();
    let frames = frames(dir.path());
    let path = dir.path().join("pages/view.html");
    let page =
        |settings: &ViewerSettings| viewer_page(&frames, settings, &path, Some("<i>half</i>"), &[]);
    let (html, content) = page(&settings()).unwrap();
    assert_eq!(content, PageContent::default());
    let found = data(&html);
    assert_eq!(found["size"], json!([8, 4]));
    let expected = json!([
        {"number": 3, "source": "../f%20%233.png"}, {"number": 4, "source": "../f%20%234.png"}
    ]);
    assert_eq!(found["frames"], expected);
    // One script and one element of data; names are escaped
    assert_eq!(html.matches("<script").count(), 2);
    assert_eq!(html.matches("</script>").count(), 2);
    assert!(html.contains("a &lt;/script&gt;&lt;b&gt; page") && html.contains("&lt;i&gt;half"));
    assert!(html.contains("default-src 'none'") && html.contains(MARKER));
    assert!(!html.contains("http:") && !html.contains("https:"));

    let embedded = ViewerSettings { embed: true, ..settings() };
    let (html, _) = page(&embedded).unwrap();
    let source = data(&html)["frames"][0]["source"].as_str().unwrap().to_owned();
    assert_eq!(source, data_url(&fs::read(&frames[0].picture).unwrap()));
    let (html, _) = page(&ViewerSettings { width: Some(4), ..embedded }).unwrap();
    let small = Picture::filled(4, 2, [30, 0, 0]).png(MARKER).unwrap();
    assert_eq!(data(&html)["frames"][0]["source"], json!(data_url(&small)));
}

#[test]
fn pages_without_pictures_are_refused() {
    let page = Path::new("view.html");
    assert!(matches!(viewer_page(&[], &settings(), page, None, &[]), Err(ViewerError::Empty)));
    let lost = ViewerFrame { number: 1, picture: "lost.png".into(), image: "lost.exr".into() };
    let error = viewer_page(&[lost], &settings(), page, None, &[]).unwrap_err();
    assert!(error.to_string().starts_with("lost.png: "), "{error}");
}

fn planes() -> SampledPlanes {
    let none = u32::MAX;
    let float = |values: [f32; 6]| PlaneSamples::Float(values.to_vec());
    SampledPlanes {
        size: [3, 2],
        image_size: [6, 4],
        step: 2,
        planes: vec![
            ("Z".to_owned(), float([1.0, 1.5, f32::INFINITY, 3.0, 3.0, 1.0])),
            ("density".to_owned(), float([5.0, 5.0, 0.0, 7.0, 7.0, 9.0])),
            ("id.I".to_owned(), PlaneSamples::Integer(vec![70_000, 70_000, none, 4, 4, none])),
        ],
    }
}

#[test]
fn ids_and_values_are_packed_by_particle() {
    let planes = planes();
    let attributes = ["density".to_owned(), "absent".to_owned()];
    assert_eq!(ids::value_names(&planes, &attributes), ["density", "depth"]);
    let text = packed_ids(&planes, &attributes).unwrap().unwrap();
    let digit = |c: u8| match c {
        b'A'..=b'Z' => c - b'A',
        b'a'..=b'z' => c - b'a' + 26,
        b'0'..=b'9' => c - b'0' + 52,
        b'+' => 62,
        _ => 63,
    };
    let mut zlib = Vec::new();
    for group in text.trim_end_matches('=').as_bytes().chunks(4) {
        let bits = (0..4)
            .fold(0_u32, |bits, i| bits << 6 | group.get(i).map_or(0, |c| u32::from(digit(*c))));
        zlib.extend(&bits.to_be_bytes()[1..group.len()]);
    }
    let mut bytes = Vec::new();
    ZlibDecoder::new(&zlib[..]).read_to_end(&mut bytes).unwrap();
    let words = |bytes: &[u8]| -> Vec<u32> {
        bytes.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word)).collect()
    };
    assert_eq!(words(&bytes[..20]), [3, 2, 2, 2, 2]);
    assert_eq!(bytes[20..26], [1, 1, 0, 2, 2, 0]);
    assert_eq!(bytes[26..38], [0; 12]);
    assert_eq!(words(&bytes[38..46]), [70_000, 4]);
    let values: Vec<f32> = words(&bytes[46..]).into_iter().map(f32::from_bits).collect();
    assert_eq!(values, [5.0, 7.0, 1.0, 3.0]);
}

#[test]
fn channels_have_one_range() {
    let planes = planes();
    let channels = ChannelKind::in_planes(&planes, &["density".to_owned()]);
    let names: Vec<&str> = channels.iter().map(ChannelKind::name).collect();
    assert_eq!(names, ["depth", "density"]);
    let ranges = ChannelRanges::of(std::slice::from_ref(&planes), &channels);
    let depth = channel_picture(&planes, &channels[0], &ranges).unwrap();
    let red: Vec<u8> = depth.pixels().iter().map(|pixel| pixel[0]).collect();
    assert_eq!(red, [255, 201, 0, 38, 38, 255]);
    // The pixel without a particle does not count
    let density = channel_picture(&planes, &channels[1], &ranges).unwrap();
    assert_eq!(density.pixels()[0], colorous::VIRIDIS.eval_continuous(0.0).as_array());
    assert_eq!(density.pixels()[3], colorous::VIRIDIS.eval_continuous(1.0).as_array());
    assert_eq!(density.pixels()[5], [0; 3]);
}
