//! Trees of keys and values, written as YAML for people or as JSON.

use serde::{Serialize, Serializer, ser::SerializeMap};

/// A value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Node {
    Text(String),
    Number(u64),
    /// On one line.
    List(Vec<Node>),
    /// An item a line, or more.
    Items(Vec<Node>),
    Map(Vec<Entry>),
}

/// A key with its value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Entry {
    pub(super) key: &'static str,
    pub(super) value: Node,
    /// For people: a line above.
    pub(super) comment: Option<&'static str>,
}

/// `key: value`.
pub(super) fn entry(key: &'static str, value: impl Into<Node>) -> Entry {
    Entry {
        key,
        value: value.into(),
        comment: None,
    }
}

impl Entry {
    /// With a line above; JSON has none.
    pub(super) const fn told(mut self, comment: &'static str) -> Self {
        self.comment = Some(comment);
        self
    }
}

impl From<&str> for Node {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Node {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<u64> for Node {
    fn from(number: u64) -> Self {
        Self::Number(number)
    }
}

impl Node {
    /// As YAML, by lines.
    pub(super) fn to_yaml(&self) -> String {
        let mut out = String::new();
        self.block(0, &mut out);
        out
    }

    /// The lines of a map or of items, `indent` spaces in; something else on a line of its own.
    fn block(&self, indent: usize, out: &mut String) {
        let space = " ".repeat(indent);
        match self {
            Self::Map(entries) => {
                for entry in entries {
                    if let Some(comment) = entry.comment {
                        *out += &format!("{space}# {comment}\n");
                    }
                    *out += &format!("{space}{}:", entry.key);
                    entry.value.after_key(indent, out);
                }
            }
            Self::Items(items) => {
                for item in items {
                    // A map's first key stands behind the dash.
                    let mut lines = String::new();
                    item.block(indent + 2, &mut lines);
                    *out += &format!("{space}- {}", lines.trim_start());
                }
            }
            other => *out += &format!("{space}{}\n", other.flow()),
        }
    }

    fn after_key(&self, indent: usize, out: &mut String) {
        match self {
            Self::Map(_) | Self::Items(_) => {
                *out += "\n";
                self.block(indent + 2, out);
            }
            other => *out += &format!(" {}\n", other.flow()),
        }
    }

    fn flow(&self) -> String {
        match self {
            Self::Text(text) => yaml_text(text),
            Self::Number(number) => number.to_string(),
            Self::List(nodes) | Self::Items(nodes) => {
                let all: Vec<String> = nodes.iter().map(Self::flow).collect();
                format!("[{}]", all.join(", "))
            }
            Self::Map(entries) => {
                let pair = |e: &Entry| format!("{}: {}", e.key, e.value.flow());
                let all: Vec<String> = entries.iter().map(pair).collect();
                format!("{{{}}}", all.join(", "))
            }
        }
    }
}

/// Words stand as they are. All else is quoted: YAML reads JSON's strings.
fn yaml_text(text: &str) -> String {
    let is_word = text.starts_with(|c: char| c.is_ascii_alphabetic())
        && text
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || "_-".contains(c));
    // Words that are no text in some version of YAML.
    let means = |word: &&str| word.eq_ignore_ascii_case(text);
    let taken = ["true", "false", "yes", "no", "on", "off", "null", "y", "n"];
    if is_word && !taken.iter().any(means) {
        return text.to_owned();
    }
    serde_json::Value::from(text).to_string()
}

impl Serialize for Node {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Text(text) => serializer.serialize_str(text),
            Self::Number(number) => serializer.serialize_u64(*number),
            Self::List(nodes) | Self::Items(nodes) => nodes.serialize(serializer),
            Self::Map(entries) => {
                let mut map = serializer.serialize_map(Some(entries.len()))?;
                for entry in entries {
                    map.serialize_entry(entry.key, &entry.value)?;
                }
                map.end()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_spellings() {
        let list = |words: &[&str]| Node::List(words.iter().map(|w| Node::from(*w)).collect());
        let tree = Node::Map(vec![
            entry("name", "dam-break"),
            entry("range", "1-5").told("What to do."),
            entry(
                "items",
                Node::Items(vec![
                    Node::Map(vec![entry("a", "CHUNK[INT]"), entry("b", 7_u64)]),
                    Node::Map(vec![entry("c", Node::Map(vec![entry("d", "No")]))]),
                ]),
            ),
            entry("args", list(&["render", "{{x}}", "it's \"so\""])),
        ]);
        assert_eq!(
            tree.to_yaml(),
            r#"name: dam-break
# What to do.
range: "1-5"
items:
  - a: "CHUNK[INT]"
    b: 7
  - c:
      d: "No"
args: [render, "{{x}}", "it's \"so\""]
"#
        );
        assert_eq!(
            serde_json::to_string(&tree).unwrap(),
            r#"{"name":"dam-break","range":"1-5","items":[{"a":"CHUNK[INT]","b":7},{"c":{"d":"No"}}],"#
                .to_owned()
                + r#""args":["render","{{x}}","it's \"so\""]}"#
        );
    }
}
