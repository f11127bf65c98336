//! Overlays: what they show, where they are, and whether they are dark or light.

use std::borrow::Cow;
use std::sync::Arc;

use glam::{Vec2, Vec3};
use spherule_formats::element_symbol;

use super::{ResolveError, color};
use crate::manifest::{
    ColorSetting, LabelFormat, Manifest, Overlay as ManifestOverlay, OverlayKind, OverlayLayout,
};
use crate::output::view::srgb_from_linear;
use crate::overlay::{
    Axes, Boxes, Color, ColorBar, ColorBarKind, Content, Corner, FrameValues, FrameView, Image,
    Layout, Orientation, Overlay, Page, Placement, RgbaPixels, ScaleBar, Template,
};
use crate::pipeline::{ColorRule, ParticleStyle, Setup};
use crate::scene::{Background, Camera};
use crate::survey::{Survey, shown_name};
use spherule_frame::values::Value;

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

/// Adds the overlays of `manifest` to `setup`, whose picture is on `page`; `pictures` are those of its overlays of the
/// type image, in this order.
///
/// # Errors
/// One shows what the particles do not have.
pub(super) fn add_overlays(
    setup: &mut Setup,
    manifest: &Manifest,
    survey: &Survey,
    page: &Page,
    pictures: &[Arc<RgbaPixels>],
) -> Result<(), ResolveError> {
    // Find what automatic corners and lengths depend on
    let camera = setup.picture.scene.camera;
    let mut pictures = pictures.iter();
    let points = film_points(setup, survey, &camera, page.picture);
    let view = first_view(setup, survey, &camera);
    // Collect what each overlay shows
    let (mut overlays, mut given, mut entries) = (Vec::new(), Vec::new(), Vec::new());
    for (entry, own) in manifest.overlays.iter().enumerate() {
        let content = match &own.kind {
            OverlayKind::Image { height, .. } => pictures.next().map(|source| {
                Content::Image(Image { source: Arc::clone(source), height: *height })
            }),
            kind => content(setup, manifest, survey, kind, view.units_per_height)?,
        };
        let Some(content) = content else { continue };
        #[expect(clippy::cast_possible_truncation, reason = "a fraction of the picture")]
        let offset = own.offset.map(|part| part as f32);
        if let Content::Text(template) = &content {
            setup.picture.files.overlay_values.extend(template.names().map(str::to_owned));
        }
        entries.push(entry);
        given.push(own.color);
        overlays.push(Overlay {
            content,
            layout: manifest.layout_of(own),
            corner: own.corner,
            placement: Placement { corner: own.corner.unwrap_or(Corner::TopLeft), offset },
            size: own.size.fraction(page.size[1], manifest.image.dpi),
            color: [0.0; 3],
            halo: [1.0; 3],
        });
    }
    // Place them, then choose colours that contrast with what is behind them
    choose_corners(&mut overlays, page, &view, &points);
    choose_colors(setup, &mut overlays, &given, page, &view);
    setup.picture.files.overlays = overlays;
    setup.picture.files.overlay_entries = entries;
    Ok(())
}

/// Gives each overlay its `given` colour, or one that contrasts with the paper or with the picture behind it.
fn choose_colors(
    setup: &Setup,
    overlays: &mut [Overlay],
    given: &[Option<Vec3>],
    page: &Page,
    view: &FrameView,
) {
    let paper = paper(setup);
    let camera = &setup.picture.scene.camera;
    for (overlay, color) in overlays.iter_mut().zip(given) {
        let behind = match overlay.layout {
            Layout::Beside => paper,
            Layout::Over => {
                let size = overlay.measure(page.size[1], view);
                backdrop(setup, camera, overlay.placement.center(size, page.picture).into())
            }
        };
        (overlay.color, overlay.halo) = colors(behind, *color);
    }
}

/// The view of the start of the camera path, with values as long as those of most frames.
pub(super) fn first_view(setup: &Setup, survey: &Survey, camera: &Camera) -> FrameView {
    let values = FrameValues {
        time: Some(0.0),
        particles: survey.most_particles as u64,
        ..FrameValues::default()
    };
    FrameView { values, units_per_height: setup.units_per_height(camera), ..FrameView::default() }
}

/// Gives overlays without a corner one where they cover no other overlay, and the fewest `points`, pixels of the picture.
fn choose_corners(overlays: &mut [Overlay], page: &Page, view: &FrameView, points: &[[f32; 2]]) {
    let mut boxes = Boxes::new(page.picture);
    let is_over = |overlay: &&mut Overlay| overlay.layout == Layout::Over;
    let size = |overlay: &Overlay| overlay.measure(page.size[1], view);
    let (open, given): (Vec<&mut Overlay>, Vec<&mut Overlay>) =
        overlays.iter_mut().filter(is_over).partition(|overlay| overlay.corner.is_none());
    for overlay in given {
        boxes.add(overlay.placement, size(overlay));
    }
    for overlay in open {
        let is_bar = matches!(overlay.content, Content::ColorBar(_) | Content::ScaleBar(_));
        let order = if is_bar { BAR_CORNERS } else { TEXT_CORNERS };
        let offset = overlay.placement.offset;
        overlay.placement.corner = boxes.freest(&order, offset, size(overlay), points);
        boxes.add(overlay.placement, size(overlay));
    }
}

/// Distance of particles from an overlay that covers none, as a fraction of the height of the picture.
const MARGIN: f32 = 0.015;

/// The manifest with a place for overlays whose layout is `auto`: beside the picture if they cover particles in `setup`,
/// whose overlays get the same layout.
pub(super) fn placed<'m>(
    manifest: &'m Manifest,
    survey: &Survey,
    setup: &mut Setup,
) -> Cow<'m, Manifest> {
    let is_open = |overlay: &ManifestOverlay| {
        overlay.layout == Some(OverlayLayout::Auto) && manifest.image.layout == Layout::Over
    };
    // Overlays that show nothing are left out
    let are_all = setup.picture.files.overlays.len() == manifest.overlays.len();
    if !are_all || manifest.against_strips().is_some() || !manifest.overlays.iter().any(is_open) {
        return Cow::Borrowed(manifest);
    }
    // Put those beside the picture that cover something
    let covers = cover_particles(setup, survey);
    let mut placed = manifest.clone();
    let overlays = setup.picture.files.overlays.iter_mut();
    for ((own, overlay), covers) in placed.overlays.iter_mut().zip(overlays).zip(covers) {
        if is_open(own) {
            (own.layout, overlay.layout) = if covers {
                (Some(OverlayLayout::Beside), Layout::Beside)
            } else {
                (Some(OverlayLayout::Over), Layout::Over)
            };
        }
    }
    Cow::Owned(placed)
}

/// Whether each of the overlays of `setup` covers particles.
fn cover_particles(setup: &Setup, survey: &Survey) -> Vec<bool> {
    let (render, camera) = (&setup.picture.render, &setup.picture.scene.camera);
    let page = Page::whole(render.width, render.height);
    let view = first_view(setup, survey, camera);
    let points = film_points(setup, survey, camera, page.picture);
    let margin = MARGIN * page.size[1] as f32;
    let mut boxes = Boxes::new(page.picture);
    let covers = setup.picture.files.overlays.iter().map(|overlay| {
        let size = overlay.measure(page.size[1], &view);
        let at = boxes.add(overlay.placement, size).map(|x| x as f32);
        let is_covered = |point: &[f32; 2]| {
            (0..2).all(|i| (at[i] - margin..=at[i] + size[i] as f32 + margin).contains(&point[i]))
        };
        points.iter().any(is_covered)
    });
    covers.collect()
}

/// What is beside the picture on its page, linear RGB: the background if it has one colour, or else white.
pub(super) fn paper(setup: &Setup) -> Vec3 {
    match setup.picture.scene.background {
        Background::Constant(color) => setup.picture.files.preview.view.conversion()(color),
        _ => Vec3::ONE,
    }
}

/// The least part of the page, along both sides, that the picture has.
const MIN_PART: u32 = 4;

/// The page of the image with room for the overlays beside the picture.
///
/// # Errors
/// There is no room left for the picture.
pub(super) fn page(
    setup: &Setup,
    manifest: &Manifest,
    survey: &Survey,
) -> Result<Page, ResolveError> {
    // Make room, but not at the cost of most of the picture
    let size = manifest.image.size();
    let view = first_view(setup, survey, &setup.picture.scene.camera);
    let page = Page::with_room_for(&setup.picture.files.overlays, size, &view);
    let is_small = |axis: usize| page.picture[axis] < size[axis].div_ceil(MIN_PART);
    if is_small(0) || is_small(1) {
        let [width, height] = size;
        let [own_width, own_height] = page.picture;
        return Err(ResolveError::Unsupported {
            key: "image.layout",
            what: format!(
                "the overlays beside the picture leave {own_width}x{own_height} of {width}x{height} pixels for it; make \
                 the image larger, or overlays smaller (overlay.size, overlay.length), or draw them over the picture"
            ),
        });
    }
    Ok(page)
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

/// What a colour bar of the particles shows, and its title; None if there is nothing to show.
///
/// # Errors
/// The particles have no colour map.
fn shown_colors(
    setup: &Setup,
    manifest: &Manifest,
    survey: &Survey,
) -> Result<Option<(String, ColorBarKind)>, ResolveError> {
    let rules = &setup.picture.particles;
    // Clear particles are seen in their colours only if these absorb light
    let shows_colors = |style: &&ParticleStyle| {
        let material = setup.picture.scene.material(style.material);
        material.transmission == 0.0 || material.color_length.is_some()
    };
    let of_styles = rules.others().iter().filter(shows_colors).map(|style| &style.color);
    let is_seen =
        !rules.is_divided() || (survey.color.is_some() && manifest.material.shows_colors());
    let seen: Vec<&ColorRule> =
        is_seen.then_some(&rules.first().color).into_iter().chain(of_styles).collect();
    let mapped = seen.iter().find_map(|rule| color_bar(rule, &seen, (manifest, survey)));
    match mapped.or_else(|| legend_of_styles(&rules.styles)) {
        None if survey.most_particles > 0 && !rules.is_divided() => Err(without_color_map()),
        shown => Ok(shown),
    }
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
        OverlayKind::ColorBar { title, unit, length, orientation, ticks, format, factor } => {
            let Some((name, kind)) = shown_colors(setup, manifest, survey)? else {
                return Ok(None);
            };
            Some(Content::ColorBar(ColorBar {
                title: title.clone().unwrap_or(name),
                unit: unit.clone().unwrap_or_default(),
                length: *length,
                orientation: *orientation,
                kind,
                ticks: ticks.clone(),
                format: format.as_ref().map(LabelFormat::format),
                factor: factor.unwrap_or(1.0),
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

/// The error of a colour bar in pictures whose colours are not those of a colour map.
fn without_color_map() -> ResolveError {
    let what = "the colours of the particles do not follow a colour map, so there is no colour bar; choose an \
                attribute (--color-by)";
    ResolveError::Unsupported { key: "overlay.type", what: what.to_owned() }
}

/// The colour bar of pictures with the settings of `manifest`: its own, or one with the defaults. None if the colours are
/// not those of a colour map.
///
/// # Errors
/// The settings and the particles do not go together, or the range depends on the camera.
pub fn color_bar_of(
    manifest: &Manifest,
    survey: &Survey,
) -> Result<Option<ColorBar>, ResolveError> {
    // Take the colours of the particles
    let rule = color::rule(&manifest.material.color, survey.color.as_ref(), survey, None)?;
    let Some((name, kind)) = color_bar(&rule, &[], (manifest, survey)) else {
        return Ok(None);
    };
    let mut bar = ColorBar {
        title: name,
        unit: String::new(),
        length: 1.0,
        orientation: Orientation::Vertical,
        kind,
        ticks: None,
        format: None,
        factor: 1.0,
    };
    // Take texts and numbers of the first colour bar, if there is one
    let own = manifest.overlays.iter().find_map(|overlay| match &overlay.kind {
        OverlayKind::ColorBar { title, unit, ticks, format, factor, .. } => {
            Some((title, unit, ticks, format, factor))
        }
        _ => None,
    });
    if let Some((title, unit, ticks, format, factor)) = own {
        bar.title = title.clone().unwrap_or(bar.title);
        bar.unit = unit.clone().unwrap_or_default();
        bar.ticks.clone_from(ticks);
        bar.format = format.as_ref().map(LabelFormat::format);
        bar.factor = factor.unwrap_or(1.0);
    }
    Ok(Some(bar))
}

/// The names and colours of styles, if one has a name.
fn legend_of_styles(styles: &[ParticleStyle]) -> Option<(String, ColorBarKind)> {
    let named = styles.iter().filter(|style| style.is_named);
    let entries: Vec<(String, Color)> = named
        .filter_map(|style| match &style.color {
            ColorRule::Constant(color) => Some((style.name.clone(), srgb(*color))),
            _ => None,
        })
        .collect();
    (!entries.is_empty()).then(|| (String::new(), ColorBarKind::Categories(entries)))
}

/// The name of the value that colours the particles, and its colours; None if it is none. Categories are also those of
/// the rules `seen` in the picture.
fn color_bar(
    rule: &ColorRule,
    seen: &[&ColorRule],
    (manifest, survey): (&Manifest, &Survey),
) -> Option<(String, ColorBarKind)> {
    let ColorRule::Attribute { name, map, .. } = rule else {
        return None;
    };
    // Sample the map, or list its categories
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
        (None, categories) => {
            let own = categories.filter(|categories| !categories.is_empty())?;
            // Other styles may have further categories of the same attribute
            let others = seen.iter().filter_map(|rule| match rule {
                ColorRule::Attribute { name: other, map, .. } if other == name => map.categories(),
                _ => None,
            });
            let mut all = own.to_vec();
            for category in others.flatten() {
                if !all.iter().any(|(value, _)| *value == category.0) {
                    all.push(*category);
                }
            }
            if all.len() > own.len() {
                all.sort_by_key(|(value, _)| *value);
            }
            ColorBarKind::Categories(named(&all, (manifest, survey), name))
        }
    };
    Some((shown_name(name).to_owned(), kind))
}

/// Categories with their names, or their numbers.
fn named(
    categories: &[(i64, Vec3)],
    (manifest, survey): (&Manifest, &Survey),
    attribute: &str,
) -> Vec<(String, Color)> {
    let labels = survey.labels.iter().find(|(column, _)| column.eq_ignore_ascii_case(attribute));
    let (names, is_elements) = match &manifest.material.color {
        ColorSetting::Mapped(by) => (by.names.as_ref(), by.map().is_of_elements()),
        _ => (None, false),
    };
    let name = |value: i64| {
        let mut all = names.iter().flat_map(|names| &names.0);
        let found = all.find(|(known, _)| *known == value);
        let symbol = || element_symbol(value).filter(|_| is_elements);
        let label = || labels.and_then(|(_, labels)| labels.get(&value)).map(|label| shown(label));
        let name = found.map(|(_, name)| name.clone()).or_else(label);
        name.or_else(|| symbol().map(str::to_owned)).unwrap_or_else(|| value.to_string())
    };
    let all = categories.iter();
    all.map(|(value, color)| (name(*value), srgb(*color))).collect()
}

/// A label in a legend, where an empty one would look like a mistake.
fn shown(label: &str) -> String {
    if label.is_empty() { "none".to_owned() } else { label.to_owned() }
}

/// The time, with decimals for the time between frames or for three digits of the only time, or the frame number.
fn time_stamp(survey: &Survey) -> Template {
    // Find decimals that tell frames apart
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
    // Write tiny times in powers of ten
    let is_tiny = |time: f64| step.is_none() && time > 0.0 && time < 1e-4;
    let mut text = match decimals {
        Some(_) if survey.largest_time.is_some_and(is_tiny) => "t = {time:.2e}".to_owned(),
        Some(decimals) => format!("t = {{time:.{decimals}f}}"),
        None => "frame {frame}".to_owned(),
    };
    // Add the unit
    if let Some(unit) = survey.time_unit.as_ref().filter(|_| decimals.is_some()) {
        text.extend([" ", unit]);
    }
    Template::parse(&text).expect("a text with known variables")
}

/// Checks that the particles have a value.
fn check_value(survey: &Survey, name: &str) -> Result<(), ResolveError> {
    let value = super::color::value_of(survey, name, "overlay.text")?;
    match value {
        Value::Magnitude(_) | Value::Component(..) => Ok(()),
        _ => Err(ResolveError::Unsupported {
            key: "overlay.text",
            what: format!("{name} is no attribute, and only attributes have a range here"),
        }),
    }
}

/// The colours of text and of its halo in front of `behind`; `own` is the colour that is given.
fn colors(behind: Vec3, own: Option<Vec3>) -> (Color, Color) {
    let is_light = behind.dot(LUMINANCE) > MIDDLE;
    let text = own.unwrap_or(if is_light { Vec3::ZERO } else { Vec3::ONE });
    // A halo in the colour of the backdrop is invisible over it
    let contrasts = (text.dot(LUMINANCE) > MIDDLE) != is_light;
    let halo = if contrasts {
        behind
    } else if is_light {
        Vec3::ZERO
    } else {
        Vec3::ONE
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
    picture.files.preview.view.conversion()(color)
}

pub(super) fn srgb(linear: Vec3) -> Color {
    linear.to_array().map(|v| srgb_from_linear(v.clamp(0.0, 1.0)))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::camera::tests::survey;
    use super::*;
    use crate::scene::ColorMap;

    #[test]
    fn legends_have_the_categories_of_all_styles() {
        let manifest = Manifest::parse("input.path = \"in\"", Path::new("job.toml")).unwrap();
        let survey = survey();
        let by = |name: &str, values: &[i64]| ColorRule::Attribute {
            name: name.to_owned(),
            map: ColorMap::of_categories("okabe-ito", values).unwrap(),
            required: true,
            needs_geometry: false,
        };
        let rules = [by("type", &[3, 5]), by("phase", &[9]), by("type", &[1, 5])];
        let seen: Vec<&ColorRule> = rules.iter().collect();
        let labels = |rule: &ColorRule| {
            let (_, kind) = color_bar(rule, &seen, (&manifest, &survey)).unwrap();
            let ColorBarKind::Categories(all) = kind else { panic!("categories") };
            all.into_iter().map(|(label, _)| label).collect::<Vec<_>>()
        };
        assert_eq!(labels(&rules[0]), ["1", "3", "5"]);
        assert_eq!(labels(&rules[1]), ["9"]);
    }
}
