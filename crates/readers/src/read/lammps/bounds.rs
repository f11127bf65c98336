//! The simulation box, which scaled positions are fractions of.

use glam::DVec3;

use crate::read::text::{self, Line};
use spherule_frame::{ParseError, SimulationCell};

/// A corner and the three edges that meet there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bounds {
    corner: DVec3,
    edges: [DVec3; 3],
}

/// One of the three lines after `ITEM: BOX BOUNDS`.
#[derive(Debug)]
pub(super) struct Axis {
    at: usize,
    /// None if something else is among them.
    numbers: Vec<f64>,
}

impl Axis {
    /// The numbers of `line`.
    pub(super) fn parse(line: Line<'_>) -> Self {
        // One more than allowed is enough to decide.
        let numbers: Option<Vec<f64>> = text::words(line.text).take(5).map(text::number).collect();
        Self { at: line.at, numbers: numbers.unwrap_or_default() }
    }
}

/// The flags of the boundaries on a line such as `ITEM: BOX BOUNDS xy xz yz pp pp ff`.
pub(super) fn boundary_flags(line: &[u8]) -> Vec<&[u8]> {
    let words = text::words(line).skip(3);
    let is_flag = |word: &&[u8]| word.len() == 2 && word.iter().all(|b| b"pfsm".contains(b));
    words.filter(is_flag).take(3).collect()
}

/// Whether the boundaries are periodic, by such a line. Without flags, all are, as is the default of LAMMPS.
pub(super) fn periodic_axes(line: &[u8]) -> [bool; 3] {
    let flags = boundary_flags(line);
    [0, 1, 2].map(|axis| flags.get(axis).is_none_or(|flag| flag.contains(&b'p')))
}

impl Bounds {
    /// Takes the three lines after `ITEM: BOX BOUNDS`: `lo hi` for an orthogonal box, `lo hi tilt`
    /// for a triclinic one, an edge and a coordinate of the corner for a general triclinic one. The
    /// number of values distinguishes them, since not all programs write the flags.
    pub(super) fn new(axes: [Axis; 3]) -> Result<Self, ParseError> {
        let [x, y, z] = axes.each_ref().map(|axis| &axis.numbers);
        match (&x[..], &y[..], &z[..]) {
            (&[xlo, xhi], &[ylo, yhi], &[zlo, zhi]) => {
                Ok(Self::triclinic(DVec3::new(xlo, ylo, zlo), DVec3::new(xhi, yhi, zhi), [0.0; 3]))
            }
            (&[xlo, xhi, xy], &[ylo, yhi, xz], &[zlo, zhi, yz]) => Ok(Self::triclinic(
                DVec3::new(xlo, ylo, zlo),
                DVec3::new(xhi, yhi, zhi),
                [xy, xz, yz],
            )),
            (&[ax, ay, az, ox], &[bx, by, bz, oy], &[cx, cy, cz, oz]) => Ok(Self {
                corner: DVec3::new(ox, oy, oz),
                edges: [DVec3::new(ax, ay, az), DVec3::new(bx, by, bz), DVec3::new(cx, cy, cz)],
            }),
            _ => {
                let what = "box bounds are 3 lines of 2, 3 or 4 numbers each";
                let counts = [x.len(), y.len(), z.len()];
                let wrong =
                    counts.iter().position(|count| !(2..=4).contains(count) || *count != counts[0]);
                Err(ParseError::malformed(axes[wrong.unwrap_or(0)].at, what))
            }
        }
    }

    /// `lo` and `hi` are those of the axis-parallel box around the tilted one, tilt factors are xy, xz and yz.
    pub(super) fn triclinic(lo: DVec3, hi: DVec3, [xy, xz, yz]: [f64; 3]) -> Self {
        let shifts = [0.0, xy, xz, xy + xz];
        let lowest = |shifts: &[f64]| shifts.iter().copied().fold(0.0, f64::min);
        let highest = |shifts: &[f64]| shifts.iter().copied().fold(0.0, f64::max);
        let corner = lo - DVec3::new(lowest(&shifts), lowest(&[yz]), 0.0);
        let far = hi - DVec3::new(highest(&shifts), highest(&[yz]), 0.0);
        let size = far - corner;
        Self {
            corner,
            edges: [
                DVec3::new(size.x, 0.0, 0.0),
                DVec3::new(xy, size.y, 0.0),
                DVec3::new(xz, yz, size.z),
            ],
        }
    }

    /// The cell.
    pub(super) fn cell(&self, periodic: [bool; 3]) -> Option<SimulationCell> {
        SimulationCell::new(self.corner, self.edges, periodic)
    }

    /// The position of the fractions `scaled`.
    pub(super) fn place(&self, scaled: DVec3) -> DVec3 {
        let [a, b, c] = self.edges;
        self.corner + scaled.x * a + scaled.y * b + scaled.z * c
    }
}
