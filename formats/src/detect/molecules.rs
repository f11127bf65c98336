//! Text formats of molecular simulations that are not read, recognised by the structure of their lines.

const LAMMPS_DATA: &str = "a LAMMPS data file, which is the start of a simulation and is not read; write a dump from it \
                           (`write_dump all custom out.dump id type x y z`)";
const GRO: &str =
    "a GROMACS .gro file, which is not read; write .xyz with MDAnalysis, VMD or OVITO";
const PROTEIN: &str =
    "a Protein Data Bank file, which is not read; write .xyz with Open Babel, MDAnalysis or OVITO";
const CIF: &str = "a CIF file, which is not read; write .xyz with Open Babel, ASE or OVITO";

/// The message for `head`, the beginning of a file, if that is one of them.
pub(super) fn what(head: &[u8]) -> Option<&'static str> {
    let lines: Vec<&[u8]> = head
        .split(|b| *b == b'\n')
        .map(|line| line.strip_suffix(b"\r").unwrap_or(line))
        .collect();
    [
        (is_lammps_data(&lines), LAMMPS_DATA),
        (is_protein(&lines), PROTEIN),
        (is_gro(&lines), GRO),
        (is_cif(&lines), CIF),
    ]
    .into_iter()
    .find_map(|(is_one, what)| is_one.then_some(what))
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

/// Records of 80 columns that begin with their names.
fn is_protein(lines: &[&[u8]]) -> bool {
    const OPENINGS: [&[u8]; 9] = [
        b"HEADER", b"TITLE ", b"REMARK", b"CRYST1", b"COMPND", b"MODEL ", b"ATOM  ", b"HETATM",
        b"EXPDTA",
    ];
    let begins = |line: &&[u8], names: &[&[u8]]| names.iter().any(|n| line.starts_with(n));
    let is_atom = |line: &&[u8]| {
        let number = line.get(30..38).map(<[u8]>::trim_ascii);
        begins(line, &[b"ATOM  ", b"HETATM"]) && number.is_some_and(is_number)
    };
    lines.first().is_some_and(|line| begins(line, &OPENINGS))
        && (lines.iter().any(is_atom)
            || lines.first().is_some_and(|l| l.starts_with(b"HEADER    ")))
}

/// A title, a count, and atoms in fixed columns: residue, names, number, and positions of 8 columns each.
fn is_gro(lines: &[&[u8]]) -> bool {
    let [title, count, atom, ..] = lines else {
        return false;
    };
    let field = |range: std::ops::Range<usize>| atom.get(range).map(<[u8]>::trim_ascii);
    let numbers = [field(20..28), field(28..36), field(36..44)];
    !is_count(title.trim_ascii())
        && is_count(count.trim_ascii())
        && field(0..5).is_some_and(is_count)
        && field(15..20).is_some_and(is_count)
        && numbers.into_iter().all(|n| n.is_some_and(is_number))
}

fn is_cif(lines: &[&[u8]]) -> bool {
    let mut lines = lines
        .iter()
        .filter(|line| !line.is_empty() && !line.starts_with(b"#"));
    let opens = lines.next().is_some_and(|line| line.starts_with(b"data_"));
    opens && lines.any(|line| line.starts_with(b"_"))
}

fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace)
        .filter(|w| !w.is_empty())
}

fn is_count(word: &[u8]) -> bool {
    !word.is_empty() && word.iter().all(u8::is_ascii_digit)
}

fn is_number(word: &[u8]) -> bool {
    std::str::from_utf8(word).is_ok_and(|word| word.parse::<f64>().is_ok())
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
        suggests(
            "MD of 2 waters, t= 0.0\n    6\n    1WATER  OW1    1   0.126   1.624   1.679  0.1227 -0.0580  0.0434\n",
            "GROMACS",
        );
        suggests(
            "CRYST1   10.000   10.000   10.000  90.00  90.00  90.00 P 1           1\n\
             ATOM      1  N   ALA A   1      11.104   6.134  -6.504  1.00  0.00           N\n",
            "Protein Data Bank",
        );
        suggests(
            "HEADER    HYDROLASE                               09-MAY-83   1LYZ\n",
            "Protein Data Bank",
        );
        suggests("data_1ABC\n#\n_entry.id 1ABC\n", "CIF");
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
