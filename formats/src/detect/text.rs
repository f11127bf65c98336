//! Text formats that are known but not read, recognised by the structure of their first lines.

use crate::read::{prmtop, psf};

/// The first lines of a file.
type Lines<'a> = [&'a [u8]];

/// How a format is recognised, and what to do with its files.
type TextFormat = (fn(&Lines<'_>) -> bool, &'static str);

const FORMATS: &[TextFormat] = &[
    (
        |lines| lines.first() == Some(&&b"---"[..]) && begins(lines, b"creator: LAMMPS"),
        "a LAMMPS dump in YAML, which is not read; use `dump custom`",
    ),
    (
        |lines| first(lines, psf::is_psf),
        "a topology (PSF), which has no positions; give it with --topology beside a file with coordinates",
    ),
    (
        |lines| begins(lines, b"Number of particles ="),
        "an AtomEye configuration (.cfg), which is not read; write a LAMMPS dump or extended XYZ with OVITO",
    ),
];

const PRMTOP: &str = "an AMBER topology (prmtop), which has no positions; give it with --topology beside a file with \
                      coordinates";

/// The message for `head`, the beginning of a file, if that is one of the formats.
pub(super) fn what(head: &[u8]) -> Option<&'static str> {
    let lines: Vec<&[u8]> =
        head.split(|b| *b == b'\n').map(|line| line.strip_suffix(b"\r").unwrap_or(line)).collect();
    if prmtop::is_prmtop(head) {
        return Some(PRMTOP);
    }
    FORMATS.iter().find(|(is_one, _)| is_one(&lines)).map(|(_, what)| *what)
}

fn first(lines: &Lines<'_>, is_one: impl Fn(&[u8]) -> bool) -> bool {
    lines.first().is_some_and(|line| is_one(line))
}

/// Whether a line begins with `start`.
fn begins(lines: &Lines<'_>, start: &[u8]) -> bool {
    lines.iter().any(|line| line.starts_with(start))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// Whatever the name, the file is refused with `hint`.
    #[track_caller]
    fn suggests(text: &str, hint: &str) {
        let crlf = text.replace('\n', "\r\n");
        for text in [text, &crlf] {
            for name in ["a", "a.xyz", "a.csv", "a.txt", "a.pdb"] {
                let error = crate::detect::detect_format(text.as_bytes(), Path::new(name))
                    .expect_err("refused");
                assert!(error.to_string().contains(hint), "{name}: {error}: {text}");
            }
        }
    }

    #[test]
    fn formats_are_recognised_by_their_lines() {
        suggests("---\ncreator: LAMMPS\ntimestep: 0\n", "dump custom");
        suggests("PSF CMAP\n\n 1 !NTITLE\n", "--topology beside");
        suggests("%VERSION  VERSION_STAMP = V0001.000\n%FLAG TITLE\n", "prmtop");
        for before in ["", "\n", "%COMMENT from a script\n"] {
            let section =
                "%FLAG TITLE\n%FORMAT(20a4)\nACE\n%FLAG POINTERS\n%FORMAT(10I8)\n       3       1";
            suggests(&format!("{before}{section}\n"), "prmtop");
        }
        suggests("Number of particles = 2\nA = 1.0 Angstrom\n", "AtomEye");
    }

    #[test]
    fn particle_text_is_not_misrecognised() {
        let row =
            "   1.000  -2.500   3.000   4.000   5.000   6.000   7.000   8.000   9.000  10.000\n";
        for text in [
            "x,y,z\n0,1,2\n",
            "3\n\nH 0 0 0\n",
            "2\ncell\nO 0.1 0.2 0.3 1\nH 1 2 3 1\n",
            "title\n3\n0 0 0\n",
            "atoms\n3 atoms here\n",
            "ATOM,x,y,z\n1,0,0,0\n",
            "x y z a b c d e f g\n 1 2 3 4 5 6 7 8 9 10\n",
            &format!("x y z a b c d e f g\n{row}"),
            &format!("# ten columns\n{row}"),
            &format!("{row}{row}"),
            "ATOM      1  N   ALA A   1      11.104   6.134  -6.504  1.00  0.00           N\n",
            "",
        ] {
            assert_eq!(what(text.as_bytes()), None, "{text}");
        }
    }
}
