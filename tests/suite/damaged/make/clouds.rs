//! Point clouds, snapshots and geometry that are broken: LAS, LAZ, PCD, GADGET, text of Houdini.

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
        .patch("times", 104, &[0x83, 34, 0])
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
