//! Whether particles have shapes of their own: orientations, and sizes along each axis or shapes of types.

use spherule_formats::{RawParticles, sample_indices};
use spherule_frame::TypeShape;
use spherule_frame::grain_columns::{GrainColumns, OtherShapes};

/// Number of particles that are looked at.
const SAMPLE: usize = 1 << 14;

/// What gives particles shapes other than spheres.
#[derive(Debug, Clone, PartialEq)]
pub struct ShapeSource {
    /// Columns of orientations and sizes, or types, in words.
    pub what: String,
    /// Half the typical size of a particle, if columns have sizes.
    pub radius: Option<f64>,
}

/// What gives particles of `raw` a shape other than a sphere; None if they are spheres, or nothing says what they are.
pub(super) fn shape_source(raw: &RawParticles) -> Option<ShapeSource> {
    let is_body = |shape: &TypeShape| {
        use TypeShape::{ConvexPolyhedron, Ellipsoid, Mesh, Spheres};
        matches!(shape, Ellipsoid(_) | ConvexPolyhedron(_) | Mesh { .. } | Spheres(_))
    };
    if raw.shapes.as_ref().is_some_and(|types| types.shapes.iter().any(is_body)) {
        let what = "the shapes of their types".to_owned();
        return Some(ShapeSource { what, radius: None });
    }
    let sample = sample_indices(raw.positions.len(), SAMPLE);
    let OtherShapes { used, radius } = GrainColumns::of_other_shapes(&raw.attributes, sample)?;
    let names: Vec<String> = used.iter().map(|name| format!("`{name}`")).collect();
    Some(ShapeSource { what: names.join(", "), radius: Some(radius) })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use spherule_formats::{Attribute, AttributeData, Positions};
    use spherule_frame::TypeShapes;

    use super::*;

    /// Two particles with these diameters, and an orientation.
    fn ellipsoids(diameters: [[f64; 3]; 2]) -> RawParticles {
        let column = |name: &str, data: Vec<f64>| Attribute {
            name: name.to_owned(),
            components: data.len() / 2,
            data: AttributeData::F64(data),
        };
        let [a, b] = diameters;
        let names = ["shapex", "shapey", "shapez"].iter().enumerate();
        let mut attributes: Vec<Attribute> =
            names.map(|(axis, name)| column(name, vec![a[axis], b[axis]])).collect();
        attributes.push(column("orientation", [1.0, 0.0, 0.0, 0.0].repeat(2)));
        let positions = Positions::F64(vec![glam::DVec3::ZERO; 2]);
        RawParticles { positions, attributes, ..RawParticles::default() }
    }

    #[test]
    fn sizes_that_differ_make_a_shape() {
        let found = shape_source(&ellipsoids([[1.0; 3], [1.0, 4.0, 1.0]])).expect("a shape");
        assert_eq!(found.what, "`orientation`, `shapex`, `shapey`, `shapez`");
        assert_eq!(found.radius, Some(1.0));
        // Spheres, a point among ellipsoids, sizes without orientations, and nothing
        assert_eq!(shape_source(&ellipsoids([[1.0; 3], [2.0; 3]])), None);
        assert_eq!(shape_source(&ellipsoids([[0.0; 3], [1.0, 2.0, 1.0]])), None);
        let mut sizes = ellipsoids([[1.0; 3], [1.0, 2.0, 1.0]]);
        sizes.attributes.pop();
        assert_eq!(shape_source(&sizes), None);
        assert_eq!(shape_source(&RawParticles::default()), None);
    }

    #[test]
    fn types_have_shapes() {
        let with = |shape| {
            let types = TypeShapes { attribute: "typeid".to_owned(), shapes: vec![shape] };
            shape_source(&RawParticles { shapes: Some(Arc::new(types)), ..RawParticles::default() })
        };
        assert!(with(TypeShape::Ellipsoid(glam::Vec3::ONE)).is_some());
        assert_eq!(with(TypeShape::Sphere(1.0)), None);
        assert_eq!(with(TypeShape::Other("Polygon".to_owned())), None);
    }
}
