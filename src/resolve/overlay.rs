//! Overlays: what they show, where they are, and whether they are dark or light.

use std::sync::Arc;

use glam::{Vec2, Vec3};
use spherule_formats::element_symbol;

use super::ResolveError;
use crate::manifest::{self, ColorSetting, Manifest, MapName, OverlayKind};
use crate::math::functions::exp2;
use crate::output::view::{srgb_from_linear, view_transform};
use crate::overlay::{
    Axes, Color, ColorBar, ColorBarKind, Content, Corner, FrameValues, FrameView, Image, Overlay,
    Placement, RgbaPixels, ScaleBar, Template,
};
use crate::pipeline::{ColorRule, Setup};
use crate::scene::Camera;
use crate::survey::{ParticleValue, Survey, shown_name};

/// Colours of a continuous bar.
const COLORS: u16 = 256;

/// Corners for colour bars and scale bars, best first.
const BAR_CORNERS: [Corner; 4] =
    [Corner::BottomRight, Corner::TopRight, Corner::BottomLeft, Corner::TopLeft];

/// Corners for text and axes, best first.
const TEXT_CORNERS: [Corner; 4] =
    [Corner::TopLeft, Corner::BottomLeft, Corner::TopRight, Corner::BottomRight];

/// Whether positions of particles are needed to find a free corner.
pub(super) fn needs_points(manifest: &Manifest) -> bool {
    manifest.overlays.iter().any(|overlay| overlay.corner.is_none())
}

/// Adds the overlays of `manifest` to `setup`; `pictures` are those of its overlays of the type image, in this order.
///
/// # Errors
/// One shows what the particles do not have.
pub(super) fn add_overlays(
    setup: &mut Setup,
    manifest: &Manifest,
    survey: &Survey,
    camera: &Camera,
    pictures: &[Arc<RgbaPixels>],
) -> Result<(), ResolveError> {
    let mut pictures = pictures.iter();
    let [columns, rows] = camera.eyes();
    let render = &setup.picture.render;
    let picture = [render.width / columns, render.height / rows];
    let points = film_points(setup, survey, camera, picture);
    // Values as long as those of most frames
    let values = FrameValues {
        time: Some(0.0),
        particles: survey.most_particles as u64,
        ..FrameValues::default()
    };
    let view = FrameView {
        values,
        units_per_height: setup.units_per_height(camera),
        ..FrameView::default()
    };
    // Overlays without a corner leave those that others have
    let given = manifest.overlays.iter().filter_map(|overlay| overlay.corner);
    let mut taken: Vec<Corner> = given.collect();
    let mut overlays = Vec::new();
    for own in &manifest.overlays {
        #[expect(clippy::cast_possible_truncation, reason = "a fraction of the picture")]
        let offset = own.offset.map(|part| part as f32);
        let content = match &own.kind {
            OverlayKind::Image { height, .. } => pictures.next().map(|source| {
                Content::Image(Image { source: Arc::clone(source), height: *height })
            }),
            kind => content(setup, manifest, survey, kind, view.units_per_height)?,
        };
        let Some(content) = content else { continue };
        let mut overlay = Overlay {
            content,
            placement: Placement { corner: own.corner.unwrap_or(Corner::TopLeft), offset },
            size: own.size.fraction(picture[1], manifest.image.dpi),
            color: [0.0; 3],
            halo: [1.0; 3],
        };
        let size = overlay.measure(picture[1], &view);
        if own.corner.is_none() {
            let is_bar =
                matches!(own.kind, OverlayKind::ColorBar { .. } | OverlayKind::ScaleBar { .. });
            let order = if is_bar { BAR_CORNERS } else { TEXT_CORNERS };
            let free: Vec<Corner> =
                (order.into_iter()).filter(|corner| !taken.contains(corner)).collect();
            let choice = if free.is_empty() { &order[..] } else { &free };
            overlay.placement.corner = Corner::freest(choice, offset, size, picture, &points);
            taken.push(overlay.placement.corner);
        }
        let at = overlay.placement.center(size, picture);
        (overlay.color, overlay.halo) = colors(setup, camera, own, at);
        if let Content::Text(template) = &overlay.content {
            setup.picture.overlay_values.extend(template.names().map(str::to_owned));
        }
        overlays.push(overlay);
    }
    setup.picture.overlays = overlays;
    Ok(())
}

/// The particles of the survey on the film, pixels.
fn film_points(
    setup: &Setup,
    survey: &Survey,
    camera: &Camera,
    picture: [u32; 2],
) -> Vec<[f32; 2]> {
    let window = setup.picture.render.window;
    let whole = window.map_or(picture, |window| window.image);
    let first = window.map_or([0, 0], |window| [window.left, window.top]);
    let points = survey.points.iter();
    let on_film = points.filter_map(|point| camera.film_of(Vec3::from_array(*point)));
    let pixel = |film: Vec2| {
        let [x, y] = [film.x * whole[0] as f32, film.y * whole[1] as f32];
        [x - first[0] as f32, y - first[1] as f32]
    };
    on_film.map(pixel).collect()
}

/// What an overlay shows; None if there is nothing to show.
fn content(
    setup: &Setup,
    manifest: &Manifest,
    survey: &Survey,
    kind: &OverlayKind,
    units_per_height: f64,
) -> Result<Option<Content>, ResolveError> {
    Ok(match kind {
        OverlayKind::ColorBar { title, unit, length, orientation } => {
            let Some((name, kind)) = color_bar(setup, manifest) else {
                if survey.most_particles == 0 {
                    return Ok(None);
                }
                return Err(ResolveError::Unsupported {
                    key: "overlay.type",
                    what: "the colours of the particles are no values of a map, so that there is no colour bar; \
                           choose an attribute (--color-by)"
                        .to_owned(),
                });
            };
            Some(Content::ColorBar(ColorBar {
                title: title.clone().unwrap_or(name),
                unit: unit.clone().unwrap_or_default(),
                length: *length,
                orientation: *orientation,
                kind,
            }))
        }
        OverlayKind::Text { text } => {
            let template = match text {
                Some(text) => text.template().clone(),
                None => time_stamp(survey),
            };
            for name in template.names() {
                check_value(survey, name)?;
            }
            Some(Content::Text(template))
        }
        OverlayKind::ScaleBar { length, unit } => Some(Content::ScaleBar(ScaleBar {
            length: length.unwrap_or_else(|| ScaleBar::round_length(units_per_height)),
            unit: unit.clone().unwrap_or_default(),
        })),
        OverlayKind::Axes => {
            Some(Content::Axes(Axes { names: ["x", "y", "z"].map(str::to_owned) }))
        }
        OverlayKind::Image { .. } => None,
    })
}

/// The name of the value that colours the particles, and its colours; None if it is none.
fn color_bar(setup: &Setup, manifest: &Manifest) -> Option<(String, ColorBarKind)> {
    let ColorRule::Attribute { name, map, .. } = &setup.picture.color else {
        return None;
    };
    let kind = match (map.range(), map.categories()) {
        (Some((range, scale)), _) => {
            let steps = map.steps();
            let count = steps.and_then(|steps| u16::try_from(steps).ok()).unwrap_or(COLORS);
            let at = |i: u16| match steps {
                Some(_) => (f32::from(i) + 0.5) / f32::from(count),
                None => f32::from(i) / f32::from(count - 1),
            };
            ColorBarKind::Numbers {
                colors: (0..count).map(|i| srgb(map.color_at(at(i)))).collect(),
                range,
                scale,
                is_discrete: steps.is_some(),
            }
        }
        (None, categories) => ColorBarKind::Categories(named(categories?, manifest)),
    };
    Some((shown_name(name).to_owned(), kind))
}

/// Categories with their names, or their numbers.
fn named(categories: &[(i64, Vec3)], manifest: &Manifest) -> Vec<(String, Color)> {
    let (names, is_elements) = match &manifest.material.color {
        ColorSetting::Mapped(by) => (by.names.as_ref(), by.map() == MapName::ELEMENTS),
        _ => (None, false),
    };
    let name = |value: i64| {
        let mut all = names.iter().flat_map(|names| &names.0);
        let found = all.find(|(known, _)| *known == value);
        let symbol = || element_symbol(value).filter(|_| is_elements);
        let name = found.map(|(_, name)| name.clone());
        name.or_else(|| symbol().map(str::to_owned)).unwrap_or_else(|| value.to_string())
    };
    let all = categories.iter();
    all.map(|(value, color)| (name(*value), srgb(*color))).collect()
}

/// The time, with decimals for the time between frames or for three digits of the only time, or the frame number.
fn time_stamp(survey: &Survey) -> Template {
    let decimals = |is_enough: &dyn Fn(f64) -> bool| {
        (0..6).find(|decimals| is_enough(f64::from(10_u32.pow(*decimals)))).unwrap_or(6)
    };
    let step = survey.frame_time.filter(|step| *step > 0.0);
    let decimals = match (step, survey.largest_time) {
        (Some(step), _) => Some(decimals(&|scale| {
            (step * scale).round() / scale >= 0.95 * step && (step * scale).round() >= 1.0
        })),
        (None, Some(time)) => Some(decimals(&|scale| {
            time == 0.0 || time * scale >= 100.0 || (time * scale).fract() == 0.0
        })),
        (None, None) => None,
    };
    let text = match decimals {
        Some(decimals) => format!("t = {{time:.{decimals}f}}"),
        None => "frame {frame}".to_owned(),
    };
    Template::parse(&text).expect("a text with known variables")
}

/// Checks that the particles have a value.
fn check_value(survey: &Survey, name: &str) -> Result<(), ResolveError> {
    let value = super::color::value_of(survey, name, "overlay.text")?;
    match value {
        ParticleValue::Magnitude(_) | ParticleValue::Component(..) => Ok(()),
        _ => Err(ResolveError::Unsupported {
            key: "overlay.text",
            what: format!("{name} is no attribute, and only attributes have a range here"),
        }),
    }
}

/// The colours of text and of its halo over what is behind the particles at a position of the film.
fn colors(setup: &Setup, camera: &Camera, own: &manifest::Overlay, at: [f32; 2]) -> (Color, Color) {
    let behind = backdrop(setup, camera, Vec2::from_array(at));
    let is_light = behind.dot(LUMINANCE) > MIDDLE;
    let text = own.color.unwrap_or(match is_light {
        true => Vec3::ZERO,
        false => Vec3::ONE,
    });
    // A halo in the colour of the backdrop is invisible over it
    let contrasts = (text.dot(LUMINANCE) > MIDDLE) != is_light;
    let halo = match contrasts {
        true => behind,
        false if is_light => Vec3::ZERO,
        false => Vec3::ONE,
    };
    (srgb(text), srgb(halo))
}

/// Weights of linear RGB in the luminance (ITU-R BT.709).
const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

/// The luminance on which black and white text have the same contrast (WCAG 2: (l + 0.05)^2 = 1.05 * 0.05).
const MIDDLE: f32 = 0.179;

/// What the preview shows without particles at a position of the film, linear RGB.
fn backdrop(setup: &Setup, camera: &Camera, film: Vec2) -> Vec3 {
    let (scene, picture) = (&setup.picture.scene, &setup.picture);
    let ray = camera.ray(film);
    let color = match &scene.ground {
        Some(ground) if ground.shadow_catcher.is_none() && ground.is_opaque_at(&ray) => {
            ground.color
        }
        _ => match &scene.environment {
            Some(environment) if scene.is_environment_visible => {
                environment.radiance(ray.direction)
            }
            _ if picture.render.transparent_background => scene.background.color(camera.forward()),
            _ if camera.projection().is_panorama() => scene.background.color(ray.direction),
            _ => scene.background.color_on_film(ray.direction, film),
        },
    };
    view_transform(color * exp2(picture.preview.exposure))
}

fn srgb(linear: Vec3) -> Color {
    linear.to_array().map(|v| srgb_from_linear(v.clamp(0.0, 1.0)))
}
