//! The attributes of an image with Cryptomatte layers: their names, and a manifest with the names of the objects.

use std::collections::BTreeSet;
use std::fmt::Write;

use super::renderer::{BuiltFrame, BuiltParticles};
use super::setup::Setup;
use super::shading::particle_shading;
use crate::output::TextAttribute;
use crate::render::ShadeSource;
use crate::render::cryptomatte::{ObjectName, murmur_hash3, object_of};
use crate::render::layers::MatteKind;
use crate::scene::Owner;
use crate::scene::material::DEFAULT_COLOR;

/// Maximum number of names in a manifest. A manifest of more names is left out.
const MAX_NAMES: usize = 100_000;

/// Maximum length of a name with its object in a manifest, bytes.
const NAME_BYTES: u64 = 32;

/// Maximum memory of the manifests of a frame of `particles`, bytes: in the frame, in the layout of the file and in its
/// header.
pub(super) fn predicted_bytes(setup: &Setup, particles: u64) -> u64 {
    let mattes = setup.picture.render.channels.mattes();
    let names = particles.min(MAX_NAMES as u64);
    3 * NAME_BYTES * names * mattes.count() as u64
}

/// The attributes of the Cryptomatte layers of `frame`.
pub(super) fn attributes_of(setup: &Setup, frame: &BuiltFrame) -> Vec<TextAttribute> {
    if setup.picture.render.channels.mattes().next().is_none() {
        return Vec::new();
    }
    let (count, picture) = (frame.report.particles, &setup.picture);
    match &*frame.particles {
        BuiltParticles::Decoded(shading) => {
            attributes(setup, &particle_shading(picture, shading), count)
        }
        BuiltParticles::Stored(stored) => {
            attributes(setup, &stored.shading(picture, DEFAULT_COLOR), count)
        }
    }
}

/// The attributes of all Cryptomatte layers of an image of `particles` particles.
fn attributes(setup: &Setup, source: &dyn ShadeSource, particles: u64) -> Vec<TextAttribute> {
    let mattes = setup.picture.render.channels.mattes();
    let count = u32::try_from(particles).unwrap_or(u32::MAX);
    let mut all = Vec::new();
    for kind in mattes {
        // The key of a layer is the start of the hash of its name
        let hash = format!("{:08x}", murmur_hash3(kind.plane().name().as_bytes()));
        let mut put = |name: &str, text: String| {
            all.push(TextAttribute { name: format!("cryptomatte/{}/{name}", &hash[..7]), text });
        };
        put("conversion", "uint32_to_float32".to_owned());
        put("hash", "MurmurHash3_32".to_owned());
        if let Some(manifest) = manifest(setup, kind, source, count) {
            put("manifest", manifest);
        }
        put("name", kind.plane().name().to_owned());
    }
    all
}

/// The parts of the particles: attributes and their values; None if there are too many.
fn parts_of(source: &dyn ShadeSource, count: u32) -> Option<BTreeSet<(&str, i32)>> {
    let mut parts = BTreeSet::new();
    for part in (0..count).map_while(|index| source.part(index)) {
        parts.insert(part);
        if parts.len() > MAX_NAMES {
            return None;
        }
    }
    Some(parts)
}

/// The manifest of a layer of `kind`; None if there are too many names.
fn manifest(
    setup: &Setup,
    kind: MatteKind,
    source: &dyn ShadeSource,
    count: u32,
) -> Option<String> {
    let scene = &setup.picture.scene;
    let mut json = String::from("{");
    let mut add = |name: &[u8]| {
        let comma = if json.len() > 1 { "," } else { "" };
        // Names are letters, digits and minus signs, which need no escapes
        let text = String::from_utf8_lossy(name);
        let _ = write!(json, "{comma}\"{text}\":\"{:08x}\"", object_of(name));
    };
    // Name the particles as the kind divides them
    match kind {
        MatteKind::Material => {
            let of_particles = scene.materials.iter().map(|material| material.owner);
            for owner in of_particles.filter(|owner| owner.is_of_particles()) {
                add(ObjectName::of_owner(owner).as_bytes());
            }
        }
        MatteKind::Particle => {
            if count as usize > MAX_NAMES {
                return None;
            }
            let ids: BTreeSet<u32> = (0..count).map(|index| source.id(index)).collect();
            for id in ids {
                add(ObjectName::of_particle(id).as_bytes());
            }
        }
        MatteKind::Part => {
            let parts = parts_of(source, count)?;
            for (attribute, value) in &parts {
                add(ObjectName::of_part(attribute, *value).as_bytes());
            }
            if parts.is_empty() {
                add(ObjectName::of_owner(Owner::Particles).as_bytes());
            }
        }
    }
    // Name the ground, unless it is invisible, and everything else
    let has_ground = scene.ground.as_ref().is_some_and(|ground| ground.shadow_catcher.is_none());
    for owner in scene.materials.iter().map(|material| material.owner) {
        let is_named = match owner {
            Owner::Ground => has_ground,
            Owner::Thing(_) => true,
            Owner::Particles | Owner::Part(_) | Owner::Style(_) | Owner::Spray => false,
        };
        if is_named {
            add(ObjectName::of_owner(owner).as_bytes());
        }
    }
    json.push('}');
    Some(json)
}
