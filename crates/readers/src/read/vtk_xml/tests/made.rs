//! XML files in every encoding that is read.
#![expect(clippy::cast_possible_truncation, reason = "tests make small numbers")]

use std::io::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::write::ZlibEncoder;

use spherule_frame::{AttributeData, Endian};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Where {
    Ascii,
    Inline,
    /// Lines of 20 characters, an element in the middle.
    InlineBroken,
    Base64,
    /// As pyvisfile: the length in a run of its own.
    Base64Apart,
    Raw,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Pack {
    Plain,
    /// Block size; and whether a full last block is given its size (meshio) or 0 (VTK).
    Zlib(usize, bool),
    Lz4(usize),
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Style {
    pub(super) place: Where,
    pub(super) pack: Pack,
    pub(super) endian: Endian,
    pub(super) wide_header: bool,
}

impl Style {
    pub(super) const RAW: Self =
        Self { place: Where::Raw, pack: Pack::Plain, endian: Endian::Little, wide_header: false };

    pub(super) fn integers(self, values: &[usize]) -> Vec<u8> {
        let size = if self.wide_header { 8 } else { 4 };
        let one = |v: &usize| {
            let all = (*v as u64).to_le_bytes();
            let mut bytes = all[..size].to_vec();
            if self.endian == Endian::Big {
                bytes.reverse();
            }
            bytes
        };
        values.iter().flat_map(one).collect()
    }

    /// Header and data, each to be encoded.
    pub(super) fn packed(self, data: &[u8]) -> (Vec<u8>, Vec<u8>) {
        let (block, full_is_zero) = match self.pack {
            Pack::Plain => return (self.integers(&[data.len()]), data.to_vec()),
            Pack::Zlib(block, full_is_zero) => (block, full_is_zero),
            Pack::Lz4(block) => (block, true),
        };
        let blocks: Vec<Vec<u8>> = data.chunks(block).map(|b| self.squeeze(b)).collect();
        let mut last = data.len() % block;
        if last == 0 && !full_is_zero && !blocks.is_empty() {
            last = block;
        }
        let mut header = vec![blocks.len(), block, last];
        header.extend(blocks.iter().map(Vec::len));
        (self.integers(&header), blocks.concat())
    }

    pub(super) fn squeeze(self, block: &[u8]) -> Vec<u8> {
        if matches!(self.pack, Pack::Lz4(_)) {
            return lz4_flex::block::compress(block);
        }
        let mut zlib = ZlibEncoder::new(Vec::new(), flate2::Compression::default());
        zlib.write_all(block).unwrap();
        zlib.finish().unwrap()
    }

    /// What stands in the file for the array.
    pub(super) fn encoded(self, data: &[u8]) -> Vec<u8> {
        let (header, data) = self.packed(data);
        if self.place == Where::Raw {
            return [header, data].concat();
        }
        if self.pack == Pack::Plain && self.place != Where::Base64Apart {
            return STANDARD.encode([header, data].concat()).into_bytes();
        }
        (STANDARD.encode(header) + &STANDARD.encode(data)).into_bytes()
    }
}

/// A file being written.
pub(super) struct Made {
    style: Style,
    xml: String,
    blob: Vec<u8>,
}

impl Made {
    pub(super) fn new(style: Style) -> Self {
        let order = match style.endian {
            Endian::Little => "LittleEndian",
            Endian::Big => "BigEndian",
        };
        let header = if style.wide_header { " header_type=\"UInt64\"" } else { "" };
        let compressor = match style.pack {
            Pack::Plain => "",
            Pack::Zlib(..) => " compressor=\"vtkZLibDataCompressor\"",
            Pack::Lz4(_) => " compressor=\"vtkLZ4DataCompressor\"",
        };
        Self {
            style,
            xml: format!(
                "<?xml version=\"1.0\"?>\n<!-- made by a test -->\n<VTKFile type=\"PolyData\" \
                 version=\"0.1\" byte_order=\"{order}\"{header}{compressor}>\n<PolyData>\n"
            ),
            blob: Vec::new(),
        }
    }

    pub(super) fn xml(mut self, xml: &str) -> Self {
        self.xml += xml;
        self
    }

    pub(super) fn array(mut self, name: &str, components: usize, data: &AttributeData) -> Self {
        let type_name = match data {
            AttributeData::F32(_) => "Float32",
            AttributeData::F64(_) => "Float64",
            AttributeData::U8(_) => "UInt8",
            AttributeData::U32(_) => "UInt32",
            other => panic!("{other:?} is not written"),
        };
        let head = format!(
            "<DataArray type=\"{type_name}\" Name=\"{name}\" NumberOfComponents=\"{components}\""
        );
        let key = "<InformationKey name=\"A\"><Value index=\"0\">17.5</Value></InformationKey>";
        let bytes = bytes_of(data, self.style.endian);
        match self.style.place {
            Where::Ascii => {
                let text: Vec<String> =
                    (0..data.len()).map(|i| data.get_f64(i).to_string()).collect();
                self.xml +=
                    &format!("{head} format=\"ascii\">\n{}\n{key}</DataArray>\n", text.join("\n "));
            }
            Where::Inline | Where::InlineBroken => {
                let mut text = String::from_utf8(self.style.encoded(&bytes)).unwrap();
                if self.style.place == Where::InlineBroken {
                    let lines: Vec<&str> = text
                        .as_bytes()
                        .chunks(20)
                        .map(|c| std::str::from_utf8(c).unwrap())
                        .collect();
                    let half = lines.len() / 2;
                    text = format!(
                        "{}\r\n{key}{}",
                        lines[..half].join("\n  "),
                        lines[half..].join("\n  ")
                    );
                }
                self.xml += &format!("{head} format=\"binary\">\n  {text}\n  {key}</DataArray>\n");
            }
            Where::Base64 | Where::Base64Apart | Where::Raw => {
                self.xml += &format!(
                    "{head} format=\"appended\" offset=\"{}\">{key}</DataArray>\n",
                    self.blob.len()
                );
                let encoded = self.style.encoded(&bytes);
                self.blob.extend(encoded);
            }
        }
        self
    }

    pub(super) fn end(self) -> Vec<u8> {
        let mut file = (self.xml + "</PolyData>\n").into_bytes();
        let encoding = match self.style.place {
            Where::Ascii | Where::Inline | Where::InlineBroken => None,
            Where::Base64 | Where::Base64Apart => Some("base64"),
            Where::Raw => Some("raw"),
        };
        if let Some(encoding) = encoding {
            file.extend(format!("  <AppendedData encoding=\"{encoding}\">\n   _").bytes());
            file.extend(self.blob);
            file.extend(b"\n  </AppendedData>\n");
        }
        file.extend(b"</VTKFile>\n");
        file
    }
}

pub(super) fn bytes_of(data: &AttributeData, endian: Endian) -> Vec<u8> {
    let mut bytes: Vec<u8> = match data {
        AttributeData::F32(v) => v.iter().flat_map(|x| x.to_le_bytes()).collect(),
        AttributeData::F64(v) => v.iter().flat_map(|x| x.to_le_bytes()).collect(),
        AttributeData::U32(v) => v.iter().flat_map(|x| x.to_le_bytes()).collect(),
        AttributeData::U8(v) => v.clone(),
        other => panic!("{other:?} is not written"),
    };
    if endian == Endian::Big {
        bytes.chunks_mut(data.scalar_type().size()).for_each(<[u8]>::reverse);
    }
    bytes
}

pub(super) fn points(n: usize) -> AttributeData {
    // Bytes that spell markup; finite, and exact as decimal text.
    let nasty = f32::from_le_bytes(*b"<&</");
    AttributeData::F32(
        (0..3 * n).map(|i| if i % 5 == 2 { nasty } else { i as f32 * 0.5 }).collect(),
    )
}

pub(super) fn ids(n: usize) -> AttributeData {
    AttributeData::U32((0..n as u32).map(|i| i * 7).collect())
}

/// Pieces of the given sizes with time, points, `id` and a byte attribute.
pub(super) fn made(style: Style, sizes: &[usize]) -> Vec<u8> {
    let mut made = Made::new(style)
        .xml("<FieldData>\n")
        .array("TimeValue", 1, &AttributeData::F64(vec![0.75]))
        .xml("</FieldData>\n");
    for &n in sizes {
        made = made
            .xml(&format!("<Piece NumberOfPoints=\"{n}\"  >\n<PointData Scalars=\"id\">\n"))
            .array("id", 1, &ids(n))
            .array("a &lt; b", 1, &AttributeData::U8(vec![65; n]))
            .xml("<Array type=\"String\" Name=\"s\" format=\"ascii\">65 66 0</Array></PointData>\n<Points>\n")
            .array("Position", 3, &points(n))
            .xml("</Points>\n<Verts><DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">0</DataArray></Verts></Piece>\n");
    }
    made.end()
}

pub(super) fn all_styles() -> Vec<Style> {
    let mut styles = Vec::new();
    for place in [
        Where::Ascii,
        Where::Inline,
        Where::InlineBroken,
        Where::Base64,
        Where::Base64Apart,
        Where::Raw,
    ] {
        // 7 cuts numbers in two; 1 << 15 is VTK's own.
        for pack in [
            Pack::Plain,
            Pack::Zlib(7, true),
            Pack::Zlib(12, true),
            Pack::Zlib(12, false),
            Pack::Zlib(1 << 15, true),
            Pack::Lz4(28),
        ] {
            for endian in [Endian::Little, Endian::Big] {
                for wide_header in [false, true] {
                    styles.push(Style { place, pack, endian, wide_header });
                }
            }
        }
    }
    styles
}
