//! The comment line of molecular text: the `key=value` pairs of extended XYZ, and the step that
//! LAMMPS writes there.

use glam::DVec3;

use crate::read::text;
use spherule_frame::SimulationCell;

/// The value of `key` (any case) in the `key=value` pairs of `comment`. Values may be in quotes or
/// braces and have blanks then.
pub(super) fn value<'a>(comment: &'a [u8], key: &str) -> Option<&'a [u8]> {
    let mut rest = comment;
    let mut open = Unclosed::default();
    loop {
        rest = rest.trim_ascii_start();
        if rest.is_empty() {
            return None;
        }
        let (name, after) = item(rest, b"=", &mut open);
        let Some(after) = after.trim_ascii_start().strip_prefix(b"=") else {
            rest = after; // a word without a value
            continue;
        };
        let (found, after) = item(after.trim_ascii_start(), b"", &mut open);
        if name.eq_ignore_ascii_case(key.as_bytes()) {
            return Some(found);
        }
        rest = after;
    }
}

/// Closing characters that were looked for in vain. They are not looked for again, since a line may have as
/// many openings as it has room for.
#[derive(Default)]
struct Unclosed(Vec<u8>);

impl Unclosed {
    /// Where the item that `text` begins with ends, see [`closed_at`].
    fn end(&mut self, text: &[u8], closing: u8) -> Option<usize> {
        if self.0.contains(&closing) {
            return None;
        }
        let end = closed_at(text, closing);
        if end.is_none() {
            self.0.push(closing);
        }
        end
    }
}

/// The quoted or bare item that `text` begins with, and what follows. A bare one ends at a blank
/// or at one of `ends`, and takes at least one byte.
fn item<'a>(text: &'a [u8], ends: &[u8], open: &mut Unclosed) -> (&'a [u8], &'a [u8]) {
    let closing = match text.first() {
        Some(b'"') => Some(b'"'),
        Some(b'\'') => Some(b'\''),
        Some(b'{') => Some(b'}'),
        Some(b'[') => Some(b']'),
        _ => None,
    };
    if let Some(closing) = closing
        && let Some(end) = open.end(text, closing)
    {
        return (&text[1..end], &text[end + 1..]);
    }
    let end =
        text.iter().position(|b| b.is_ascii_whitespace() || ends.contains(b)).unwrap_or(text.len());
    // A stray `=` must not stop the walk.
    let next = end.max(usize::from(end == 0 && !ends.is_empty()));
    (&text[..end], &text[next.min(text.len())..])
}

/// Where the item that begins at 0 ends; a backslash protects what follows it.
fn closed_at(text: &[u8], closing: u8) -> Option<usize> {
    let mut at = 1;
    while let Some(byte) = text.get(at) {
        match byte {
            b'\\' => at += 2,
            b if *b == closing => return Some(at),
            _ => at += 1,
        }
    }
    None
}

/// The simulation cell of extended XYZ: `Lattice`, with the edges one after the other, `Origin` (zero by default) and
/// `pbc` (periodic by default).
pub(super) fn cell(comment: &[u8]) -> Option<SimulationCell> {
    let lattice = value(comment, "Lattice").or_else(|| value(comment, "Cell"))?;
    let vectors: [DVec3; 3] = numbers::<9>(lattice)?
        .chunks_exact(3)
        .map(DVec3::from_slice)
        .collect::<Vec<_>>()
        .try_into()
        .ok()?;
    let origin = value(comment, "Origin")
        .or_else(|| value(comment, "cell_origin"))
        .and_then(numbers::<3>)
        .unwrap_or_default();
    let flags = value(comment, "pbc").map(|flags| text::words(flags).collect::<Vec<_>>());
    let is_periodic = |axis: usize| {
        let flag = flags.as_ref().and_then(|flags| flags.get(axis)?.first());
        flag.is_none_or(|flag| matches!(flag, b'T' | b't' | b'1'))
    };
    let periodic = [0, 1, 2].map(is_periodic);
    SimulationCell::new(DVec3::from_array(origin), vectors, periodic)
}

/// `N` numbers in `text`, if there are exactly so many.
fn numbers<const N: usize>(text: &[u8]) -> Option<[f64; N]> {
    let words = text::words(text).take(N + 1).map(text::number);
    words.collect::<Option<Vec<f64>>>()?.try_into().ok()
}

/// The number in `Atoms. Timestep: 1000`, as LAMMPS' `dump xyz` writes it.
pub(super) fn lammps_step(comment: &[u8]) -> Option<&[u8]> {
    let comment = comment.trim_ascii();
    let rest = comment.strip_prefix(b"Atoms.")?.trim_ascii_start();
    Some(rest.strip_prefix(b"Timestep:")?.trim_ascii())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_by_key() {
        let comment = br#"Lattice="5 0 0  0 5 0  0 0 5" energy = -1.5 flag pbc='T T F' v={1 2} note="say \"x=1\"" Time=0.5"#;
        let text = |key| value(comment, key).map(|v| std::str::from_utf8(v).unwrap());
        assert_eq!(text("lattice"), Some("5 0 0  0 5 0  0 0 5"));
        assert_eq!(text("energy"), Some("-1.5"));
        assert_eq!(text("pbc"), Some("T T F"));
        assert_eq!(text("v"), Some("1 2"));
        assert_eq!(text("time"), Some("0.5"));
        assert_eq!(text("flag"), None);
        assert_eq!(text("x"), None);
    }

    #[test]
    fn cells_of_extended_xyz() {
        let found = cell(br#"Lattice="5 0 0 1 4 0 0.5 0 3" Origin="-1 2 3" pbc="T F T""#).unwrap();
        assert_eq!(found.origin, DVec3::new(-1.0, 2.0, 3.0));
        let vectors = [[5.0, 0.0, 0.0], [1.0, 4.0, 0.0], [0.5, 0.0, 3.0]];
        assert_eq!(found.vectors, vectors.map(DVec3::from_array));
        assert_eq!(found.periodic, [true, false, true]);
        let plain = cell(b"Lattice='1 0 0 0 1 0 0 0 1'").unwrap();
        assert_eq!((plain.origin, plain.periodic), (DVec3::ZERO, [true; 3]));
        for bad in [
            "Lattice=\"1 0 0 0 1 0 0 0\"",
            "Lattice=\"1 0 0 0 1 0 0 0 1 0\"",
            "Lattice=\"1 0 0 0 x 0 0 0 1\"",
            "Lattice=\"0 0 0 0 0 0 0 0 0\"",
            "Lattice=\"nan 0 0 0 1 0 0 0 1\"",
            "none",
        ] {
            assert_eq!(cell(bad.as_bytes()), None, "{bad}");
        }
    }

    #[test]
    fn unusual_comments_end() {
        for comment in ["", "=", "= =", "a=", "\"", "a=\"b", "==a=1", "{", "a = ", "'", "\\"] {
            assert_eq!(value(comment.as_bytes(), "nothing"), None, "{comment}");
        }
    }

    #[test]
    fn nested_comment_openings_take_linear_time() {
        // Looked through from each of them, these would take hours.
        for openings in ["{ ", "\" ", "a={ ", "[ ' "] {
            let comment = openings.repeat(1 << 20);
            assert_eq!(value(comment.as_bytes(), "nothing"), None);
        }
    }

    #[test]
    fn step_of_lammps() {
        let found = lammps_step(b"Atoms. Timestep: 1200");
        assert_eq!(found, Some(&b"1200"[..]));
        assert_eq!(lammps_step(b"Atoms"), None);
    }
}
