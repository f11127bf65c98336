//! Rays in the leaves of a mapped native frame, whatever they hold.

use std::fs;

use glam::Vec3;
use spherule::accel::Structure;
use spherule::accel::simd::SimdLevel;
use spherule::accel::stored::{StoredSettings, StoredTree};
use spherule::accel::traverse::TreeCrossing;
use spherule::accel::view::TreeView;
use spherule::ray::{Ray, RayPacket};
use spherule_formats::blocks::StoredLeaves;
use spherule_formats::native::{Access, MAGIC, NativeFile, layout};

/// Radii that are given instead of those in the file; the first byte picks one.
const RADII: [Option<f32>; 5] = [None, Some(0.4), Some(1e-3), Some(1e4), Some(0.0)];

/// The first byte picks settings, the others are a native frame, whose header and index get the checksums that
/// mutation would never hit.
pub fn trace(bytes: &[u8]) -> usize {
    let Some((choice, bytes)) = bytes.split_first() else {
        return 0;
    };
    let Some(bytes) = repaired(bytes) else {
        return 0;
    };
    if layout::parse(&bytes).is_err() {
        // Most inputs end here, and a file for each would be slow.
        return 0;
    }
    let dir = tempfile::tempdir().expect("a temporary directory");
    let path = dir.path().join("a.spf");
    fs::write(&path, &bytes).expect("writable");
    let file = NativeFile::open(&path, Access::Map).expect("as its bytes were parsed");
    let frame = file.frame().expect("unchanged");
    let Ok(leaves) = frame.leaves() else {
        return 0;
    };
    let settings = StoredSettings {
        structure: Structure::Kdtree,
        radius: RADII[usize::from(*choice) % RADII.len()],
        keep_indices: choice & 0x80 != 0,
    };
    let traced = traced(&leaves, settings, frame.verify_all().is_ok());
    file.check().expect("nobody touched it");
    traced
}

/// `bytes` under a header that is right for the index they state.
fn repaired(bytes: &[u8]) -> Option<Vec<u8>> {
    let stated = u64::from_le_bytes(*bytes.get(24..)?.first_chunk()?);
    let index = bytes.get(usize::try_from(stated).ok()?..)?;
    let (_, body) = bytes.split_at_checked(layout::HEADER_LEN)?;
    let header = layout::header(bytes.len() as u64, stated, index, 0);
    bytes.starts_with(MAGIC).then(|| [&header, body].concat())
}

/// Returns how many particles are traced. What is not `sound` makes wrong pictures, but no panic.
fn traced(leaves: &StoredLeaves, settings: StoredSettings, is_sound: bool) -> usize {
    let mut tree = StoredTree::new();
    if let Err(fault) = tree.build(leaves, settings) {
        assert!(!fault.to_string().is_empty());
        return 0;
    }
    for level in SimdLevel::ALL.into_iter().filter(|l| l.is_supported()) {
        tree.set_simd(level);
        trace_rays(&tree.view(leaves), is_sound);
    }
    tree.view(leaves).len()
}

/// Rays from far off, from the middle, along the axes, and with ends.
fn trace_rays(view: &TreeView, is_sound: bool) {
    let bounds = view.bounds();
    let (center, reach) = ((bounds.min + bounds.max) * 0.5, (bounds.max - bounds.min).length());
    let axes = [Vec3::X, Vec3::NEG_Y, Vec3::Z, Vec3::new(0.6, 0.8, 0.0), Vec3::splat(0.577_350_26)];
    let starts = [center, bounds.min, Vec3::ZERO, center + Vec3::splat(reach)];
    let mut packet = RayPacket::default();
    let mut crossings = Vec::new();
    for direction in axes {
        for start in starts {
            let ray = Ray {
                t_max: if packet.len() % 3 == 0 { f32::INFINITY } else { reach },
                ..Ray::new(start - direction * reach, direction)
            };
            trace_ray(view, &ray, is_sound, &mut crossings);
            packet.push(&ray);
            if packet.is_full() {
                trace_packet(view, &packet, is_sound);
                packet.clear();
            }
        }
    }
    trace_packet(view, &packet, is_sound);
}

fn trace_ray(view: &TreeView, ray: &Ray, is_sound: bool, crossings: &mut Vec<TreeCrossing>) {
    let nearest = view.nearest(ray);
    let any = view.any_hit(ray);
    assert!(!is_sound || any == nearest.is_some(), "{ray:?}");
    view.crossings(ray, crossings);
    for slot in nearest.map(|hit| hit.slot).into_iter().chain(crossings.iter().map(|c| c.slot)) {
        view.sphere(slot);
        assert!((view.particle(slot) as usize) < view.len());
    }
}

/// Packets find what single rays find.
fn trace_packet(view: &TreeView, packet: &RayPacket, is_sound: bool) {
    let any = view.any_hit_packet(packet);
    let hits = view.nearest_packet(packet);
    for hit in hits.iter().flatten() {
        assert!((view.particle(hit.slot) as usize) < view.len());
    }
    for (lane, ray) in packet.rays().enumerate().filter(|_| is_sound) {
        assert_eq!(hits[lane], view.nearest(&ray), "lane {lane}: {ray:?}");
        assert_eq!(any >> lane & 1 != 0, view.any_hit(&ray), "lane {lane}: {ray:?}");
    }
}
