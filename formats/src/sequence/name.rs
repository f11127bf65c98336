//! File names taken apart: literal text, numbers, extension.
//!
//! `-` is a sign where a separator or nothing comes before it (`frame_-5`, `smoke.-0012`), else a
//! separator (`frame-5`).

use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::read::sniff::is_digits;
use spherule_readers::compression::strip_extension;

/// A file name, split so that names of one sequence differ in `numbers` only.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct FileName {
    /// The file.
    pub path: PathBuf,
    /// Text around the numbers, one more than there are numbers; without the extension.
    pub literals: Vec<String>,
    /// The runs of digits with their signs, in order.
    pub numbers: Vec<i64>,
    /// The same as written.
    digits: Vec<String>,
    /// Which of `numbers` a pattern's `#` stands for.
    pub frame_column: Option<usize>,
    /// Lower case, without dot and the extension of a compression; empty if there is none.
    pub extension: String,
    /// As written, dot and the extension of a compression included.
    suffix: String,
    /// Number of a file among those of one step, see [`Self::split_piece`].
    pub piece: Option<i64>,
}

impl FileName {
    /// Splits the name of `path`; `frame` is the byte range that a pattern says is the number.
    pub(super) fn parse(path: &Path, frame: Option<Range<usize>>) -> Self {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let stem_len = stem_len(&name);
        // Separate the extension, with that of a compression
        let (stem, suffix) = name.split_at(stem_len);
        let extension =
            strip_extension(&suffix.to_ascii_lowercase()).trim_start_matches('.').to_owned();
        // Divide the rest into text and numbers
        let mut parts = Splitter::default();
        let mut frame_column = None;
        match frame.filter(|range| range.end <= stem_len) {
            Some(range) => {
                parts.split(&stem[..range.start]);
                frame_column = Some(parts.numbers.len());
                // Too long for a number: then it is text, and no frame number.
                if !parts.push_number(&stem[range.clone()]) {
                    frame_column = None;
                }
                parts.split(&stem[range.end..]);
            }
            None => parts.split(stem),
        }
        parts.literals.push(parts.literal);
        Self {
            path: path.to_owned(),
            literals: parts.literals,
            numbers: parts.numbers,
            digits: parts.digits,
            frame_column,
            extension,
            suffix: suffix.to_owned(),
            piece: None,
        }
    }

    /// Whether the name ends with a number between dots, as `snap_010.3.hdf5`.
    pub(super) fn may_be_piece(&self) -> bool {
        let column = self.numbers.len().checked_sub(1);
        let is_free = column.is_some() && self.frame_column != column;
        self.is_snapshot()
            && is_free
            && matches!(self.literals.as_slice(), [.., dot, end] if dot == "." && end.is_empty())
    }

    /// Makes the last number that of a file among those of one step.
    pub(super) fn split_piece(&mut self) {
        if !self.may_be_piece() {
            return;
        }
        self.piece = self.numbers.pop();
        self.digits.pop();
        self.literals.pop();
        if let Some(end) = self.literals.last_mut() {
            end.push('*');
        }
    }

    /// The path of the file `number` among those of one step, if this is the name of the whole: `snap_010.3.hdf5` of
    /// `snap_010.hdf5`.
    pub(super) fn piece_path(&self, number: i64) -> Option<PathBuf> {
        if !self.is_snapshot() || self.piece.is_some() {
            return None;
        }
        let name = self.path.file_name()?.to_str()?;
        let stem = name.strip_suffix(&self.suffix)?;
        let suffix = &self.suffix;
        Some(self.path.with_file_name(format!("{stem}.{number}{suffix}")))
    }

    /// The name of that file.
    pub(super) fn piece(&self, number: i64) -> Option<Self> {
        let mut piece = self.clone();
        piece.path = self.piece_path(number)?;
        piece.piece = Some(number);
        piece.literals.last_mut()?.push_str(".*");
        Some(piece)
    }

    /// The path of file `number` of the step to which this file belongs.
    pub(super) fn sibling_piece(&self, number: u64) -> Option<PathBuf> {
        self.piece?;
        let name = self.path.file_name()?.to_str()?;
        let (stem, digits) = name.strip_suffix(&self.suffix)?.rsplit_once('.')?;
        // Numbers have a fixed width if one begins with 0
        let width = if digits.starts_with('0') { digits.len() } else { 1 };
        Some(self.path.with_file_name(format!("{stem}.{number:0width$}{}", self.suffix)))
    }

    /// Whether files with such a name may belong to one step. Binary snapshots have no extension.
    fn is_snapshot(&self) -> bool {
        ["hdf5", "h5", ""].contains(&self.extension.as_str())
    }

    /// The number of a file that has no siblings: what follows the word `frame`, else the last.
    pub(super) fn lone_column(&self) -> Option<usize> {
        let after_frame = self.literals.iter().take(self.numbers.len()).position(|l| {
            let literal = l.to_ascii_lowercase();
            literal.trim_end_matches(['_', '-', '.', ' ']).ends_with("frame")
        });
        self.frame_column.or(after_frame).or(self.numbers.len().checked_sub(1))
    }

    /// A pattern for names like this one: `#` for column `frame`, `*` for the columns in `free`,
    /// the numbers of this name elsewhere.
    pub(super) fn pattern(&self, frame: Option<usize>, free: &[usize]) -> String {
        let mut text = String::new();
        for (column, literal) in self.literals.iter().enumerate() {
            text += literal;
            match self.digits.get(column) {
                Some(_) if Some(column) == frame => text.push('#'),
                Some(_) if free.contains(&column) => text.push('*'),
                Some(digits) => text += digits,
                None => {}
            }
        }
        text + &self.suffix
    }
}

/// Length of a file name without its extension and that of a compression. Digits are no extension (`dump.250`).
fn stem_len(name: &str) -> usize {
    let lower = name.to_ascii_lowercase();
    let plain = strip_extension(&lower);
    match plain.rsplit_once('.') {
        Some((stem, extension)) if !stem.is_empty() && !is_digits(extension) => stem.len(),
        _ => plain.len(),
    }
}

/// Whether a `-` after `text` is a sign, if digits come next.
pub(super) fn sign_may_follow(text: &str) -> bool {
    text.is_empty() || text.ends_with(['_', '.', ' '])
}

#[derive(Default)]
struct Splitter {
    literals: Vec<String>,
    numbers: Vec<i64>,
    digits: Vec<String>,
    literal: String,
}

impl Splitter {
    fn split(&mut self, mut text: &str) {
        while !text.is_empty() {
            let plain = text.find(|c: char| c.is_ascii_digit()).unwrap_or(text.len());
            self.literal += &text[..plain];
            text = &text[plain..];
            let digits = text.bytes().take_while(u8::is_ascii_digit).count();
            if digits > 0 && self.ends_in_sign() {
                self.literal.pop();
                self.push_number(&format!("-{}", &text[..digits]));
            } else if digits > 0 {
                self.push_number(&text[..digits]);
            }
            text = &text[digits..];
        }
    }

    fn ends_in_sign(&self) -> bool {
        let before = self.literal.strip_suffix('-');
        before.is_some_and(|b| sign_may_follow(b) && (self.numbers.is_empty() || !b.is_empty()))
    }

    /// Digits beyond i64 (hashes, time stamps in nanoseconds) stay text: false.
    fn push_number(&mut self, digits: &str) -> bool {
        match digits.parse() {
            Ok(number) => {
                self.numbers.push(number);
                self.digits.push(digits.to_owned());
                self.literals.push(std::mem::take(&mut self.literal));
                true
            }
            Err(_) => {
                self.literal += digits;
                false
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(name: &str) -> FileName {
        FileName::parse(Path::new(name), None)
    }

    #[test]
    fn names_are_split_at_numbers() {
        let name = parse("x/dam_break_frame_23_24389_particles.bgeo");
        assert_eq!(name.literals, ["dam_break_frame_", "_", "_particles"]);
        assert_eq!(name.numbers, [23, 24389]);
        assert_eq!(name.extension, "bgeo");
        assert_eq!(name.lone_column(), Some(0));
        assert_eq!(name.pattern(Some(0), &[1]), "dam_break_frame_#_*_particles.bgeo");
    }

    #[test]
    fn double_extensions_and_none() {
        let gz = parse("dump.drop.1200.lammps.gz");
        assert_eq!((gz.numbers.as_slice(), gz.extension.as_str()), (&[1200][..], "lammps"));
        assert_eq!(gz.pattern(Some(0), &[]), "dump.drop.#.lammps.gz");
        let bare = parse("dump.250");
        assert_eq!((bare.numbers.as_slice(), bare.extension.as_str()), (&[250][..], ""));
        let long = parse("a99999999999999999999_7.vtk");
        assert_eq!((long.literals.len(), long.numbers.as_slice()), (2, &[7][..]));
    }

    #[test]
    fn a_minus_is_a_sign_only_after_a_separator() {
        for (text, numbers, pattern) in [
            ("s_-5.vtk", [-5].as_slice(), "s_#.vtk"),
            ("s.-0012.vtk", &[-12], "s.#.vtk"),
            ("-7.vtk", &[-7], "#.vtk"),
            ("s-5.vtk", &[5], "s-#.vtk"),
            ("2024-11-05.vtk", &[2024, 11, 5], "#-11-05.vtk"),
            ("s_--5.vtk", &[5], "s_--#.vtk"),
        ] {
            let name = parse(text);
            assert_eq!(name.numbers, numbers, "{text}");
            assert_eq!(name.pattern(Some(0), &[]), pattern, "{text}");
        }
    }

    #[test]
    fn a_pattern_may_cut_a_run_of_digits() {
        let name = FileName::parse(Path::new("x17.vtk"), Some(2..3));
        assert_eq!(name.pattern(Some(1), &[]), "x1#.vtk");
        assert_eq!((name.numbers, name.frame_column), (vec![1, 7], Some(1)));
    }
}
