//! The names that a graph may use: node types with their inheritance, edge labels with the types
//! that they join, attributes with kind, unit and range. This file guarantees that a name outside
//! the schema is refused with the nearest known one, unless the schema is `open`.

mod error;
mod file;

pub use error::{NameKind, SchemaError, suggest};
pub use file::SchemaFileError;

use crate::{AttributeId, LabelId, LargeType, TypeId, Value, ValueKind};
use rustc_hash::{FxHashMap, FxHashSet};
use serde::{Deserialize, Serialize};
use std::sync::OnceLock;

/// A node type.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NodeType {
    /// Its name.
    pub name: String,
    /// The types that it is a special case of; empty for the root.
    pub parents: Vec<TypeId>,
}

/// An edge label.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Label {
    /// Its name.
    pub name: String,
    /// Types that it may start at (or subtypes); empty for any.
    pub from: Vec<TypeId>,
    /// Types that it may end at (or subtypes); empty for any.
    pub to: Vec<TypeId>,
}

/// An attribute.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AttributeType {
    /// Its name.
    pub name: String,
    /// The kind of its values; `None` in an open schema, where each value says its own.
    pub kind: Option<ValueKind>,
    /// Its unit, such as `m` or `rad/s`.
    pub unit: Option<String>,
    /// The least number it may hold.
    pub min: Option<f64>,
    /// The largest number it may hold.
    pub max: Option<f64>,
    /// Whether the graph keeps an index of the nodes by its value.
    pub index: bool,
    /// How many of its values are kept, the newest among them; 0 for no history.
    pub history: u16,
    /// Its owner may give it out beside the graph, and folds it in so many times a second.
    pub hot: Option<f64>,
    /// What its values are, where they lie beside the graph.
    pub large: Option<LargeType>,
}

/// The names a graph may use.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(from = "Parts", into = "Parts")]
pub struct Schema {
    parts: Parts,
    type_ids: FxHashMap<String, TypeId>,
    label_ids: FxHashMap<String, LabelId>,
    attribute_ids: FxHashMap<String, AttributeId>,
    /// For each type, itself and all its subtypes by id, once somebody asks for them: all together may
    /// take room and time that no schema is worth.
    subtypes: Vec<OnceLock<Box<[TypeId]>>>,
    has_hot: bool,
}

#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
struct Parts {
    open: bool,
    types: Vec<NodeType>,
    labels: Vec<Label>,
    attributes: Vec<AttributeType>,
}

impl PartialEq for Schema {
    fn eq(&self, other: &Self) -> bool {
        self.parts == other.parts
    }
}

impl From<Schema> for Parts {
    fn from(schema: Schema) -> Self {
        schema.parts
    }
}

impl From<Parts> for Schema {
    fn from(parts: Parts) -> Self {
        let mut schema = Self {
            type_ids: (0..)
                .zip(&parts.types)
                .map(|(i, t)| (t.name.clone(), TypeId(i)))
                .collect(),
            label_ids: (0..)
                .zip(&parts.labels)
                .map(|(i, l)| (l.name.clone(), LabelId(i)))
                .collect(),
            attribute_ids: (0..)
                .zip(&parts.attributes)
                .map(|(i, a)| (a.name.clone(), AttributeId(i)))
                .collect(),
            subtypes: Vec::new(),
            has_hot: parts.attributes.iter().any(|found| found.hot.is_some()),
            parts,
        };
        schema.index_subtypes();
        schema
    }
}

impl Schema {
    /// A schema that takes every name as it comes; for worlds that bring no schema of their own.
    pub fn open() -> Self {
        Parts {
            open: true,
            ..Parts::default()
        }
        .into()
    }

    /// Whether unknown names are added instead of refused.
    pub fn is_open(&self) -> bool {
        self.parts.open
    }

    /// All types, by id.
    pub fn types(&self) -> &[NodeType] {
        &self.parts.types
    }

    /// All labels, by id.
    pub fn labels(&self) -> &[Label] {
        &self.parts.labels
    }

    /// All attributes, by id.
    pub fn attributes(&self) -> &[AttributeType] {
        &self.parts.attributes
    }

    /// The type of that name.
    pub fn find_type(&self, name: &str) -> Option<TypeId> {
        self.type_ids.get(name).copied()
    }

    /// The label of that name.
    pub fn find_label(&self, name: &str) -> Option<LabelId> {
        self.label_ids.get(name).copied()
    }

    /// The attribute of that name.
    pub fn find_attribute(&self, name: &str) -> Option<AttributeId> {
        self.attribute_ids.get(name).copied()
    }

    /// Whether the graph keeps an index of the nodes by the attribute's value.
    pub fn has_index(&self, attribute: AttributeId) -> bool {
        let known = self.parts.attributes.get(usize::from(attribute.0));
        known.is_some_and(|attribute| attribute.index)
    }

    /// Whether any attribute is hot.
    pub fn has_hot(&self) -> bool {
        self.has_hot
    }

    /// How many times a second the attribute's owner folds it into the graph, where it is hot.
    #[inline]
    pub fn hot_rate(&self, attribute: AttributeId) -> Option<f64> {
        self.parts.attributes.get(usize::from(attribute.0))?.hot
    }

    /// What the attribute's values are, where they lie beside the graph.
    pub fn large_type(&self, attribute: AttributeId) -> Option<LargeType> {
        self.parts.attributes.get(usize::from(attribute.0))?.large
    }

    /// How many values of the attribute are kept, the newest among them; 0 for no history.
    pub fn history(&self, attribute: AttributeId) -> usize {
        let known = self.parts.attributes.get(usize::from(attribute.0));
        known.map_or(0, |attribute| usize::from(attribute.history))
    }

    /// A type's name.
    pub fn type_name(&self, id: TypeId) -> &str {
        self.parts
            .types
            .get(usize::from(id.0))
            .map_or("?", |t| &t.name)
    }

    /// A label's name.
    pub fn label_name(&self, id: LabelId) -> &str {
        self.parts
            .labels
            .get(usize::from(id.0))
            .map_or("?", |l| &l.name)
    }

    /// An attribute's name.
    pub fn attribute_name(&self, id: AttributeId) -> &str {
        self.parts
            .attributes
            .get(usize::from(id.0))
            .map_or("?", |a| &a.name)
    }

    /// Whether `special` is `general` or one of its subtypes.
    pub fn is_subtype(&self, special: TypeId, general: TypeId) -> bool {
        special == general || self.subtypes(general).binary_search(&special).is_ok()
    }

    /// The type itself and all its subtypes, by id.
    pub fn subtypes(&self, general: TypeId) -> &[TypeId] {
        let known = self.subtypes.get(usize::from(general.0));
        known.map_or(&[], |known| {
            known.get_or_init(|| subtypes(&self.parts.types, general))
        })
    }

    /// The type of that name.
    ///
    /// # Errors
    /// Where there is none, with the nearest one.
    pub fn type_id(&self, name: &str) -> Result<TypeId, SchemaError> {
        self.find_type(name)
            .ok_or_else(|| self.unknown(NameKind::Type, name))
    }

    /// The label of that name.
    ///
    /// # Errors
    /// Where there is none, with the nearest one.
    pub fn label_id(&self, name: &str) -> Result<LabelId, SchemaError> {
        self.find_label(name)
            .ok_or_else(|| self.unknown(NameKind::Label, name))
    }

    /// The attribute of that name.
    ///
    /// # Errors
    /// Where there is none, with the nearest one.
    pub fn attribute_id(&self, name: &str) -> Result<AttributeId, SchemaError> {
        self.find_attribute(name)
            .ok_or_else(|| self.unknown(NameKind::Attribute, name))
    }

    fn unknown(&self, kind: NameKind, name: &str) -> SchemaError {
        let known: Vec<&str> = match kind {
            NameKind::Type => self.parts.types.iter().map(|t| t.name.as_str()).collect(),
            NameKind::Label => self.parts.labels.iter().map(|l| l.name.as_str()).collect(),
            NameKind::Attribute => self
                .parts
                .attributes
                .iter()
                .map(|a| a.name.as_str())
                .collect(),
        };
        SchemaError::UnknownName {
            kind,
            name: name.to_owned(),
            suggestion: suggest(name, known),
        }
    }

    /// Adds a node type.
    ///
    /// # Errors
    /// [`SchemaError::BadName`], [`SchemaError::Full`].
    pub fn add_type(&mut self, name: &str, parents: &[TypeId]) -> Result<TypeId, SchemaError> {
        if let Some(id) = self.find_type(name) {
            return Ok(id);
        }
        let id = TypeId(next_id(name, self.parts.types.len())?);
        self.parts.types.push(NodeType {
            name: name.to_owned(),
            parents: parents.to_vec(),
        });
        self.type_ids.insert(name.to_owned(), id);
        self.index_subtypes();
        Ok(id)
    }

    /// Adds an edge label; empty `from` or `to` allow any type there.
    ///
    /// # Errors
    /// [`SchemaError::BadName`], [`SchemaError::Full`].
    pub fn add_label(
        &mut self,
        name: &str,
        from: &[TypeId],
        to: &[TypeId],
    ) -> Result<LabelId, SchemaError> {
        if let Some(id) = self.find_label(name) {
            return Ok(id);
        }
        let id = LabelId(next_id(name, self.parts.labels.len())?);
        self.parts.labels.push(Label {
            name: name.to_owned(),
            from: from.to_vec(),
            to: to.to_vec(),
        });
        self.label_ids.insert(name.to_owned(), id);
        Ok(id)
    }

    /// Adds an attribute.
    ///
    /// # Errors
    /// [`SchemaError::BadName`], [`SchemaError::Full`].
    pub fn add_attribute(&mut self, attribute: AttributeType) -> Result<AttributeId, SchemaError> {
        if let Some(id) = self.find_attribute(&attribute.name) {
            return Ok(id);
        }
        let id = AttributeId(next_id(&attribute.name, self.parts.attributes.len())?);
        self.attribute_ids.insert(attribute.name.clone(), id);
        self.has_hot |= attribute.hot.is_some();
        self.parts.attributes.push(attribute);
        Ok(id)
    }

    /// Whether an edge of that label may join nodes of these types.
    ///
    /// # Errors
    /// [`SchemaError::WrongEnds`].
    pub fn check_ends(&self, label: LabelId, from: TypeId, to: TypeId) -> Result<(), SchemaError> {
        let allowed = |ends: &[TypeId], end: TypeId| {
            ends.is_empty() || ends.iter().any(|&general| self.is_subtype(end, general))
        };
        match self.parts.labels.get(usize::from(label.0)) {
            Some(rule) if !(allowed(&rule.from, from) && allowed(&rule.to, to)) => {
                Err(SchemaError::WrongEnds {
                    label: rule.name.clone(),
                    from: self.type_name(from).to_owned(),
                    to: self.type_name(to).to_owned(),
                })
            }
            _ => Ok(()),
        }
    }

    /// Whether the attribute may hold the value.
    ///
    /// # Errors
    /// [`SchemaError::WrongKind`], [`SchemaError::OutOfRange`] (a number that is not one is
    /// outside every range), [`SchemaError::TooLarge`], [`SchemaError::WrongShape`].
    pub fn check_value(&self, attribute: AttributeId, value: &Value) -> Result<(), SchemaError> {
        let Some(rule) = self.parts.attributes.get(usize::from(attribute.0)) else {
            return Ok(());
        };
        if let Some(expected) = rule.kind
            && expected != value.kind()
        {
            return Err(SchemaError::WrongKind {
                attribute: rule.name.clone(),
                expected,
                found: value.kind(),
            });
        }
        if let (Some(large), Value::Large(handle)) = (rule.large, value) {
            large.check(&rule.name, handle)?;
        }
        if (rule.min.is_some() || rule.max.is_some())
            && let Some(number) = value.as_f64()
        {
            let min = rule.min.unwrap_or(f64::NEG_INFINITY);
            let max = rule.max.unwrap_or(f64::INFINITY);
            if !(min..=max).contains(&number) {
                let attribute = rule.name.clone();
                return Err(SchemaError::OutOfRange {
                    attribute,
                    min,
                    max,
                    value: number,
                });
            }
        }
        Ok(())
    }

    fn index_subtypes(&mut self) {
        self.subtypes.clear();
        let count = self.parts.types.len();
        self.subtypes.resize_with(count, OnceLock::new);
    }
}

/// The type and all that descend from it, by id, also where types descend from each other in a circle.
fn subtypes(types: &[NodeType], general: TypeId) -> Box<[TypeId]> {
    let mut children: FxHashMap<TypeId, Vec<TypeId>> = FxHashMap::default();
    for (id, child) in (0..).map(TypeId).zip(types) {
        for &parent in &child.parents {
            children.entry(parent).or_default().push(id);
        }
    }
    let mut found = FxHashSet::from_iter([general]);
    let mut open = vec![general];
    while let Some(next) = open.pop() {
        let children = children.get(&next).map_or(&[][..], Vec::as_slice);
        open.extend(children.iter().filter(|&&child| found.insert(child)));
    }
    let mut found: Vec<TypeId> = found.into_iter().collect();
    found.sort_unstable();
    found.into_boxed_slice()
}

fn next_id(name: &str, count: usize) -> Result<u16, SchemaError> {
    if name.is_empty() || name.len() > 255 {
        return Err(SchemaError::BadName(name.to_owned()));
    }
    u16::try_from(count)
        .ok()
        .filter(|&id| id < u16::MAX)
        .ok_or(SchemaError::Full)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn schema() -> Schema {
        Schema::from_toml(
            "test",
            r#"
            [types]
            thing = []
            room = ["thing"]
            object = ["thing"]
            table = ["object"]
            [labels]
            in = { from = ["object"], to = ["room"] }
            [attributes]
            probability = { kind = "f64", min = 0.0, max = 1.0 }
            "#,
        )
        .unwrap()
    }

    #[test]
    fn subtypes_are_seen_through_every_step_of_inheritance() {
        let schema = schema();
        let [thing, room, table] = ["thing", "room", "table"].map(|n| schema.type_id(n).unwrap());
        assert!(schema.is_subtype(table, thing));
        assert!(!schema.is_subtype(table, room));
        assert!(!schema.is_subtype(thing, table));
    }

    #[test]
    fn a_type_with_very_many_ways_to_its_ancestors_is_nothing_special() {
        let step = |i: u32| format!("a{i} = ['a{0}', 'b{0}']\nb{i} = ['a{0}', 'b{0}']\n", i - 1);
        let steps: String = (1..60).map(step).collect();
        let text = format!("[types]\na0 = []\nb0 = []\n{steps}");
        let schema = Schema::from_toml("ladder", &text).unwrap();
        let [top, bottom] = ["a0", "b59"].map(|name| schema.type_id(name).unwrap());
        assert!(schema.is_subtype(bottom, top));
        assert_eq!(schema.subtypes(top).len(), 119);
    }

    #[test]
    fn types_that_another_process_made_descend_from_each_other_do_no_harm() {
        let mut parts = schema().parts;
        let thing = parts.types.iter().position(|t| t.name == "thing").unwrap();
        let all = (0..parts.types.len() as u16).map(TypeId);
        parts.types[thing].parents = all.chain([TypeId(77)]).collect();
        let schema = Schema::from(parts);
        let thing = TypeId(thing as u16);
        assert_eq!(schema.subtypes(thing).len(), 4);
        assert!(schema.is_subtype(thing, schema.type_id("table").unwrap()));
        assert!(schema.subtypes(TypeId(77)).is_empty());
    }

    #[test]
    fn a_misspelt_name_is_refused_with_the_right_one() {
        let error = schema().type_id("tabel").unwrap_err();
        assert_eq!(
            error.to_string(),
            "unknown node type `tabel`, did you mean `table`?"
        );
    }

    #[test]
    fn ends_kinds_and_ranges_are_held() {
        let schema = schema();
        let [room, table] = ["room", "table"].map(|n| schema.type_id(n).unwrap());
        let within = schema.label_id("in").unwrap();
        assert!(schema.check_ends(within, table, room).is_ok());
        assert!(schema.check_ends(within, room, table).is_err());
        let probability = schema.attribute_id("probability").unwrap();
        assert!(schema.check_value(probability, &Value::F64(0.5)).is_ok());
        for bad in [Value::F64(1.5), Value::F64(f64::NAN), Value::I64(0)] {
            assert!(schema.check_value(probability, &bad).is_err(), "{bad:?}");
        }
    }
}
