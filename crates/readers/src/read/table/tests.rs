use super::*;
use glam::DVec3;
use spherule_frame::{AttributeData, MemoryBudget};

const WORDS: Dialect = Dialect {
    separator: Separator::Blanks,
    decimal: Decimal::Point,
    comments: Comments::None,
    surplus: ExtraCells::Empty,
};

fn scalar(numbers: NumberKind, on_text: TextPolicy) -> TargetArray {
    TargetArray::attribute("a", 1, numbers, on_text)
}

/// A table of one column for each of `targets`.
fn columns(bytes: &[u8], dialect: Dialect, targets: Vec<TargetArray>) -> WholeText<'_> {
    let place = |target| Some(TargetComponent { target, component: 0 });
    let table = Table {
        dialect,
        fields: (0..targets.len()).map(place).collect(),
        targets,
        rows: 0,
        labels: None,
    };
    WholeText { bytes, table }
}

/// A table and its text.
struct WholeText<'a> {
    bytes: &'a [u8],
    table: Table,
}

impl WholeText<'_> {
    /// As a whole, and the same in pieces.
    fn parse(&self, budget: MemoryBudget) -> Result<Vec<ColumnValues>, ParseError> {
        let parse = |mut text| self.table.parse(&mut text, usize::MAX, budget).content;
        let whole = parse(TextInput::whole(self.bytes));
        let pieces = parse(TextInput::in_pieces(self.bytes, false, 1000));
        assert_eq!(format!("{whole:?}"), format!("{pieces:?}"));
        whole
    }
}

/// Bytes of several pieces.
const PIECE: usize = 1 << 20;

#[test]
fn fields_are_assigned_by_name() {
    let bytes = b"7 3 1 2\n\n  8\t6 4 5 \r\n";
    let place = |target, component| Some(TargetComponent { target, component });
    let table = Table {
        dialect: WORDS,
        fields: vec![place(1, 0), place(0, 2), place(0, 0), place(0, 1)],
        targets: vec![TargetArray::positions(), scalar(NumberKind::WholeIfAll, TextPolicy::Fault)],
        rows: 2,
        labels: None,
    };
    let table = WholeText { bytes, table };
    let mut values = table.parse(MemoryBudget::UNLIMITED).unwrap();
    assert_eq!(values.pop(), Some(ColumnValues::Whole(vec![7, 8])));
    assert_eq!(
        values.pop().unwrap().into_positions(),
        Positions::F64(vec![DVec3::new(1., 2., 3.), DVec3::new(4., 5., 6.)])
    );
}

#[test]
fn integers_widen_to_floats_and_text() {
    let whole = || scalar(NumberKind::WholeIfAll, TextPolicy::LeaveOut);
    let parse = |text: &str| {
        let mut values =
            columns(text.as_bytes(), WORDS, vec![whole()]).parse(MemoryBudget::UNLIMITED).unwrap();
        values.pop().unwrap()
    };
    let big = "9007199254740993";
    assert_eq!(parse(big), ColumnValues::Whole(vec![9_007_199_254_740_993]));
    assert_eq!(parse("1\n2.5\n3"), ColumnValues::Real(vec![1., 2.5, 3.]));
    assert_eq!(parse("1\nx\n3"), ColumnValues::Text);
    assert_eq!(parse(""), ColumnValues::Whole(vec![]));
}

#[test]
#[cfg_attr(miri, ignore = "too many bytes for an interpreter")]
fn many_pieces_are_joined_in_order() {
    let rows = 400_000_u32;
    let mut text = String::new();
    for i in 0..rows {
        text.push_str(&format!("{i} {}\n", f64::from(i) * 0.5));
    }
    assert!(text.len() > 3 * PIECE);
    let targets = vec![
        scalar(NumberKind::WholeIfAll, TextPolicy::Fault),
        scalar(NumberKind::WholeIfAll, TextPolicy::Fault),
    ];
    let values = columns(text.as_bytes(), WORDS, targets).parse(MemoryBudget::UNLIMITED).unwrap();
    let ids = (0..rows).map(i64::from).collect();
    let halves = (0..rows).map(|i| f64::from(i) * 0.5).collect();
    assert_eq!(values, [ColumnValues::Whole(ids), ColumnValues::Real(halves)]);
}

#[test]
fn the_first_fault_is_reported() {
    let mut text = "1\n".repeat(PIECE);
    text.replace_range(10..11, "x");
    text.replace_range(PIECE + 100..PIECE + 101, "y");
    let table = columns(text.as_bytes(), WORDS, vec![scalar(NumberKind::Real, TextPolicy::Fault)]);
    let error = table.parse(MemoryBudget::UNLIMITED).unwrap_err().to_string();
    assert_eq!(error, "byte 10: column 1 has \"x\", not a number");
}

#[test]
fn unfinished_last_line_is_described() {
    let two = || {
        vec![
            scalar(NumberKind::Real, TextPolicy::Fault),
            scalar(NumberKind::Real, TextPolicy::Fault),
        ]
    };
    let error = |text: &str| {
        let table = columns(text.as_bytes(), WORDS, two());
        table.parse(MemoryBudget::UNLIMITED).unwrap_err().to_string()
    };
    let cut = "the file is cut short, perhaps still being written";
    assert_eq!(error("1 2\n3"), format!("byte 4: line has 1 of 2 columns: {cut}"));
    assert_eq!(error("1 2\n3 -"), format!("byte 6: column 2 has \"-\", not a number: {cut}"));
    assert_eq!(error("1\n3 4\n"), "byte 0: line has 1 of 2 columns");
    assert_eq!(error("1 2 3\n"), "byte 4: line has more than 2 columns");
}

#[test]
fn cells_are_trimmed_and_unquoted() {
    let split = |line: &'static str, separator| {
        let found: Vec<_> = cells(line.as_bytes(), separator)
            .map(|c| (c.at, std::str::from_utf8(c.text).unwrap()))
            .collect();
        found
    };
    assert_eq!(split(" a ; b;;", b';'), [(1, "a"), (5, "b"), (7, ""), (8, "")]);
    assert_eq!(split(r#""x, y" ,"z",1"#, b','), [(1, "x, y"), (9, "z"), (12, "1")]);
    assert_eq!(split(r#""a""b",c"#, b','), [(1, r#"a""b"#), (7, "c")]);
    assert_eq!(split(r#""open,c"#, b','), [(0, r#""open"#), (6, "c")]);
    assert_eq!(split("a\t b\t", b'\t'), [(0, "a"), (3, "b"), (5, "")]);
    assert_eq!(split("", b','), [(0, "")]);
}

#[test]
fn empty_cells_are_nan_and_commas_may_be_points() {
    let dialect = Dialect {
        separator: Separator::Byte(b';'),
        decimal: Decimal::Comma,
        comments: Comments::HashOrSlashes,
        surplus: ExtraCells::Empty,
    };
    let targets = vec![
        scalar(NumberKind::Real, TextPolicy::Fault),
        scalar(NumberKind::WholeIfAll, TextPolicy::LeaveOut),
    ];
    let text = b"# 1;2\n1,5;2;\n // 3\n;3;;\n";
    let values = columns(text, dialect, targets).parse(MemoryBudget::UNLIMITED).unwrap();
    let [ColumnValues::Real(a), b] = &values[..] else { panic!("{values:?}") };
    assert!(a[0] == 1.5 && a[1].is_nan() && a.len() == 2);
    assert_eq!(b.clone().into_data(), Some(AttributeData::I64(vec![2, 3])));
}
