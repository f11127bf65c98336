//! Grains whose shape depends on the type of the particle, as GSD files say it.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use glam::Vec3;
use spherule_formats::order::index_u32;
use spherule_frame::{TypeShape, TypeShapes};

use super::SharedFrame;
use super::meshes::CREASE_ANGLE;
use crate::surface::grains::{GrainMesh, GrainMeshError, GrainShape, GrainSphere};
use crate::surface::mesh::MeshNormals;

/// Grains of a style with the same shape.
#[derive(Debug, Default)]
pub(super) struct GrainPart {
    pub(super) shape: GrainShape,
    /// Semi-axes of all of them, or factors on a mesh.
    pub(super) size: Option<Vec3>,
    /// Their indices in the style, ascending; None: all.
    pub(super) members: Option<Vec<u32>>,
}

/// The grains of the particles in `range`, a part for each type with a shape of its own. Notes types whose shape cannot
/// be drawn; their particles are spheres.
pub(super) fn parts_by_type(
    frame: &SharedFrame<'_>,
    types: &TypeShapes,
    range: Range<usize>,
    notes: &mut Vec<String>,
) -> Vec<GrainPart> {
    // Collect the particles of each type; without the attribute, all have type 0
    let attribute = frame.attribute(&types.attribute).filter(|a| a.components == 1);
    let mut members: BTreeMap<usize, Vec<u32>> = BTreeMap::new();
    for (place, index) in range.enumerate() {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "others have no shape"
        )]
        let number = attribute.map_or(0, |attribute| attribute.data.get_f64(index) as usize);
        let known = number.min(types.shapes.len());
        members.entry(known).or_default().push(index_u32(place));
    }
    let part = |(number, members): (usize, Vec<u32>)| {
        let shape = types.shapes.get(number).unwrap_or(&TypeShape::Unspecified);
        let drawn = drawn(shape);
        let (shape, size) = drawn.unwrap_or_else(|why| {
            notes.push(format!("type {number} has {why}; its particles are drawn as spheres"));
            (GrainShape::Ellipsoid, None)
        });
        GrainPart { shape, size, members: Some(members) }
    };
    members.into_iter().map(part).collect()
}

/// The shape of grains, and its size if that is not the radius.
///
/// # Errors
/// It cannot be drawn.
fn drawn(shape: &TypeShape) -> Result<(GrainShape, Option<Vec3>), String> {
    let mesh = |mesh: Result<GrainMesh, GrainMeshError>| {
        let mesh = mesh.map_err(|error| format!("a shape that cannot be drawn: {error}"))?;
        Ok((GrainShape::Mesh(Arc::new(mesh)), Some(Vec3::ONE)))
    };
    match shape {
        TypeShape::Unspecified => Ok((GrainShape::Ellipsoid, None)),
        TypeShape::Sphere(radius) => Ok((GrainShape::Ellipsoid, Some(Vec3::splat(*radius)))),
        TypeShape::Ellipsoid(semi_axes) => Ok((GrainShape::Ellipsoid, Some(*semi_axes))),
        TypeShape::ConvexPolyhedron(points) => mesh(GrainMesh::convex(points)),
        TypeShape::Mesh { vertices, triangles } => {
            let normals = MeshNormals::Smooth(CREASE_ANGLE.to_radians());
            mesh(GrainMesh::new(vertices.clone(), triangles.clone(), normals))
        }
        TypeShape::Spheres(spheres) => {
            let spheres = spheres.iter().map(|&(center, radius)| GrainSphere { center, radius });
            mesh(GrainMesh::spheres(&spheres.collect::<Vec<_>>()))
        }
        TypeShape::Other(kind) => Err(format!("a shape that grains do not have ({kind})")),
    }
}

#[cfg(test)]
mod tests {
    use std::borrow::Cow;

    use glam::DVec3;
    use spherule_formats::{Attribute, AttributeData, ParticleFrame, Positions, RawParticles};

    use super::*;

    #[test]
    fn each_type_has_its_shape() {
        let numbers = AttributeData::U32(vec![0, 3, 1, 0, 7, 2]);
        let raw = RawParticles {
            positions: Positions::F32(vec![Vec3::ZERO; 6]),
            attributes: vec![Attribute { name: "typeid".to_owned(), components: 1, data: numbers }],
            ..RawParticles::default()
        };
        let frame = ParticleFrame::from_raw(raw, DVec3::ZERO).with_positions(Cow::Owned);
        let points = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let open = TypeShape::Mesh { vertices: points.clone(), triangles: vec![[0, 1, 2]] };
        let types = TypeShapes {
            attribute: "typeid".to_owned(),
            shapes: vec![
                TypeShape::Spheres(vec![(-Vec3::X, 1.0), (Vec3::X, 1.5)]),
                TypeShape::ConvexPolyhedron(points),
                open,
                TypeShape::Other("Polygon".to_owned()),
            ],
        };
        let mut notes = Vec::new();
        let parts = parts_by_type(&frame, &types, 1..6, &mut notes);
        let found: Vec<(String, Option<Vec3>, Vec<u32>)> = (parts.into_iter())
            .map(|part| (format!("{:?}", part.shape), part.size, part.members.unwrap_or_default()))
            .collect();
        let shape = |name: &str, size, members: &[u32]| (name.to_owned(), size, members.to_vec());
        let expected = [
            shape("Mesh(2560 triangles)", Some(Vec3::ONE), &[2]),
            shape("Mesh(4 triangles)", Some(Vec3::ONE), &[1]),
            shape("Ellipsoid", None, &[4]),
            shape("Ellipsoid", None, &[0]),
            shape("Ellipsoid", None, &[3]),
        ];
        assert_eq!(found, expected);
        assert_eq!(notes.len(), 2, "{notes:?}");
        assert!(notes[0].contains("type 2") && notes[0].contains("is not closed"), "{notes:?}");
        assert!(notes[1].contains("type 3") && notes[1].contains("Polygon"), "{notes:?}");
    }
}
