//! Shapes of types: JSON for each, as in the chunk `particles/type_shapes` of the schema `hoomd`.

use glam::{DVec3, Vec3};
use serde_json::Value;
use spherule_frame::TypeShape;

/// Bytes of memory per byte of text, at most: `[1],` is a list with room for four values.
pub(super) const BYTES_OF_TEXT: u64 = 64;

/// The shape that `text` describes. Damaged text is a shape of an unknown kind: positions do not depend on it.
pub(super) fn of_json(text: &[u8]) -> TypeShape {
    let unknown = || TypeShape::Other("damaged text".to_owned());
    match serde_json::from_slice::<Value>(text) {
        _ if text.trim_ascii().is_empty() => TypeShape::Unspecified,
        Ok(Value::Object(shape)) if shape.is_empty() => TypeShape::Unspecified,
        Ok(shape) => shape_of(&shape).unwrap_or_else(unknown),
        Err(_) => unknown(),
    }
}

/// The shape in an object; None if it lacks what its kind needs.
fn shape_of(shape: &Value) -> Option<TypeShape> {
    let number = |key: &str| shape.get(key)?.as_f64();
    let points = |key: &str| -> Option<Vec<Vec3>> {
        shape.get(key)?.as_array()?.iter().map(|row| Some(vector(row)?.as_vec3())).collect()
    };
    let vertices = || points("vertices");
    #[expect(clippy::cast_possible_truncation, reason = "lengths are f32 in the renderer")]
    Some(match shape.get("type")?.as_str()? {
        "Sphere" => TypeShape::Sphere((0.5 * number("diameter")?) as f32),
        "Ellipsoid" => {
            TypeShape::Ellipsoid(DVec3::new(number("a")?, number("b")?, number("c")?).as_vec3())
        }
        "ConvexPolyhedron" => TypeShape::ConvexPolyhedron(vertices()?),
        "Mesh" => {
            let faces = shape.get("indices")?.as_array()?.iter();
            TypeShape::Mesh {
                vertices: vertices()?,
                triangles: faces.map(triangle).collect::<Option<_>>()?,
            }
        }
        "SphereUnion" => {
            let diameters = shape.get("diameters")?.as_array()?;
            let centers = points("centers")?;
            let radii = diameters.iter().map(|diameter| Some((0.5 * diameter.as_f64()?) as f32));
            let radii: Vec<f32> = radii.collect::<Option<_>>()?;
            if radii.len() != centers.len() {
                return None;
            }
            TypeShape::Spheres(centers.into_iter().zip(radii).collect())
        }
        kind => TypeShape::Other(kind.chars().take(40).collect()),
    })
}

fn vector(row: &Value) -> Option<DVec3> {
    match &row.as_array()?[..] {
        [x, y, z] => Some(DVec3::new(x.as_f64()?, y.as_f64()?, z.as_f64()?)),
        _ => None,
    }
}

fn triangle(row: &Value) -> Option<[u32; 3]> {
    let corner = |index: &Value| u32::try_from(index.as_u64()?).ok();
    match &row.as_array()?[..] {
        [a, b, c] => Some([corner(a)?, corner(b)?, corner(c)?]),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_of_the_schema_are_read() {
        let of = |text: &str| of_json(text.as_bytes());
        assert_eq!(of(r#"{"type": "Sphere", "diameter": 3}"#), TypeShape::Sphere(1.5));
        let ellipsoid = of(r#"{"type": "Ellipsoid", "a": 3, "b": 2.5, "c": 1}"#);
        assert_eq!(ellipsoid, TypeShape::Ellipsoid(Vec3::new(3.0, 2.5, 1.0)));
        let points = r#""vertices": [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0]]"#;
        let vertices = vec![Vec3::X, Vec3::Y, Vec3::Z, Vec3::ZERO];
        assert_eq!(
            of(&format!(r#"{{"type": "ConvexPolyhedron", "rounding_radius": 0.1, {points}}}"#)),
            TypeShape::ConvexPolyhedron(vertices.clone())
        );
        assert_eq!(
            of(&format!(r#"{{"type": "Mesh", {points}, "indices": [[0, 1, 2]]}}"#)),
            TypeShape::Mesh { vertices, triangles: vec![[0, 1, 2]] }
        );
        assert_eq!(
            of(
                r#"{"type": "SphereUnion", "centers": [[1, 0, 0], [0, 1, 0]], "diameters": [3, 1]}"#
            ),
            TypeShape::Spheres(vec![(Vec3::X, 1.5), (Vec3::Y, 0.5)])
        );
        assert_eq!(of(r#"{"type": "Polygon"}"#), TypeShape::Other("Polygon".to_owned()));
        assert_eq!([of("{}"), of(""), of(" ")], [const { TypeShape::Unspecified }; 3]);
    }

    #[test]
    fn damage_is_a_shape_of_an_unknown_kind() {
        let deep = "[".repeat(100_000);
        for text in [
            "{",
            "7",
            "[]",
            &deep,
            r#"{"type": 7}"#,
            r#"{"type": "Sphere"}"#,
            r#"{"type": "Ellipsoid", "a": 1, "b": 2}"#,
            r#"{"type": "ConvexPolyhedron", "vertices": [[1, 2]]}"#,
            r#"{"type": "SphereUnion", "centers": [[1, 2, 3]], "diameters": []}"#,
            r#"{"type": "Mesh", "vertices": [[1, 2, 3]], "indices": [[-1, 0, 0]]}"#,
        ] {
            assert_eq!(
                of_json(text.as_bytes()),
                TypeShape::Other("damaged text".to_owned()),
                "{text:.40}"
            );
        }
    }
}
