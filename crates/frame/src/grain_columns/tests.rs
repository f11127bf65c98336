//! Columns of programs, and those that users name.

use glam::{DMat3, DQuat, DVec3};

use super::*;
use crate::AttributeData;

fn column(name: &str, components: usize, data: &[f64]) -> Attribute {
    Attribute { name: name.to_owned(), components, data: AttributeData::F64(data.to_vec()) }
}

fn scalars(names: &[&str], values: &[f64]) -> Vec<Attribute> {
    let of = |(name, value): (&&str, &f64)| column(name, 1, &[*value, 0.0]);
    names.iter().zip(values).map(of).collect()
}

/// A rotation with four different components.
fn rotation() -> DQuat {
    DQuat::from_xyzw(0.1, -0.3, 0.5, 0.8).normalize()
}

#[track_caller]
fn assert_rotation(attributes: &[Attribute], used: &[&str]) {
    let found = GrainColumns::find(attributes).expect("grains");
    assert_eq!(found.used, used);
    let found = DQuat::from_array(found.orientations[0].map(f64::from));
    assert!(found.dot(rotation()).abs() > 1.0 - 1e-6, "{found} {}", rotation());
}

#[test]
fn orientations_of_programs_are_found() {
    let [x, y, z, w] = rotation().to_array();
    // GSD and OVITO
    assert_rotation(&[column("orientation", 4, &[w, x, y, z])], &["orientation"]);
    assert_rotation(&[column("Orientation", 4, &[x, y, z, w])], &["Orientation"]);
    assert_rotation(&[column("orient", 4, &[x, y, z, w])], &["orient"]);
    // Scalars, in any order and case
    let of = |names: [&str; 4], values: [f64; 4]| {
        let mut columns = scalars(&names, &values);
        columns.reverse();
        columns.insert(1, column("mass", 1, &[1.0, 2.0]));
        assert_rotation(&columns, &names);
    };
    of(["quatw", "quati", "quatj", "quatk"], [w, x, y, z]);
    of(["c_q[1]", "c_q[2]", "c_q[3]", "c_q[4]"], [w, x, y, z]);
    of(["c_quat[1]", "c_quat[2]", "c_quat[3]", "c_quat[4]"], [w, x, y, z]);
    of(["quat1", "quat2", "quat3", "quat4"], [w, x, y, z]);
    of(["Orientation.X", "Orientation.Y", "Orientation.Z", "Orientation.W"], [x, y, z, w]);
    of(["orientationx", "orientationy", "orientationz", "orientationw"], [x, y, z, w]);
    // A matrix, row by row
    let rows = DMat3::from_quat(rotation()).transpose().to_cols_array();
    assert_rotation(&[column("orientationTensor", 9, &rows)], &["orientationTensor"]);
}

#[test]
fn other_columns_are_no_orientations() {
    let none = |columns: &[Attribute]| assert_eq!(GrainColumns::find(columns), None);
    none(&[]);
    none(&[column("mass", 1, &[1.0])]);
    // Another number of components, a part of a quaternion, and exponents alone
    none(&[column("orientation", 3, &[1.0, 0.0, 0.0])]);
    none(&scalars(&["quatw", "quati", "quatj"], &[1.0, 0.0, 0.0]));
    none(&scalars(&["blockiness1", "blockiness2"], &[2.0, 2.0]));
    // LAMMPS users give this compute either order
    none(&scalars(&["c_orient[1]", "c_orient[2]", "c_orient[3]", "c_orient[4]"], &[1.0; 4]));
}

#[test]
fn sizes_of_programs_are_semi_axes() {
    let sizes = |columns: &[Attribute]| GrainColumns::find(columns).expect("grains").sizes[0];
    let shape = ["shapex", "shapey", "shapez"];
    let lammps = scalars(&shape, &[2.0, 4.0, 6.0]);
    assert_eq!(sizes(&lammps), [1.0, 2.0, 3.0]);
    let liggghts = [lammps, scalars(&["quat1"], &[1.0])].concat();
    assert_eq!(sizes(&liggghts), [2.0, 4.0, 6.0]);
    assert_eq!(
        sizes(&scalars(&["c_shape[1]", "c_shape[2]", "c_shape[3]"], &[2.0, 4.0, 6.0])),
        [1.0, 2.0, 3.0]
    );
    assert_eq!(sizes(&[column("AsphericalShape", 3, &[1.0, 2.0, 3.0])]), [1.0, 2.0, 3.0]);
    assert_eq!(sizes(&[column("axesScales", 3, &[2.0, 4.0, 6.0])]), [1.0, 2.0, 3.0]);
    let ovito = ["AsphericalShape.X", "AsphericalShape.Y", "AsphericalShape.Z"];
    assert_eq!(sizes(&scalars(&ovito, &[1.0, 2.0, 3.0])), [1.0, 2.0, 3.0]);
}

#[test]
fn exponents_have_one_convention() {
    let size = scalars(&["shapex", "shapey", "shapez"], &[1.0; 3]);
    let exponents = |more: Vec<Attribute>| {
        let all = [size.clone(), more].concat();
        GrainColumns::find(&all).expect("grains").exponents.map(|exponents| exponents[0])
    };
    assert_eq!(exponents(vec![]), None);
    assert_eq!(exponents(scalars(&["blockiness1", "blockiness2"], &[3.0, 5.0])), Some([3.0, 5.0]));
    assert_eq!(exponents(scalars(&["block1", "block2"], &[3.0, 5.0])), Some([3.0, 5.0]));
    // eps2 = 0.5 and eps1 = 1
    assert_eq!(exponents(vec![column("phiAndTheta", 2, &[0.5, 1.0])]), Some([2.0, 4.0]));
}

fn names(columns: &[&str]) -> Vec<String> {
    columns.iter().map(|name| (*name).to_owned()).collect()
}

fn orientation_names(columns: &[&str], kind: OrientationKind) -> GrainNames {
    GrainNames { orientation: Some((names(columns), kind)), ..GrainNames::default() }
}

#[test]
fn named_columns_have_precedence() {
    let [x, y, z, w] = rotation().to_array();
    let columns = [
        column("orientation", 4, &[x, y, z, w]),
        column("r", 1, &[0.5]),
        column("AsphericalShape", 3, &[1.0, 2.0, 3.0]),
    ];
    let xyzw = OrientationKind::Quaternion(QuaternionOrder::Xyzw);
    let found = GrainColumns::named(&columns, &orientation_names(&["Orientation"], xyzw));
    let found = found.expect("columns");
    assert_eq!(found.used, ["orientation", "AsphericalShape"]);
    assert!((f64::from(found.orientations[0][3]) - w).abs() < 1e-7);
    assert_eq!(found.sizes, [[1.0, 2.0, 3.0]]);
    // Components of vectors, and one diameter for all axes
    let all = GrainNames {
        sizes: Some((names(&["r"]), SizeKind::Diameters)),
        exponents: Some(names(&["AsphericalShape.y", "AsphericalShape[2]"])),
        ..orientation_names(
            &["orientation.w", "orientation[0]", "orientation.y", "orientation.z"],
            OrientationKind::Quaternion(QuaternionOrder::Wxyz),
        )
    };
    let found = GrainColumns::named(&columns, &all).expect("columns");
    assert_eq!((found.sizes, found.exponents), (vec![[0.25; 3]], Some(vec![[2.0, 3.0]])));
    assert!((f64::from(found.orientations[0][0]) - x).abs() < 1e-7);
}

#[test]
fn euler_angles_are_rotations_about_z_x_and_z() {
    let angles: [f64; 3] = [0.3, 1.2, -2.0];
    let [a, b, c] = angles;
    let expected =
        DQuat::from_rotation_z(a) * DQuat::from_rotation_x(b) * DQuat::from_rotation_z(c);
    let of = |angles: [f64; 3], unit| {
        let kind = OrientationKind::Euler(unit);
        let found =
            GrainColumns::named(&[column("e", 3, &angles)], &orientation_names(&["e"], kind));
        DQuat::from_array(found.expect("columns").orientations[0].map(f64::from))
    };
    assert!(of(angles, AngleUnit::Radians).dot(expected).abs() > 1.0 - 1e-6);
    assert!(of(angles.map(f64::to_degrees), AngleUnit::Degrees).dot(expected).abs() > 1.0 - 1e-6);
}

#[test]
fn matrices_are_rotations() {
    let mut number = 0_u32;
    let mut next = || {
        number = number.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(number) / f64::from(u32::MAX) - 0.5
    };
    for _ in 0..100 {
        let rotation = DQuat::from_xyzw(next(), next(), next(), next()).normalize();
        let rows = DMat3::from_quat(rotation).transpose().to_cols_array();
        let found = DQuat::from_array(from_matrix(&rows));
        assert!(found.dot(rotation).abs() > 1.0 - 1e-12, "{rotation} {found}");
    }
    // Half turns, mirrors and NaN
    for axis in DVec3::AXES {
        let half = DQuat::from_axis_angle(axis, std::f64::consts::PI);
        let found = from_matrix(&DMat3::from_quat(half).transpose().to_cols_array());
        assert!(DQuat::from_array(found).dot(half).abs() > 1.0 - 1e-12);
    }
    let mirror = [-1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    assert!(from_matrix(&mirror)[0].is_nan() && from_matrix(&[f64::NAN; 9])[0].is_nan());
}

#[test]
fn unknown_columns_have_a_suggestion() {
    let columns = scalars(&["quat1", "quat2", "mass"], &[1.0; 3]);
    let message = |columns: &[Attribute], names: &[&str]| {
        let kind = OrientationKind::Quaternion(QuaternionOrder::Wxyz);
        let names = orientation_names(names, kind);
        GrainColumns::named(columns, &names).expect_err("no such columns").to_string()
    };
    assert_eq!(message(&columns, &["qat2"]), "no column `qat2`; did you mean `quat2`?");
    assert_eq!(message(&columns, &["spin"]), "no column `spin`; columns are quat1, quat2, mass");
    assert_eq!(message(&[], &["spin"]), "no column `spin`; the frame has no columns");
    assert_eq!(
        message(&columns, &["quat1", "quat2"]),
        "an orientation needs 4 numbers, but quat1, quat2 have 2"
    );
    let size =
        GrainNames { sizes: Some((names(&["v"]), SizeKind::SemiAxes)), ..GrainNames::default() };
    let two = [column("v", 2, &[1.0, 2.0])];
    let error = GrainColumns::named(&two, &size).expect_err("two numbers").to_string();
    assert_eq!(error, "a size needs 3 or 1 numbers, but v has 2");
}

#[test]
fn angular_velocities_of_programs_are_found() {
    let found =
        |columns: &[Attribute]| AngularVelocities::find(columns).expect("angular velocities");
    let numbers = [1.0, -2.0, 3.0];
    for name in ["omega", "Angular Velocity", "AngularVelocity", "angular_velocity"] {
        let own = found(&[column("velocity", 3, &[9.0; 3]), column(name, 3, &numbers)]);
        assert_eq!((own.values, own.used), (vec![[1.0, -2.0, 3.0]], vec![name.to_owned()]));
    }
    for names in [
        ["omegax", "omegay", "omegaz"],
        ["Angular Velocity.X", "Angular Velocity.Y", "Angular Velocity.Z"],
    ] {
        let mut columns = scalars(&names, &numbers);
        columns.reverse();
        let own = found(&columns);
        assert_eq!(own.values, [[1.0, -2.0, 3.0], [0.0; 3]]);
        assert_eq!(own.used, names);
    }
    // Numbers that are not finite stay for the one who counts them
    assert!(found(&[column("omega", 3, &[f64::NAN, 0.0, 1.0])]).values[0][0].is_nan());
    // Vorticity, the degrees of USD, a scalar, and momenta without moments of inertia
    let [vorticity, degrees] =
        ["vorticity", "angularVelocities"].map(|name| column(name, 3, &numbers));
    let momentum = column("angmom", 4, &[0.0; 4]);
    let upright = column("orientation", 4, &[1.0, 0.0, 0.0, 0.0]);
    for columns in
        [vec![vorticity, degrees], vec![column("omega", 1, &[1.0])], vec![momentum, upright]]
    {
        assert_eq!(AngularVelocities::find(&columns), None);
    }
    let named = |name: &str| {
        AngularVelocities::named(
            &[column("spin", 3, &numbers), column("mass", 1, &[1.0])],
            &names(&[name]),
        )
    };
    assert_eq!(named("spin").expect("a column").values, [[1.0, -2.0, 3.0]]);
    let error = named("mass").expect_err("one number").to_string();
    assert_eq!(error, "an angular velocity needs 3 numbers, but mass has 1");
}

#[test]
fn angular_momenta_are_those_of_hoomd() {
    // The angular momentum S = I w about the axes of the particle, and the quaternion 2 q S
    let (q, velocity, inertia) =
        (rotation(), DVec3::new(0.3, -1.1, 0.7), DVec3::new(2.0, 3.0, 5.0));
    let own = inertia * (q.inverse() * velocity);
    let [x, y, z, w] = (q * DQuat::from_xyzw(own.x, own.y, own.z, 0.0)).to_array();
    let columns = |inertia: DVec3| {
        let [a, b, c, d] = q.to_array();
        [
            column("orientation", 4, &[d, a, b, c]),
            column("angmom", 4, &[w, x, y, z].map(|part| 2.0 * part)),
            column("moment_inertia", 3, &inertia.to_array()),
        ]
    };
    let found = |inertia| {
        let found = AngularVelocities::find(&columns(inertia)).expect("angular velocities");
        DVec3::from_array(found.values[0].map(f64::from))
    };
    assert!((found(inertia) - velocity).length() < 1e-6, "{}", found(inertia));
    // Without a moment of inertia about x, there is no rotation about it
    let flat = q.inverse() * found(DVec3::new(0.0, 3.0, 5.0));
    let expected = DVec3::new(0.0, own.y / 3.0, own.z / 5.0);
    assert!((flat - expected).length() < 1e-6, "{flat} {expected}");
}
