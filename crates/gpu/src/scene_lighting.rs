//! The lighting of scenes of the tracer. Its tables take milliseconds to compute, so they are kept while the scene has
//! the same environment, ground and material.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::Vec3;
use spherule_tracer::render::device::{
    ambient_reach, light_on, mirrors_see_through, reflected_by_white, rough_glass_table,
    rough_table,
};
use spherule_tracer::render::{IndirectLight, RenderSettings, ShadeSource};
use spherule_tracer::scene::ground::Pattern;
use spherule_tracer::scene::{self, Finish, Material, Scene, environment::TableArrays};

use crate::lighting::{self, Catcher, Ground, Lighting, Rough, TablePlace, Tables};

/// What the tables depend on.
#[derive(Debug, Clone)]
struct Key {
    environment: Option<Arc<scene::Environment>>,
    /// Those of the groups of spheres.
    finishes: Vec<Finish>,
    /// The particles, if rays enter them.
    glass: Option<Material>,
    /// The normal of a shadow catcher.
    catcher: Option<Vec3>,
}

impl Key {
    fn of(scene: &Scene, source: &dyn ShadeSource) -> Self {
        let ground = scene.ground.as_ref();
        let of_styles = source.styles().iter().map(|style| scene.material(style.material));
        let materials = std::iter::once(scene.particle_material()).chain(of_styles);
        Self {
            environment: scene.environment.clone().filter(|environment| !environment.is_black()),
            finishes: materials.map(|material| material.finish).collect(),
            glass: Some(*scene.particle_material()).filter(|material| material.transmission > 0.0),
            catcher: ground.filter(|ground| ground.shadow_catcher.is_some()).map(|g| g.up),
        }
    }

    fn is_same(&self, other: &Self) -> bool {
        let environments = match (&self.environment, &other.environment) {
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            (None, None) => true,
            _ => false,
        };
        environments
            && self.finishes == other.finishes
            && self.glass == other.glass
            && self.catcher == other.catcher
    }
}

/// The lighting of the last scene.
#[derive(Debug, Default)]
pub(crate) struct SceneLighting {
    kept: Option<(Key, Lighting)>,
}

impl SceneLighting {
    /// The lighting of `scene`, whose spheres have the styles of `source`. Its ground has no pattern but squares.
    pub(crate) fn of(
        &mut self,
        scene: &Scene,
        source: &dyn ShadeSource,
        settings: &RenderSettings,
    ) -> &Lighting {
        let key = Key::of(scene, source);
        let kept = self.kept.take().filter(|(kept, _)| kept.is_same(&key));
        let (_, lighting) = self.kept.insert(kept.unwrap_or_else(|| {
            let lighting = prepared(&key);
            (key, lighting)
        }));
        // What is cheap follows the scene
        for (finish, style) in lighting.finishes.iter_mut().skip(1).zip(source.styles()) {
            finish.0 = style.first;
        }
        let catcher = lighting.ground.and_then(|ground| ground.catcher);
        lighting.ground = scene.ground.as_ref().map(|ground| ground_of(ground, catcher));
        lighting.is_environment_visible = scene.is_environment_visible;
        lighting.environment_group = scene.environment_group.into();
        lighting.bounces = settings.traced_bounces();
        lighting.indirect_limit = settings.clamp;
        lighting.has_mirrors = mirrors_see_through(scene, settings);
        lighting.ambient_reach = match settings.indirect {
            IndirectLight::Traced => None,
            IndirectLight::Ambient { radius } => Some(ambient_reach(radius)),
        };
        lighting
    }
}

/// The lighting with all tables. Of the ground, only the catcher is known.
fn prepared(key: &Key) -> Lighting {
    static VERSIONS: AtomicU64 = AtomicU64::new(0);
    let version = VERSIONS.fetch_add(1, Ordering::Relaxed);
    let mut tables = Tables { version, ..Tables::default() };
    let environment = key.environment.as_deref();
    let finishes = key.finishes.iter().map(|finish| (0, finish_of(*finish, &mut tables))).collect();
    let catcher = key.catcher.map(|up| {
        let light = environment.map(|environment| light_on(environment, up));
        Catcher {
            strength: 1.0,
            whole: light.as_ref().map_or(Vec3::ZERO, reflected_by_white).to_array(),
            table: light.map_or_else(TablePlace::default, |table| tables.add(table.arrays())),
        }
    });
    let rough_glass = key.glass.as_ref().and_then(rough_glass_table).map(|(alpha, numbers)| {
        let table = Tables::place(&tables.constants);
        tables.constants.extend(numbers);
        Rough { alpha, table }
    });
    Lighting {
        rough_glass,
        environment: environment.map(|environment| environment_of(environment, &mut tables)),
        ground: catcher.map(|catcher| Ground { catcher: Some(catcher), ..NO_GROUND }),
        finishes,
        bounces: 0,
        ambient_reach: None,
        indirect_limit: None,
        has_mirrors: false,
        is_environment_visible: false,
        environment_group: 0,
        tables,
    }
}

const NO_GROUND: Ground = Ground {
    up: [0.0; 3],
    height: 0.0,
    center: [0.0; 3],
    base: [0.0; 3],
    fade: [0.0; 2],
    color: [0.0; 3],
    checker: None,
    catcher: None,
};

impl Tables {
    /// The place of the next number of an array.
    fn place<T>(numbers: &[T]) -> u32 {
        u32::try_from(numbers.len()).expect("tables are small")
    }

    fn add(&mut self, table: TableArrays<'_>) -> TablePlace {
        let place = TablePlace {
            side: u32::try_from(table.side).expect("tables are small"),
            records: Self::place(&self.texels),
            ends: Self::place(&self.constants),
        };
        self.texels.extend_from_slice(table.records);
        self.constants.extend_from_slice(table.rows);
        self.constants.extend_from_slice(table.cells);
        place
    }
}

fn environment_of(environment: &scene::Environment, tables: &mut Tables) -> lighting::Environment {
    let axes = environment.axes();
    let table = tables.add(environment.table().arrays());
    let image = Tables::place(&tables.texels);
    tables.texels.extend(environment.pixels().iter().map(|[r, g, b]| [*r, *g, *b, 0.0]));
    lighting::Environment {
        axes: [axes.right, axes.back, axes.up].map(|axis| axis.to_array()),
        table,
        image,
        detail: environment
            .detail()
            .map(|(map, scale)| lighting::Detail { map: Arc::clone(map), scale: scale.to_array() }),
        harmonics: environment.irradiance_harmonics().coefficients().map(|c| c.to_array()),
    }
}

fn finish_of(finish: Finish, tables: &mut Tables) -> lighting::Finish {
    let rough = rough_table(finish).map(|(alpha, numbers)| {
        let table = Tables::place(&tables.constants);
        tables.constants.extend(numbers);
        Rough { alpha, table }
    });
    match (finish, rough) {
        (Finish::Plastic { .. }, Some(rough)) => lighting::Finish::Plastic(rough),
        (Finish::Metal { .. }, Some(rough)) => lighting::Finish::Metal(rough),
        _ => lighting::Finish::Matte,
    }
}

/// The plane of `ground`, which has no pattern but squares.
pub(crate) fn ground_of(ground: &scene::Ground, catcher: Option<Catcher>) -> Ground {
    Ground {
        up: ground.up.to_array(),
        height: ground.height,
        center: ground.center.to_array(),
        base: ground.base.to_array(),
        fade: [ground.fade_start, ground.fade_end],
        color: ground.color.to_array(),
        checker: match ground.pattern {
            Pattern::Checker { tile } => Some((tile, ground.axes()[0].to_array())),
            Pattern::Plain | Pattern::Sand { .. } | Pattern::Image(_) => None,
        },
        catcher: ground
            .shadow_catcher
            .and_then(|strength| catcher.map(|catcher| Catcher { strength, ..catcher })),
    }
}
