//! Point clouds, snapshots and geometry that are broken: LAS, LAZ, E57, PCD, GADGET, text of Houdini.

#[path = "../../../../fuzz/src/readers/e57_pages.rs"]
mod e57_pages;

use super::base::{Base, find};
use super::{Made, NAN, WHOLE, little};
use crate::harness::sample;

/// LAS 1.2 with points of format 0.
fn las_bytes(points: &[[i32; 3]]) -> Vec<u8> {
    let mut file = b"LASF".to_vec();
    file.resize(227, 0);
    let count = u32::try_from(points.len()).expect("a few points");
    let mut put = |at: usize, value: &[u8]| file[at..at + value.len()].copy_from_slice(value);
    put(24, &[1, 2]);
    put(94, &227_u16.to_le_bytes());
    put(96, &227_u32.to_le_bytes());
    put(105, &20_u16.to_le_bytes());
    put(107, &count.to_le_bytes());
    for (index, number) in [0.25, 0.25, 0.25, 0.0, 0.0, 0.0].into_iter().enumerate() {
        put(131 + 8 * index, &f64::to_le_bytes(number));
    }
    for point in points {
        file.extend(point.iter().flat_map(|number| number.to_le_bytes()));
        file.extend([0; 8]);
    }
    file
}

pub(super) fn las() -> Vec<Made> {
    Base::new("lidar", "las", las_bytes(&[[0, 0, 0], [4, 2, 1], [8, 4, 2]]))
        .replace("magic", "LASF", "LASX")
        .cut_at("cut-in-head", 100)
        .cut_at("cut-in-points", 227 + 45)
        .patch("absurd-points", 107, &[0xff; 4])
        .patch("far-points", 96, &[0xff; 4])
        .patch("format", 104, &[11])
        .patch("short-record", 105, &[10, 0])
        .patch("absurd-record", 105, &[0xff; 2])
        .patch("scale", 131, &f64::NAN.to_le_bytes())
        .patch("offset", 155, &f64::INFINITY.to_le_bytes())
        .file("zero", las_bytes(&[]))
        .made
}

/// A damaged file that is not made here.
fn kept(name: &str) -> Vec<u8> {
    std::fs::read(crate::damaged::directory().join(name)).expect("a damaged file")
}

/// Streams of points (format 2), and chunks with layers (format 6).
pub(super) fn laz() -> Vec<Made> {
    let bytes = |format: u8| {
        let path = sample(&format!("las/format{format}.laz"));
        std::fs::read(path).expect("a sample")
    };
    let place = |bytes: &[u8]| find(bytes, b"laszip encoded") + 52;
    let start = |bytes: &[u8]| bytes[96] as usize + 256 * bytes[97] as usize;
    let (stream, layers) = (bytes(2), bytes(6));
    let (stream_record, layers_record) = (place(&stream), place(&layers));
    let (stream_start, layers_start) = (start(&stream), start(&layers));
    let mut made = Base::new("stream", "laz", stream)
        .replace("no-record", "laszip encoded", "laszip missing")
        .patch("compressor", stream_record, &[9, 0])
        .patch("other-compressor", stream_record, &[3, 0])
        // Found by mutation
        .file("times", kept("stream-times.laz"))
        .patch("variable-chunks", stream_record + 12, &[0xff; 4])
        .patch("item", stream_record + 34, &[77, 0])
        .patch("other-items", stream_record + 34, &[7, 0])
        .patch("absurd-points", 107, &[0xff; 4])
        .patch("more-points", 107, &[0xff, 0xff, 0, 0])
        .cut_at("cut-in-points", stream_start + 900)
        .cut_at("cut-before-points", stream_start)
        .made;
    made.extend(
        Base::new("layers", "laz", layers)
            .patch("compressor", layers_record, &[2, 0])
            .patch("no-points", layers_start + 8 + 30, &[0; 4])
            .patch("absurd-layer", layers_start + 8 + 30 + 4, &[0xff; 4])
            .patch("more-points", 247, &[0xff, 0xff])
            .cut_at("cut-in-points", layers_start + 900)
            .cut_at("cut-before-points", layers_start)
            .made,
    );
    made
}

/// The content of an E57 file of a scan with one packet, before it is divided into pages.
fn e57_content(points: &[[f32; 3]]) -> Vec<u8> {
    let each = u16::try_from(4 * points.len()).expect("a few points");
    let axis = |axis: usize| points.iter().flat_map(move |point| point[axis].to_le_bytes());
    let mut packet = [3, each, each, each].map(u16::to_le_bytes).concat();
    packet.extend((0..3).flat_map(axis));
    let len = u16::try_from(4 + packet.len() - 1).expect("short").to_le_bytes();
    let section = [1_u64, 32 + 4 + packet.len() as u64, 80, 0].map(u64::to_le_bytes).concat();
    let body = [&section, &[1, 0][..], &len, &packet].concat();
    let field = |axis| format!("<cartesian{axis} type=\"Float\" precision=\"single\"/>");
    let xml = format!(
        "<e57Root><data3D><vectorChild><points fileOffset=\"48\" recordCount=\"{}\"><prototype>{}</prototype></points>\
         </vectorChild></data3D></e57Root>",
        points.len(),
        ["X", "Y", "Z"].map(field).concat()
    );
    let mut file = b"ASTM-E57\x01\0\0\0\0\0\0\0".to_vec();
    let lengths = [1024, 48 + body.len() as u64, xml.len() as u64, 1024];
    file.extend(lengths.map(u64::to_le_bytes).concat());
    file.extend(body);
    file.extend(xml.bytes());
    file
}

pub(super) fn e57() -> Vec<Made> {
    let content = e57_content(&WHOLE);
    let text = |old: &str, new: &str| {
        let mut changed = super::base::replace(&content, old.as_bytes(), new.as_bytes());
        let len = changed.len() - find(&changed, b"<e57Root");
        changed[32..40].copy_from_slice(&(len as u64).to_le_bytes());
        e57_pages::sealed(changed)
    };
    let bytes = |at: usize, new: &[u8]| {
        let mut changed = content.clone();
        changed[at..at + new.len()].copy_from_slice(new);
        e57_pages::sealed(changed)
    };
    let xml = String::from_utf8(content[find(&content, b"<e57Root")..].to_vec()).expect("text");
    let single = "<cartesianX type=\"Float\" precision=\"single\"/>";
    Base::new("scan", "e57", e57_pages::sealed(content.clone()))
        .replace("magic", "ASTM-E57", "ASTM-E75")
        .cut_at("cut-in-head", 40)
        .cut_at("cut-in-page", 900)
        .patch("checksum", 100, &[9])
        .file("version", bytes(8, &[2]))
        .file("page-size", bytes(40, &[9, 0]))
        .file("far-xml", bytes(24, &[0xff; 4]))
        .file("absurd-xml", bytes(32, &[0xff; 8]))
        .file("section", bytes(48, &[7]))
        .file("far-packet", bytes(64, &[0xff; 8]))
        .file("packet", bytes(80, &[7]))
        .file("short-packet", bytes(82, &[7, 0]))
        .file("fields-of-packet", bytes(84, &[2, 0]))
        .file("absurd-points", text("recordCount=\"3\"", "recordCount=\"4000000000\""))
        .file("more-points", text("recordCount=\"3\"", "recordCount=\"4\""))
        .file("no-x", text("cartesianX", "cartesianW"))
        .file("two-x", text("cartesianY", "cartesianX"))
        .file("type", text("type=\"Float\"", "type=\"String\""))
        .file("xml", text("</prototype>", "</points>"))
        .file("range", text(single, "<cartesianX type=\"Integer\" minimum=\"9\" maximum=\"8\"/>"))
        .file("no-scans", text(&xml, "<e57Root/>"))
        .file("nan", e57_pages::sealed(e57_content(&NAN)))
        .file("zero", e57_pages::sealed(e57_content(&[])))
        .made
}

fn pcd_bytes(points: &[[f32; 3]]) -> Vec<u8> {
    let count = points.len();
    let mut file = format!(
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n\
         WIDTH {count}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\nDATA binary\n"
    )
    .into_bytes();
    file.extend(little(points));
    file
}

pub(super) fn pcd() -> Vec<Made> {
    Base::new("cloud", "pcd", pcd_bytes(&WHOLE))
        .replace("magic", "# .PCD v0.7 - Point Cloud Data file format\nVERSION", "VERSIONS")
        .cut("cut-in-head", "FIELDS x", 0)
        .cut("cut-in-points", "DATA binary\n", 20)
        .replace("absurd-points", "POINTS 3", "POINTS 2000000000")
        .replace("overflowing-points", "POINTS 3", "POINTS 6148914691236517206")
        .replace("negative-points", "POINTS 3", "POINTS -3")
        .replace("no-z", "FIELDS x y z", "FIELDS x y w")
        .replace("type", "TYPE F", "TYPE X")
        .replace("size", "SIZE 4 4", "SIZE 3 4")
        .replace("data", "DATA binary", "DATA zipped")
        .replace("not-compressed", "DATA binary", "DATA binary_compressed")
        .file("nan", pcd_bytes(&NAN))
        .file("zero", pcd_bytes(&[]))
        .made
}

/// A snapshot of format 1: the header, positions, velocities and ids of dark matter.
fn gadget_bytes(points: &[[f32; 3]]) -> Vec<u8> {
    let count = u32::try_from(points.len()).expect("a few points");
    let mut header = [0, count, 0, 0, 0, 0].map(u32::to_le_bytes).concat();
    header.extend([0.0, 2.5, 0.0, 0.0, 0.0, 0.0, 0.5].map(f64::to_le_bytes).concat());
    header.resize(256, 0);
    let ids: Vec<u8> = (1..=count).flat_map(u32::to_le_bytes).collect();
    let block = |body: &[u8]| {
        let len = u32::try_from(body.len()).expect("short").to_le_bytes();
        [&len, body, &len].concat()
    };
    [block(&header), block(&little(points)), block(&little(points)), block(&ids)].concat()
}

pub(super) fn gadget() -> Vec<Made> {
    // Each length is before and behind a block
    let positions = 4 + 256 + 4;
    Base::new("snapshot", "gadget", gadget_bytes(&WHOLE))
        .patch("magic", 0, &[9])
        .patch("length-behind", 260, &[9])
        .cut_at("cut-in-head", 100)
        .cut_at("cut-behind-head", positions)
        .cut_at("cut-in-positions", positions + 20)
        .patch("absurd-points", 8, &[0xff; 4])
        .patch("other-count", 8, &[4])
        .patch("length-before", positions, &[40])
        .patch("absurd-length", positions, &[0xff; 4])
        .patch("length-behind-positions", positions + 4 + 36, &[37])
        .file("nan", gadget_bytes(&NAN))
        .file("zero", gadget_bytes(&[]))
        .made
}

fn geo_text(points: &str, count: usize) -> Vec<u8> {
    format!(
        "[\n\t\"fileversion\",\"20.5.278\",\n\t\"hasindex\",false,\n\t\"pointcount\",{count},\n\t\"attributes\",[\n\t\t\
         \"pointattributes\",[\n\t\t\t[\n\t\t\t\t[\"scope\",\"public\",\"type\",\"numeric\",\"name\",\"P\"],\n\t\t\t\t[\
         \"size\",3,\"storage\",\"fpreal32\",\"values\",[\"size\",3,\"storage\",\"fpreal32\",\"tuples\",[{points}]]]\n\
         \t\t\t]\n\t\t]\n\t]\n]\n"
    )
    .into_bytes()
}

pub(super) fn geo() -> Vec<Made> {
    Base::new("text", "geo", geo_text("[0,0,0],[1,0.5,0.25],[2,1,0.5]", 3))
        .replace("magic", "\"fileversion\"", "\"version\"")
        .cut("cut-in-head", "20.5", 0)
        .cut("cut-in-points", "[1,0.", 0)
        .cut("cut-at-end", "[2,1,0.5]]]]", 0)
        .replace("word", "0.25", "half")
        .replace("text", "0.25", "\"half\"")
        .replace("absurd-points", "\"pointcount\",3", "\"pointcount\",2000000000")
        .replace("negative-points", "\"pointcount\",3", "\"pointcount\",-3")
        .replace("other-count", "\"pointcount\",3", "\"pointcount\",4")
        .replace("no-count", "\"pointcount\",3", "\"vertexcount\",3")
        .replace("no-positions", "\"P\"", "\"Q\"")
        .replace("storage", "\"fpreal32\",\"tuples\"", "\"fpreal9\",\"tuples\"")
        .replace("two-components", "\"values\",[\"size\",3", "\"values\",[\"size\",2")
        .replace("absurd-size", "\"values\",[\"size\",3", "\"values\",[\"size\",3000000000")
        .replace("arrangement", "\"tuples\"", "\"triples\"")
        .file("nan", geo_text("[0,0,0],[nan,0.5,0.25],[2,1,0.5]", 3))
        .file("zero", geo_text("", 0))
        .made
}
