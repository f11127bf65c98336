//! Grains of styles: their orientations and sizes from the columns of a frame.

use glam::Vec3;
use spherule_formats::Radius;
use spherule_frame::grain_columns::{GrainColumns, GrainNames};

use super::SharedFrame;
use super::load_error::LoadError;
use super::setup::{GrainRules, Setup, StyleForm};
use super::styles::{StyleParticles, StyleRanges};
use crate::manifest::GrainKind;
use crate::surface::grains::{
    GrainError, GrainMotion, GrainReport, GrainShape, GrainSizes, GrainTree, Grains,
};

/// The exponents of ellipsoids.
const ROUND: [f32; 2] = [2.0; 2];

/// The shapes of the grains of a style.
#[derive(Debug, Default)]
pub(super) struct FrameGrains {
    /// The style.
    pub(super) style: usize,
    shape: GrainShape,
    /// Quaternions x, y, z, w; empty without columns.
    orientations: Vec<[f32; 4]>,
    /// Semi-axes; empty without columns.
    sizes: Vec<[f32; 3]>,
    /// Semi-axes of all grains.
    size: Option<Vec3>,
    /// Exponents of superquadrics; empty without columns.
    exponents: Vec<[f32; 2]>,
}

/// The grains of all styles of a frame, which was read from a file and has this number. Notes which columns they have.
///
/// # Errors
/// The frame lacks a column that is named.
pub(super) fn grains_of(
    setup: &Setup,
    (frame, ranges): (&SharedFrame<'_>, &StyleRanges),
    (number, file): (i64, &str),
    notes: &mut Vec<String>,
) -> Result<Vec<FrameGrains>, LoadError> {
    let mut all = Vec::new();
    for (index, style) in setup.picture.particles.styles.iter().enumerate() {
        let range = ranges.of(index);
        let StyleForm::Grains(rules) = &style.form else { continue };
        if range.is_empty() {
            continue;
        }
        // Take the columns of the usual names, and then those that are named
        let usual = GrainColumns::find(&frame.attributes).unwrap_or_default();
        let named = if rules.names == GrainNames::default() {
            GrainColumns::default()
        } else {
            GrainColumns::named(&frame.attributes, &rules.names)
                .map_err(|fault| LoadError::Grains { file: file.to_owned(), fault })?
        };
        let mut used = usual.used;
        used.extend(named.used);
        notes.push(match &used[..] {
            [] => format!(
                "frame {number}: no columns have orientations or sizes of the grains of style `{}`; they are drawn upright",
                style.name
            ),
            used => format!("frame {number}: grains of style `{}` by {}", style.name, used.join(", ")),
        });
        fn pick<T: Copy>(own: &[T], usual: &[T], range: &std::ops::Range<usize>) -> Vec<T> {
            let all = if own.is_empty() { usual } else { own };
            all.get(range.clone()).map(<[T]>::to_vec).unwrap_or_default()
        }
        let exponents = pick(
            &named.exponents.unwrap_or_default(),
            &usual.exponents.unwrap_or_default(),
            &range,
        );
        all.push(FrameGrains {
            style: index,
            shape: shape_of(rules, !exponents.is_empty()),
            orientations: pick(&named.orientations, &usual.orientations, &range),
            sizes: pick(&named.sizes, &usual.sizes, &range),
            size: rules.size,
            exponents: if rules.exponents.is_some() { Vec::new() } else { exponents },
        });
    }
    Ok(all)
}

/// The shape of grains; `has_exponents`: their columns have exponents.
fn shape_of(rules: &GrainRules, has_exponents: bool) -> GrainShape {
    let usual = match (rules.exponents, has_exponents) {
        (None, false) => GrainKind::Ellipsoid,
        _ => GrainKind::Superquadric,
    };
    match rules.kind.unwrap_or(usual) {
        GrainKind::Ellipsoid => GrainShape::Ellipsoid,
        GrainKind::Superquadric => {
            GrainShape::Superquadric { exponents: rules.exponents.unwrap_or(ROUND) }
        }
        GrainKind::Capsule => GrainShape::Capsule,
        GrainKind::Cylinder => GrainShape::Cylinder,
        GrainKind::Cuboid => GrainShape::Cuboid,
    }
}

impl FrameGrains {
    /// The tree of the grains at the places of `own`, which move by `displacements` while the shutter is open.
    ///
    /// # Errors
    /// There are too many.
    pub(super) fn tree(
        self,
        own: &StyleParticles,
        displacements: Option<&[Vec3]>,
    ) -> Result<GrainTree, GrainError> {
        // Without a size, it is the radius
        let radii: Vec<[f32; 3]> = match &own.radius {
            Radius::PerParticle(radii) => radii.iter().map(|radius| [*radius; 3]).collect(),
            Radius::Common(_) => Vec::new(),
        };
        let sizes = match (self.size, &self.sizes[..], &own.radius) {
            (Some(size), ..) => GrainSizes::Common(size),
            (None, [], Radius::Common(radius)) => GrainSizes::Common(Vec3::splat(*radius)),
            (None, [], Radius::PerParticle(_)) => GrainSizes::Each(&radii),
            (None, sizes, _) => GrainSizes::Each(sizes),
        };
        let rotations = vec![Vec3::ZERO; displacements.map_or(0, <[Vec3]>::len)];
        let motion =
            displacements.map(|displacements| GrainMotion { displacements, rotations: &rotations });
        let exponents = match self.shape {
            GrainShape::Superquadric { .. } => &self.exponents[..],
            _ => &[],
        };
        let grains = Grains {
            orientations: &self.orientations,
            exponents,
            motion,
            ..Grains::new(&own.centers, sizes)
        };
        GrainTree::new(&grains, self.shape)
    }
}

/// What was wrong with the grains of a style.
pub(super) fn report_notes(style: &str, report: &GrainReport) -> Vec<String> {
    let counts = [
        (report.not_normalised, "with a quaternion of another length than 1, which is normalised"),
        (report.no_orientation, "without an orientation, drawn upright"),
        (report.bad_sizes, "left out: a semi-axis is not above 0"),
        (report.bad_centers, "left out: a coordinate is not finite or too far away"),
        (report.bad_exponents, "with an exponent below 1, drawn as ellipsoids"),
        (report.bad_motions, "with a motion that is not finite, drawn at rest"),
    ];
    let counted = counts.into_iter().filter(|(count, _)| *count > 0);
    counted.map(|(count, what)| format!("style `{style}`: {count} grains {what}")).collect()
}
