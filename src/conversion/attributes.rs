//! The storage of attributes: the value of `--attributes`.

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

/// The name that stands for all other attributes.
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
    /// All values.
    pub const ALL: [Self; 5] = [Self::Keep, Self::F32, Self::F16, Self::U8, Self::Off];

    /// Name on the command line.
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

/// The storage of each attribute. Text form: `velocity:f16,density:u8,*:off`. `*` stands for all other attributes;
/// by default they are kept.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct AttributeChoices {
    named: BTreeMap<String, Storage>,
    others: Storage,
}

impl AttributeChoices {
    /// Stores no attributes.
    pub const NONE: Self = Self { named: BTreeMap::new(), others: Storage::Off };

    /// The storage of the attribute `name`. An exact match has priority over one that ignores case.
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
        self.named.keys().any(|known| known.eq_ignore_ascii_case(name))
    }

    /// All listed attributes and their storage, with `*` last.
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
                return Err(format!("`{name}` occurs twice"));
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
            format!("`{item}` has no storage; write NAME:HOW, where HOW is one of {names}")
        })?;
    let storage = Storage::ALL.into_iter().find(|s| s.name() == how);
    let storage =
        storage.ok_or_else(|| format!("`{item}`: unknown storage `{how}`; use one of {names}"))?;
    Ok((name, storage))
}

/// The text does not depend on the order in which the attributes were given.
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
    fn listed_names_have_priority() {
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
    fn equal_choices_have_the_same_text() {
        assert_eq!(AttributeChoices::default().to_string(), "*:keep");
        assert_eq!(AttributeChoices::NONE.to_string(), "*:off");
        let text = parsed("velocity:f16,density:u8").to_string();
        assert_eq!(text, "density:u8,velocity:f16,*:keep");
        assert_eq!(parsed(&text), parsed("velocity:f16,density:u8"));
    }

    #[test]
    fn unknown_names_are_found() {
        let known = ["velocity".to_owned(), "id".to_owned()];
        assert_eq!(parsed("ID:off,*:f16").unknown(&known), None);
        assert_eq!(parsed("id:off,vel:f16").unknown(&known), Some("vel"));
    }

    #[test]
    fn invalid_texts_are_rejected() {
        for (text, what) in [
            ("", "has no storage"),
            ("velocity", "write NAME:HOW"),
            (":f16", "has no storage"),
            ("v:f16,,", "has no storage"),
            ("v:f64", "unknown storage `f64`; use one of keep, f32, f16, u8, off"),
            ("v:f16,v:off", "`v` occurs twice"),
            ("*:f16,*:off", "`*` occurs twice"),
        ] {
            let error = text.parse::<AttributeChoices>().expect_err(text);
            assert!(error.contains(what), "{text}: {error}");
        }
    }
}
