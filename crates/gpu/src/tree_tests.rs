//! Trees on a device contain their spheres, in an order along a curve.

use super::*;

/// Even points and four at each of many places, from a fixed sequence.
fn points(count: u32) -> Vec<[f32; 3]> {
    let coordinate = |i: u32, prime: u32| (i.wrapping_mul(prime) >> 8) as f32 / 1e6 - 7.0;
    let point = |i: u32| [2_654_435_761, 2_246_822_519, 3_266_489_917].map(|p| coordinate(i, p));
    (0..count).map(|i| point(if i % 8 < 4 { i } else { i / 32 })).collect()
}

/// The box of child `j` of a node.
fn child_box(node: &[u32; 16], j: usize) -> [[f64; 2]; 3] {
    std::array::from_fn(|axis| {
        let step = f64::from(f32::from_bits((node[3] >> (8 * axis) & 255) << 23));
        let byte = |word: usize| f64::from(node[4 + 4 * axis + word].to_le_bytes()[j % 4]);
        let low = f64::from(f32::from_bits(node[axis]));
        [low + step * byte(j / 4), low + step * byte(2 + j / 4)]
    })
}

/// Checks that the boxes above each visible sphere contain it, and returns the indices of these spheres.
fn visible(content: &TreeContent, shape: &TreeShape) -> Vec<u32> {
    let mut found = Vec::new();
    for (slot, sphere) in content.spheres.iter().enumerate() {
        if sphere[0] > 1e38 {
            continue;
        }
        found.push(if shape.is_common { sphere[3].to_bits() } else { content.order[slot] });
        let reach = if shape.is_common { 0.0 } else { f64::from(sphere[3]) };
        let [mut child, width] = [slot / 8, 8];
        for start in &shape.starts[..shape.levels as usize] {
            let node = &content.nodes[*start as usize + child / width];
            let number = child % width;
            assert!(node[3] >> (24 + number) & 1 == 1, "slot {slot} is in an empty child");
            for (axis, [low, high]) in child_box(node, number).into_iter().enumerate() {
                let (center, slack) = (f64::from(sphere[axis]), 1e-5);
                assert!(low <= center - reach + slack && center + reach <= high + slack);
            }
            child /= width;
        }
    }
    found
}

/// The tree of `centers`, and the indices of its visible spheres in their order.
fn built(builder: &mut TreeBuilder, device: &Device, spheres: &Spheres<'_>) -> Vec<u32> {
    builder.build(device, spheres, None).unwrap();
    visible(&builder.content(device).unwrap(), builder.shape())
}

#[test]
fn boxes_contain_all_places_once() {
    let Some(device) = Device::for_tests() else { return };
    let mut builder = TreeBuilder::new(&device);
    for count in [0, 1, 8, 9, 2047, 2049, 9000] {
        let centers = points(count);
        let radii: Vec<f32> = (0..count).map(|i| 0.01 + (i % 5) as f32).collect();
        for radii in [Radii::Common(0.2), Radii::PerSphere(&radii)] {
            for order in [
                Order::Any(KeyLength::Short),
                Order::Any(KeyLength::Long),
                Order::Any(KeyLength::Longest),
                Order::AlongCurve,
            ] {
                let found = built(
                    &mut builder,
                    &device,
                    &Spheres {
                        centers: Centers::Points(&centers),
                        radii,
                        order,
                        displacements: None,
                        keeps_codes: false,
                        keeps_copies: false,
                    },
                );
                // Each place is visible, by its lowest index if copies follow each other
                let bits = |i: &u32| centers[*i as usize].map(f32::to_bits);
                let mut places: Vec<_> = found.iter().map(bits).collect();
                places.sort_unstable();
                places.dedup();
                let mut all: Vec<_> = centers.iter().map(|c| c.map(f32::to_bits)).collect();
                all.sort_unstable();
                all.dedup();
                assert!(places == all, "{count} {order:?}");
                if let (Radii::Common(_), Order::Any(KeyLength::Long)) = (radii, order) {
                    assert_eq!(found.len(), all.len(), "copies are visible");
                }
            }
        }
    }
}

#[test]
fn neighbours_in_the_order_are_near_each_other() {
    let Some(device) = Device::for_tests() else { return };
    let mut builder = TreeBuilder::new(&device);
    let centers = points(8192);
    let distance = |order: &[u32]| {
        let pairs = order.windows(2);
        let length = |pair: &[u32]| {
            let [a, b] = [pair[0], pair[1]].map(|i| centers[i as usize]);
            a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f32>()
        };
        pairs.map(length).sum::<f32>()
    };
    let given: Vec<u32> = (0..8192).collect();
    for length in [KeyLength::Short, KeyLength::Long, KeyLength::Longest] {
        let radii = Radii::Common(0.1);
        let spheres = Spheres {
            centers: Centers::Points(&centers),
            radii,
            order: Order::Any(length),
            displacements: None,
            keeps_codes: false,
            keeps_copies: false,
        };
        assert!(
            distance(&built(&mut builder, &device, &spheres)) < 0.1 * distance(&given),
            "{length:?}"
        );
    }
}

#[test]
fn levels_end_at_one_node() {
    assert_eq!(level_sizes(1), [1]);
    assert_eq!(level_sizes(9), [2, 1]);
    assert_eq!(level_sizes(513), [65, 9, 2, 1]);
    assert_eq!(level_sizes(MAX_SPHERES / BLOCK).len(), 10);
}
