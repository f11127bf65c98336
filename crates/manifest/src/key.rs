//! The declaration of a key: its name, its description in `init`, the schema, the manual and the command line, the
//! rules for its values, and whether images depend on it. `keys.rs` has the macros that declare keys.

/// Conditions under which images depend on a key.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Affects {
    Images,
    Nothing,
    SmoothSurfaces,
    /// Unions and smooth surfaces.
    Bodies,
    /// Unions and smooth surfaces with path tracing.
    PathTracedBodies,
    /// Spray or whitewater with path tracing.
    Spray,
    /// Whitewater of smooth surfaces.
    Whitewater,
    /// Spheres that reflect and refract.
    BranchingSpheres,
    /// The path integrator.
    PathTracing,
    /// A sky as environment of the path integrator.
    Sky,
    /// An image as environment of the path integrator.
    EnvironmentImage,
    /// Mist.
    Mist,
    /// The channel for light groups.
    LightGroups,
    /// A limit of noise.
    NoiseLimit,
}

impl Affects {
    /// Description for the manual.
    #[cfg(test)]
    pub(super) const fn text(self) -> &'static str {
        match self {
            Self::Images => "Changes images.",
            Self::Nothing => "Does not change images.",
            Self::SmoothSurfaces => "Changes images of smooth surfaces.",
            Self::Bodies => "Changes images of unions and smooth surfaces.",
            Self::PathTracedBodies => {
                "Changes images of unions and smooth surfaces with `integrator = \"path\"`."
            }
            Self::Spray => {
                "Changes images of `integrator = \"path\"` with `spray = true` or `whitewater = true`."
            }
            Self::Whitewater => "Changes images with `whitewater = true`.",
            Self::BranchingSpheres => "Changes images of spheres that reflect and transmit.",
            Self::PathTracing => "Changes images of `integrator = \"path\"`.",
            Self::Sky => "Changes images of `integrator = \"path\"` with a sky.",
            Self::EnvironmentImage => {
                "Changes images of `integrator = \"path\"` with an image as environment."
            }
            Self::Mist => "Changes images with `mist.visibility`.",
            Self::LightGroups => "Changes images with the channel `light_groups`.",
            Self::NoiseLimit => "Changes images with `render.noise`.",
        }
    }
}

/// An end of the range of a number.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bound {
    pub(super) value: f64,
    pub(super) is_excluded: bool,
}

/// An option of the command line that sets a key.
#[derive(Debug, Clone, Copy)]
pub struct Flag {
    /// Without the hyphens.
    pub name: &'static str,
    /// Name of its value in the help.
    pub value_name: &'static str,
    /// Its heading in the help.
    pub heading: &'static str,
}

/// Rules of a declaration; each sets one field of the [`Key`].
macro_rules! rules {
    ($($(#[$doc:meta])+ $name:ident($($argument:ident: $type:ty)?) { $field:ident: $value:expr })+) => {
        impl Key {
            $($(#[$doc])+ pub(super) fn $name(self, $($argument: $type)?) -> Self {
                Self { $field: $value, ..self }
            })+
        }
    };
}

rules! {
    /// Minimum, inclusive.
    from(low: impl Into<f64>) { low: Some(Bound { value: low.into(), is_excluded: false }) }
    /// Minimum, exclusive.
    above(low: impl Into<f64>) { low: Some(Bound { value: low.into(), is_excluded: true }) }
    /// Maximum, inclusive.
    to(high: impl Into<f64>) { high: Some(Bound { value: high.into(), is_excluded: false }) }
    /// Maximum, exclusive.
    below(high: impl Into<f64>) { high: Some(Bound { value: high.into(), is_excluded: true }) }
    /// Unit of a number, such as "degrees".
    unit(unit: &'static str) { unit: Some(unit) }
    /// Meaning of 0 at the start of a range.
    zero(meaning: &'static str) { zero: Some(meaning) }
    /// Allows 0 in addition to the range.
    or_zero() { or_zero: true }
    /// Refuses the zero vector.
    direction() { is_direction: true }
    /// Requires a number to be in range in single precision as well.
    single() { is_single: true }
    /// The word for a value that is not set, such as "auto".
    or(word: &'static str) { word: Some(word) }
    /// An example in TOML, for keys without a default.
    example(example: &'static str) { example: example }
    /// The effect if the key is not set.
    unset(unset: &'static str) { unset: Some(unset) }
    /// Message if the key is missing.
    required(why: &'static str) { required: Some(why) }
    /// The condition under which images depend on the key.
    affects(affects: Affects) { affects: affects }
}

impl Key {
    /// An old name of a value, and the current one.
    pub(super) fn renamed(self, old: &'static str, new: &'static str) -> Self {
        let renamed = Some([old, new]);
        Self { renamed, ..self }
    }

    /// The option that sets the key, with the name of its value and its heading in the help.
    pub(super) fn flag(
        self,
        name: &'static str,
        value_name: &'static str,
        heading: &'static str,
    ) -> Self {
        let flag = Some(Flag { name, value_name, heading });
        Self { flag, ..self }
    }
}

/// The declaration of a key; its fields are documented by the rules above.
#[derive(Debug, Clone, Copy)]
pub(super) struct Key {
    pub(super) name: &'static str,
    docs: &'static [&'static str],
    pub(super) low: Option<Bound>,
    pub(super) high: Option<Bound>,
    pub(super) unit: Option<&'static str>,
    zero: Option<&'static str>,
    pub(super) or_zero: bool,
    pub(super) is_direction: bool,
    pub(super) is_single: bool,
    pub(super) word: Option<&'static str>,
    pub(super) example: &'static str,
    pub(super) unset: Option<&'static str>,
    pub(super) required: Option<&'static str>,
    pub(super) affects: Affects,
    pub(super) renamed: Option<[&'static str; 2]>,
    pub(super) flag: Option<Flag>,
}

impl Key {
    pub(super) const fn new(name: &'static str, docs: &'static [&'static str]) -> Self {
        Self {
            name,
            docs,
            low: None,
            high: None,
            unit: None,
            zero: None,
            or_zero: false,
            is_direction: false,
            is_single: false,
            word: None,
            example: "",
            unset: None,
            required: None,
            affects: Affects::Images,
            renamed: None,
            flag: None,
        }
    }

    /// The comment of the key: the first paragraph of its documentation.
    pub(super) fn comment(&self) -> String {
        paragraphs(self.docs).swap_remove(0)
    }

    /// The other paragraphs of its documentation.
    pub(super) fn details(&self) -> Vec<String> {
        paragraphs(self.docs).split_off(1)
    }

    /// The range of a number for messages: ` from 0 to 1`.
    pub(super) fn range(&self) -> String {
        let zero = self.zero.map(|zero| format!(" ({zero})")).unwrap_or_default();
        let low = self.low.map(|b| (shown(b.value) + &zero, b.is_excluded));
        // The limit of single precision is not worth mentioning.
        let high = self
            .high
            .filter(|b| b.value < f64::from(f32::MAX))
            .map(|b| (shown(b.value), b.is_excluded));
        match (low, high) {
            (None, None) => String::new(),
            (Some((low, false)), None) => format!(" from {low}"),
            (Some((low, true)), None) => format!(" above {low}"),
            (Some((low, false)), Some((high, false))) => format!(" from {low} to {high}"),
            (Some((low, true)), Some((high, true))) => format!(" between {low} and {high}"),
            (Some((low, true)), Some((high, false))) => format!(" above {low}, at most {high}"),
            (Some((low, false)), Some((high, true))) => format!(" from {low}, below {high}"),
            (None, Some((high, false))) => format!(" up to {high}"),
            (None, Some((high, true))) => format!(" below {high}"),
        }
    }

    /// Whether a finite number is in range.
    pub(super) fn holds(&self, value: f64) -> bool {
        let above = |b: Bound| value > b.value || !b.is_excluded && value == b.value;
        let below = |b: Bound| value < b.value || !b.is_excluded && value == b.value;
        let in_range = self.low.is_none_or(above) && self.high.is_none_or(below);
        value.is_finite() && (in_range || self.or_zero && value == 0.0)
    }
}

/// A bound for messages; bounds of single precision appear as they were written.
#[expect(clippy::cast_possible_truncation, reason = "for display")]
fn shown(value: f64) -> String {
    let value = value as f32;
    match value.abs() {
        0.0 | 1e-3..1e6 => value.to_string(),
        _ => format!("{value:e}"),
    }
}

/// The lines of a doc comment, joined into one line per paragraph.
pub(super) fn paragraphs(docs: &[&str]) -> Vec<String> {
    let lines: Vec<&str> = docs.iter().map(|line| line.trim()).collect();
    lines.split(|line| line.is_empty()).map(|p| p.join(" ")).collect()
}
