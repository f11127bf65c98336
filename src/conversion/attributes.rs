//! The value of `--attributes`: which attributes are stored, and how.

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

/// Name for all attributes that are not listed.
const OTHERS: &str = "*";

/// Storage of the values of an attribute.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Storage {
    /// Unchanged.
    #[default]
    Keep,
    /// Single precision.
    F32,
    /// Half precision.
    F16,
    /// 8 bits over the range of each component.
    U8,
    /// Not stored.
    Off,
}

impl Storage {
    /// All kinds of storage.
    pub const ALL: [Self; 5] = [Self::Keep, Self::F32, Self::F16, Self::U8, Self::Off];

    /// The name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Keep => "keep",
            Self::F32 => "f32",
            Self::F16 => "f16",
            Self::U8 => "u8",
            Self::Off => "off",
        }
    }
}

/// Storage of each attribute. Written `velocity:f16,density:u8,*:off`, where `*` stands for all attributes that are
/// not listed; without it they are kept.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct AttributeChoices {
    named: BTreeMap<String, Storage>,
    others: Storage,
}

impl AttributeChoices {
    /// No attribute is stored.
    pub const NONE: Self = Self {
        named: BTreeMap::new(),
        others: Storage::Off,
    };

    /// Storage of the attribute `name`. An exact match of the name is preferred over one that ignores case.
    pub fn of(&self, name: &str) -> Storage {
        let alike = || {
            let mut named = self.named.iter();
            named.find(|(known, _)| known.eq_ignore_ascii_case(name))
        };
        match self.named.get(name) {
            Some(storage) => *storage,
            None => alike().map_or(self.others, |(_, storage)| *storage),
        }
    }

    /// Whether the attribute `name` is listed.
    pub fn names(&self, name: &str) -> bool {
        self.named
            .keys()
            .any(|known| known.eq_ignore_ascii_case(name))
    }

    /// All choices: attributes and their storage, followed by `*` for the others.
    pub fn iter(&self) -> impl Iterator<Item = (&str, Storage)> {
        let named = self.named.iter().map(|(name, s)| (name.as_str(), *s));
        named.chain([(OTHERS, self.others)])
    }

    /// The first listed name that is not among the `known` attributes.
    pub fn unknown(&self, known: &[String]) -> Option<&str> {
        let is_known = |name: &str| known.iter().any(|k| k.eq_ignore_ascii_case(name));
        let mut names = self.named.keys().map(String::as_str);
        names.find(|name| !is_known(name))
    }
}

impl FromStr for AttributeChoices {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut choices = Self::default();
        let mut has_others = false;
        for item in text.split(',') {
            let (name, storage) = choice(item.trim())?;
            let is_repeated = if name == OTHERS {
                choices.others = storage;
                std::mem::replace(&mut has_others, true)
            } else {
                choices.named.insert(name.to_owned(), storage).is_some()
            };
            if is_repeated {
                return Err(format!("`{name}` is there twice"));
            }
        }
        Ok(choices)
    }
}

/// Parses `NAME:HOW`; the name may contain colons.
fn choice(item: &str) -> Result<(&str, Storage), String> {
    let names = Storage::ALL.map(Storage::name).join(", ");
    let (name, how) = item
        .rsplit_once(':')
        .map(|(name, how)| (name.trim(), how.trim()))
        .filter(|(name, _)| !name.is_empty())
        .ok_or_else(|| {
            format!("`{item}` does not say how; write NAME:HOW, where HOW is one of {names}")
        })?;
    let storage = Storage::ALL.into_iter().find(|s| s.name() == how);
    let storage = storage.ok_or_else(|| format!("`{item}`: there is no `{how}`, but {names}"))?;
    Ok((name, storage))
}

/// The text is the same for equal choices, whatever their order on input.
impl fmt::Display for AttributeChoices {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, (name, storage)) in self.iter().enumerate() {
            let comma = if index > 0 { "," } else { "" };
            write!(f, "{comma}{name}:{}", storage.name())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> AttributeChoices {
        text.parse().expect("choices")
    }

    #[test]
    fn names_rule_over_the_others() {
        let choices = parsed("velocity:f16, a:b:u8 ,*:off,Id:keep");
        assert_eq!(choices.of("velocity"), Storage::F16);
        assert_eq!(choices.of("VELOCITY"), Storage::F16);
        assert_eq!(choices.of("a:b"), Storage::U8);
        assert_eq!(choices.of("id"), Storage::Keep);
        assert_eq!(choices.of("density"), Storage::Off);
        assert_eq!(parsed("v:off").of("density"), Storage::Keep);
        assert_eq!(AttributeChoices::NONE.of("v"), Storage::Off);
        let cases = parsed("v:off,V:f32");
        assert_eq!((cases.of("v"), cases.of("V")), (Storage::Off, Storage::F32));
    }

    #[test]
    fn the_text_is_the_same_for_the_same_choices() {
        assert_eq!(AttributeChoices::default().to_string(), "*:keep");
        assert_eq!(AttributeChoices::NONE.to_string(), "*:off");
        let text = parsed("velocity:f16,density:u8").to_string();
        assert_eq!(text, "density:u8,velocity:f16,*:keep");
        assert_eq!(parsed(&text), parsed("velocity:f16,density:u8"));
    }

    #[test]
    fn names_that_no_frame_has_are_found() {
        let known = ["velocity".to_owned(), "id".to_owned()];
        assert_eq!(parsed("ID:off,*:f16").unknown(&known), None);
        assert_eq!(parsed("id:off,vel:f16").unknown(&known), Some("vel"));
    }

    #[test]
    fn what_cannot_be_meant_is_told() {
        for (text, what) in [
            ("", "does not say how"),
            ("velocity", "write NAME:HOW"),
            (":f16", "does not say how"),
            ("v:f16,,", "does not say how"),
            ("v:f64", "there is no `f64`, but keep, f32, f16, u8, off"),
            ("v:f16,v:off", "`v` is there twice"),
            ("*:f16,*:off", "`*` is there twice"),
        ] {
            let error = text.parse::<AttributeChoices>().expect_err(text);
            assert!(error.contains(what), "{text}: {error}");
        }
    }
}
