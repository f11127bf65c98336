//! Grains of styles: their orientations and sizes from the columns of a frame.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use glam::{DQuat, DVec3, Vec3};
use rayon::prelude::*;
use spherule_formats::Radius;
use spherule_frame::grain_columns::{AngularVelocities, GrainColumns, GrainNames};

use super::SharedFrame;
use super::grain_parts::{GrainPart, parts_by_type};
use super::load_error::LoadError;
use super::setup::{GrainRules, Setup, StyleForm};
use super::shutter::Shutter;
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
    parts: Vec<GrainPart>,
    /// Quaternions x, y, z, w; empty without columns.
    orientations: Vec<[f32; 4]>,
    /// Semi-axes; empty without columns.
    sizes: Vec<[f32; 3]>,
    /// Exponents of superquadrics; empty without columns.
    exponents: Vec<[f32; 2]>,
    /// Angular velocities, radians per unit of time; from [`Self::expose`] on, rotations during the exposure. Empty
    /// without columns and without motion blur.
    turns: Vec<Vec3>,
}

/// The note that says from which columns the grains of a style are.
fn note_of_columns(number: i64, style: &str, of_types: &str, used: &[String]) -> String {
    if used.is_empty() {
        return format!(
            "frame {number}: no columns have orientations or sizes of the grains of style `{style}`; they are drawn upright"
        );
    }
    format!("frame {number}: grains of style `{style}` by {of_types}{}", used.join(", "))
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
        let mut used = usual.used.clone();
        used.extend(named.used.iter().cloned());
        let mut grains = columns_of(rules, (&usual, &named), &range);
        if setup.picture.view.shutter.is_some()
            && let Some(turning) = angular_velocities(rules, frame, file)?
        {
            let own = turning.values.get(range.clone()).unwrap_or_default();
            grains.turns = own.iter().map(|turn| Vec3::from_array(*turn)).collect();
            let used = turning.used.join(", ");
            notes.push(format!("frame {number}: grains of style `{}` turn by {used}", style.name));
        }
        let (parts, of_types) = match frame.shapes.as_ref().filter(|_| rules.is_open()) {
            Some(types) => (parts_by_type(frame, types, range, notes), "the shapes of types, "),
            None => {
                let shape = shape_of(rules, !grains.exponents.is_empty());
                (vec![GrainPart { shape, size: rules.common_size(), members: None }], "")
            }
        };
        notes.push(note_of_columns(number, &style.name, of_types, &used));
        all.push(FrameGrains { style: index, parts, ..grains });
    }
    Ok(all)
}

/// The angular velocities of all particles of a frame; None without columns.
///
/// # Errors
/// The frame lacks a column that is named.
fn angular_velocities(
    rules: &GrainRules,
    frame: &SharedFrame<'_>,
    file: &str,
) -> Result<Option<AngularVelocities>, LoadError> {
    let Some(names) = &rules.names.angular_velocity else {
        return Ok(AngularVelocities::find(&frame.attributes));
    };
    AngularVelocities::named(&frame.attributes, names)
        .map(Some)
        .map_err(|fault| LoadError::Grains { file: file.to_owned(), fault })
}

/// The columns of the grains in `range`: those that are named before the usual ones.
fn columns_of(
    rules: &GrainRules,
    (usual, named): (&GrainColumns, &GrainColumns),
    range: &Range<usize>,
) -> FrameGrains {
    fn pick<T: Copy>(own: &[T], usual: &[T], range: &Range<usize>) -> Vec<T> {
        let all = if own.is_empty() { usual } else { own };
        all.get(range.clone()).map(<[T]>::to_vec).unwrap_or_default()
    }
    let exponents = |columns: &GrainColumns| columns.exponents.clone().unwrap_or_default();
    FrameGrains {
        orientations: pick(&named.orientations, &usual.orientations, range),
        // A mesh has a size of its own
        sizes: match &rules.mesh {
            Some(_) if rules.names.sizes.is_none() => Vec::new(),
            _ => pick(&named.sizes, &usual.sizes, range),
        },
        exponents: match rules.exponents {
            Some(_) => Vec::new(),
            None => pick(&exponents(named), &exponents(usual), range),
        },
        ..FrameGrains::default()
    }
}

impl GrainRules {
    /// Whether the style says how large they are.
    fn is_sized(&self) -> bool {
        self.size.is_some() || self.names.sizes.is_some()
    }

    /// Whether the file may say which shape they have.
    fn is_open(&self) -> bool {
        let has_exponents = self.exponents.is_some() || self.names.exponents.is_some();
        self.kind.is_none() && self.mesh.is_none() && !self.is_sized() && !has_exponents
    }

    /// Semi-axes of all grains, or factors on their mesh.
    fn common_size(&self) -> Option<Vec3> {
        let of_mesh = self.mesh.as_ref().filter(|_| self.names.sizes.is_none());
        self.size.or(of_mesh.map(|_| Vec3::ONE))
    }
}

/// The shape of grains; `has_exponents`: their columns have exponents.
fn shape_of(rules: &GrainRules, has_exponents: bool) -> GrainShape {
    if let Some(mesh) = &rules.mesh {
        return GrainShape::Mesh(Arc::clone(mesh));
    }
    let usual = match (rules.exponents, has_exponents) {
        (None, false) => GrainKind::Ellipsoid,
        _ => GrainKind::Superquadric,
    };
    match rules.kind.unwrap_or(usual) {
        // Without a mesh, only programs ask for one
        GrainKind::Ellipsoid | GrainKind::Mesh | GrainKind::ConvexHull => GrainShape::Ellipsoid,
        GrainKind::Superquadric => {
            GrainShape::Superquadric { exponents: rules.exponents.unwrap_or(ROUND) }
        }
        GrainKind::Capsule => GrainShape::Capsule,
        GrainKind::Cylinder => GrainShape::Cylinder,
        GrainKind::Cuboid => GrainShape::Cuboid,
    }
}

/// The orientation of grains that are not rotated.
const UPRIGHT: [f32; 4] = [0.0, 0.0, 0.0, 1.0];

impl FrameGrains {
    /// Turns the grains to their orientations in the middle of the exposure, and determines how far they turn while the
    /// shutter is open.
    pub(super) fn expose(&mut self, shutter: Shutter) {
        if self.turns.is_empty() {
            return;
        }
        self.orientations.resize(self.turns.len(), UPRIGHT);
        let [middle, length] = shutter.middle_and_length();
        let turns = self.turns.par_iter_mut();
        turns.zip(&mut self.orientations).for_each(|(turn, orientation)| {
            *orientation = rotated(*orientation, middle * turn.as_dvec3());
            *turn = (length * turn.as_dvec3()).as_vec3();
        });
    }

    /// The trees of the grains at the places of `own`, which move by `displacements` while the shutter is open.
    ///
    /// # Errors
    /// There are too many.
    pub(super) fn trees(
        mut self,
        own: &StyleParticles,
        displacements: Option<&[Vec3]>,
    ) -> Result<Vec<GrainTree>, GrainError> {
        // Without a size, it is the radius
        if let (true, Radius::PerParticle(radii)) = (self.sizes.is_empty(), &own.radius) {
            self.sizes = radii.iter().map(|radius| [*radius; 3]).collect();
        }
        let radius = match own.radius {
            Radius::Common(radius) => radius,
            Radius::PerParticle(_) => 1.0,
        };
        let parts = std::mem::take(&mut self.parts);
        let tree = |part: GrainPart| self.tree(part, (&own.centers, radius), displacements);
        parts.into_iter().map(tree).collect()
    }

    /// The tree of the grains of `part`; `radius` is for grains without a size.
    fn tree(
        &self,
        part: GrainPart,
        (centers, radius): (&[Vec3], f32),
        displacements: Option<&[Vec3]>,
    ) -> Result<GrainTree, GrainError> {
        let GrainPart { shape, size, members } = part;
        let members = members.as_deref();
        let centers = chosen(centers, members);
        let sizes = chosen(&self.sizes, members);
        let orientations = chosen(&self.orientations, members);
        let exponents = match shape {
            GrainShape::Superquadric { .. } => chosen(&self.exponents, members),
            _ => Cow::Borrowed(&[][..]),
        };
        let displacements = displacements.map(|all| chosen(all, members));
        let rotations = chosen(&self.turns, members);
        let motion = displacements
            .as_ref()
            .map(|displacements| GrainMotion { displacements, rotations: &rotations });
        let sizes = match (size, &sizes[..]) {
            (Some(size), _) => GrainSizes::Common(size),
            (None, []) => GrainSizes::Common(Vec3::splat(radius)),
            (None, sizes) => GrainSizes::Each(sizes),
        };
        let grains = Grains {
            orientations: &orientations,
            exponents: &exponents,
            motion,
            ..Grains::new(&centers, sizes)
        };
        let tree = GrainTree::new(&grains, shape)?;
        Ok(match members {
            Some(members) => tree.with_indices(members),
            None => tree,
        })
    }
}

/// The quaternion x, y, z, w of an orientation after a rotation about an axis of the scene by the angle in radians that is
/// the length of `turn`. A rotation that is zero or not finite changes nothing.
fn rotated(orientation: [f32; 4], turn: DVec3) -> [f32; 4] {
    let angle = turn.length();
    let is_turned = angle > 0.0 && angle < f64::INFINITY;
    if !is_turned {
        return orientation;
    }
    let (sine, cosine) = libm::sincos(0.5 * angle);
    let rotation = DQuat::from_vec4((turn * (sine / angle)).extend(cosine));
    let [x, y, z, w] = orientation.map(f64::from);
    (rotation * DQuat::from_xyzw(x, y, z, w)).as_quat().to_array()
}

/// The values of `members`, or all.
fn chosen<'v, T: Copy>(values: &'v [T], members: Option<&[u32]>) -> Cow<'v, [T]> {
    match members {
        Some(members) if !values.is_empty() => {
            members.iter().map(|member| values[*member as usize]).collect()
        }
        _ => Cow::Borrowed(values),
    }
}

/// How many times a mesh may be larger or smaller than the radius before that is noted: a mesh in millimetres for
/// particles in metres is a thousand times its usual size.
const USUAL_RATIO: f64 = 50.0;

/// A note if the mesh of a style without a size is much larger or smaller than the particles.
pub(super) fn unit_note(style: &str, rules: &GrainRules, radius: &Radius) -> Option<String> {
    let mesh = rules.mesh.as_ref().filter(|_| !rules.is_sized())?;
    let radius = match radius {
        Radius::Common(radius) => *radius,
        Radius::PerParticle(radii) => *radii.first()?,
    };
    let ratio = mesh.radius() / f64::from(radius);
    let is_usual = (1.0 / USUAL_RATIO..USUAL_RATIO).contains(&ratio);
    let (factor, size) = if ratio > 1.0 { (ratio, "larger") } else { (1.0 / ratio, "smaller") };
    (!is_usual && factor.is_finite()).then(|| {
        format!(
            "style `{style}`: the mesh is {factor:.0} times {size} than the particles; if it is in another unit, set size \
             (size = [0.001, 0.001, 0.001] for millimetres to metres)"
        )
    })
}

/// What was wrong with the grains of a style.
pub(super) fn report_notes(style: &str, report: &GrainReport) -> Vec<String> {
    let counts = [
        (report.not_normalised, "with a quaternion of another length than 1, which is normalised"),
        (report.no_orientation, "without an orientation, drawn upright"),
        (report.bad_sizes, "left out: a semi-axis is not above 0"),
        (report.bad_centers, "left out: a coordinate is not finite or too far away"),
        (report.bad_exponents, "with an exponent below 1, drawn as ellipsoids"),
        (
            report.bad_motions,
            "with a velocity or an angular velocity that is not finite, which counts as none",
        ),
    ];
    let counted = counts.into_iter().filter(|(count, _)| *count > 0);
    counted.map(|(count, what)| format!("style `{style}`: {count} grains {what}")).collect()
}

#[cfg(test)]
mod tests {
    use super::super::FrameStep;
    use super::*;

    #[test]
    fn grains_are_turned_to_the_middle_of_the_exposure() {
        // Open from the time of the frame for one unit of time
        let step = FrameStep { time: 2.0, numbers: 1 };
        let shutter = Shutter { open: 0.0, close: 0.5, step, has_velocities: true, slices: 1 };
        let quarter = std::f32::consts::FRAC_PI_2;
        // A rotation about x, and no orientation
        let tilted = [0.6, 0.0, 0.0, 0.8];
        let nothing = [f32::NAN; 4];
        let mut grains = FrameGrains {
            orientations: vec![tilted, tilted, tilted, nothing],
            turns: vec![quarter * Vec3::Z, Vec3::ZERO, Vec3::splat(f32::NAN), Vec3::X],
            ..FrameGrains::default()
        };
        grains.expose(shutter);
        assert!((grains.turns[0] - quarter * Vec3::Z).length() < 1e-6, "{}", grains.turns[0]);
        let turned = DQuat::from_rotation_z(0.25 * std::f64::consts::PI)
            * DQuat::from_xyzw(0.6, 0.0, 0.0, 0.8);
        let found = DQuat::from_array(grains.orientations[0].map(f64::from));
        assert!((found - turned).length() < 1e-6, "{found} {turned}");
        // Without a rotation, to the bit
        assert_eq!(grains.orientations[1..3], [tilted; 2]);
        assert!(grains.turns[2].is_nan() && grains.orientations[3][0].is_nan());
        // Grains without orientations get them
        let mut upright = FrameGrains { turns: vec![quarter * Vec3::Z], ..FrameGrains::default() };
        upright.expose(shutter);
        let half_angle = (0.125 * std::f64::consts::PI).sin();
        assert!((f64::from(upright.orientations[0][2]) - half_angle).abs() < 1e-6);
    }
}
