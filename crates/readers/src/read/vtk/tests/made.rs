//! Binary legacy files, written piece by piece and in the layouts of two writers.
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    reason = "tests make small numbers"
)]

/// A binary file written piece by piece.
pub(super) struct TestFile(pub(super) Vec<u8>);

impl TestFile {
    pub(super) fn new(version: &str) -> Self {
        Self(format!("# vtk DataFile Version {version}\ntitle\nBINARY\n").into_bytes())
    }

    pub(super) fn text(mut self, text: &str) -> Self {
        self.0.extend(text.as_bytes());
        self
    }

    pub(super) fn floats(mut self, values: &[f32]) -> Self {
        self.0.extend(values.iter().flat_map(|v| v.to_be_bytes()));
        self
    }

    pub(super) fn ints(mut self, values: impl IntoIterator<Item = i32>) -> Self {
        self.0.extend(values.into_iter().flat_map(i32::to_be_bytes));
        self
    }

    pub(super) fn longs(mut self, values: impl IntoIterator<Item = i64>) -> Self {
        self.0.extend(values.into_iter().flat_map(i64::to_be_bytes));
        self
    }

    pub(super) fn bytes(mut self, bytes: &[u8]) -> Self {
        self.0.extend(bytes);
        self
    }

    /// Three points whose bytes spell keywords and line ends.
    pub(super) fn three_points(self, dataset: &str) -> Self {
        self.text(&format!("DATASET {dataset}\nPOINTS 3 float\n")).floats(&NASTY).text("\n")
    }
}

/// `CELLS` is in there, as are line feeds and blanks.
pub(super) const NASTY: [f32; 9] = [
    f32::from_be_bytes(*b"\nCEL"),
    f32::from_be_bytes(*b"LS 3"),
    f32::from_be_bytes(*b" 6\n\n"),
    f32::from_be_bytes(*b"\n\n\n\n"),
    -0.0,
    1.0e-40,
    f32::from_be_bytes(*b"META"),
    f32::from_be_bytes(*b"DATA"),
    f32::from_be_bytes(*b"\nEND"),
];

/// As SPlisHSPlasH writes it.
pub(super) fn splish(points: &[[f32; 3]], ids: &[u32], velocity: &[[f32; 3]]) -> Vec<u8> {
    let n = points.len();
    let count = n as i32;
    TestFile::new("4.1")
        .text(&format!("DATASET UNSTRUCTURED_GRID\nPOINTS {n} float\n"))
        .floats(points.as_flattened())
        .text(&format!("\nCELLS {n} {}\n", 2 * n))
        .ints((0..count).flat_map(|i| [1, i]))
        .text(&format!("\nCELL_TYPES {n}\n"))
        .ints((0..count).map(|_| 1))
        .text(&format!("\nPOINT_DATA {n}\nSCALARS id unsigned_int 1\nLOOKUP_TABLE id_table\n"))
        .ints(ids.iter().map(|id| id.cast_signed()))
        .text(&format!("\nFIELD FieldData 2\nvelocity 3 {n} float\n"))
        .floats(velocity.as_flattened())
        .text("\n")
        .0
}

/// As VTK 9 writes it, METADATA with an unnamed component and all.
pub(super) fn modern(points: &[[f32; 3]], ids: &[u32], velocity: &[[f32; 3]]) -> Vec<u8> {
    let n = points.len();
    let count = n as i64;
    TestFile::new("5.1")
        .text("DATASET POLYDATA\nFIELD FieldData 1\nTIME 1 1 double\n")
        .bytes(&0.25_f64.to_be_bytes())
        .text(&format!("\nPOINTS {n} float\n"))
        .floats(points.as_flattened())
        .text("\nMETADATA\nINFORMATION 1\nNAME L2_NORM_RANGE LOCATION vtkDataArray\nDATA 2 0.7 1.3 \n\n")
        .text(&format!("VERTICES {} {n}\nOFFSETS vtktypeint64\n", n + 1))
        .longs(0..=count)
        .text("\nCONNECTIVITY vtktypeint64\n")
        .longs(0..count)
        .text(&format!("\nPOINT_DATA {n}\nFIELD FieldData 2\nid 1 {n} unsigned_int\n"))
        .ints(ids.iter().map(|id| id.cast_signed()))
        .text(&format!("\nvelocity 3 {n} float\n"))
        .floats(velocity.as_flattened())
        .text("\nMETADATA\nCOMPONENT_NAMES\nu\n\n\nINFORMATION 1\nNAME A LOCATION B\nDATA 2 0 1 \n\n")
        .0
}
