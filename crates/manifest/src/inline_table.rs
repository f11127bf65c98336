//! Tables as values of keys: `material = { type = "glass" }`.

use serde_json::{Map, Value as Json, json};

use super::field::Field;
use super::keys::Keys;
use super::list::Entries;
use super::value::Fault;

/// A table that is the value of a key. Keys that are left out have their defaults.
pub(super) trait InlineTable: Default {
    /// An example in TOML.
    const EXAMPLE: &str;

    /// Visits the keys.
    fn keys(&mut self, keys: &mut Keys<'_>);

    /// Reads the table.
    fn read(field: &Field<'_>) -> Result<Self, Fault> {
        let section = field.as_table().ok_or(Fault::Unwanted)?;
        let mut table = Self::default();
        let mut keys = Keys::Read(section);
        table.keys(&mut keys);
        keys.finish();
        Ok(table)
    }

    /// The keys and their values.
    fn entries(mut self) -> Entries {
        let mut entries = Entries::default();
        self.keys(&mut Keys::List(&mut entries));
        entries
    }

    /// The table as TOML, without keys that have their defaults.
    fn written(self) -> String {
        let (own, usual) = (self.entries(), Self::default().entries());
        let pairs = own.list().iter().zip(usual.list());
        let changed = pairs
            .filter(|(own, usual)| own.value != usual.value || own.declared.required.is_some());
        let pair = |(entry, _): (&super::list::Entry, _)| {
            Some(format!("{} = {}", entry.name(), entry.value.as_ref()?))
        };
        let pairs: Vec<String> = changed.filter_map(pair).collect();
        if pairs.is_empty() { "{}".to_owned() } else { format!("{{ {} }}", pairs.join(", ")) }
    }

    /// The table as JSON schema.
    fn table_schema() -> Json {
        let entries = Self::default().entries();
        let properties: Map<String, Json> = (entries.list().iter())
            .map(|entry| (entry.name().to_owned(), entry.schema.clone()))
            .collect();
        let required: Vec<&str> = (entries.list().iter())
            .filter(|entry| entry.declared.required.is_some())
            .map(|entry| entry.name())
            .collect();
        let mut schema =
            json!({ "type": "object", "properties": properties, "additionalProperties": false });
        if !required.is_empty() {
            schema["required"] = required.into();
        }
        schema
    }
}

/// Makes an [`InlineTable`] a [`super::value::Value`].
macro_rules! inline_table {
    ($table:ty) => {
        impl $crate::value::Value for $table {
            const FLAG: $crate::value::FlagKind = $crate::value::FlagKind::Toml;

            fn kind(_: &$crate::key::Key) -> String {
                <Self as $crate::inline_table::InlineTable>::EXAMPLE.to_owned()
            }

            fn parse(
                field: &$crate::field::Field<'_>,
                _: &$crate::key::Key,
            ) -> Result<Self, $crate::value::Fault> {
                $crate::inline_table::InlineTable::read(field)
            }

            fn toml(&self) -> String {
                $crate::inline_table::InlineTable::written(self.clone())
            }

            fn schema(_: &$crate::key::Key) -> serde_json::Value {
                <Self as $crate::inline_table::InlineTable>::table_schema()
            }
        }
    };
}
pub(super) use inline_table;
