use super::*;
use crate::Shape;
use crate::normals::ShadingNormals;
use crate::spheres::SphereSurface;
use spherule_tree::accel::{BuildSettings, SphereRadius, Spheres, Structure, TreeBuilder};

const SUPPORT: f32 = 4.0;

/// The shading normals at the hits of `rays` on spheres of radius 1 at `centers`, which must be the same for every
/// structure.
fn normals_at(centers: &[Vec3], rays: &[Ray]) -> Vec<Vec3> {
    let mut all = Structure::ALL.map(|structure| {
        let mut builder = TreeBuilder::new();
        let spheres = Spheres { centers, radius: SphereRadius::Common(1.0) };
        builder.build(&spheres, &BuildSettings::new(structure));
        let normals = ShadingNormals::Pca(PcaNormals::new(SUPPORT));
        let surface = SphereSurface::new(builder.tree().view()).with_normals(normals);
        let shading = |ray: &Ray| surface.nearest(ray).expect("aimed at a sphere").shading;
        rays.iter().map(shading).collect::<Vec<_>>()
    });
    assert!(all.iter().all(|other| *other == all[0]));
    std::mem::take(&mut all[0])
}

/// A lattice of points `spacing` apart, `counts` along the axes, from the origin.
fn lattice(counts: [i16; 3], spacing: f32) -> Vec<Vec3> {
    let [x, y, z] = counts;
    let points = (0..x).flat_map(|i| (0..y).flat_map(move |j| (0..z).map(move |k| [i, j, k])));
    points.map(|p| Vec3::from_array(p.map(f32::from)) * spacing).collect()
}

fn downwards(x: f32, y: f32) -> Ray {
    Ray::new(Vec3::new(x, y, 50.0), -Vec3::Z)
}

#[test]
fn a_flat_surface_of_spheres_faces_one_way() {
    let centers = lattice([16, 16, 6], 1.4);
    let rays: Vec<Ray> = (0..200_i16)
        .map(|i| downwards(8.0 + 0.03 * f32::from(i), 9.0 + 0.9 * f32::from(i).sin()))
        .collect();
    let normals = normals_at(&centers, &rays);
    let worst = normals.iter().map(|normal| normal.z).fold(1.0, f32::min);
    assert!(worst > 0.99, "{worst}");
    assert!(normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-5));
}

#[test]
fn sheets_face_both_ways() {
    let centers = lattice([12, 12, 1], 2.0);
    let up = Ray::new(Vec3::new(10.3, 10.4, -50.0), Vec3::Z);
    let [above, below] = normals_at(&centers, &[downwards(10.3, 10.4), up])[..] else {
        panic!("two rays");
    };
    assert!(above.z > 0.95 && below.z < -0.95, "{above} {below}");
}

#[test]
fn a_ball_of_spheres_is_round() {
    let centers: Vec<Vec3> = lattice([21, 21, 21], 2.0)
        .iter()
        .map(|p| *p - 20.0)
        .filter(|p| p.length() < 18.0)
        .collect();
    let rays: Vec<Ray> = (0..300_i16)
        .map(|i| {
            let away = Vec3::new(
                f32::from(i).sin(),
                (1.7 * f32::from(i)).cos(),
                (0.3 * f32::from(i)).sin(),
            );
            Ray::new(away.normalize() * 60.0, -away.normalize())
        })
        .collect();
    let normals = normals_at(&centers, &rays);
    let cosines = rays.iter().zip(&normals).map(|(ray, n)| -n.dot(ray.direction));
    let mean = cosines.sum::<f32>() / 300.0;
    assert!(mean > 0.92, "{mean}");
}

#[test]
fn isolated_spheres_have_sphere_normals() {
    let centers = [Vec3::ZERO, Vec3::new(100.0, 0.0, 0.0)];
    let ray = downwards(0.6, 0.0);
    let normal = normals_at(&centers, &[ray])[0];
    assert!((normal - Vec3::new(0.6, 0.0, 0.8)).length() < 1e-5, "{normal}");
}

#[test]
fn coincident_spheres_have_a_normal() {
    let normal = normals_at(&[Vec3::ZERO; 300], &[downwards(0.6, 0.0)])[0];
    assert!((normal - Vec3::new(0.6, 0.0, 0.8)).length() < 1e-3, "{normal}");
    let normal = normals_at(&[Vec3::ZERO; 5000], &[downwards(0.6, 0.0)])[0];
    assert!((normal - Vec3::new(0.6, 0.0, 0.8)).length() < 1e-5, "{normal}");
}

#[test]
fn principal_components_of_a_known_matrix() {
    // Rotated by 45 degrees about z: the smallest component is along x + y.
    let least = least_component(&SymmetricMatrix([2.0, 2.0, 5.0, -1.0, 0.0, 0.0])).expect("one");
    let along = DVec3::new(1.0, 1.0, 0.0).normalize();
    assert!((least.direction.dot(along).abs() - 1.0).abs() < 1e-12);
    assert!((least.gap - 2.0 / 3.0).abs() < 1e-12, "1 of 1, 3, 5");
    for none in [[1.0, 1.0, 1.0, 0.0, 0.0, 0.0], [0.0; 6], [f64::NAN; 6]] {
        assert!(least_component(&SymmetricMatrix(none)).is_none());
    }
    let long = SymmetricMatrix([1.0, 1.0, 9.0, 0.0, 0.0, 0.0]);
    assert!(least_component(&long).is_none_or(|least| least.gap < 1e-6));
}

#[test]
fn normals_face_the_visible_side() {
    let direction = -Vec3::Z;
    let normal = towards_viewer(Vec3::new(0.8, 0.0, -0.6), Vec3::Z, direction);
    assert!(normal.z > 0.0 && normal.x > 0.99);
    let from_inside = towards_viewer(Vec3::Z, -Vec3::Z, direction);
    assert!(from_inside.z < 0.0 || from_inside == -Vec3::Z);
}
