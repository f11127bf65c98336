//! Trees of keys and values, written as YAML with comments or as JSON.

use serde::{Serialize, Serializer, ser::SerializeMap};

/// A value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum YamlNode {
    Text(String),
    Number(u64),
    /// A list on one line.
    FlowList(Vec<YamlNode>),
    /// A list with one item per line.
    BlockList(Vec<YamlNode>),
    Map(Vec<Field>),
}

/// A key with its value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Field {
    pub(super) key: &'static str,
    pub(super) value: YamlNode,
    /// A comment line above the key; YAML only.
    pub(super) comment: Option<&'static str>,
}

/// `key: value`.
pub(super) fn field(key: &'static str, value: impl Into<YamlNode>) -> Field {
    Field { key, value: value.into(), comment: None }
}

impl Field {
    /// Adds a comment line above the key. JSON has no comments.
    pub(super) const fn with_comment(mut self, comment: &'static str) -> Self {
        self.comment = Some(comment);
        self
    }
}

impl From<&str> for YamlNode {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for YamlNode {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<u64> for YamlNode {
    fn from(number: u64) -> Self {
        Self::Number(number)
    }
}

impl YamlNode {
    /// The tree as YAML.
    pub(super) fn to_yaml(&self) -> String {
        let mut out = String::new();
        self.block(0, &mut out);
        out
    }

    /// Writes a map or a block list, indented by `indent` spaces. Anything else is written as one line.
    fn block(&self, indent: usize, out: &mut String) {
        let space = " ".repeat(indent);
        match self {
            Self::Map(fields) => {
                for field in fields {
                    if let Some(comment) = field.comment {
                        *out += &format!("{space}# {comment}\n");
                    }
                    *out += &format!("{space}{}:", field.key);
                    field.value.after_key(indent, out);
                }
            }
            Self::BlockList(items) => {
                for item in items {
                    // The first key of a map follows the dash
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
            Self::Map(_) | Self::BlockList(_) => {
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
            Self::FlowList(nodes) | Self::BlockList(nodes) => {
                let all: Vec<String> = nodes.iter().map(Self::flow).collect();
                format!("[{}]", all.join(", "))
            }
            Self::Map(fields) => {
                let pair = |f: &Field| format!("{}: {}", f.key, f.value.flow());
                let all: Vec<String> = fields.iter().map(pair).collect();
                format!("{{{}}}", all.join(", "))
            }
        }
    }
}

/// Plain words are not quoted. Everything else is quoted as a JSON string, which is valid YAML.
fn yaml_text(text: &str) -> String {
    let is_word = text.starts_with(|c: char| c.is_ascii_alphabetic())
        && text.chars().all(|c| c.is_ascii_alphanumeric() || "_-".contains(c));
    // Words that are not strings in some version of YAML
    let is_same = |word: &&str| word.eq_ignore_ascii_case(text);
    let reserved = ["true", "false", "yes", "no", "on", "off", "null", "y", "n"];
    if is_word && !reserved.iter().any(is_same) {
        return text.to_owned();
    }
    serde_json::Value::from(text).to_string()
}

impl Serialize for YamlNode {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Text(text) => serializer.serialize_str(text),
            Self::Number(number) => serializer.serialize_u64(*number),
            Self::FlowList(nodes) | Self::BlockList(nodes) => nodes.serialize(serializer),
            Self::Map(fields) => {
                let mut map = serializer.serialize_map(Some(fields.len()))?;
                for field in fields {
                    map.serialize_entry(field.key, &field.value)?;
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
    fn yaml_and_json() {
        let list =
            |words: &[&str]| YamlNode::FlowList(words.iter().map(|w| YamlNode::from(*w)).collect());
        let tree = YamlNode::Map(vec![
            field("name", "dam-break"),
            field("range", "1-5").with_comment("What to do."),
            field(
                "items",
                YamlNode::BlockList(vec![
                    YamlNode::Map(vec![field("a", "CHUNK[INT]"), field("b", 7_u64)]),
                    YamlNode::Map(vec![field("c", YamlNode::Map(vec![field("d", "No")]))]),
                ]),
            ),
            field("args", list(&["render", "{{x}}", "it's \"so\""])),
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
