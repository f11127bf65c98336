//! LAMMPS data files, which are not read, recognised by the structure of their lines.

const LAMMPS_DATA: &str = "a LAMMPS data file, which is the start of a simulation and is not read; write a dump from it \
                           (`write_dump all custom out.dump id type x y z`)";

/// The message for `head`, the beginning of a file, if that is one of them.
pub(super) fn what(head: &[u8]) -> Option<&'static str> {
    let lines: Vec<&[u8]> = head
        .split(|b| *b == b'\n')
        .map(|line| line.strip_suffix(b"\r").unwrap_or(line))
        .collect();
    is_lammps_data(&lines).then_some(LAMMPS_DATA)
}

/// A title, counts as `12 atoms`, and the box as `0 1 xlo xhi` or counts of types.
fn is_lammps_data(lines: &[&[u8]]) -> bool {
    let signed = |line: &&[u8]| line.starts_with(b"LAMMPS data file");
    let (mut atoms, mut others) = (false, false);
    // The first line is free text.
    for line in lines.iter().skip(1) {
        let code = line.split(|b| *b == b'#').next().unwrap_or_default();
        let words: Vec<&[u8]> = words(code).take(5).collect();
        match words.as_slice() {
            [count, b"atoms"] => atoms |= is_count(count),
            [count, b"atom", b"types"] => others |= is_count(count),
            [_, _, b"xlo", b"xhi"] => others = true,
            _ => {}
        }
    }
    (atoms && others) || (lines.first().is_some_and(signed) && (atoms || others))
}

fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace)
        .filter(|w| !w.is_empty())
}

fn is_count(word: &[u8]) -> bool {
    !word.is_empty() && word.iter().all(u8::is_ascii_digit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn suggests(text: &str, hint: &str) {
        let what = what(text.as_bytes()).expect("known");
        assert!(what.contains(hint), "{what}");
        let crlf = text.replace('\n', "\r\n");
        assert_eq!(super::what(crlf.as_bytes()), Some(what));
    }

    #[test]
    fn formats_are_recognised_by_their_lines() {
        suggests(
            "LAMMPS data file via write_data, version 2 Aug 2023\n\n3 atoms\n1 atom types\n\n\
             0 1 xlo xhi\n0 1 ylo yhi\n0 1 zlo zhi\n\nAtoms # atomic\n\n1 1 0 0 0\n",
            "write_dump",
        );
        suggests(
            "# made by hand\n\n  3  atoms # all\n-1 1.5 xlo xhi\n",
            "LAMMPS data",
        );
    }

    #[test]
    fn particle_text_is_not_misrecognised() {
        for text in [
            "x,y,z\n0,1,2\n",
            "3\n\nH 0 0 0\n",
            "title\n3\n0 0 0\n",
            "atoms\n3 atoms here\n",
            "ATOM,x,y,z\n1,0,0,0\n",
            "",
        ] {
            assert_eq!(what(text.as_bytes()), None, "{text}");
        }
    }
}
